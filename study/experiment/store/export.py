"""Exports for archives and other programs: the answers of a results folder in, a Psych-DS or BIDS data set out.

Psych-DS: `data/*_data.csv`, and `dataset_description.json` in schema.org's words. BIDS: behavioural data without
imaging (`sub-*/beh/*_beh.tsv`, a JSON file beside each). Both carry every showing and role, answers to the form, and
the protocol, but no identities (`anonymous`); Psych-DS also how every stimulus was shown. Simulated answers are called
so in title, readme and every row.
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
from study.experiment.folder import PROTOCOL
from study.experiment.form import WRITTEN, asked
from study.experiment.protocol.whole import Protocol
from study.experiment.store import tables as stored
from study.experiment.store.anonymous import without_identities
from study.experiment.store.frames import ROLES, Blends, answers_frame, with_blends, with_form
from study.experiment.store.responses import Responses, rows_of
from study.experiment.store.sessions import session_table
from study.experiment.store.variables import (
    PARTICIPANTS,
    PRESENTATIONS,
    SHARED,
    SHOWN_TO,
    STIMULI,
    Variable,
    form_columns,
)
from study.files import whole_folder
from study.spreadsheets import safe_table

MADE_BY = "Segue"
DESCRIPTION = "dataset_description.json"
BIDS_VERSION = "1.10.0"
COARSE = " Told by five participants or more, or withheld; numbers are means of five or more."


@dataclass(frozen=True)
class Credit:
    """Who made a data set, and what others may do with it: names, and a licence's identifier by SPDX."""

    authors: tuple[str, ...] = ()
    licence: str = ""

    @property
    def address(self) -> str:
        """Where the licence can be read."""
        return f"https://spdx.org/licenses/{self.licence}.html" if self.licence else ""


NOBODY = Credit()


def credited(authors: Sequence[str], licence: str) -> Credit:
    """Return a credit.

    Raises
    ------
    SessionError
        For a licence that SPDX does not list.
    """
    from packaging.licenses import InvalidLicenseExpression, canonicalize_license_expression

    try:
        return Credit(tuple(authors), str(canonicalize_license_expression(licence)) if licence else "")
    except InvalidLicenseExpression as error:
        raise SessionError(
            f"--licence: expected an identifier of spdx.org/licenses, such as CC-BY-4.0, found {licence!r} ({error})."
        ) from error


@dataclass(frozen=True, eq=False)
class Shared:
    """What is exported: tables by name, `variables` with the meaning of their columns, and words on the whole."""

    protocol: Protocol
    tables: Mapping[str, pd.DataFrame]
    variables: Mapping[str, Mapping[str, Variable]]
    credit: Credit

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
        source = f" After {self.protocol.source.removeprefix('after ')}." if self.protocol.source else ""
        whose = f" NOT PEOPLE'S ANSWERS ALONE: {self.whose}." if self.whose else ""
        return (
            f"{self.protocol.title}: {size} in {counted(len(self.protocol.studies), 'study', 'studies')} of "
            f"motion transitions.{source}"
            f"{whose} Collected under the protocol {self.protocol.name}, sha256 {self.protocol.sha256}. Exported by "
            f"{MADE_BY} {study.__version__}."
        )

    @property
    def readme(self) -> str:
        """What to know before reading the tables."""
        return (
            f"# {self.title}\n\n{self.words}\n\nEmpty cells (n/a in BIDS): missed, or without a meaning for that task. "
            "Rows whose `role` is not `trial` count in no analysis, nor does any but the last `attempt` of a trial.\n"
        )


def gather(protocol: Protocol, responses: Responses, blends: Blends, credit: Credit = NOBODY) -> Shared:
    """Read everything that is exported.

    Parameters
    ----------
    responses
        Without identities.
    """
    answers = answers_frame(responses, all_attempts=True, roles=ROLES)
    sessions = session_table(responses)
    names = dict(zip(sessions["id"], sessions["participant"], strict=True))
    begun = dict(zip(sessions["participant"], sessions["started_at"], strict=True))

    def whole(table: sa.Table, variables: Mapping[str, Variable]) -> pd.DataFrame:
        wanted = [column for column in table.c if column.name in {*variables, "session_id", "detail_json", "at"}]
        listed = [
            {**json.loads(row.get("detail_json") or "{}"), **row, "participant": names[row["session_id"]]}
            for row in rows_of(responses, sa.select(*wanted))
        ]
        for row in listed:
            row["after_s"] = (row["at"] - begun[row["participant"]]).total_seconds() if "at" in row else None
            row["blend_frames"], row["blend_s"] = blends.get(row["stimulus"], (None, None))
        return pd.DataFrame(listed, columns=list(variables))

    after = pd.to_datetime(answers["answered_at"], format="ISO8601") - answers["participant"].map(begun)
    answers = with_blends(answers.assign(answered_after_s=after.dt.total_seconds()), blends)[list(SHARED)]
    stimuli = whole(stored.answer_stimuli, STIMULI)
    presentations = whole(stored.presentations, PRESENTATIONS)
    participants = sessions[list(PARTICIPANTS)].copy()
    for column in SHOWN_TO:
        size = pd.to_numeric(presentations[column.removeprefix("shown_")])
        participants[column] = participants["participant"].map(size.groupby(presentations["participant"]).median())
    form = {name: field for name, field in asked(protocol).items() if field.kind not in WRITTEN}
    participants = with_form(participants, responses, form)
    of_participants = {**PARTICIPANTS, **SHOWN_TO, **form_columns(form, COARSE)}
    parts: dict[str, tuple[pd.DataFrame, Mapping[str, Variable]]] = {
        "answers": (answers, SHARED),
        "participants": (participants, of_participants),
        "stimuli": (stimuli, STIMULI),
        "presentations": (presentations, PRESENTATIONS),
    }
    tables = {name: safe_table(frame) for name, (frame, _) in parts.items()}
    return Shared(protocol, tables, {name: variables for name, (_, variables) in parts.items()}, credit)


def export(
    protocol: Protocol, responses: Responses, kind: str, folder: Path, blends: Blends, credit: Credit = NOBODY
) -> Path:
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
    refuse_to_replace(folder)
    with without_identities(protocol, responses) as shown, whole_folder(folder) as unfinished:
        {"psych-ds": _write_psych_ds, "bids": _write_bids}[kind](gather(protocol, shown, blends, credit), unfinished)
    return folder


def refuse_to_replace(folder: Path) -> None:
    """Refuse a folder that holds anything that Segue did not export."""
    if folder.exists() and not _replaceable(folder):
        raise SessionError(
            f"{folder}: expected a new or empty folder, or an earlier export of Segue, found other files; name another"
        )


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


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write JSON that a person can read."""
    path.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def _by_study(shared: Shared) -> list[tuple[str, pd.DataFrame]]:
    """Answers by study, with a label, in the protocol's order."""
    answers = shared.tables["answers"]
    names = labels([study.name for study in shared.protocol.studies])
    parts = [(name, answers[answers["study"] == study]) for study, name in names.items()]
    return [(name, part) for name, part in parts if len(part)]


# Psych-DS


def _write_psych_ds(shared: Shared, folder: Path) -> None:
    write_data(shared, folder)
    (folder / "materials").mkdir()
    (folder / "materials" / PROTOCOL).write_text(shared.protocol.text, encoding="utf-8")


def write_data(shared: Shared, folder: Path) -> None:
    """Write the tables of a Psych-DS data set, what they and their columns mean, and a readme."""
    data = folder / "data"
    data.mkdir()
    parts = [(f"task-{name}", part, "answers") for name, part in _by_study(shared)]
    parts += [(f"description-{name}", table, name) for name, table in shared.tables.items() if name != "answers"]
    measured: dict[str, dict[str, Any]] = {}
    for stem, table, name in parts:
        if len(table):
            own = {column: one.property(column) for column, one in shared.variables[name].items()}
            table.to_csv(data / f"{stem}_data.csv", index=False, lineterminator="\n")
            write_json(data / f"{stem}_data.json", {"variableMeasured": [*own.values()]})
            measured = own | measured
    description = {
        "@context": "https://schema.org/",
        "@type": "Dataset",
        "name": shared.title,
        "description": shared.words,
        "sdPublisher": {"@type": "Organization", "name": MADE_BY},
        "author": [{"@type": "Person", "name": name} for name in shared.credit.authors],
        "license": shared.credit.address,
        "variableMeasured": [*measured.values()],
    }
    write_json(folder / DESCRIPTION, {key: value for key, value in description.items() if value})
    (folder / "README.md").write_text(shared.readme, encoding="utf-8")


# BIDS


def _write_bids(shared: Shared, folder: Path) -> None:
    subjects = labels([str(name) for name in shared.tables["participants"]["participant"]])
    about = {"Name": shared.title, "BIDSVersion": BIDS_VERSION, "DatasetType": "raw"}
    generated = [{"Name": MADE_BY, "Version": study.__version__}]
    credit = {"Authors": list(shared.credit.authors), "License": shared.credit.licence}
    stated = {name: value for name, value in credit.items() if value}
    write_json(folder / DESCRIPTION, {**about, "GeneratedBy": generated, **stated})
    (folder / "README.md").write_text(shared.readme, encoding="utf-8")
    (folder / "code").mkdir()
    (folder / "code" / PROTOCOL).write_text(shared.protocol.text, encoding="utf-8")
    people = shared.tables["participants"].rename(columns={"participant": "participant_id"})
    people["participant_id"] = [f"sub-{subjects[str(name)]}" for name in people["participant_id"]]
    _write_tsv(folder / "participants.tsv", people)
    columns = zip(people.columns, shared.variables["participants"].values(), strict=True)
    write_json(folder / "participants.json", {name: variable.entry() for name, variable in columns})
    described = {name: variable.entry() for name, variable in SHARED.items() if name not in ("participant", "study")}
    for task, part in _by_study(shared):
        spec = next(each for each in shared.protocol.studies if each.name == part["study"].iloc[0])
        told = {"TaskName": task, "TaskDescription": spec.title or spec.name, "Instructions": spec.instructions}
        for name, own in part.groupby("participant", sort=False):
            beh = folder / f"sub-{subjects[str(name)]}" / "beh"
            beh.mkdir(parents=True, exist_ok=True)
            file = beh / f"sub-{subjects[str(name)]}_task-{task}_beh.tsv"
            _write_tsv(file, own.drop(columns=["participant", "study"]))
            write_json(file.with_suffix(".json"), {**{key: text for key, text in told.items() if text}, **described})


def _write_tsv(path: Path, table: pd.DataFrame) -> None:
    """Tabs, and n/a for what is missing; texts lose their tabs and line ends, for which the format has no escape."""
    table.map(_one_line).to_csv(path, sep="\t", index=False, na_rep="n/a", lineterminator="\n", quoting=csv.QUOTE_NONE)


def _one_line(value: Any) -> Any:
    return re.sub(r"\s+", " ", value) or None if isinstance(value, str) else value
