"""The researcher's routes, behind a token: who is where, answers so far, drop-outs, faults, downloads."""

from __future__ import annotations

import asyncio
import csv
import io
import json
import secrets
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from study.apps.server.hosting import Host
from study.apps.server.live import LiveSession
from study.experiment.form import asked
from study.experiment.plan import questions
from study.experiment.session import current
from study.experiment.store import participants as people
from study.experiment.store.frames import answers_csv
from study.experiment.store.sessions import session_by_id
from study.experiment.store.tables import events, form_values, participants, presentations, sessions, withdrawals
from study.spreadsheets import safe_cell

Handler = Callable[[Request], Awaitable[Response]]

LATEST_FAULTS = 50


def researcher_routes(host: Host) -> list[Route]:
    """The routes; each asks for the token first."""

    def behind_token(handler: Handler) -> Handler:
        async def run(request: Request) -> Response:
            scheme, _, given = request.headers.get("authorization", "").partition(" ")
            right = secrets.compare_digest(given.encode(), host.settings.researcher_token.encode())
            if not (right and scheme.lower() == "bearer"):
                why = {"error": "Expected the researcher's token, as Authorization: Bearer TOKEN."}
                return JSONResponse(why, status_code=401, headers={"www-authenticate": "Bearer"})
            return await handler(request)

        return run

    async def overview(_: Request) -> Response:
        # Taken here: in a thread, participants who arrive would change it while it is gone through.
        by_number = {live.record.id: live for live in host.live_sessions.values()}
        return JSONResponse(await asyncio.to_thread(_overview, host, by_number))

    async def table(request: Request) -> Response:
        name = request.path_params["name"]
        if name not in TABLES:
            return JSONResponse({"error": f"Expected one of {', '.join(TABLES)}."}, status_code=404)
        content = await asyncio.to_thread(TABLES[name], host)
        headers = {"content-disposition": f'attachment; filename="{host.protocol.name}-{name}.csv"'}
        return Response(content, media_type="text/csv; charset=utf-8", headers=headers)

    return [
        Route("/api/researcher/overview", behind_token(overview), methods=["GET"]),
        Route("/api/researcher/{name:str}.csv", behind_token(table), methods=["GET"]),
    ]


def _overview(host: Host, by_number: Mapping[int, LiveSession]) -> dict[str, Any]:
    now = host.clock()
    rows = people.overview(host.responses)
    listed = [_listed(host, row, by_number.get(row["id"]), now) for row in rows]
    states = [row["state"] for row in listed]
    with host.responses.engine.connect() as connection:
        withdrawn = connection.execute(sa.select(sa.func.count()).select_from(withdrawals)).scalar_one()
        query = (
            sa.select(events.c.at, sessions.c.participant, events.c.detail_json)
            .join(sessions, sessions.c.id == events.c.session_id)
            .where(events.c.kind == "fault")
        )
        found = connection.execute(query.order_by(events.c.id.desc()).limit(LATEST_FAULTS)).all()
    return {
        "title": host.protocol.title,
        "protocol_sha256": host.protocol.sha256,
        "counts": {
            state: states.count(state)
            for state in ("in progress", "finished", "failed checks", "dropped out", "declined")
        },
        "withdrawn": withdrawn,
        "most_participants": host.settings.most_participants,
        "groups": people.filled_groups(host.responses, host.places, clock=host.clock),
        "sessions": listed,
        "faults": [{"at": row[0].isoformat(), "participant": row[1], "detail": row[2]} for row in found],
        "tables": list(TABLES),
    }


def _listed(host: Host, row: Mapping[str, Any], live: LiveSession | None, now: datetime) -> dict[str, Any]:
    happened = row["events"]
    if "failed-checks" in happened:
        state = "failed checks"
    elif "finished" in happened:
        state = "finished"
    elif "declined" in happened:
        state = "declined"
    elif now - row["seen_at"] > host.settings.dropped_after and live is None:
        state = "dropped out"
    else:
        state = "in progress"
    return {
        "participant": row["participant"],
        "group": row["group_number"],
        "parameters": json.loads(row["parameters_json"]),
        "state": state,
        "step": current(live.state).place if live is not None else "",
        "answers": row["answers"],
        "questions": _questions(host, row["id"], live),
        "began_at": row["began_at"].isoformat(timespec="seconds"),
        "seen_at": row["seen_at"].isoformat(timespec="seconds"),
        "faults": happened.get("fault", 0),
        "focus_losses": happened.get("focus-lost", 0),
    }


def _questions(host: Host, session_id: int, live: LiveSession | None) -> int:
    """How many a session has; looked up once, since to read all plans every few seconds would make answers wait."""
    if session_id not in host.questions:
        record = live.record if live is not None else session_by_id(host.responses, session_id)
        host.questions[session_id] = questions(host.protocol, record.plan)
    return host.questions[session_id]


def _csv(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(columns)
    writer.writerows([safe_cell(cell) for cell in row] for row in rows)
    return text.getvalue()


def _joined(host: Host, table: sa.Table, *columns: sa.Column[Any]) -> str:
    query = sa.select(sessions.c.participant, *columns).join(table, table.c.session_id == sessions.c.id)
    with host.responses.engine.connect() as connection:
        rows = connection.execute(query.order_by(sessions.c.id)).all()
    cells = [[cell.isoformat() if isinstance(cell, datetime) else cell for cell in row] for row in rows]
    return _csv(["participant", *(column.name for column in columns)], cells)


TABLES: dict[str, Callable[[Host], str]] = {
    "answers": lambda host: answers_csv(host.responses, host.manifest.blends, asked(host.protocol)),
    "form": lambda host: _joined(host, form_values, form_values.c.name, form_values.c.value, form_values.c.at),
    "presentations": lambda host: _joined(
        host, presentations, *(c for c in presentations.c if c.name not in ("id", "session_id", "detail_json"))
    ),
    "events": lambda host: _joined(host, events, events.c.kind, events.c.at, events.c.detail_json),
    "participants": lambda host: _joined(
        host, participants, participants.c.group_number, participants.c.parameters_json, participants.c.began_at
    ),
}
