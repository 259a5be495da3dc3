"""The published protocols: what 2004 sections 4.2 to 4.5 print, and that each can be shown on either library."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from study.experiment.observers import lengths_apart, truth
from study.experiment.plan import Plan, draw_plan
from study.experiment.protocol.proofreading import to_do
from study.experiment.protocol.whole import find_protocol, load_protocol, protocols_folder
from study.experiment.simulation import simulate
from study.experiment.stimuli.prepare import check, prepare
from study.experiment.store.frames import answers_frame
from study.experiment.store.responses import open_responses
from study.experiment.wording import all_texts
from study.motion.library import Library, open_library
from study.tasks.observer import default_observer

PUBLISHED = ("blend_length_jnd", "geodesic_vs_fixed", "velocity_vs_fixed", "geodesic_vs_timewarp")
ALL = tuple(sorted(path.stem for path in protocols_folder().glob("*.toml")))


@pytest.fixture(scope="module")
def synthetic() -> Any:
    return open_library("synthetic")


@pytest.fixture(scope="module")
def cmu(mocap: Path) -> Any:
    return open_library(mocap / "cmu")


def published(name: str) -> Any:
    return load_protocol(find_protocol(name))


def test_the_published_protocols_are_there() -> None:
    assert {*PUBLISHED, "demo"} <= set(ALL)


@pytest.mark.parametrize("name", ALL)
def test_every_protocol_loads_and_bears_the_name_of_its_file(name: str) -> None:
    assert published(name).name == name


@pytest.mark.parametrize("name", [name for name in ALL if name != "demo"])
def test_every_study_can_be_run_once_somebody_signs_for_it(name: str) -> None:
    """Consent, form, practice and debriefing are there; what is left to write is who runs it."""
    protocol = published(name)
    (left,) = to_do(protocol)
    assert left.startswith("consent.contact says 'FILL IN")
    read = {one.where: one.text for one in all_texts(protocol)}
    assert all(read[where] for where in ("consent.text", "texts.welcome", "texts.debrief"))
    assert {field.name for field in protocol.form} == {"age", "gender", "vision", "animation"}
    assert protocol.studies[0].practice > 0
    assert all(study.instructions for study in protocol.studies)
    for study in protocol.studies:
        practised = {transition.name for transition in protocol.practice_of(study)}
        assert not practised & {transition.name for transition in protocol.transitions_of(study)}
    # 2003 section 4.2; 2004 section 4.1; by a power analysis (docs/transitions_today.md).
    assert protocol.participants in ((40,) if name == "transitions_today" else (26, 35))


def test_attention_checks_are_used_and_have_a_rule() -> None:
    protocol = published("one_hop_vs_direct")
    assert [study.attention_checks for study in protocol.studies] == [2, 2]
    assert protocol.analysis.exclusions.most_failed_checks == 0.5


@pytest.mark.parametrize("name", PUBLISHED)
def test_what_all_studies_of_2004_have_in_common(name: str) -> None:
    """30 fps; two seconds of entry and of exit (4.2); five seconds to answer (4.2, 4.3); alpha .01 (5.2)."""
    protocol = published(name)
    assert protocol.fps == 30.0
    assert (protocol.stimuli.entry_s, protocol.stimuli.exit_s) == (2.0, 2.0)
    assert protocol.timing.answer_s == 5.0
    assert protocol.participants == 35
    assert protocol.analysis.alpha == 0.01
    assert protocol.stimuli.weight == "linear"
    assert "2004" in protocol.source


def test_study_one_is_as_printed() -> None:
    """Section 4.2: k - 15, k - 10, k - 5, k, k + 5, k + 10, k + 20; three types of motion; threshold 75%."""
    protocol = published("blend_length_jnd")
    (study,) = protocol.studies
    assert (study.task, study.reference, study.order) == ("same-different", "geodesic", "both")
    assert study.differences_frames == (-15, -10, -5, 0, 5, 10, 20)
    shown = [t.category for t in protocol.transitions_of(study)]
    assert shown == ["walking", "standing to walking", "running to turning"]
    assert protocol.analysis.threshold == 0.75


@pytest.mark.parametrize(("name", "method"), [("geodesic_vs_fixed", "geodesic"), ("velocity_vs_fixed", "velocity")])
def test_studies_two_and_three_are_as_printed(name: str, method: str) -> None:
    """Sections 4.3, 4.4: eight transitions, against 10 frames, optimal lengths from 5 to 35 frames, not close to 10."""
    protocol = published(name)
    (study,) = protocol.studies
    assert (study.task, study.reference, study.comparison, study.fixed_frames) == ("preference", method, "fixed", 10)
    assert len(protocol.transitions_of(study)) == 8
    for transition in protocol.transitions_of(study):
        points = protocol.points_for(study, transition)
        assert points.choose == "random"
        assert (points.shortest_frames, points.longest_frames, points.avoid_frames) == (5, 35, 10)
        assert points.avoid_within_frames >= 1


def test_study_two_shows_locomotion_and_study_three_does_not() -> None:
    """4.3: standing and idling to walking or running, walking to running, turning; 4.4: boxing, dancing, tai-chi."""
    two, three = (published(name) for name in ("geodesic_vs_fixed", "velocity_vs_fixed"))
    locomotion = {"standing to walking", "standing to running", "walking to running", "turning"}
    assert {t.category for t in two.transitions_of(two.studies[0])} == locomotion
    assert {t.category for t in three.transitions_of(three.studies[0])} == {"boxing", "dancing", "tai-chi"}


def test_study_four_is_as_printed() -> None:
    """Section 4.5: geodesic against time-warped, "procedures and stimuli identical to those of study two"."""
    two, four = published("geodesic_vs_fixed"), published("geodesic_vs_timewarp")
    (study,) = four.studies
    assert (study.task, study.reference, study.comparison) == ("preference", "geodesic", "timewarp")
    assert len(four.transitions_of(study)) == 8
    assert [t.category for t in four.transitions_of(study)] == [t.category for t in two.transitions_of(two.studies[0])]
    kept = {"least_warp_frames": None}
    assert four.points.model_copy(update=kept) == two.points
    assert (four.timing, four.stimuli) == (two.timing, two.stimuli)


def shown_on(name: str, library: Library) -> Any:
    """Check and build a protocol's stimuli on a library; what must hold on any."""
    protocol = published(name)
    assert check(protocol, library) == []
    prepared = prepare(protocol, library)
    plan = draw_plan(protocol, prepared.pairs, "p01")
    entry, after = round(protocol.stimuli.entry_s * 30), round(protocol.stimuli.exit_s * 30)
    for record in prepared.records:
        assert record.blend_frames >= 1
        # Beside a longer time-warped blend, a shorter one shows more of the destination.
        assert record.frames >= entry + record.blend_frames + after
        assert record.frames == entry + record.blend_frames + after or "geodesic_vs_timewarp" in protocol.name
        assert record.synthetic == library.synthetic
        for use in (record.source, record.destination):
            assert 0 <= use.frame < use.frames
    return prepared, plan


def trials_and_pairs(prepared: Any, plan: Plan) -> Any:
    """What the study shows, practice apart, which shows other transitions."""
    trials = [trial for trial in plan.trials if trial.role == "trial"]
    shown = {trial.motion for trial in trials}
    assert not shown & {trial.motion for trial in plan.trials if trial.role == "practice"}
    return trials, [pair for pair in prepared.pairs if pair.motion in shown]


def assert_study_one(prepared: Any, plan: Plan) -> None:
    trials, pairs = trials_and_pairs(prepared, plan)
    assert len(trials) == 42
    assert set(Counter((t.motion, t.difference_frames, t.a_first) for t in trials).values()) == {1}
    assert len({identifier for pair in pairs for identifier in pair.stimuli}) == 21
    for pair in pairs:
        reference, comparison = prepared.stimulus(pair.stimuli[0]).record, prepared.stimulus(pair.stimuli[1]).record
        assert 16 <= reference.blend_frames <= 35
        assert comparison.blend_frames == reference.blend_frames + pair.difference_frames


def assert_study_two_or_three(prepared: Any, plan: Plan) -> None:
    trials, pairs = trials_and_pairs(prepared, plan)
    assert len(trials) == len(pairs) == 8
    for pair in pairs:
        optimal, fixed = prepared.stimulus(pair.stimuli[0]).record, prepared.stimulus(pair.stimuli[1]).record
        assert fixed.blend_frames == 10
        assert 5 <= optimal.blend_frames <= 35
        assert abs(optimal.blend_frames - 10) > 4
        # Both show the same transition points: only the length differs.
        assert (optimal.source.frame, optimal.destination.frame) == (fixed.source.frame, fixed.destination.frame)


def assert_study_four(prepared: Any, plan: Plan) -> None:
    """Section 4.5: warps of 10 frames on average, such as 18 frames of the source with 28 of the destination."""
    trials, pairs = trials_and_pairs(prepared, plan)
    assert len(trials) == len(pairs) == 8
    warps = []
    for pair in pairs:
        geodesic, warped = (prepared.stimulus(name).record for name in pair.stimuli)
        assert (geodesic.source.frame, geodesic.destination.frame) == (warped.source.frame, warped.destination.frame)
        assert geodesic.frames == warped.frames
        (windows,) = (
            re.findall(r"of (\d+) source and (\d+) destination", note)[0] for note in warped.notes if "warped" in note
        )
        shorter, longer = sorted(int(frames) for frames in windows)
        assert longer <= 2 * shorter
        for frames in (geodesic.blend_frames, longer):
            assert 5 <= frames <= 35
            assert abs(frames - 10) > 4
        warps.append(longer - shorter)
    assert min(warps) >= 5
    assert 7 <= sum(warps) / len(warps) <= 13


def assert_as_printed(name: str, prepared: Any, plan: Plan) -> None:
    checks = {"blend_length_jnd": assert_study_one, "geodesic_vs_timewarp": assert_study_four}
    checks.get(name, assert_study_two_or_three)(prepared, plan)


@pytest.mark.slow
@pytest.mark.parametrize("name", PUBLISHED)
def test_published_protocols_are_shown_on_the_synthetic_library(name: str, synthetic: Any) -> None:
    assert_as_printed(name, *shown_on(name, synthetic))


def test_the_demo_is_short_on_the_synthetic_library(synthetic: Any) -> None:
    prepared, plan = shown_on("demo", synthetic)
    assert len(plan.trials) == 17
    assert sum(record.frames for record in prepared.records) < 1500
    assert all(use.added_before == use.added_after == 0 for r in prepared.records for use in (r.source, r.destination))


@pytest.mark.mocap
@pytest.mark.slow
@pytest.mark.parametrize("name", PUBLISHED)
def test_published_protocols_are_shown_on_cmu_clips(name: str, cmu: Any) -> None:
    prepared, plan = shown_on(name, cmu)
    assert_as_printed(name, prepared, plan)
    assert "EIA-0196217" in prepared.acknowledgement
    uses = [use for record in prepared.records for use in (record.source, record.destination)]
    assert all(use.file for use in uses)
    # What was added to a clip is said in words, too.
    for use in uses:
        assert any("extended" in note for note in use.notes) == bool(use.added_before or use.added_after)
    if name == "blend_length_jnd":
        assert any(use.added_before or use.added_after for use in uses)


@pytest.mark.mocap
def test_the_demo_is_shown_on_cmu_clips(cmu: Any) -> None:
    prepared, plan = shown_on("demo", cmu)
    assert len(plan.trials) == 17
    assert not prepared.synthetic


def test_a_simulated_session_of_study_one_recovers_its_known_answers(tmp_path: Path, synthetic: Any) -> None:
    """35 participants as in the paper; at each level the proportion is the truth's within its sampling error."""
    from study.models.population import population_different

    protocol = published("demo")
    prepared = prepare(protocol, synthetic)
    with open_responses(tmp_path) as responses:
        simulate(protocol, prepared, responses, 35, seed=1)
        table = answers_frame(responses)
    known = truth(protocol, default_observer(), prepared.pairs, lengths_apart(protocol, prepared))
    jnd = table[(table["study"] == "jnd") & ~table["missed"]]
    for difference, rows in jnd.groupby("difference_frames"):
        chance = float(population_different(default_observer().same_different, int(difference)))
        # 70 answers a level, not quite independent within participants: three and a half binomial errors.
        error = (chance * (1 - chance) / len(rows)) ** 0.5
        assert abs((rows["answer"] == "different").mean() - chance) < 3.5 * error + 0.01
    favoured = table[table["study"] == "geodesic_vs_fixed"]["chose_a"].mean()
    assert favoured == pytest.approx(known["studies"]["geodesic_vs_fixed"]["favouring_a"], abs=0.08)
