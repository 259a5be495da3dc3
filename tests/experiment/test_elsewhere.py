"""Answers from other programs: stored as they were given, or refused whole."""

from __future__ import annotations

import ast
import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from study.errors import SessionError, StimulusError
from study.experiment.elsewhere.bringing import Brought, bring
from study.experiment.elsewhere.sending import KEY, send
from study.experiment.protocol.whole import Protocol, load_protocol, parse_protocol
from study.experiment.stimuli.manifest import Manifest, read_manifest, record
from study.experiment.stimuli.prepare import prepare
from study.experiment.store.answers import stored_answers
from study.experiment.store.responses import Responses, open_responses
from study.experiment.store.sessions import all_sessions, find_session
from study.motion.library import open_library

TEXT = """\
name = "short"
title = "Two of a kind"
seed = 3

[stimuli]
width = 160
height = 120
entry_s = 0.3
exit_s = 0.3

[points]
shortest_frames = 4
longest_frames = 20

[[transitions]]
name = "walk_run"
category = "walking"
source = "walk"
destination = "jog"

[[studies]]
name = "jnd"
task = "same-different"
reference = "geodesic"
differences_frames = [-2, 0]
order = "both"
practice = 1
attention_checks = 1
confidence_points = 3
"""

Sent = tuple[Protocol, Manifest, Path]


def sent_to(folder: Path, tool: str, text: str = TEXT) -> Sent:
    protocol = parse_protocol(text)
    made = prepare(protocol, open_library("synthetic"))
    record(made, folder)
    manifest = read_manifest(folder)
    videos = {one.id: {"file": f"stimuli/{one.id}.mp4"} for one in manifest.records}
    manifest = Manifest(**{**vars(manifest), "videos": videos})
    assert send(folder, protocol, manifest, tool, 2) == ["p001", "p002"]
    return protocol, manifest, folder


@pytest.fixture(scope="module")
def psychopy(tmp_path_factory: pytest.TempPathFactory) -> Sent:
    return sent_to(tmp_path_factory.mktemp("psychopy"), "psychopy")


def answered(sent: Sent, participant: str = "p001", name: str = "key_resp") -> list[dict[str, str]]:
    """The conditions as PsychoPy writes them into its data, with the first key as the answer to each."""
    with (sent[2] / f"conditions_{participant}.csv").open(newline="") as file:
        rows = [dict(row) for row in csv.DictReader(file)]
    for row in rows:
        row |= {f"{name}.keys": ast.literal_eval(row["keys"])[0], f"{name}.rt": "0.75", "participant": "somebody"}
    return rows


def brought(
    sent: Sent, responses: Responses, rows: list[dict[str, str]], columns: tuple[str | None, str | None] = (None, None)
) -> Brought:
    protocol, manifest, _ = sent
    return bring(protocol, manifest, responses, [*enumerate(rows, start=2)], "data.csv", columns)


@pytest.fixture
def responses(tmp_path: Path) -> Any:
    with open_responses(tmp_path / "responses.sqlite") as opened:
        yield opened


def test_keys_and_times_are_stored_as_answers_of_the_trials_that_were_sent(
    psychopy: Sent, responses: Responses
) -> None:
    rows = answered(psychopy)
    assert {row["role"] for row in rows} == {"practice", "trial", "check"}
    assert [row["film_1"] == "" for row in rows] == [row["segue_item"] == "confidence" for row in rows]
    assert brought(psychopy, responses, rows) == Brought(1, 1, len(rows), 0)
    session = find_session(responses, "p001")
    assert session is not None
    assert not session.simulated
    stored = {(str(one.trial), one.item): one for one in stored_answers(responses, session.id)}
    for row in rows:
        one = stored[row["segue_trial"], row["segue_item"]]
        legal = ast.literal_eval(row["answers"])
        assert (one.value, one.response_s, one.shown_well) == (legal[0], 0.75, True)
        trial = next(trial for trial in session.plan.trials if trial.trial == one.trial)
        films = [row[name] for name in ("film_1", "film_2") if row[name]]
        assert films in ([], [f"stimuli/{name}.mp4" for name in trial.stimuli])


def test_rows_that_come_later_go_on_where_the_earlier_ones_ended(psychopy: Sent, responses: Responses) -> None:
    rows = answered(psychopy)
    assert brought(psychopy, responses, rows[:4]) == Brought(1, 0, 4, 0)
    assert brought(psychopy, responses, rows) == Brought(1, 1, len(rows) - 4, 0)
    assert brought(psychopy, responses, rows) == Brought(1, 1, 0, 0)


def test_no_response_and_a_late_one_are_missed(psychopy: Sent, responses: Responses) -> None:
    rows = [row for row in answered(psychopy) if row["segue_item"] == "" or row["segue_trial"] not in ("2", "3")]
    for row in rows:
        if row["segue_trial"] == "2":
            row |= {"key_resp.keys": "None", "key_resp.rt": ""}
        if row["segue_trial"] == "3":
            row["key_resp.rt"] = "5.2"
    assert brought(psychopy, responses, rows) == Brought(1, 1, len(rows), 1)
    missed = [one.trial for one in stored_answers(responses, 1) if one.missed]
    assert missed == [2, 3]


CHANGES: dict[str, tuple[Callable[[list[dict[str, str]]], Any], str]] = {
    "a gap": (
        lambda rows: rows.pop(2),
        r"row 4: .* found one to trial 2, confidence, but none of trial 2, which comes",
    ),
    "another participant": (lambda rows: rows[0].update(segue_participant="ann"), r"p001, p002, .* found 'ann'"),
    "another trial": (
        lambda rows: rows[-1].update(segue_trial="99"),
        r"found one to trial 99, confidence, but none of",
    ),
    "no trial": (lambda rows: rows[1].update(segue_trial=""), r"row 3: expected the number of a trial in segue_trial"),
    "another key": (
        lambda rows: rows[0].update({"key_resp.keys": "x"}),
        r"row 2: Expected one of same, different .*'x'",
    ),
    "no number": (lambda rows: rows[0].update({"key_resp.rt": "soon"}), r"row 2: expected a response time .* 'soon'"),
    "no time": (
        lambda rows: rows[0].update({"key_resp.rt": ""}),
        r"row 2: expected a response time .* found ''",
    ),
    "two answers": (lambda rows: rows.append(rows[0] | {"key_resp.keys": "d"}), r"found another one in row 2\. Delete"),
    "no form": (lambda rows: rows.append({KEY[0]: "p001", "segue_form": "{"}), r"row \d+: expected a form as JSON"),
    "two columns": (lambda rows: rows[0].update({"key_2.keys": "s"}), r"one column answer or NAME.keys .* key_2.keys"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_what_does_not_fit_is_refused_and_nothing_is_stored(psychopy: Sent, responses: Responses, change: str) -> None:
    wrong, said = CHANGES[change]
    rows = answered(psychopy, "p002") + answered(psychopy)
    own = rows[len(rows) // 2 :]
    wrong(own)
    with pytest.raises(SessionError, match=said):
        brought(psychopy, responses, own)
    assert all_sessions(responses) == ()


def test_columns_can_be_named(psychopy: Sent, responses: Responses) -> None:
    rows = [row | {"other.keys": "x"} for row in answered(psychopy)]
    assert brought(psychopy, responses, rows, ("key_resp.keys", None)).answers == len(rows)
    with pytest.raises(SessionError, match=r"Expected one column 'rtt', found none among"):
        brought(psychopy, responses, rows, ("key_resp.keys", "rtt"))
    with pytest.raises(SessionError, match=r"segue_participant, segue_trial, segue_item, .* found none"):
        brought(psychopy, responses, [{"participant": "p001"}])


def test_a_table_for_any_program_names_answers_as_they_are_stored(tmp_path: Path, responses: Responses) -> None:
    sent = sent_to(tmp_path / "csv", "csv")
    with (sent[2] / "trials.csv").open(newline="") as file:
        rows = [{**row, "answer": row["answers"].split()[-1], "response_s": "1"} for row in csv.DictReader(file)]
    assert brought(sent, responses, rows) == Brought(2, 2, len(rows), 0)
    assert {one.value for one in stored_answers(responses, 1)} == {"different", "2"}


def test_trials_that_depend_on_answers_can_not_be_sent(tmp_path: Path) -> None:
    text = TEXT.replace('differences_frames = [-2, 0]\norder = "both"\n', "").replace("attention_checks = 1\n", "")
    text += '\n[studies.procedure]\nname = "staircase"\nstart_frames = 3\nmost_frames = 4\nsteps_frames = [2, 1]\n'
    text += 'side = "longer"\nreversals = 3\naveraged = 2\nmost_trials = 10\n'
    with pytest.raises(StimulusError, match="'staircase', whose trials depend on the answers; use `segue serve`"):
        sent_to(tmp_path, "csv", text)


def test_a_folder_that_was_sent_is_a_results_folder(psychopy: Sent) -> None:
    assert load_protocol(psychopy[2] / "protocol.toml").sha256 == psychopy[0].sha256
    assert (psychopy[2] / "README.md").read_text().startswith("# A Segue study in PsychoPy")
