"""Exports for archives and other programs: the answers of a results folder in, a Psych-DS or BIDS data set out.

Psych-DS: `data/*_data.csv`, and `dataset_description.json` in schema.org's words. BIDS: behavioural data without
imaging (`sub-*/beh/*_beh.tsv`, a JSON file beside each). Both carry every showing and role, what participants said of
themselves in the form, and the protocol; Psych-DS also how every stimulus was shown. Parameters of recruiting services,
tokens and codes stay behind. Simulated answers are called so in title, readme and every row.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import sqlalchemy as sa

import study
from study.counting import counted
from study.errors import SessionError
from study.experiment.protocol.whole import Protocol
from study.experiment.store import tables as stored
from study.experiment.store.frames import ROLES, answers_frame
from study.experiment.store.responses import Responses, rows_of
from study.experiment.store.sessions import session_table
from study.experiment.store.variables import ANSWERS, PARTICIPANTS, PRESENTATIONS, SHOWN_TO, STIMULI, Variable
from study.files import whole_folder
from study.spreadsheets import safe_table

MADE_BY = "Segue"
DESCRIPTION = "dataset_description.json"
BIDS_VERSION = "1.10.0"


@dataclass(frozen=True, eq=False)
class Shared:
    """What is exported: tables by name, `variables` with the meaning of their columns, and words on the whole."""

    protocol: Protocol
    tables: Mapping[str, pd.DataFrame]
    variables: Mapping[str, Mapping[str, Variable]]

    @property
    def title(self) -> str:
        """The protocol's title, and what everybody has to know before using the data."""
        return f"{self.protocol.title} ({self.whose})" if self.whose else self.protocol.title

    @property
    def whose(self) -> str:
        """Said where not all answers are people's."""
        simulated = self.tables["participants"]["simulated"].astype(bool)
        if not simulated.any():
            return ""
        return "simulated answers, no people" if simulated.all() else "people's and simulated answers mixed"

    @property
    def words(self) -> str:
        """A paragraph on the data set."""
        answers, people = (len(self.tables[name]) for name in ("answers", "participants"))
        size = f"{counted(answers, 'answer')} of {counted(people, 'participant')}"
        source = f" After {self.protocol.source}." if self.protocol.source else ""
        whose = f" NOT PEOPLE'S ANSWERS ALONE: {self.whose}." if self.whose else ""
        return (
            f"{self.protocol.title}: {size} in {counted(len(self.protocol.studies), 'study', 'studies')} of "
            f"motion transitions.{source}"
            f"{whose} Collected under the protocol {self.protocol.name}, sha256 {self.protocol.sha256}. Exported by "
            f"{MADE_BY} {study.__version__}."
        )


def gather(protocol: Protocol, responses: Responses) -> Shared:
    """Read everything that is exported.

    Raises
    ------
    SessionError
        Where there is no answer.
    """
    answers = answers_frame(responses, all_attempts=True, roles=ROLES)
    if answers.empty:
        raise SessionError(f"{responses.place}: expected answers to export, found none; collect or simulate some first")
    sessions = session_table(responses)
    names = dict(zip(sessions["id"], sessions["participant"], strict=True))
    form = rows_of(responses, sa.select(stored.form_values))

    def whole(table: sa.Table, variables: Mapping[str, Variable]) -> pd.DataFrame:
        wanted = [table.c[name] for name in variables if name in table.c]
        detail = [table.c.detail_json] if "detail_json" in table.c else []
        rows = rows_of(responses, sa.select(table.c.session_id, *wanted, *detail))
        listed = [
            {**json.loads(row.get("detail_json") or "{}"), **row, "participant": names[row["session_id"]]}
            for row in rows
        ]
        return pd.DataFrame(listed, columns=list(variables))

    stimuli = whole(stored.answer_stimuli, STIMULI)
    presentations = whole(stored.presentations, PRESENTATIONS)
    participants = sessions[list(PARTICIPANTS)].copy()
    for column in SHOWN_TO:
        size = pd.to_numeric(presentations[column.removeprefix("shown_")])
        participants[column] = participants["participant"].map(size.groupby(presentations["participant"]).median())
    labels = {f"form_{field.name}": field.label for field in protocol.form}
    labels |= {f"form_{study.name}.{field.name}": field.label for study in protocol.studies for field in study.form}
    for column in labels:
        said = {row["session_id"]: row["value"] for row in form if f"form_{row['name']}" == column}
        participants[column] = sessions["id"].map(said)
    asked = {column: Variable(f"Asked in the form: {label}") for column, label in labels.items()}
    variables: dict[str, Mapping[str, Variable]] = {
        "answers": ANSWERS,
        "stimuli": STIMULI,
        "presentations": PRESENTATIONS,
        "participants": {**PARTICIPANTS, **SHOWN_TO, **asked},
    }
    frames = {"answers": answers, "participants": participants, "stimuli": stimuli, "presentations": presentations}
    return Shared(protocol, {name: safe_table(frame) for name, frame in frames.items()}, variables)


def export(protocol: Protocol, responses: Responses, kind: str, folder: Path) -> Path:
    """Write a data set as a folder; an earlier export of ours there is replaced.

    Parameters
    ----------
    kind
        `psych-ds` or `bids`.

    Raises
    ------
    SessionError
        Where there is no answer, or the folder holds anything that Segue did not export.
    """
    if folder.exists() and not _replaceable(folder):
        raise SessionError(
            f"{folder}: expected a new or empty folder, or an earlier export of Segue, found other files; name another"
        )
    shared = gather(protocol, responses)
    with whole_folder(folder) as unfinished:
        {"psych-ds": _write_psych_ds, "bids": _write_bids}[kind](shared, unfinished)
    return folder


def _replaceable(folder: Path) -> bool:
    """Whether it contains only what `export` wrote."""
    if not folder.is_dir():
        return False
    if not any(folder.iterdir()):
        return True
    try:
        description = json.loads((folder / DESCRIPTION).read_text(encoding="utf-8"))
        makers = [*description.get("GeneratedBy", []), description.get("sdPublisher", {})]
        return any(maker.get("name", maker.get("Name")) == MADE_BY for maker in makers)
    except (OSError, ValueError, TypeError, AttributeError):  # none, or another program's
        return False


def label(name: str) -> str:
    """Return a name as both standards want it: letters and digits only."""
    return re.sub(r"[^A-Za-z0-9]", "", name) or "x"


def labels(names: Sequence[str]) -> dict[str, str]:
    """Return a label for each name, all different; a number tells names apart whose letters and digits are the same."""
    found: dict[str, str] = {}
    for name in names:
        made, number = label(name), 2
        while made in found.values():
            made, number = f"{label(name)}x{number}", number + 1
        found[name] = made
    return found


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def _by_study(shared: Shared) -> list[tuple[str, pd.DataFrame]]:
    """Answers by study, with a label, in the protocol's order."""
    answers = shared.tables["answers"]
    names = labels([study.name for study in shared.protocol.studies])
    parts = [(name, answers[answers["study"] == study]) for study, name in names.items()]
    return [(name, part) for name, part in parts if len(part)]


# Psych-DS


def _write_psych_ds(shared: Shared, folder: Path) -> None:
    data = folder / "data"
    data.mkdir()
    parts = [(f"task-{name}", part) for name, part in _by_study(shared)]
    parts += [(f"description-{name}", table) for name, table in shared.tables.items() if name != "answers"]
    for name, table in parts:
        if len(table):
            table.to_csv(data / f"{name}_data.csv", index=False, lineterminator="\n")
    variables = {name: variable for table in shared.variables.values() for name, variable in table.items()}
    description = {
        "@context": "https://schema.org/",
        "@type": "Dataset",
        "name": shared.title,
        "description": shared.words,
        "sdPublisher": {"@type": "Organization", "name": MADE_BY},
        "variableMeasured": [_property(name, variable) for name, variable in variables.items()],
    }
    _write_json(folder / DESCRIPTION, description)
    (folder / "README.md").write_text(_readme(shared), encoding="utf-8")
    (folder / "materials").mkdir()
    (folder / "materials" / "protocol.toml").write_text(shared.protocol.text, encoding="utf-8")


def _property(name: str, variable: Variable) -> dict[str, Any]:
    """A column in schema.org's words."""
    found: dict[str, Any] = {"@type": "PropertyValue", "name": name, "description": variable.description}
    if variable.unit:
        found["unitText"] = variable.unit
    if variable.levels:
        levels = variable.levels.items()
        found["valueReference"] = [{"@type": "DefinedTerm", "name": name, "description": text} for name, text in levels]
    return found


def _readme(shared: Shared) -> str:
    return (
        f"# {shared.title}\n\n{shared.words}\n\nEmpty cells (n/a in BIDS): missed, or without a meaning for that task. "
        "Rows whose `role` is not `trial` count in no analysis, nor does any but the last `attempt` of a trial.\n"
    )


# BIDS


def _write_bids(shared: Shared, folder: Path) -> None:
    subjects = labels([str(name) for name in shared.tables["participants"]["participant"]])
    generated = [{"Name": MADE_BY, "Version": study.__version__}]
    _write_json(
        folder / DESCRIPTION,
        {"Name": shared.title, "BIDSVersion": BIDS_VERSION, "DatasetType": "raw", "GeneratedBy": generated},
    )
    (folder / "README.md").write_text(_readme(shared), encoding="utf-8")
    (folder / "code").mkdir()
    (folder / "code" / "protocol.toml").write_text(shared.protocol.text, encoding="utf-8")
    people = shared.tables["participants"].rename(columns={"participant": "name"})
    people.insert(0, "participant_id", [f"sub-{subjects[str(name)]}" for name in people["name"]])
    _write_tsv(folder / "participants.tsv", people)
    columns = {"participant_id": Variable("Label of the participant in this data set.")}
    columns |= {"name": Variable("Name of the session in Segue's database.")}
    columns |= {name: one for name, one in shared.variables["participants"].items() if name != "participant"}
    _write_json(folder / "participants.json", {name: variable.entry() for name, variable in columns.items()})
    described = {name: variable.entry() for name, variable in ANSWERS.items() if name not in ("participant", "study")}
    for task, part in _by_study(shared):
        title = next(each.title or each.name for each in shared.protocol.studies if each.name == part["study"].iloc[0])
        about = {"TaskName": task, "TaskDescription": title}
        for name, own in part.groupby("participant", sort=False):
            beh = folder / f"sub-{subjects[str(name)]}" / "beh"
            beh.mkdir(parents=True, exist_ok=True)
            file = beh / f"sub-{subjects[str(name)]}_task-{task}_beh.tsv"
            _write_tsv(file, own.drop(columns=["participant", "study"]))
            _write_json(file.with_suffix(".json"), {**about, **described})


def _write_tsv(path: Path, table: pd.DataFrame) -> None:
    """Tabs, and n/a for what is missing; texts lose their tabs and line ends, for which the format has no escape."""
    table.map(_one_line).to_csv(path, sep="\t", index=False, na_rep="n/a", lineterminator="\n", quoting=csv.QUOTE_NONE)


def _one_line(value: Any) -> Any:
    return re.sub(r"\s+", " ", value) or None if isinstance(value, str) else value
