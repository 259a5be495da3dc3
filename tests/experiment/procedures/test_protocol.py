"""Staircases in a protocol: refusals with their lines, texts, what `segue check` says, stimuli of all levels."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from toys import ToyLibrary, with_staircases

from study.apps.cli import run
from study.errors import ProtocolError
from study.experiment.protocol.whole import parse_protocol
from study.experiment.stimuli.outlook import look_ahead
from study.experiment.stimuli.prepare import prepare
from study.experiment.wording import welcome_text


def line_of(text: str, beginning: str) -> int:
    return 1 + next(place for place, line in enumerate(text.splitlines()) if line.startswith(beginning))


@pytest.mark.parametrize(
    ("keys", "old", "new", "line", "message"),
    [
        (
            "",
            "start_frames = 6",
            "start_frames = 9",
            "start_frames",
            "expected from least_frames to most_frames, 1 to 8",
        ),
        ("", "start_frames = 6", "strat_frames = 6", "strat_frames", "unknown key; did you mean 'start_frames'?"),
        (
            "",
            "start_frames = 6\n",
            "",
            "[studies.procedure]",
            "start_frames: expected this key, found",
        ),
        ("", '"staircase"', '"stairs"', "name = ", "expected 'constant' or 'staircase' or 'quest-plus', found"),
        ("", "averaged = 2", "averaged = 4", "averaged", "expected at most the 3 reversals, found 4; lower it"),
        ("differences_frames = [1]\n", "", "", "differences_frames", "expected no differences_frames with 'staircase'"),
        ('order = "both"\n', "", "", "order", "expected 'random' or 'by-group' with 'staircase'"),
        ("attention_checks = 1\n", "", "", "attention_checks", "catch_every tells who looks; remove it"),
    ],
)
def test_what_does_not_fit_is_refused_at_its_line(keys: str, old: str, new: str, line: str, message: str) -> None:
    text = with_staircases(keys=keys)
    text = text.replace(old, new, 1) if old else text
    with pytest.raises(ProtocolError) as raised:
        parse_protocol(text)
    said = str(raised.value)
    assert message in said
    if line != "name = ":
        assert said.startswith(f"protocol:{line_of(text, line)}: studies[0].")


def test_only_studies_of_differences_have_staircases() -> None:
    table = '\n[studies.procedure]\nname = "staircase"\nstart_frames = 3\nmost_frames = 5\n'
    with pytest.raises(ProtocolError, match=r"expected a same-different.* task with 'staircase' in the study 'liking'"):
        parse_protocol(with_staircases() + table)


def test_a_task_that_always_shows_a_difference_has_no_trials_without_one() -> None:
    text = with_staircases().replace('task = "same-different"', 'task = "oddity"', 1)
    with pytest.raises(ProtocolError, match=r"procedure: expected catch_every = 0 .* of 'oddity' shows"):
        parse_protocol(text)
    study = parse_protocol(text.replace("catch_every = 4", "catch_every = 0")).study("jnd")
    assert 0 not in study.differences_frames


def test_texts_and_outlook_say_how_many_trials_there_may_be(toy_library: ToyLibrary) -> None:
    text = with_staircases().replace('welcome = "Welcome."', 'welcome = "You will see {trials} pairs."')
    protocol = parse_protocol(text)
    study = protocol.study("jnd")
    fewest, most = protocol.fewest_trials_of(study), protocol.trials_of(study)
    assert fewest < most
    assert welcome_text(protocol) == f"You will see {fewest + 2}–{most + 2} pairs."
    ahead = look_ahead(protocol, toy_library)
    assert (ahead.fewest_trials, ahead.trials) == (fewest + 2, most + 2)
    assert ahead.problems == ()
    assert ahead.minutes <= ahead.minutes_at_most


def test_stimuli_of_all_levels_that_may_come_are_made(toy_library: ToyLibrary) -> None:
    protocol = parse_protocol(with_staircases(keys="practice = 2\n"))
    made = prepare(protocol, toy_library)
    own = [pair for pair in made.pairs if pair.study == "jnd"]
    assert (
        tuple(pair.difference_frames for pair in own) == protocol.study("jnd").differences_frames == tuple(range(-8, 9))
    )
    lengths = {record.id: record.blend_frames for record in made.records}
    for pair in own:
        reference, comparison = (lengths[name] for name in pair.stimuli)
        assert comparison - reference == pair.difference_frames


def test_check_says_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = with_staircases().replace('"slow"', '"walk"').replace('"quick"', '"walk_fast"').replace('"still"', '"stand"')
    file = tmp_path / "toy.toml"
    file.write_text(text)
    protocol = parse_protocol(text)
    fewest, most = protocol.fewest_trials_of(protocol.study("jnd")), protocol.trials_of(protocol.study("jnd"))
    assert run(["check", str(file)]) == 0
    said = capsys.readouterr().out
    assert "1-up/2-down staircases, which aim at 70.7% right responses, with differences from −8 to 8 frames" in said
    assert f"{fewest} to {most} trials; frames at 30 fps" in said
    assert f"A participant sees {fewest + 2} to {most + 2} trials made of" in said
    assert run(["check", str(file), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["fewest_trials"], result["trials"]) == (fewest + 2, most + 2)


def test_all_problems_of_a_table_are_told_at_once() -> None:
    text = with_staircases().replace("start_frames = 6", "strat_frames = 6").replace("reversals = 3", "reversals = 1")
    with pytest.raises(ProtocolError) as refusal:
        parse_protocol(text.replace("most_frames = 8\n", ""))
    told = str(refusal.value).splitlines()
    assert len(told) == 3
    for line, problem in zip(
        told, ("most_frames: expected", "reversals: expected at", "strat_frames: unk"), strict=True
    ):
        assert f"procedure.{problem}" in line


def test_all_problems_of_a_study_are_told_at_once() -> None:
    text = with_staircases().replace(
        'task = "same-different"', 'task = "same-different"\nshow = "pair"\ncomparison = "cut"'
    )
    with pytest.raises(ProtocolError) as refusal:
        parse_protocol(text)
    assert [line.split("studies[0].")[1].split(":")[0] for line in str(refusal.value).splitlines()] == [
        "show",
        "comparison",
    ]
