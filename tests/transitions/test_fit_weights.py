from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from walks import make_rig

from study.errors import TransitionError
from study.motion import quaternions as quat
from study.motion.clip import Clip
from study.transitions.candidates import candidates
from study.transitions.cost_matrix import cost_matrix
from study.transitions.fit_weights import (
    LabelledCut,
    best_transition,
    cost_terms,
    cross_validate,
    fit_weights,
    weight_groups,
)
from study.transitions.labels import Label, append_label, read_labels
from study.transitions.weights import LEE2002, ROLES, WANG2003


@pytest.fixture(scope="module")
def clips() -> list[Clip]:
    """Restless figures: every joint wanders smoothly on its own, so that no two joints tell the same."""
    skeleton = make_rig()
    rng = np.random.default_rng(3)
    made = []
    for number in range(4):
        seconds = np.arange(160) / 30.0
        rates, phases = (
            rng.uniform(0.3, 1.6, (2, skeleton.joints, 3)),
            rng.uniform(0, 2 * np.pi, (2, skeleton.joints, 3)),
        )
        swing = 0.35 * np.sin(2 * np.pi * rates[0] * seconds[:, None, None] + phases[0])
        swing += 0.2 * np.sin(2 * np.pi * rates[1] * seconds[:, None, None] + phases[1])
        path = np.stack([0.5 * seconds, np.full(160, 0.9), 0.2 * seconds], axis=1)
        made.append(Clip(skeleton, path, quat.exp(0.5 * swing), 30.0, name=f"restless{number}"))
    return made


def cuts_from(clips: Any, weights: Any, *, good: int = 5, bad: int = 60, seed: int = 0) -> list[LabelledCut]:
    """So many cuts for each pair of clips: good ones cost least by known weights, bad ones all the same."""
    rng = np.random.default_rng(seed)
    cuts = []
    level = np.quantile(cost_matrix(clips[0], clips[1], weights=weights, root="none"), 0.7)
    for source, destination in ((0, 1), (1, 2), (2, 3), (3, 0)):
        a, b = clips[source], clips[destination]
        costs = cost_matrix(a, b, weights=weights, root="none")[1:-1, 1:-1]
        near = np.argwhere(np.abs(costs - level) < 0.005 * level) + 1
        least = np.argwhere(costs <= np.sort(costs.ravel())[good]) + 1
        for found, label, count in ((near, 1.0, bad), (least, 0.0, good)):
            for i, j in found[rng.permutation(len(found))[:count]]:
                cuts.append(LabelledCut(a, b, int(i), int(j), label))
    return cuts


def test_a_is_the_cost_per_unit_of_weight(clips: list[Clip]) -> None:
    cuts = [LabelledCut(clips[0], clips[1], i, j, 0.0) for i, j in ((5, 90), (40, 11), (100, 140))]
    groups = weight_groups(clips[0].skeleton)
    assert {role for group in groups for role in group} == set(clips[0].skeleton.roles)
    for nu in (0.0, 1.0, 5.0):
        for weights in (WANG2003, LEE2002):
            by_group = np.array([weights.get(group[0], 0.0) for group in groups])
            whole = cost_matrix(clips[0], clips[1], weights=weights, nu=nu, root="none")
            expected = [whole[cut.source_frame, cut.destination_frame] for cut in cuts]
            np.testing.assert_allclose(cost_terms(cuts, groups, nu) @ by_group, expected, rtol=1e-9, atol=1e-12)


def test_labels_from_known_weights_give_them_back(clips: list[Clip]) -> None:
    """2003 Eq. 3: bad transitions at one cost, good ones near none, drawn from Table 1's weights."""
    found = fit_weights(cuts_from(clips, WANG2003))
    assert max(found.weights.values()) == 1.0
    for role in ROLES:
        if role in found.weights:
            assert found.weights[role] == pytest.approx(WANG2003.get(role, 0.0), abs=0.08), role
    for part in ("hip", "knee", "shoulder", "elbow", "ankle", "toe", "wrist"):
        assert found.weights[f"{part}.L"] == found.weights[f"{part}.R"], "symmetric"


def test_labels_that_are_the_cost_itself_give_the_weights_exactly(clips: list[Clip]) -> None:
    rng = np.random.default_rng(1)
    weights = {"hip.L": 1.0, "hip.R": 1.0, "chest": 0.25, "wrist.L": 0.5, "wrist.R": 0.5}
    costs = cost_matrix(clips[0], clips[1], weights=weights, root="none")
    cuts = [
        LabelledCut(clips[0], clips[1], int(i), int(j), 3.0 * costs[i, j]) for i, j in rng.integers(0, 160, (60, 2))
    ]
    cuts.append(LabelledCut(clips[0], clips[0], 9, 9, 0.0))
    found = fit_weights(cuts)
    assert found.scale == pytest.approx(3.0)
    assert found.residual == pytest.approx(0.0, abs=1e-9)
    for role, value in found.weights.items():
        assert value == pytest.approx(weights.get(role, 0.0), abs=1e-8)


def test_leaving_one_out_moves_the_best_transition_by_less_than_a_frame(clips: list[Clip]) -> None:
    cuts = cuts_from(clips, WANG2003, good=4, bad=6)
    seen = []
    found = cross_validate(cuts, transfer=(clips[0], clips[2]), progress=lambda done, of: seen.append((done, of)))
    assert len(found.deviations) == len(found.transfer) == len(cuts)
    assert found.mean_frames == np.mean(found.deviations)
    assert found.median_frames == 0.0
    assert found.transfer_same == found.transfer.count(0)
    assert seen[-1] == (len(cuts), len(cuts))


def test_without_motions_to_carry_over_to_nothing_is_carried_over(clips: list[Clip]) -> None:
    cuts = cuts_from(clips, WANG2003, good=2, bad=2)
    found = cross_validate(cuts)
    assert len(found.deviations) == len(cuts)
    assert (found.transfer, found.transfer_same) == ((), 0)


def test_the_best_transition_within_a_clip_is_not_to_the_next_frame(clips: list[Clip]) -> None:
    i, j = best_transition(clips[0], clips[0], WANG2003)
    assert abs(i - j) >= 15
    short = replace(clips[0], root_positions=clips[0].root_positions[:10], rotations=clips[0].rotations[:10])
    with pytest.raises(TransitionError, match=r"more than 0\.5 s"):
        best_transition(short, short, WANG2003)


def test_labels_that_can_not_be_fitted_are_refused(clips: list[Clip]) -> None:
    good = LabelledCut(clips[0], clips[1], 3, 4, 0.0)
    with pytest.raises(TransitionError, match="both good and bad"):
        fit_weights([good, good])
    with pytest.raises(TransitionError, match="at least two good and two bad"):
        cross_validate([good, replace(good, bad=1.0), good])
    still = LabelledCut(clips[0], clips[0], 7, 7, 1.0)
    with pytest.raises(TransitionError, match="Check the labels"):
        fit_weights([good, still])


def test_labels_are_kept_one_by_one(tmp_path: Path) -> None:
    path = tmp_path / "labels.csv"
    first, second = (
        Label("walk", "run", 10, 20, "good", found="best lee2002"),
        Label("walk", "run", 11, 20, "bad", 60.0),
    )
    append_label(path, first)
    assert read_labels(path) == (first,)
    append_label(path, second)
    append_label(path, replace(first, label="bad"))
    assert read_labels(path) == (second, replace(first, label="bad")), "the last word on a cut counts"
    assert len(path.read_text(encoding="utf-8").splitlines()) == 4, "what was said before stays in the file"
    assert [entry.name for entry in tmp_path.iterdir()] == ["labels.csv"]


def test_labels_from_elsewhere_keep_their_columns(tmp_path: Path) -> None:
    path = tmp_path / "labels.csv"
    path.write_text("who,label,source,destination,source_frame,destination_frame\nann,Good,a,b,1,2", encoding="utf-8")
    append_label(path, Label("a", "b", 3, 4, "bad"))
    assert [(label.source_frame, label.label, label.fps) for label in read_labels(path)] == [
        (1, "good", 30.0),
        (3, "bad", 30.0),
    ]
    assert (
        path.read_text(encoding="utf-8").splitlines()[0]
        == "who,label,source,destination,source_frame,destination_frame"
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("source,label\n", r"labels\.csv:1: expected the columns"),
        (
            "source,destination,source_frame,destination_frame,label\na,b,1,2,fine\n",
            r":2: expected a label of good, bad",
        ),
        (
            "source,destination,source_frame,destination_frame,label\na,b,1,x,good\n",
            r":2: expected a frame number.*'x'",
        ),
        (
            "source,destination,source_frame,destination_frame,label,fps\na,b,1,2,good,fast\n",
            r":2: expected a number as fps",
        ),
    ],
)
def test_faulty_tables_are_refused_with_their_line(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "labels.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(TransitionError, match=words):
        read_labels(path)


def test_candidates_hold_the_best_and_the_worst_of_each_metric(clips: list[Clip]) -> None:
    found = candidates(clips[0], clips[1], np.random.default_rng(0), best=1, worst=1, at_random=3)
    by_kind = {part: one for one in found for part in one.found.split(", ")}
    costs = cost_matrix(clips[0], clips[1], weights="lee2002")[15:-1, 1:-15]
    best, worst = by_kind["best lee2002"], by_kind["worst lee2002"]
    assert costs[best.source_frame - 15, best.destination_frame - 1] == costs.min()
    assert costs[worst.source_frame - 15, worst.destination_frame - 1] == costs.max()
    assert {"best wang2003", "worst wang2003", "best pointcloud", "worst pointcloud", "random"} <= by_kind.keys()
    again = candidates(clips[0], clips[1], np.random.default_rng(0), best=1, worst=1, at_random=3)
    assert found == again, "a seed gives the same cuts in the same order, so that labelling goes on where it stopped"


def test_candidates_within_one_clip_are_apart(clips: list[Clip]) -> None:
    for one in candidates(clips[0], clips[0], np.random.default_rng(0), at_random=0):
        assert abs(one.source_frame - one.destination_frame) >= 12
