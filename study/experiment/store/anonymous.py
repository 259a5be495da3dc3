"""Answers without identities: a database of responses in, one that may be given to anyone out.

People get other names, in another order; times count from the beginning of each session, set to the year 1970. Written
texts, what identifies a browser or a link, and sessions without answers stay behind; the form's other answers are
coarsened until nobody stands alone (`form.coarsened`). Simulated participants stay what they are.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from random import SystemRandom
from typing import Any

import sqlalchemy as sa

from renderer.files import scratch_folder
from study.errors import SessionError
from study.experiment.form import asked, coarsened
from study.experiment.protocol.whole import Protocol
from study.experiment.store import tables as stored
from study.experiment.store.databases import alone
from study.experiment.store.responses import Responses, open_responses, rows_of
from study.experiment.store.variables import PRESENTATIONS

BEGINNING = datetime(1970, 1, 1, tzinfo=UTC)
"""When every session begins."""

Row = dict[str, Any]


@contextmanager
def without_identities(
    protocol: Protocol,
    responses: Responses,
    place: Path | None = None,
    *,
    shuffle: Callable[[list[Row]], None] | None = None,
) -> Iterator[Responses]:
    """A copy that tells nobody who took part, open within the block.

    Parameters
    ----------
    place
        File of the copy; a passing one unless given.
    shuffle
        Puts the sessions of people into another order; by chance that nobody can repeat unless given.

    Raises
    ------
    SessionError
        Where there is no answer.
    """
    found = {table: _rows(responses, table) for table in _TABLES}
    if not (answered := {row["session_id"] for row in found[stored.answers]}):
        raise SessionError(f"{responses.place}: expected answers to export, found none; collect or simulate some first")
    found[stored.form_values] = _coarse_form(protocol, found[stored.form_values])
    sessions = [row for row in found.pop(stored.sessions) if row["id"] in answered]
    sessions = _renamed(sessions, shuffle or SystemRandom().shuffle)
    begun = {row["id"]: row["started_at"] for row in sessions}
    numbers = {session: number for number, session in enumerate(begun, start=1)}

    def copied(row: Row) -> Row:
        session, shown = row["session_id"], "place" in row
        times = {name: BEGINNING + (at - begun[session]) for name, at in row.items() if isinstance(at, datetime)}
        kept = {name: value for name, value in row.items() if name not in ("id", "detail_json")}
        detail = json.loads(row["detail_json"] or "{}") if shown else {}  # of other tables', a browser's or a link's
        size = {"detail_json": json.dumps({name: detail[name] for name in PRESENTATIONS if name in detail})}
        return {**kept, **times, "session_id": numbers[session], **(size if shown else {})}

    with scratch_folder("export") as passing, open_responses(place or passing / "responses.sqlite") as copy:
        with alone(copy.engine) as connection:
            begins = [{**row, "id": numbers[row["id"]], "started_at": BEGINNING} for row in sessions]
            connection.execute(sa.insert(stored.sessions), begins)
            for table, rows in found.items():
                if kept := [copied(row) for row in rows if row["session_id"] in numbers]:
                    connection.execute(sa.insert(table), kept)
        yield copy


_TABLES = (
    stored.sessions,
    stored.answers,
    stored.answer_stimuli,
    stored.presentations,
    stored.form_values,
    stored.events,
)


def _rows(responses: Responses, table: sa.Table) -> list[Row]:
    return [dict(row) for row in rows_of(responses, sa.select(table).order_by(*table.primary_key))]


def _renamed(sessions: list[Row], shuffle: Callable[[list[Row]], None]) -> list[Row]:
    """The sessions with people under other names, in another order."""
    people = [row for row in sessions if not row["simulated"]]
    shuffle(people)
    for number, row in enumerate(people, start=1):
        row["participant"] = f"p{number:03d}"
        row["plan_json"] = json.dumps({**json.loads(row["plan_json"]), "participant": row["participant"]})
    everybody = people + [row for row in sessions if row["simulated"]]
    return [{**row, "library": Path(row["library"]).name} for row in everybody]


def _coarse_form(protocol: Protocol, rows: list[Row]) -> list[Row]:
    """The rows of the form: what people said of themselves taken together, what they said of a study each by itself."""
    given: dict[int, dict[str, str]] = {}
    for row in rows:
        given.setdefault(row["session_id"], {})[row["name"]] = row["value"]
    about = {field.name: field for field in protocol.form}
    parts = [about, *({name: field} for name, field in asked(protocol).items() if name not in about)]
    told = [coarsened(part, {one: said for one, said in given.items() if set(said) & set(part)}) for part in parts]
    coarse = {(person, name): value for part in told for person, said in part.items() for name, value in said.items()}
    return [{**row, "value": coarse.get((row["session_id"], row["name"]), "")} for row in rows]
