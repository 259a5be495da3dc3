"""Exports in the standards' own programs, and what each format keeps of types, units and blend lengths."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import psych_ds
import pytest
from parts import unavailable
from toys import FakeStimuli, keep_answer

from study.errors import SessionError
from study.experiment.form import asked
from study.experiment.plan import draw_plan
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.experiment.simulation import simulate
from study.experiment.store.answers import Presentation, record_form
from study.experiment.store.export import Credit, credited, export
from study.experiment.store.frames import export_csv, export_parquet
from study.experiment.store.responses import Responses, open_responses
from study.experiment.store.sessions import begin_session
from study.experiment.store.variables import EXPORTED
from study.tasks.answer import Answer

CREDIT = Credit(("Doe, Jane", "A laboratory"), "CC-BY-4.0")
NOT_OURS = {"HEDVersion", "SourceDatasets", "CogAtlasID", "CogPOID", "Instructions"} | {
    f"Institution{part}" for part in ("Name", "Address", "alDepartmentName")
}
"""What BIDS recommends and only the researcher knows; the instructions of the second toy study are empty."""

FORM = """
form = [
    { name = "age" },
    { name = "gender" },
    { name = "hand", label = "Your hand", kind = "choice", choices = ["left", "right"] },
    { name = "club", label = "Your club" },
]
"""


@pytest.fixture(scope="module")
def protocol() -> Protocol:
    from toys import TOY_PROTOCOL

    return parse_protocol(TOY_PROTOCOL.replace("[stimuli]", FORM + "\n[stimuli]", 1))


@pytest.fixture
def study(tmp_path: Path, protocol: Protocol, toy_stimuli: FakeStimuli) -> Any:
    """Seven people with a form, a film and an answer, and two simulated participants; blends by stimulus."""
    pairs = toy_stimuli.pairs
    blends = {
        name: (10 + place, (10 + place) / 30)
        for place, name in enumerate(sorted({s for p in pairs for s in p.stimuli}))
    }
    with open_responses(tmp_path / "answers.sqlite") as opened:
        simulate(protocol, toy_stimuli, opened, 2, seed=1)
        for number in range(7):
            record = begin_session(opened, protocol, draw_plan(protocol, pairs, f"anna-{number}"))
            hand = "left" if number == 3 else "right"
            record_form(
                opened, record, {"age": str(20 + number), "hand": hand, "club": f"Anna's {number}", "gender": ""}
            )
            size = {"height_px": 756, "height_degrees": 15.5, "agent": "Anna's browser"}
            shown = [Presentation(1, 1, "first", record.plan.trials[0].stimuli[0], "swap", 9, 9, 1.0, True, size)]
            keep_answer(opened, record, Answer(1, "", 1, "same", 0.75), shown)
        yield opened, blends


def bids_issues(folder: Path, cache: Path) -> list[dict[str, Any]]:
    program = Path(sys.executable).with_name("bids-validator-deno")
    if not program.exists():
        unavailable("the validator of BIDS", "install it: pip install bids-validator-deno")
    quiet = {**os.environ, "DENO_NO_UPDATE_CHECK": "1", "DENO_DIR": str(cache), "NO_COLOR": "1"}
    ran = subprocess.run(
        [program, folder, "--format", "json"], env=quiet, capture_output=True, text=True, timeout=300, check=False
    )
    found: list[dict[str, Any]] = json.loads(ran.stdout)["issues"]["issues"]
    assert (ran.returncode == 0) == all(one["severity"] != "error" for one in found), ran.stderr
    return found


def test_the_validator_of_bids_finds_only_what_researchers_have_to_add(
    tmp_path: Path, protocol: Protocol, study: tuple[Responses, Any]
) -> None:
    folder = export(protocol, study[0], "bids", tmp_path / "out", study[1], CREDIT)
    assert {(one["severity"], one.get("subCode", one["code"])) for one in bids_issues(folder, tmp_path)} == {
        ("warning", code) for code in NOT_OURS
    }
    people = folder / "participants.tsv"
    people.write_text(people.read_text().replace("sub-p001", "sub-p999"))
    (folder / "notes.txt").write_text("mine")
    assert {"PARTICIPANT_ID_MISMATCH", "NOT_INCLUDED"} <= {one["code"] for one in bids_issues(folder, tmp_path)}


def edited(name: str, change: Callable[[str], str]) -> Callable[[Path], None]:
    def edit(folder: Path) -> None:
        (path,) = folder.rglob(name)
        path.write_text(change(path.read_text(encoding="utf-8")), encoding="utf-8")

    return edit


BROKEN: dict[str, Callable[[Path], object]] = {
    "its name": lambda folder: next(folder.rglob("task-jnd_data.csv")).rename(folder / "data" / "jnd_data.csv"),
    "is not described": edited("task-jnd_data.csv", lambda text: text.replace("answered_after_s", "later", 1)),
    "is in no table": lambda folder: [shutil.rmtree(folder / "data"), (folder / "data").mkdir()],
    "no table under data": lambda folder: shutil.rmtree(folder / "data"),
    "rows of another length": edited("task-jnd_data.csv", lambda text: text + "1,2\n"),
    "its header": edited("task-jnd_data.csv", lambda text: text.replace("method_b", "method_a", 1)),
    "no description": edited("dataset_description.json", lambda text: text.replace('"description"', '"told"', 1)),
    "@type is not Dataset": edited("dataset_description.json", lambda text: text.replace('"Dataset"', '"Data"')),
    "@context is not schema.org": edited(
        "dataset_description.json", lambda text: text.replace("schema.org", "b.org", 1)
    ),
    "without @type": edited("task-jnd_data.json", lambda text: text.replace('"@type": "PropertyValue",', "", 1)),
    "no README": lambda folder: (folder / "README.md").unlink(),
}


def test_psych_ds_keeps_the_rules_of_its_specification(
    tmp_path: Path, protocol: Protocol, study: tuple[Responses, Any]
) -> None:
    folder = export(protocol, study[0], "psych-ds", tmp_path / "out", study[1], CREDIT)
    assert psych_ds.problems(folder) == []
    about = json.loads((folder / "dataset_description.json").read_text())
    assert about["license"] == "https://spdx.org/licenses/CC-BY-4.0.html"
    assert [one["name"] for one in about["author"]] == ["Doe, Jane", "A laboratory"]
    for number, (problem, change) in enumerate(BROKEN.items()):
        broken = tmp_path / f"broken{number}"
        shutil.copytree(folder, broken)
        change(broken)
        assert any(problem in found for found in psych_ds.problems(broken)), problem


@pytest.mark.parametrize("kind", ["psych-ds", "bids"])
def test_archives_tell_blend_lengths_and_nobodys_identity(
    tmp_path: Path, protocol: Protocol, study: tuple[Responses, Any], kind: str
) -> None:
    responses, blends = study
    folder = export(protocol, responses, kind, tmp_path / "out", blends)
    whole = "".join(path.read_text(encoding="utf-8") for path in folder.rglob("*") if path.is_file())
    assert "anna" not in whole.lower()
    assert not [year for year in range(2020, 2100) if f"{year}-" in whole]
    files = sorted(folder.rglob("task-*_data.csv" if kind == "psych-ds" else "*_beh.tsv"))
    rows = pd.concat([pd.read_csv(file, sep="," if kind == "psych-ds" else "\t") for file in files])
    assert {(row.first, row.first_blend_frames) for row in rows.itertuples()} <= {
        (n, f) for n, (f, _) in blends.items()
    }
    assert rows["second_blend_s"].to_numpy() == pytest.approx(rows["second_blend_frames"].to_numpy() / 30)
    assert rows["answered_after_s"].between(0, 600).all()
    name = "data/description-participants_data.csv" if kind == "psych-ds" else "participants.tsv"
    people = pd.read_csv(folder / name, sep="," if kind == "psych-ds" else "\t")
    persons = people[~people["simulated"]]
    assert (len(persons), len(people)) == (7, 9)
    assert list(persons["form_age"]) == [23.0] * 7  # of seven people five can't be told from the other two
    assert persons["form_hand"].isna().all()  # one left hand: nobody's is told
    assert "form_club" not in people
    assert people[people["simulated"]]["form_age"].isna().all()


def test_parquet_keeps_types_units_and_words(tmp_path: Path, protocol: Protocol, study: tuple[Responses, Any]) -> None:
    try:
        from arro3.io import read_parquet
    except ImportError:
        unavailable("Parquet", "install it: pip install arro3-core arro3-io")
    responses, blends = study
    table = read_parquet(export_parquet(responses, tmp_path / "a.parquet", blends, asked(protocol))).read_all()
    text = pd.read_csv(export_csv(responses, tmp_path / "a.csv", blends, asked(protocol)))
    dictionary = json.loads((tmp_path / "a_columns.json").read_text())
    assert table.schema.names == [*text.columns] == [*EXPORTED, *(f"form_{name}" for name in asked(protocol))]
    types = {field.name: str(field.type) for field in table.schema}
    names = (
        "participant",
        "trial",
        "response_s",
        "missed",
        "answered_at",
        "first_blend_frames",
        "form_age",
        "form_club",
    )
    kinds = ("Utf8", "Int64", "Float64", "Boolean", 'Timestamp(µs, "UTC")', "Int64", "Float64", "Utf8")
    assert all(kind in types[name] for name, kind in zip(names, kinds, strict=True)), types
    for field in table.schema:
        told = {key.decode(): value.decode() for key, value in field.metadata.items()}
        assert told["Description"] == dictionary[field.name]["Description"]
        assert told.get("Units") == dictionary[field.name].get("Units")
        values, written = table[field.name].to_pylist(), text[field.name]
        assert [value is None for value in values] == list(written.isna()), field.name
        if field.name == "answered_at":
            assert [value.isoformat() for value in values] == [*written]
        else:
            assert [value for value in values if value is not None] == pytest.approx([*written.dropna()]), field.name


def test_parquet_says_what_to_install(
    tmp_path: Path, study: tuple[Responses, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "arro3", None)
    with pytest.raises(SessionError, match=r"found none .*; install it: pip install arro3-core arro3-io"):
        export_parquet(study[0], tmp_path / "a.parquet", study[1], {})
    assert not (tmp_path / "a.parquet").exists()


def test_an_unknown_licence_is_refused() -> None:
    assert credited(["A"], "cc-by-4.0") == Credit(("A",), "CC-BY-4.0")
    with pytest.raises(SessionError, match=r"--licence: expected an identifier of spdx.org/licenses, .*found 'free'"):
        credited(["A"], "free")
