"""Sessions: who takes part under which protocol, with which plan, as the database keeps them.

An open database and a plan come in; stored sessions go out, begun once and taken up again with the plan that is stored.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Collection, Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import sqlalchemy as sa

from study.errors import SessionError
from study.experiment.plan import Plan, plan_from_json
from study.experiment.protocol.whole import Protocol
from study.experiment.store.databases import alone, damaged
from study.experiment.store.responses import Clock, Responses, rows_of, utc_now
from study.experiment.store.tables import answers, events, sessions, withdrawals

if TYPE_CHECKING:
    import pandas as pd

LARGEST_SEED = 2**63 - 1
"""What the databases' integers hold."""


@dataclass(frozen=True)
class SessionRecord:
    """A stored session: who, under which protocol, with which plan."""

    id: int
    participant: str
    simulated: bool
    plan: Plan
    protocol_sha256: str
    truth: Mapping[str, Any] | None


def refuse_other_stimuli(responses: Responses, identifiers: Collection[str]) -> None:
    """Refuse a database whose sessions show stimuli that are not among these: their answers would be about nothing."""
    known = set(identifiers)
    for record in all_sessions(responses):
        if missing := record.plan.stimuli - known:
            raise SessionError(
                f"{responses.place}: expected sessions with the stimuli of this results folder, found that of "
                f"{record.participant!r}, which shows others ({len(missing)}, made from other motions, or by another "
                "version of Segue); use another database, or the results folder that it belongs to."
            )


def begin_session(
    responses: Responses,
    protocol: Protocol,
    plan: Plan,
    *,
    simulated: bool = False,
    library: str = "",
    library_synthetic: bool = False,
    truth: Mapping[str, Any] | None = None,
    clock: Clock = utc_now,
    within: sa.Connection | None = None,
) -> SessionRecord:
    """Start a participant's session, or take up the one that there is.

    Parameters
    ----------
    within
        The caller's own transaction (`databases.alone`) where this is a part of it.

    Raises
    ------
    SessionError
        Where the database holds another protocol's sessions (another hash), where the participant's plan, or whether
        the participant is simulated, differs from what is stored.
    """
    if plan.seed > LARGEST_SEED:
        raise SessionError(f"Expected a seed below 2 to the power of 63, found {plan.seed}; choose another one.")
    with alone(responses.engine) if within is None else nullcontext(within) as connection:
        _refuse_other_protocol(connection, responses.place, protocol)
        found = connection.execute(sa.select(sessions).where(sessions.c.participant == plan.participant)).one_or_none()
        if found is not None:
            record = _session_record(found._mapping, responses.place)
            _refuse_other_plan(record, plan, simulated)
            connection.execute(sa.insert(events).values(session_id=record.id, kind="resumed", at=clock()))
            return record
        key = _fresh_id(connection)
        connection.execute(
            sa.insert(sessions).values(
                id=key,
                participant=plan.participant,
                simulated=simulated,
                protocol_name=protocol.name,
                protocol_text=protocol.text,
                protocol_sha256=protocol.sha256,
                plan_json=plan.to_json(),
                seed=plan.seed,
                library=library,
                library_synthetic=library_synthetic,
                truth_json=None if truth is None else json.dumps(truth, sort_keys=True),
                started_at=clock(),
                **_versions(),
            )
        )
        connection.execute(sa.insert(events).values(session_id=key, kind="started", at=clock()))
    return SessionRecord(key, plan.participant, simulated, plan, protocol.sha256, truth)


def _fresh_id(connection: sa.Connection) -> int:
    """The next number: the same in every database, and never that of a session which was withdrawn."""
    latest = [sa.func.coalesce(sa.func.max(column), 0) for column in (sessions.c.id, withdrawals.c.session_id)]
    return 1 + int(max(connection.execute(sa.select(one)).scalar_one() for one in latest))


def _versions() -> dict[str, str]:
    import numpy as np

    import study

    return {
        "segue_version": study.__version__,
        "python_version": platform.python_version(),
        "numpy_version": np.__version__,
    }


def _refuse_other_protocol(connection: sa.Connection, place: str, protocol: Protocol) -> None:
    query = sa.select(sessions.c.protocol_name, sessions.c.protocol_sha256).distinct()
    for name, sha256 in connection.execute(query):
        if sha256 != protocol.sha256:
            raise SessionError(
                f"{place}: expected sessions of {protocol.name!r} with sha256 {protocol.sha256[:12]}, found "
                f"some of {name!r} with {sha256[:12]}. Answers under different protocols are not mixed: use another "
                "results folder, or the protocol.toml of this one."
            )


def _refuse_other_plan(record: SessionRecord, plan: Plan, simulated: bool) -> None:
    if record.simulated != simulated:
        kinds = {True: "a simulated", False: "a real"}
        raise SessionError(
            f"Expected {kinds[simulated]} participant {plan.participant!r}, found {kinds[record.simulated]} one "
            "of that name; choose another name."
        )
    if record.plan != plan:
        raise SessionError(
            f"Expected the stored plan of participant {plan.participant!r} (seed {record.plan.seed}), found another "
            f"(seed {plan.seed}); continue with the stored plan, or choose another name."
        )


def find_session(responses: Responses, participant: str) -> SessionRecord | None:
    """A participant's session, or None; resuming starts from its stored plan."""
    return next(iter(_records(responses, sessions.c.participant == participant)), None)


def session_by_id(responses: Responses, session_id: int) -> SessionRecord:
    """A session by its number."""
    found = _records(responses, sessions.c.id == session_id)
    if not found:
        raise SessionError(f"{responses.place}: expected the number of a session, found {session_id}.")
    return found[0]


def all_sessions(responses: Responses) -> tuple[SessionRecord, ...]:
    """Every session, in the order in which they were started."""
    return _records(responses, sa.true())


def _records(responses: Responses, condition: sa.ColumnElement[bool]) -> tuple[SessionRecord, ...]:
    rows = rows_of(responses, sa.select(sessions).where(condition).order_by(sessions.c.id))
    return tuple(_session_record(row, responses.place) for row in rows)


def _session_record(row: sa.RowMapping, place: str) -> SessionRecord:
    try:
        plan = plan_from_json(row["plan_json"])
        truth = None if row["truth_json"] is None else json.loads(row["truth_json"])
    except SessionError as error:
        raise SessionError(f"{place}: session {row['id']}: {error}") from error
    except ValueError as error:
        raise damaged(place, f"session {row['id']}: {error}") from error
    return SessionRecord(row["id"], row["participant"], row["simulated"], plan, row["protocol_sha256"], truth)


def session_table(responses: Responses) -> pd.DataFrame:
    """One row a session: participant, simulated, protocol, seed, versions, library, truth, start, answers."""
    import pandas as pd

    count = sa.func.count(answers.c.id).label("answers")
    columns = [column for column in sessions.c if column.name not in ("protocol_text", "plan_json")]
    query = sa.select(*columns, count).outerjoin(answers, answers.c.session_id == sessions.c.id)
    rows = rows_of(responses, query.group_by(sessions.c.id).order_by(sessions.c.id))
    return pd.DataFrame([dict(row) for row in rows], columns=[*(c.name for c in columns), "answers"])
