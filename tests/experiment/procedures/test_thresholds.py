"""Simulated studies with staircases through the whole analysis: it finds what is known, and says which it is."""

from __future__ import annotations

import pytest
from toys import TOY_PROTOCOL, FakeStimuli, pairs_of, with_staircases

from study.analysis.analyse import Analysis, analyse_folder, analysis_json
from study.analysis.oddity.analyse import Oddity
from study.analysis.same_different.analyse import SameDifferent
from study.experiment.observers import truth
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.experiment.simulation import simulate
from study.experiment.store.frames import answers_frame
from study.experiment.store.responses import open_responses
from study.models.population import population_different
from study.report.sections.same_different.section import KIND
from study.report.sections.section import About
from study.tasks.observer import default_observer

LONGER_RUNS = with_staircases().replace(
    "start_frames = 6\nmost_frames = 8\nsteps_frames = [2, 1]\nreversals = 3\naveraged = 2\nmost_trials = 14",
    "start_frames = 14\nmost_frames = 24\nsteps_frames = [4, 2, 1]\nreversals = 12\naveraged = 10\nmost_trials = 120",
)
OBSERVER = default_observer(8.0, 7.0)


def analysed(protocol: Protocol, people: int) -> Analysis:
    with open_responses("sqlite://") as responses:
        simulate(protocol, FakeStimuli(pairs_of(protocol)), responses, people, seed=2, settings=OBSERVER)
        answers, checks = (answers_frame(responses, roles=(role,)) for role in ("trial", "check"))
    return analyse_folder(protocol, answers, checks, resamples=20)


@pytest.fixture(scope="module")
def found() -> SameDifferent:
    return analysed(parse_protocol(LONGER_RUNS), 24).of(SameDifferent)["jnd"]


def test_the_thresholds_are_what_the_observers_have(found: SameDifferent) -> None:
    """70.7% "different" for the staircases, 75% for the model; where the population reaches either is known."""
    known = truth(parse_protocol(LONGER_RUNS), OBSERVER)["studies"]["jnd"]
    assert found.staircases is not None
    assert found.staircases.target == pytest.approx(0.5**0.5)
    assert found.model is not None
    for side in ("longer", "shorter"):
        aimed = known["staircase"][f"threshold_{side}_frames"]
        # What is known is checked against the observer's own curve.
        assert population_different(OBSERVER.same_different, aimed) == pytest.approx(0.5**0.5, abs=1e-5)
        threshold = found.staircases.thresholds[side]
        assert threshold.frames is not None
        assert threshold.standard_error is not None
        assert abs(threshold.frames - abs(aimed)) < 3 * threshold.standard_error
        model = found.model.jnd[side]
        assert model.frames is not None
        assert model.standard_error is not None
        assert abs(model.frames - abs(known[f"threshold_{side}_frames"])) < 3 * model.standard_error
        assert threshold.frames < model.frames


def test_the_answer_and_the_report_say_which_threshold_is_which(found: SameDifferent) -> None:
    assert found.answer.startswith("By the staircases, 70.7% of the responses are “different” at k + ")
    assert "(mean of the last 10 reversals). The following rest on all trials. " in found.answer
    section = KIND.section(found, About("jnd", "Just noticeable difference", data="simulated"))
    assert section is not None
    tables = {table.name: table for table in (*section.tables, *section.folded)}
    estimates = [row["estimate"] for row in tables["jnd_thresholds"].rows]
    assert estimates.count("staircases, mean of the last 10 reversals (70.7%)") == 1
    assert len(tables["jnd_staircases"].rows) == 48
    tracks = next(drawing for drawing in section.drawings if drawing.name == "jnd_tracks")
    assert tracks.picture.svg.count(" reversals") == 24  # each participant is read out
    assert section.notes[0].startswith(
        "Trials were chosen by staircases. Their threshold is where 70.7% of the responses are “different”: the mean"
    )


def test_json_has_the_staircases_and_constant_stimuli_have_none() -> None:
    own, none = (
        analysis_json(analysed(parse_protocol(text), 3))["jnd"]["jnd"]["staircases"]
        for text in (with_staircases(), TOY_PROTOCOL)
    )
    assert none is None
    assert {run["side"] for run in own["runs"]} == {"longer", "shorter"}
    assert set(own["thresholds"]) == {"longer", "shorter"}


def test_an_oddity_study_has_the_threshold_of_its_staircases() -> None:
    text = LONGER_RUNS.replace('task = "same-different"', 'task = "oddity"', 1).replace(
        "catch_every = 4", "catch_every = 0"
    )
    found = analysed(parse_protocol(text), 6).of(Oddity)["jnd"]
    assert found.staircases is not None
    assert all(one.frames is not None for one in found.staircases.thresholds.values())
    assert any(
        said.startswith("By the staircases, 70.7% of the responses are right at k + ") for said in found.sentences(0.05)
    )
