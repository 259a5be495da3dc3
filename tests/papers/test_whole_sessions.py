"""The whole session of 2004 (section 4) and the study of 2003 (section 4.2), on both libraries, end to end."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from study.analysis.analyse import analyse
from study.analysis.preference.analyse import Preference
from study.analysis.ratings.analyse import PairRatings, Ratings
from study.analysis.study_result import Settings
from study.experiment.plan import draw_plan, plan_from_json
from study.experiment.protocol.whole import find_protocol, load_protocol
from study.experiment.session import open_session
from study.experiment.simulation import simulate
from study.experiment.stimuli.prepare import check, prepare
from study.experiment.store.frames import answers_frame
from study.experiment.store.responses import open_responses
from study.motion.library import open_library
from study.transitions.candidates import frame_costs

LIBRARIES = ["synthetic", pytest.param("cmu", marks=pytest.mark.mocap)]


@pytest.fixture
def library(request: pytest.FixtureRequest) -> Any:
    if request.param == "synthetic":
        return open_library("synthetic")
    return open_library(request.getfixturevalue("mocap") / "cmu")


def published(name: str) -> Any:
    return load_protocol(find_protocol(name))


def test_the_session_of_2004_is_as_printed() -> None:
    """Sections 4.1 to 4.5: four studies in one session, as their own protocols have them."""
    session = published("wang2004_session")
    one, two, three, four = session.studies
    for study, alone in (
        (one, published("blend_length_jnd")),
        (two, published("geodesic_vs_fixed")),
        (three, published("velocity_vs_fixed")),
        (four, published("geodesic_vs_timewarp")),
    ):
        (own,) = alone.studies
        for key in ("task", "reference", "comparison", "differences_frames", "fixed_frames", "order", "question"):
            assert getattr(study, key) == getattr(own, key), key
        assert [(t.source, t.destination, t.category) for t in session.transitions_of(study)] == [
            (t.source, t.destination, t.category) for t in alone.transitions_of(own)
        ]
        for transition, known in zip(session.transitions_of(study), alone.transitions_of(own), strict=True):
            assert session.points_for(study, transition) == alone.points_for(own, known)
    assert (four.task, four.reference, four.comparison) == ("preference", "geodesic", "timewarp")
    assert len(session.transitions_of(four)) == 8


@pytest.mark.slow
@pytest.mark.parametrize("library", LIBRARIES, indirect=True)
def test_the_session_of_2004_has_42_and_three_times_8_pairs(library: str, tmp_path: Path) -> None:
    protocol = published("wang2004_session")
    assert check(protocol, library) == []
    prepared = prepare(protocol, library)
    plan = draw_plan(protocol, prepared.pairs, "p01")
    shown = [trial for trial in plan.trials if trial.role == "trial"]
    assert list(Counter(trial.study for trial in shown).values()) == [42, 8, 8, 8]
    records = {record.id: record for record in prepared.records}
    for pair in (pair for pair in prepared.pairs if pair.study == "geodesic_vs_timewarp"):
        plain, warped = records[pair.stimuli[0]], records[pair.stimuli[1]]
        assert (plain.source.frame, plain.destination.frame) == (warped.source.frame, warped.destination.frame)
        assert 5 <= plain.blend_frames <= 35
        (windows,) = (
            re.findall(r"of (\d+) source and (\d+) destination", note)[0] for note in warped.notes if "warped" in note
        )
        lengths = [int(frames) for frames in windows]
        assert abs(lengths[0] - lengths[1]) >= 5
        assert warped.blend_frames == max(lengths)
        assert warped.frames == plain.frames == 120 + max(warped.blend_frames, plain.blend_frames)
    with open_responses(tmp_path) as responses:
        simulate(protocol, prepared, responses, 35, seed=2)
        found = analyse(answers_frame(responses), Settings(resamples=50))
    favoured = {name: study.comparisons[0].published.percent for name, study in found.of(Preference).items()}
    # 2004 Table 2, which the simulated observers were made to give; three standard errors of 280 answers.
    for study, percent, within in (
        ("geodesic_vs_fixed", 96.4, 3.5),
        ("velocity_vs_fixed", 65.7, 8.5),
        ("geodesic_vs_timewarp", 55.7, 9.0),
    ):
        assert favoured[study] == pytest.approx(percent, abs=within), study


def test_the_study_of_2003_is_as_printed() -> None:
    """Section 4.2: two groups by order, six items on a scale from 0 to 4, original against optimised weights."""
    protocol = published("transition_points")
    study, compared = protocol.studies
    assert (study.task, study.reference, study.comparison) == ("rating", "cut-lee2002", "cut-wang2003")
    assert (study.order, study.scale_points, len(study.items)) == ("by-group", 5, 6)
    assert (protocol.stimuli.entry_s, protocol.stimuli.exit_s, protocol.fps) == (3.0, 3.0, 30.0)
    assert protocol.analysis.alpha == 0.05
    # Table 2: the optimised motion compared with the original on two items.
    assert (compared.task, compared.show, compared.order, compared.scale_points) == ("rating", "pair", "by-group", 5)
    assert (compared.reference, compared.comparison) == (study.reference, study.comparison)
    assert [item.name for item in compared.items] == ["looks_better", "more_natural"]


@pytest.mark.parametrize("library", LIBRARIES, indirect=True)
def test_the_study_of_2003_cuts_where_each_metric_is_least(library: str, tmp_path: Path) -> None:
    """Six seconds with a cut at three; the F of the published analysis has 1 and 48 degrees of freedom."""
    protocol = published("transition_points")
    assert check(protocol, library) == []
    prepared = prepare(protocol, library)
    (transition,) = protocol.transitions_of(protocol.studies[0])
    assert (transition.category, transition.source) == ("dancing", "dance_turns")
    pairs = [pair for pair in prepared.pairs if pair.motion == transition.name and pair.study == "cuts"]
    assert [pair.methods[0] for pair in pairs] == ["cut-lee2002", "cut-wang2003"]
    points = []
    clips = [library.clip(name, fps=30.0) for name in (transition.source, transition.destination)]
    for pair, metric in zip(pairs, ("lee2002", "wang2003"), strict=True):
        record = prepared.stimulus(pair.stimuli[0]).record
        assert (record.frames, record.blend_start, record.blend_stop) == (180, 90, 90)
        points.append((record.source.frame, record.destination.frame))
        first = int(np.ceil(0.33 * clips[1].frames))  # destination_within
        costs = frame_costs(*clips, metric)[90:, first : clips[1].frames - 90]
        assert costs[points[-1][0] - 90, points[-1][1] - first] == costs.min()
    # As in the paper (91 to 281, 232 to 280), they differ in both motions.
    assert points[0][0] != points[1][0]
    assert points[0][1] != points[1][1]
    plan = draw_plan(protocol, prepared.pairs, "p")
    assert plan_from_json(plan.to_json()) == plan
    (instructions,) = (
        step
        for step in open_session(protocol, plan).steps
        if step.study == "cuts" and step.stimulus and step.kind == "instructions"
    )
    walking, practised = prepared.stimulus(instructions.stimulus), plan.practice("cuts")
    assert (walking.record.source.motion, walking.record.destination.motion) == ("walk", "walk")
    assert [trial.motion for trial in practised] == ["discontinuity"]
    # The example is a plain walk: nothing happens at three seconds that does not happen elsewhere.
    jumps = np.linalg.norm(np.diff(walking.positions, n=2, axis=0), axis=-1).max(axis=1)
    assert jumps[85:95].max() <= 1.05 * max(jumps[:85].max(), jumps[95:].max())
    orders = [
        tuple(
            trial.methods[0]
            for trial in draw_plan(protocol, prepared.pairs, "p", group=group).trials
            if trial.role == "trial" and trial.study == "cuts"
        )
        for group in (0, 1)
    ]
    assert orders == [("cut-lee2002", "cut-wang2003"), ("cut-wang2003", "cut-lee2002")]
    with open_responses(tmp_path) as responses:
        simulate(protocol, prepared, responses, 26, seed=3)
        result = analyse(answers_frame(responses), Settings(scale_points=protocol.scale_points))
    found = result.of(Ratings)["cuts"].questions
    assert len(found) == 6
    for question in found:
        effects = question.anova[:3]
        assert [(row.degrees_of_freedom, row.error_degrees_of_freedom) for row in effects] == [(1, 48)] * 3
        assert question.difference.of == "cut-wang2003 minus cut-lee2002"
    # The simulated observers prefer the optimised weights, by about as much as the paper's participants did.
    assert np.mean([question.difference.mean for question in found]) == pytest.approx(0.7, abs=0.35)
    assert max(question.anova[0].f for question in found) > 4.0
    # Table 2: 2.73 (1.00) and 2.69 (0.84); within three standard errors of 26 people.
    for question, mean, spread in zip(
        result.of(PairRatings)["compared"].questions, (2.73, 2.69), (1.00, 0.84), strict=True
    ):
        assert question.of == "cut-wang2003 compared with cut-lee2002"
        assert question.published.mean == pytest.approx(mean, abs=3 * spread / np.sqrt(26))
        assert question.published.standard_deviation == pytest.approx(spread, rel=0.45)
