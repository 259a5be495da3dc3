"""Participants: who takes part in the browser, known by unguessable tokens; groups filled evenly; withdrawal.

A responses database and a token come in; stored participants go out. Tokens and withdrawal codes are stored as hashes
only, so the database does not let anyone in. Withdrawing deletes all that a session holds and leaves one audit line.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import secrets
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Any, Literal

import sqlalchemy as sa

from study.experiment.plan import Plan
from study.experiment.protocol.whole import Protocol
from study.experiment.store.databases import alone
from study.experiment.store.responses import Clock, Responses
from study.experiment.store.sessions import begin_session
from study.experiment.store.tables import (
    answer_stimuli,
    answers,
    events,
    form_values,
    participants,
    presentations,
    sessions,
    withdrawals,
)

DROPPED_AFTER = timedelta(hours=1)
"""Time without activity after which an unfinished session counts as dropped out."""

CODE_LETTERS = "abcdefghjkmnpqrstuvwxyz23456789"


def _utc_now() -> datetime:
    return datetime.now(UTC)


def steady_clock() -> Clock:
    """A clock that is set now, by the machine's, and then runs by itself.

    It decides who is still active, so that setting the machine's clock neither frees nor holds a place.
    """
    began, ticks = _utc_now(), time.monotonic()
    return lambda: began + timedelta(seconds=time.monotonic() - ticks)


def new_token() -> str:
    """An unguessable token of 256 bits, safe in addresses and cookies."""
    return secrets.token_urlsafe(32)


def hashed(token: str) -> str:
    """What is stored in place of a token."""
    return hashlib.sha256(token.encode()).hexdigest()


@dataclass(frozen=True)
class Participant:
    """A participant in the browser: the session, the secret that addresses are made from, and what the link said.

    `page` names the tab that shows the session, and is empty while none does; it was `seen_at` then.
    """

    session_id: int
    secret: str
    group: int
    parameters: Mapping[str, str]
    page: str
    seen_at: datetime

    @property
    def withdrawal_code(self) -> str:
        """The code with which this participant can withdraw; made from the secret, so it can be shown again."""
        return _code(self.secret)


def _code(secret: str) -> str:
    """A code of 79 bits that a person can copy by hand: four groups of four letters without lookalikes."""
    number = int.from_bytes(hmac.digest(secret.encode(), b"withdrawal", "sha256"))
    letters = [CODE_LETTERS[number // len(CODE_LETTERS) ** i % len(CODE_LETTERS)] for i in range(16)]
    return "-".join("".join(letters[i : i + 4]) for i in range(0, 16, 4))


@dataclass(frozen=True)
class Newcomer:
    """Who asks to take part: a name, a new token, what the link said, and in which tab (`page`).

    `identifying` are those of the `parameters` that name one person, who takes part once.
    """

    name: str
    token: str
    parameters: Mapping[str, str] = field(default_factory=dict)
    identifying: Mapping[str, str] = field(default_factory=dict)
    page: str = ""


@dataclass(frozen=True)
class Places:
    """For how many there is room: groups to fill evenly, and the most participants in all, None for as many as come."""

    groups: int = 1
    most_participants: int | None = None
    dropped_after: timedelta = DROPPED_AFTER


def admit(
    responses: Responses,
    protocol: Protocol,
    newcomer: Newcomer,
    places: Places,
    draw: Callable[[int], Plan],
    *,
    library: str = "",
    library_synthetic: bool = False,
    clock: Clock = _utc_now,
    heard_clock: Clock | None = None,
) -> Participant | Literal["full", "taken"]:
    """Begin a newcomer's session in the group that has the fewest, or say why not: no place left, or the name is known.

    All in one transaction that no other arrival runs beside, so that several programs fill the same groups evenly and
    never beyond the cap.

    Parameters
    ----------
    draw
        The newcomer's plan in a group.
    heard_clock
        Where it is another than that of the record, the clock by which participants are `seen`.
    """
    heard_at = (heard_clock or clock)()
    with alone(responses.engine) as connection:
        filled = _filled(connection, places, heard_at)
        if places.most_participants is not None and sum(filled) >= places.most_participants:
            return "full"
        known = sa.select(sessions.c.id).where(sessions.c.participant == newcomer.name)
        if connection.execute(known).first() is not None or _has_parameters(connection, newcomer.identifying):
            return "taken"
        group = filled.index(min(filled))
        record = begin_session(
            responses,
            protocol,
            draw(group),
            library=library,
            library_synthetic=library_synthetic,
            clock=clock,
            within=connection,
        )
        return _enrol(connection, record.id, newcomer, group, clock(), heard_at)


def _has_parameters(connection: sa.Connection, identifying: Mapping[str, str]) -> bool:
    key = participants.c.parameters_sha256 == _parameters_key(identifying)
    return bool(identifying) and connection.execute(sa.select(participants.c.session_id).where(key)).first() is not None


def _enrol(
    connection: sa.Connection, session_id: int, newcomer: Newcomer, group: int, began_at: datetime, seen_at: datetime
) -> Participant:
    """Store a participant's tokens (as hashes), group and parameters."""
    secret = secrets.token_hex(32)
    row = {
        "session_id": session_id,
        "token_sha256": hashed(newcomer.token),
        "withdrawal_sha256": hashed(_code(secret)),
        "secret": secret,
        "group_number": group,
        "parameters_json": json.dumps(dict(newcomer.parameters), sort_keys=True),
        "parameters_sha256": _parameters_key(newcomer.identifying) if newcomer.identifying else None,
        "began_at": began_at,
        "seen_at": seen_at,
        "page": newcomer.page,
    }
    connection.execute(sa.insert(participants).values(row))
    return Participant(session_id, secret, group, newcomer.parameters, newcomer.page, seen_at)


def _parameters_key(parameters: Mapping[str, str]) -> str:
    return hashed(json.dumps(dict(parameters), sort_keys=True))


def find_by_token(responses: Responses, token: str) -> Participant | None:
    """The participant with a token, or None."""
    return _find(responses, participants.c.token_sha256 == hashed(token))


def find_by_parameters(responses: Responses, identifying: Mapping[str, str]) -> Participant | None:
    """The participant whom these parameters of a link name, or None."""
    return _find(responses, participants.c.parameters_sha256 == _parameters_key(identifying))


def _find(responses: Responses, condition: sa.ColumnElement[bool]) -> Participant | None:
    with responses.engine.connect() as connection:
        row = connection.execute(sa.select(participants).where(condition)).mappings().one_or_none()
    if row is None:
        return None
    parameters = json.loads(row["parameters_json"])
    return Participant(row["session_id"], row["secret"], row["group_number"], parameters, row["page"], row["seen_at"])


def give_token(responses: Responses, participant: Participant, token: str, page: str = "") -> None:
    """Replace a participant's token: the same person in another browser; the old token is of no use any more."""
    change = sa.update(participants).where(participants.c.session_id == participant.session_id)
    with responses.engine.begin() as connection:
        connection.execute(change.values(token_sha256=hashed(token), page=page))


def take_page(responses: Responses, participant: Participant, page: str, *, clock: Clock = _utc_now) -> bool:
    """Let a tab show a session in place of the participant's `page`; False where a third one took it meanwhile."""
    own = (participants.c.session_id == participant.session_id) & (participants.c.page == participant.page)
    with responses.engine.begin() as connection:
        return connection.execute(sa.update(participants).where(own).values(page=page, seen_at=clock())).rowcount == 1


def close_page(responses: Responses, token: str, page: str) -> None:
    """A tab was closed: if it showed the session, any other one may."""
    own = (participants.c.token_sha256 == hashed(token)) & (participants.c.page == page)
    with responses.engine.begin() as connection:
        connection.execute(sa.update(participants).where(own).values(page=""))


def shown_elsewhere(connection: sa.Connection, pages: Mapping[int, str]) -> bool:
    """Whether one of these sessions is shown by another tab than this, or is gone; so it stays until the commit."""
    query = sa.select(participants.c.session_id, participants.c.page).where(participants.c.session_id.in_(pages))
    # All who lock several rows do so in this order: none waits for another in a circle.
    found = connection.execute(query.order_by(participants.c.session_id).with_for_update(read=True)).all()
    return len(found) < len(pages) or any(page not in ("", pages[number]) for number, page in found)


def seen(responses: Responses, session_ids: Collection[int], *, clock: Clock = _utc_now) -> None:
    """Record that participants are active now."""
    if session_ids:
        change = sa.update(participants).where(participants.c.session_id == sa.bindparam("number"))
        now = clock()
        with responses.engine.begin() as connection:
            connection.execute(change, [{"number": one, "seen_at": now} for one in sorted(session_ids)])


def finished_sessions() -> sa.Select[tuple[int]]:
    """Ids of the sessions that are finished."""
    return sa.select(events.c.session_id).where(events.c.kind == "finished")


def filled_groups(responses: Responses, places: Places, *, clock: Clock = _utc_now) -> list[int]:
    """How many participants each group has, finished or in progress; drop-outs and those who declined do not count."""
    with responses.engine.connect() as connection:
        return _filled(connection, places, clock())


def _filled(connection: sa.Connection, places: Places, now: datetime) -> list[int]:
    left = sa.select(events.c.session_id).where(events.c.kind.in_(("declined", "left")))
    query = (
        sa.select(participants.c.group_number, sa.func.count())
        .where(
            sa.or_(
                participants.c.session_id.in_(finished_sessions()),
                sa.and_(participants.c.seen_at > now - places.dropped_after, participants.c.session_id.not_in(left)),
            )
        )
        .group_by(participants.c.group_number)
    )
    counts = {row[0]: row[1] for row in connection.execute(query)}
    return [counts.get(group, 0) for group in range(places.groups)]


def overview(responses: Responses) -> list[dict[str, Any]]:
    """One mapping a session in the browser, newest first, for the researcher's page."""
    count = (
        sa.select(sa.func.count())
        # A trial that is shown again asks the same questions, which are counted once.
        .where((answers.c.session_id == sessions.c.id) & (answers.c.attempt == 1))
        .correlate(sessions)
        .scalar_subquery()
    )
    query = (
        sa.select(
            sessions.c.id,
            sessions.c.participant,
            participants.c.group_number,
            participants.c.parameters_json,
            participants.c.began_at,
            participants.c.seen_at,
            count.label("answers"),
        )
        .join(participants, participants.c.session_id == sessions.c.id)
        .order_by(sessions.c.id.desc())
    )
    with responses.engine.connect() as connection:
        rows = connection.execute(query).mappings().all()
        kinds = connection.execute(
            sa.select(events.c.session_id, events.c.kind, sa.func.count()).group_by(events.c.session_id, events.c.kind)
        ).all()
    happened: dict[int, dict[str, int]] = {}
    for session_id, kind, number in kinds:
        happened.setdefault(session_id, {})[kind] = number
    return [{**row, "events": happened.get(row["id"], {})} for row in rows]


def withdraw(responses: Responses, withdrawal_code: str, *, clock: Clock = _utc_now) -> int | None:
    """Delete all that is stored of the participant with a withdrawal code; one audit line stays.

    Returns
    -------
    int or None
        The session that was deleted, or None for a code that no participant has.
    """
    code = withdrawal_code.strip().lower()
    with responses.engine.connect() as connection:
        query = sa.select(participants.c.session_id).where(participants.c.withdrawal_sha256 == hashed(code))
        session_id = connection.execute(query).scalar_one_or_none()
        if session_id is None:
            return None
    erase(responses, int(session_id), clock=clock)
    return int(session_id)


def erase(responses: Responses, session_id: int, *, clock: Clock = _utc_now) -> None:
    """Delete all that is stored of a session; one audit line stays. What is being answered just then goes, too."""
    with alone(responses.engine) as connection:
        if connection.dialect.name == "sqlite":
            connection.execute(sa.text("PRAGMA secure_delete = ON"))
        # Locked, so that no answer comes in between; gone where it was erased twice at one time.
        own = sa.select(sessions.c.id).where(sessions.c.id == session_id).with_for_update()
        if connection.execute(own).first() is None:
            return
        count = connection.execute(sa.select(sa.func.count()).where(answers.c.session_id == session_id)).scalar_one()
        line = {"session_id": session_id, "answers": count, "at": clock()}
        connection.execute(sa.insert(withdrawals).values(line))
        for table in (answers, answer_stimuli, presentations, form_values, events, participants):
            connection.execute(sa.delete(table).where(table.c.session_id == session_id))
        connection.execute(sa.delete(sessions).where(sessions.c.id == session_id))
    if responses.engine.dialect.name == "sqlite":
        # What was deleted is still in the write-ahead log until it is folded into the file.
        with responses.engine.connect() as connection:
            connection.execute(sa.text("PRAGMA wal_checkpoint(TRUNCATE)"))
