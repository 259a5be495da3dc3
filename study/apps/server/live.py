"""Live sessions: those that this server has in memory, each with the tab that shows it.

All that counts is in the database; a session in memory is only its answers taken up again. Other servers may serve the
same study, and a participant may be at each of them in turn, so memory alone is never a reason to refuse: what does not
fit it is looked up. What is stored the database takes once, and only from the tab that shows the session (`writer`).
"""

from __future__ import annotations

import asyncio
import logging
import math
import time
from dataclasses import dataclass, field

from study.apps.server import views
from study.apps.server.messages import Begin, RefusedError
from study.experiment.protocol.whole import Protocol
from study.experiment.session import Session, current, open_session
from study.experiment.simulation import answers_before, before_trials
from study.experiment.stimuli.manifest import Manifest
from study.experiment.store import participants as people
from study.experiment.store.answers import event_counts, stored_answers
from study.experiment.store.databases import AWAY, in_words
from study.experiment.store.participants import Participant
from study.experiment.store.responses import Responses
from study.experiment.store.sessions import SessionRecord, session_by_id
from study.tasks.answer import Answer

TAB_SECONDS = 45.0
"""Seconds without a message after which a tab counts as closed; pages send one every ten seconds."""

GONE_SECONDS = 300.0
"""Seconds without a message after which a session is kept only in the database, and resumed from there; for
a closed page it is the time of a tab."""

TELL_EVERY_SECONDS = 10.0
"""Seconds between log lines that the database is away."""

ELSEWHERE = "This session is open in another tab."

log = logging.getLogger("segue.serve")


@dataclass
class LiveSession:
    """One session in progress: its state, what was stored, and which tab shows it, as this server knows them.

    `events` counts what was stored besides answers; `displayed` is whether a page was opened before; `page_seen` is
    when the page last sent something to this server.
    """

    token: str
    record: SessionRecord
    participant: Participant
    state: Session
    answers: dict[tuple[int, str, int], Answer]
    page: str
    events: int
    finished: bool
    displayed: bool
    lock: asyncio.Lock = field(default_factory=asyncio.Lock)
    page_seen: float = -math.inf

    @property
    def is_under_way(self) -> bool:
        """Whether a session is in progress."""
        silent_s = time.monotonic() - self.page_seen
        return silent_s < (GONE_SECONDS if self.page else TAB_SECONDS) and current(self.state).kind != "done"


class LiveSessions:
    """The sessions of a study that this server has in memory, by the participants' tokens."""

    def __init__(self, protocol: Protocol, manifest: Manifest, responses: Responses, *, preview: bool) -> None:
        self.protocol, self.manifest, self.responses, self._preview = protocol, manifest, responses, preview
        self.frames = {record.id: record.frames for record in manifest.records}
        self.clock = people.steady_clock()
        self.live_sessions: dict[str, LiveSession] = {}
        self.recent: set[int] = set()
        self._told_away = -math.inf

    # Who it is

    async def live_session(self, token: str) -> LiveSession | None:
        """The session of a token: the live one, or the one in the database; None for an unknown token."""
        if token not in self.live_sessions and (known := await self.look_up(token)) is not None:
            return await self.taken_up(token, known)
        return self.live_sessions.get(token)

    async def look_up(self, token: str) -> Participant | None:
        """A participant as the database has it now; who withdrew, or changed the browser, is forgotten."""
        found = await asyncio.to_thread(people.find_by_token, self.responses, token)
        if found is None:
            self.live_sessions.pop(token, None)
        elif token in self.live_sessions:
            self.live_sessions[token].page = found.page
        return found

    async def taken_up(self, token: str, known: Participant) -> LiveSession:
        """The session of a participant: the live one, or the one in the database."""
        if token not in self.live_sessions:
            record = await asyncio.to_thread(session_by_id, self.responses, known.session_id)
            found = await asyncio.to_thread(self._load, token, known, record)
            self.live_sessions.setdefault(token, found)
        return self.live_sessions[token]

    def _load(self, token: str, participant: Participant, record: SessionRecord) -> LiveSession:
        before = stored_answers(self.responses, record.id)
        happened = event_counts(self.responses, record)
        if self._preview and (trial := participant.parameters.get("trial", "")):
            before = (*answers_before(self.protocol, record.plan, int(trial) if trial.isdecimal() else 0), *before)
            happened = {**dict.fromkeys(before_trials(self.protocol), 1), **happened}
        state = views.to_view(open_session(self.protocol, record.plan, before, passed=happened, frames=self.frames))
        answers = {(a.trial, a.item, a.attempt): a for a in before}
        known = sum(happened.values()), "finished" in happened, "display" in happened
        return LiveSession(token, record, participant, state, answers, participant.page, *known)

    async def take_up(self, live: LiveSession) -> Session:
        """What the database has, in place of what is in memory, if another server stored something meanwhile."""
        known = await self._still_there(live)
        fresh = await asyncio.to_thread(self._load, live.token, known, live.record)
        # Which pages were read is in no database: it is kept where nothing else happened.
        if fresh.answers != live.answers or fresh.events != live.events:
            live.state, live.answers = fresh.state, fresh.answers
            live.events, live.finished = fresh.events, fresh.finished
        return fresh.state

    async def _still_there(self, live: LiveSession) -> Participant:
        known = await self.look_up(live.token)
        if known is None:
            raise RefusedError(401, "Expected a participant of this study; open the link again.")
        return known

    def forget(self, session_id: int) -> None:
        """A session is in the database alone, if it still is."""
        self.live_sessions = {key: one for key, one in self.live_sessions.items() if one.record.id != session_id}

    # Which tab it is

    async def give_to(self, live: LiveSession, known: Participant, message: Begin) -> bool:
        """Give the session to a tab, where no other one has it; a reloaded tab names the page that it was."""
        if known.page != message.page:
            silent_s = min(time.monotonic() - live.page_seen, (self.clock() - known.seen_at).total_seconds())
            free = known.page in ("", message.previous) or silent_s > TAB_SECONDS or current(live.state).kind == "done"
            if not ((free or message.force) and await self._take_page(known, message.page)):
                return False
            await self.take_up(live)  # now, that no other tab can store any more
        live.page, live.page_seen = message.page, time.monotonic()
        return True

    async def _take_page(self, known: Participant, page: str) -> bool:
        return await asyncio.to_thread(people.take_page, self.responses, known, page, clock=self.clock)

    async def refuse_other_tabs(self, live: LiveSession, page: str) -> None:
        """Refuse a page that does not show this session; of one that no page shows the first to ask is taken."""
        if live.page != page:
            known = await self._still_there(live)
            if known.page != page and (known.page or not await self._take_page(known, page)):
                raise RefusedError(409, ELSEWHERE)
            live.page = page
        live.page_seen = time.monotonic()
        self.recent.add(live.record.id)

    async def leave(self, token: str, page: str) -> None:
        """A page was closed."""
        await asyncio.to_thread(people.close_page, self.responses, token, page)
        if token in self.live_sessions and self.live_sessions[token].page == page:
            self.live_sessions[token].page = ""

    async def note_who_is_here(self) -> None:
        """Store who was active, so that drop-outs are known; forget sessions that are closed or finished."""
        self.live_sessions = {
            key: one for key, one in self.live_sessions.items() if one.lock.locked() or one.is_under_way
        }
        recent, self.recent = self.recent, set()
        try:
            await asyncio.to_thread(people.seen, self.responses, recent, clock=self.clock)
        except BaseException as error:
            self.recent |= recent
            if not isinstance(error, AWAY):
                raise
            self.database_away(error)

    def database_away(self, error: Exception) -> None:
        """Log it, but not for each of the messages that meet it."""
        if time.monotonic() - self._told_away > TELL_EVERY_SECONDS:
            self._told_away = time.monotonic()
            log.warning("The database is away, pages send again: %s", in_words(error))
