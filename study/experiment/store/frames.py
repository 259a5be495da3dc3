"""Tables of answers: one row an answer, for the analysis and for other programs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import sqlalchemy as sa

from study.errors import SessionError
from study.experiment.store.responses import Responses, rows_of
from study.experiment.store.tables import answer_stimuli, answers, sessions
from study.experiment.store.variables import ANSWERS
from study.files import write_whole
from study.spreadsheets import safe_table
from study.tasks.answer import CONFIDENCE
from study.tasks.trial import PLACES

if TYPE_CHECKING:
    import pandas as pd

ROLES = ("trial", "practice", "check")
ANSWER_COLUMNS = tuple(ANSWERS)
"""The seam with the analysis: one row an answer."""


def answers_frame(
    responses: Responses,
    *,
    all_attempts: bool = False,
    roles: Sequence[str] = ("trial",),
    protocol_sha256: str | None = None,
) -> pd.DataFrame:
    """All answers as one table, one row an answer, in `ANSWER_COLUMNS`.

    Parameters
    ----------
    roles
        Which trials: `trial`, and where asked for `practice` and `check`, which no analysis counts.
    all_attempts
        With it every showing of a trial; without, the last one of each.
    protocol_sha256
        Which protocol's answers, where a database was merged from several.

    Raises
    ------
    SessionError
        Where answers under different protocols would be mixed.
    """
    import pandas as pd

    query = sa.select(answers, sessions.c.participant, sessions.c.simulated, sessions.c.protocol_sha256).join(
        sessions, answers.c.session_id == sessions.c.id
    )
    for slot, place in enumerate(PLACES[2:3], start=3):  # the table of answers itself has two
        own = answer_stimuli.alias(place)
        same = [own.c[name] == answers.c[name] for name in ("session_id", "trial", "item", "attempt")]
        query = query.outerjoin(own, sa.and_(*same, own.c.slot == slot))
        query = query.add_columns(sa.func.coalesce(own.c.stimulus, "").label(place))
    if protocol_sha256 is not None:
        query = query.where(sessions.c.protocol_sha256 == protocol_sha256)
    query = query.where(answers.c.role.in_(roles))
    rows = rows_of(responses, query.order_by(answers.c.session_id, answers.c.id))
    hashes = sorted({row["protocol_sha256"] for row in rows})
    if len(hashes) > 1:
        raise SessionError(
            f"{responses.place}: expected answers under one protocol, found {len(hashes)}: "
            f"{', '.join(sha256[:12] for sha256 in hashes)}. Say which one by its sha256."
        )
    table = pd.DataFrame(_by_slider(responses, rows), columns=[*ANSWER_COLUMNS, "session_id"])
    # How sure somebody was stands beside the answer that it is about.
    showing = pd.MultiIndex.from_frame(table[["session_id", "trial", "attempt"]])
    about = table["item"] == CONFIDENCE
    sure = pd.Series(pd.to_numeric(table["answer"][about]).to_numpy(), showing[about], dtype="Int64")
    table["confidence"] = sure.reindex(showing).to_numpy()
    table = table[~about]
    if not all_attempts:
        table = table.drop_duplicates(["session_id", "trial", "item", "slot"], keep="last")
    table["answered_at"] = [at.isoformat() for at in table["answered_at"]]
    # Answers without a meaning (missed, another task) stay empty rather than false.
    for column in ("reference_first", "a_first", "correct", "chose_a"):
        table[column] = table[column].astype("boolean")
    for column in ("simulated", "missed", "shown_well"):
        table[column] = table[column].astype(bool)
    for column in ("difference_frames", "confidence", "slot"):
        table[column] = table[column].astype("Int64")
    table["response_s"] = table["response_s"].astype(float)
    return table[list(ANSWER_COLUMNS)].reset_index(drop=True)


def _by_slider(responses: Responses, rows: Sequence[sa.RowMapping]) -> list[dict[str, Any]]:
    """A row for each slider of a trial that has several, with the method and the film that were rated there."""
    key = ("session_id", "trial", "item", "attempt")
    films: dict[tuple[Any, ...], list[Any]] = {}
    if any(" " in (row["answer"] or "") for row in rows):
        for film in rows_of(responses, sa.select(answer_stimuli).order_by(answer_stimuli.c.slot)):
            films.setdefault(tuple(film[name] for name in key), []).append(film)
    found: list[dict[str, Any]] = []
    for row in rows:
        values = (row["answer"] or "").split(" ")
        if len(values) < 2:
            found.append(dict(row))
            continue
        for value, film in zip(values, films[tuple(row[name] for name in key)], strict=True):
            own = {"answer": value, "slot": film["slot"], "method_a": film["method"], "first": film["stimulus"]}
            found.append({**row, **own, "method_b": "", "second": "", "third": ""})
    return found


def answers_csv(responses: Responses) -> str:
    """All answers, every showing and every role, as CSV (ISO times, empty where nothing is meant)."""
    return str(safe_table(answers_frame(responses, all_attempts=True, roles=ROLES)).to_csv(index=False))


def export_csv(responses: Responses, path: str | Path) -> Path:
    """Write `answers_csv` to a file, and what its columns mean beside it (`dictionary_beside`)."""
    write_whole(path, answers_csv(responses))
    entries = {name: {**ANSWERS[name].entry(), "Type": ANSWERS[name].kind} for name in ANSWER_COLUMNS}
    write_whole(dictionary_beside(path), json.dumps(entries, indent=2, ensure_ascii=False) + "\n")
    return Path(path)


def dictionary_beside(path: str | Path) -> Path:
    """Where the meaning of a table's columns stands: `answers_columns.json` beside `answers.csv`."""
    return Path(path).with_name(f"{Path(path).stem}_columns.json")
