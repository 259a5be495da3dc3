"""Exports: names and descriptions as the standards ask, every answer there, and nothing that should stay behind."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from toys import FakeStimuli, keep_answer

from study.errors import SessionError
from study.experiment.form import asked
from study.experiment.plan import draw_plan
from study.experiment.protocol.whole import Protocol
from study.experiment.simulation import simulate
from study.experiment.store.answers import Presentation, record_form
from study.experiment.store.export import export, label, labels
from study.experiment.store.frames import export_csv
from study.experiment.store.responses import Responses, open_responses
from study.experiment.store.sessions import begin_session
from study.experiment.store.variables import SHARED
from study.tasks.answer import Answer


@pytest.fixture
def responses(tmp_path: Path, toy_protocol: Protocol, toy_stimuli: FakeStimuli) -> Iterator[Responses]:
    """Two simulated participants, and a person who missed the first question and gave the second answer."""
    with open_responses(tmp_path / "answers.sqlite") as opened:
        simulate(toy_protocol, toy_stimuli, opened, 2, seed=1)
        record = begin_session(opened, toy_protocol, draw_plan(toy_protocol, toy_stimuli.pairs, "a b-1"))
        keep_answer(opened, record, Answer(1, "", 1, None, None))
        keep_answer(opened, record, Answer(2, "", 1, "same", 0.75))
        record_form(opened, record, {field.name: "one\ttwo" for field in toy_protocol.form})
        yield opened


def rows(path: Path, delimiter: str) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        quoting = csv.QUOTE_NONE if delimiter == "\t" else csv.QUOTE_MINIMAL
        return list(csv.DictReader(file, delimiter=delimiter, quoting=quoting))


def test_psych_ds_names_and_describes_everything(tmp_path: Path, toy_protocol: Protocol, responses: Responses) -> None:
    folder = export(toy_protocol, responses, "psych-ds", tmp_path / "out", {})
    files = sorted((folder / "data").glob("*.csv"))
    assert files
    for file in files:
        assert re.fullmatch(r"([a-z]+-[A-Za-z0-9]+)(_[a-z]+-[A-Za-z0-9]+)*_data\.csv", file.name), file.name
    description = json.loads((folder / "dataset_description.json").read_text(encoding="utf-8"))
    assert description["@context"] == "https://schema.org/"
    assert description["@type"] == "Dataset"
    assert "people's and simulated answers mixed" in description["name"]
    described = {entry["name"] for entry in description["variableMeasured"]}
    assert all(entry["description"] for entry in description["variableMeasured"])
    answers = 0
    for file in files:
        table = rows(file, ",")
        assert set(table[0]) <= described, file.name
        own = json.loads(file.with_suffix(".json").read_text(encoding="utf-8"))["variableMeasured"]
        assert [entry["name"] for entry in own] == list(table[0])
        answers += len(table) if file.name.startswith("task-") else 0
    with responses.engine.connect() as connection:
        assert answers == connection.exec_driver_sql("SELECT count(*) FROM answers").scalar()
    assert (folder / "materials" / "protocol.toml").read_text(encoding="utf-8") == toy_protocol.text


def test_the_table_has_a_dictionary_beside_it_in_the_words_of_the_standards(
    tmp_path: Path, toy_protocol: Protocol, responses: Responses
) -> None:
    table = rows(export_csv(responses, tmp_path / "answers.csv", {}, asked(toy_protocol)), ",")
    columns = json.loads((tmp_path / "answers_columns.json").read_text(encoding="utf-8"))
    assert list(columns) == list(table[0])
    assert all(entry["Description"] for entry in columns.values())
    assert (columns["response_s"]["Units"], columns["difference_frames"]["Units"]) == ("s", "frames")
    for name, entry in columns.items():
        assert not entry.get("Levels") or {row[name] for row in table} <= set(entry["Levels"]), name
    sidecar = json.loads(
        next(export(toy_protocol, responses, "bids", tmp_path / "bids", {}).glob("sub-*/beh/*.json")).read_text()
    )
    assert {entry.pop("Type") for entry in columns.values()} == {"text", "number", "boolean", "time"}
    assert {name: columns[name] for name in SHARED if name in columns and name not in ("participant", "study")} == {
        name: entry for name, entry in sidecar.items() if name in columns
    }


@pytest.mark.parametrize("sign", ["=", "+", "-", "@", "\t=", "\r", " =", "\ufeff=", "＝"])
@pytest.mark.parametrize("kind", ["csv", "psych-ds", "bids"])
def test_no_text_in_any_export_begins_like_a_formula(
    tmp_path: Path, toy_protocol: Protocol, toy_stimuli: FakeStimuli, sign: str, kind: str
) -> None:
    """What participants type, and what a browser sends of its presentations."""
    said = f"{sign}HYPERLINK(1)"
    with open_responses(tmp_path / "answers.sqlite") as opened:
        record = begin_session(opened, toy_protocol, draw_plan(toy_protocol, toy_stimuli.pairs, said))
        record_form(opened, record, {field.name: said for field in toy_protocol.form})
        shown = Presentation(1, 1, "first", "x", said, 9, 9, 1.0, True)
        keep_answer(opened, record, Answer(1, "", 1, "same", 0.75), [shown])
        if kind == "csv":
            files = [export_csv(opened, tmp_path / "answers.csv", {}, asked(toy_protocol))]
        else:
            files = [*export(toy_protocol, opened, kind, tmp_path / "out", {}).rglob("*.[ct]sv")]
    cells = [cell for file in files for row in rows(file, "\t" if kind == "bids" else ",") for cell in row.values()]
    # Of these, archives take only what the browser sent; BIDS has no table for it.
    assert sum("HYPERLINK" in cell for cell in cells) >= {"csv": 1, "psych-ds": 1, "bids": 0}[kind]
    assert not [cell for cell in cells if cell.lstrip(" \ufeff")[:1] in "=+-@＝\t\r" and "HYPERLINK" in cell]
    differences = [
        row.get("difference_frames") for file in files for row in rows(file, "\t" if kind == "bids" else ",")
    ]
    assert [float(value) for value in differences if value]


def test_bids_has_a_file_a_participant_and_study_with_its_sidecar(
    tmp_path: Path, toy_protocol: Protocol, responses: Responses
) -> None:
    folder = export(toy_protocol, responses, "bids", tmp_path / "out", {})
    description = json.loads((folder / "dataset_description.json").read_text(encoding="utf-8"))
    assert description["BIDSVersion"] == "1.10.0"
    people = rows(folder / "participants.tsv", "\t")
    assert [row["participant_id"] for row in people] == ["sub-p001", "sub-sim001", "sub-sim002"]
    assert [row["simulated"] for row in people] == ["False", "True", "True"]
    assert set(people[0]) == set(json.loads((folder / "participants.json").read_text(encoding="utf-8")))
    files = sorted(folder.glob("sub-*/beh/*"))
    assert len(files) == 2 * len([file for file in files if file.suffix == ".tsv"])
    for file in (file for file in files if file.suffix == ".tsv"):
        assert re.fullmatch(r"sub-([A-Za-z0-9]+)_task-[A-Za-z0-9]+_beh\.tsv", file.name), file.name
        assert file.name.startswith(file.parent.parent.name)
        table = rows(file, "\t")
        sidecar = json.loads(file.with_suffix(".json").read_text(encoding="utf-8"))
        assert set(table[0]) <= set(sidecar)
        assert sidecar["TaskName"] in file.name
        assert all(value != "" for row in table for value in row.values()), "BIDS writes n/a for what is missing"
    first, second = rows(next(folder.glob("sub-p001/beh/*.tsv")), "\t")
    assert (first["answer"], first["missed"], first["response_s"]) == ("n/a", "True", "n/a")
    assert (second["answer"], float(second["response_s"])) == ("same", 0.75)


def test_an_export_is_written_again_but_nothing_else_is_overwritten(
    tmp_path: Path, toy_protocol: Protocol, responses: Responses
) -> None:
    for kind in ("psych-ds", "bids", "psych-ds"):
        folder = export(toy_protocol, responses, kind, tmp_path / "out", {})
    assert not list(folder.glob("sub-*"))
    other = tmp_path / "thesis"
    other.mkdir()
    (other / "chapter.txt").write_text("years of work")
    with pytest.raises(SessionError, match="expected a new or empty folder, or an earlier export of Segue"):
        export(toy_protocol, responses, "bids", other, {})
    assert (other / "chapter.txt").read_text() == "years of work"
    assert not list(tmp_path.glob(".*.part"))


def test_no_answers_are_refused(tmp_path: Path, toy_protocol: Protocol) -> None:
    with (
        open_responses(tmp_path / "empty.sqlite") as opened,
        pytest.raises(SessionError, match="expected answers to export, found none"),
    ):
        export(toy_protocol, opened, "bids", tmp_path / "out", {})
    assert not (tmp_path / "out").exists()


def test_labels_hold_letters_and_digits_and_stay_apart() -> None:
    assert label("geodesic_vs-fixed 2") == "geodesicvsfixed2"
    made = labels(["p-1", "p_1", "p1", "..."])
    assert len(set(made.values())) == 4
    assert all(re.fullmatch("[A-Za-z0-9]+", name) for name in made.values())


def test_the_size_of_each_presentation_is_exported_with_its_meaning(
    tmp_path: Path, toy_protocol: Protocol, toy_stimuli: FakeStimuli
) -> None:
    size = {
        "width_px": 1344,
        "height_px": 756,
        "height_degrees": 15.5,
        "px_per_cm": None,
        "distance_cm": None,
        "frames": [0, 1],
    }
    with open_responses(tmp_path / "answers.sqlite") as opened:
        record = begin_session(opened, toy_protocol, draw_plan(toy_protocol, toy_stimuli.pairs, "p1"))
        shown = [
            Presentation(1, 1, "first", "x", "swap", 9, 9, 1.0, True, size),
            Presentation(1, 1, "second", "y", "swap", 9, 9, 1.0, True),  # as older versions stored it
        ]
        keep_answer(opened, record, Answer(1, "", 1, "same", 0.75), shown)
        folder = export(toy_protocol, opened, "psych-ds", tmp_path / "out", {})
        bids = export(toy_protocol, opened, "bids", tmp_path / "bids", {})
    first, second = rows(folder / "data" / "description-presentations_data.csv", ",")
    assert (first["width_px"], first["height_px"], first["height_degrees"]) == ("1344.0", "756.0", "15.5")
    assert (first["px_per_cm"], second["height_px"]) == ("", "")
    described = json.loads((folder / "dataset_description.json").read_text(encoding="utf-8"))["variableMeasured"]
    units = {one["name"]: one.get("unitText") for one in described}
    assert (units["height_px"], units["height_degrees"], units["height_css"]) == (
        "pixels of the screen",
        "degrees",
        "CSS pixels",
    )
    (person,) = rows(bids / "participants.tsv", "\t")
    assert (person["shown_height_px"], person["shown_height_degrees"]) == ("756.0", "15.5")
    assert "Median" in json.loads((bids / "participants.json").read_text())["shown_height_px"]["Description"]
