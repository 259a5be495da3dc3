"""Hosting: the live sessions of a study, and every rule about them that is not HTTP.

A results folder and settings come in; views for the page go out. All that counts is in the database: a live in
memory is only its answers taken up again, so a restart of the server loses nothing but who had which tab open.
"""

from __future__ import annotations

import asyncio
import logging
import math
import re
import secrets
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa

from study.apps.server import views
from study.apps.server.films import Film, whole_bytes
from study.apps.server.limits import Guesses
from study.apps.server.links import VISIT, filled_in
from study.apps.server.messages import Answered, Begin, Done, Happened, presented
from study.apps.server.settings import Settings
from study.apps.server.writer import Writer
from study.errors import SessionError, StimulusError
from study.experiment.plan import draw_plan, groups_of
from study.experiment.protocol.whole import Protocol
from study.experiment.session import Session, advanced, answered, current, filled, missed, open_session, outcome
from study.experiment.simulation import answers_before, before_trials
from study.experiment.steps import Step
from study.experiment.stimuli.manifest import Manifest
from study.experiment.stimuli.rendering import RenderAhead, known_beforehand
from study.experiment.store import participants as people
from study.experiment.store.answers import answer_rows, event_counts, event_row, record_form, stored_answers
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

MOST_EVENTS = 2000
"""Events of a page that are stored for one session, so that a page can't fill the disk."""

TELL_EVERY_SECONDS = 10.0
"""Seconds between log lines that the database is away."""

NAME = re.compile(r"[A-Za-z0-9_-]{1,40}")

log = logging.getLogger("segue.serve")


@dataclass
class LiveSession:
    """One session in progress: its state, what was stored, and which tab shows it."""

    record: SessionRecord
    participant: Participant
    state: Session
    answers: dict[tuple[int, str, int], Answer]
    lock: asyncio.Lock = field(default_factory=asyncio.Lock)
    page: str = ""
    page_seen: float = field(default_factory=time.monotonic)
    events: int = 0
    finished: bool = False
    shown_trial: tuple[int, int] | None = None

    @property
    def is_under_way(self) -> bool:
        """Whether a session is in progress."""
        silent_s = time.monotonic() - self.page_seen
        return silent_s < (GONE_SECONDS if self.page else TAB_SECONDS) and current(self.state).kind != "done"


class Host:
    """A study that is being run."""

    def __init__(
        self,
        protocol: Protocol,
        manifest: Manifest,
        responses: Responses,
        settings: Settings,
        ahead: RenderAhead | None = None,
    ) -> None:
        self.protocol, self.manifest, self.responses, self.settings = protocol, manifest, responses, settings
        self.ahead = ahead
        self.videos = manifest.videos if ahead is None else ahead.videos
        self.writer = Writer(responses.engine)
        self.cookie = f"segue-{protocol.sha256[:8]}"
        """Part of its name: browsers share cookies among all ports of a machine, which may serve several studies."""
        self.frames = {record.id: record.frames for record in manifest.records}
        # The same at every start, whatever was rendered since: pages keep films over a restart.
        known = known_beforehand(protocol, manifest.pairs)
        room = 1 if known.issuperset(self.frames) else 2
        self.film_bytes = room * whole_bytes(int(self.videos.get(one, {}).get("bytes", 0)) for one in known)
        groups = settings.groups or groups_of(protocol, manifest.pairs)
        self.places = people.Places(groups, settings.most_participants, settings.dropped_after)
        self.clock = people.steady_clock()
        self.guesses = Guesses()
        self.live_sessions: dict[str, LiveSession] = {}
        self.recent: set[int] = set()
        self.questions: dict[int, int] = {}
        self._told_away = -math.inf
        # Arrivals at this server queue here, not as threads that wait for the database's lock.
        self._starting = asyncio.Lock()

    def close(self) -> None:
        """Finish all writes."""
        self.writer.close()
        if self.ahead is not None:
            self.ahead.close()

    # Who it is

    async def live_session(self, token: str) -> LiveSession | None:
        """The session of a token: the live one, or the one in the database; None for an unknown token."""
        key = people.hashed(token)
        if key not in self.live_sessions:
            participant = await asyncio.to_thread(people.find_by_token, self.responses, token)
            if participant is None:
                return None
            found = await asyncio.to_thread(self._load, participant)
            self.live_sessions.setdefault(key, found)
        return self.live_sessions[key]

    def in_memory(self, token: str) -> LiveSession | None:
        """The session of a token, where it is in memory."""
        return self.live_sessions.get(people.hashed(token))

    def _load(self, participant: Participant) -> LiveSession:
        record = session_by_id(self.responses, participant.session_id)
        before = stored_answers(self.responses, record.id)
        happened = event_counts(self.responses, record)
        if self.settings.preview and (trial := participant.parameters.get("trial", "")):
            before = (*answers_before(self.protocol, record.plan, int(trial) if trial.isdecimal() else 0), *before)
            happened = {**dict.fromkeys(before_trials(self.protocol), 1), **happened}
        frames = {known.id: known.frames for known in self.manifest.records}
        state = views.to_view(open_session(self.protocol, record.plan, before, passed=happened, frames=frames))
        answers = {(a.trial, a.item, a.attempt): a for a in before}
        total, finished = sum(happened.values()), "finished" in happened
        return LiveSession(record, participant, state, answers, events=total, finished=finished)

    async def begin(self, token: str, message: Begin) -> tuple[dict[str, Any], str]:
        """A page was opened: the view that it shows, and the token that its cookie should hold."""
        kept = {name: value for name, value in message.parameters.items() if name in self.settings.parameters}
        parameters, unfilled = filled_in(kept, (*self.settings.identifying, VISIT))
        live = await self.live_session(token) if token and not self.settings.preview else None
        if live is not None and self._is_another(live, parameters):
            live = None
        if live is None:
            async with self._starting:
                found, token = await self._admit(parameters)
            if isinstance(found, dict):
                return found, ""
            live = found
            if unfilled:
                await self._page_event(live, "fault", {"what": "link not filled in", **unfilled})
        async with live.lock:
            if not self._take_tab(live, message.page, message.previous, message.force):
                return {"kind": "elsewhere"}, token
            if live.shown_trial is not None:
                trial, attempt = live.shown_trial
                await self._page_event(live, "interrupted", {"trial": trial, "attempt": attempt})
            await self._page_event(live, "display", message.display.model_dump(mode="json"))
            return {**await self._view(live), "session": views.session_name(live.participant)}, token

    def _is_another(self, live: LiveSession, parameters: Mapping[str, str]) -> bool:
        """Whether the link names another person than the cookie, as on a computer that several use."""
        stored = live.participant.parameters
        return any(parameters[name] != stored.get(name) for name in self.settings.identifying if parameters.get(name))

    async def _admit(self, parameters: dict[str, str]) -> tuple[LiveSession | dict[str, Any], str]:
        """A new participant, or one who returns with the identical link; or why not."""
        token = people.new_token()
        who = {name: parameters[name] for name in self.settings.identifying if name in parameters}
        known = await asyncio.to_thread(people.find_by_parameters, self.responses, who) if who else None
        if known is not None:
            # An identifier alone may be guessed; the recruiting service's number of this visit may not.
            if not parameters.get(VISIT) or parameters != dict(known.parameters):
                return {"kind": "taken"}, ""
            self._forget(known.session_id)
            await asyncio.to_thread(people.give_token, self.responses, known, token)
        else:
            name = parameters.get("participant", "")
            name = name if NAME.fullmatch(name) else f"web-{secrets.token_hex(5)}"
            found = await asyncio.to_thread(self._arrive, people.Newcomer(name, token, parameters, who))
            if isinstance(found, str):
                return {"kind": found}, ""
        live = await self.live_session(token)
        assert live is not None  # its token was stored just now
        return live, token

    def _arrive(self, newcomer: people.Newcomer) -> Participant | str:
        return people.admit(
            self.responses,
            self.protocol,
            newcomer,
            self.places,
            lambda group: draw_plan(self.protocol, self.manifest.pairs, newcomer.name, group=group),
            library=self.manifest.library,
            library_synthetic=self.manifest.synthetic,
            heard_clock=self.clock,
        )

    def _forget(self, session_id: int) -> None:
        self.live_sessions = {key: one for key, one in self.live_sessions.items() if one.record.id != session_id}

    # Which tab it is

    def _take_tab(self, live: LiveSession, page: str, previous: str, force: bool) -> bool:
        """Give the session to a tab, where no other one has it; a reloaded tab names the page that it was."""
        now = time.monotonic()
        free = not live.page or now - live.page_seen > TAB_SECONDS or live.page in (page, previous)
        if not (free or force):
            return False
        live.page, live.page_seen = page, now
        return True

    def has_tab(self, live: LiveSession, page: str) -> bool:
        """Whether a page is the one that shows this session; after a restart the first one to ask is."""
        if not live.page:
            live.page = page
        if live.page != page:
            return False
        live.page_seen = time.monotonic()
        self.recent.add(live.record.id)
        return True

    def leave(self, live: LiveSession, page: str) -> None:
        """A page was closed."""
        if live.page == page:
            live.page = ""

    # What is done

    async def done(self, live: LiveSession, message: Done) -> dict[str, Any]:
        """A page was read; sent twice, or late, it changes nothing."""
        async with live.lock:
            step = current(live.state)
            read = step.kind in ("consent", "form", "instructions", "feedback", "break", "debrief")
            if not read or message.step != views.step_key(live.state):
                return await self._view(live)
            if step.kind == "consent" and message.declined:
                await asyncio.to_thread(people.erase, self.responses, live.record.id)
                self._forget(live.record.id)
                return {"kind": "declined"}
            if step.kind == "form":
                state, values = filled(live.state, message.values)
                await asyncio.to_thread(record_form, self.responses, live.record, values, step.study)
            else:
                state = advanced(live.state)
                if step.kind in ("consent", "debrief"):
                    await self._note(live, step.kind)
            live.state = views.to_view(state)
            return await self._view(live)

    async def answer(self, live: LiveSession, message: Answered) -> dict[str, Any]:
        """An answer: committed when this returns. Sent twice it counts once; out of turn it is not counted."""
        async with live.lock:
            key = (message.trial, message.item, message.attempt)
            if key in live.answers:
                return {**await self._view(live), "counted": self._is_stored(live, key, message)}
            state = self._at_question(live.state, key)
            if state is None:
                return {**await self._view(live), "counted": False}
            well = message.shown_well and all(shown.shown_well for shown in message.shown)
            step = current(state)
            late = step.duration_s is not None and (message.response_s or 0.0) > step.duration_s
            if message.value is None or late:
                state, answer = missed(state, shown_well=well)
            elif message.response_s is None:
                raise SessionError("Expected response_s with an answer, found none.")
            else:
                state, answer = answered(state, message.value, message.response_s, shown_well=well)
            at = datetime.now(UTC)
            stimuli = live.state.trial(message.trial).stimuli
            shown = [presented(message, one, stimuli, self.frames) for one in message.shown]
            try:
                await self.writer.put(answer_rows(live.record, state.trial(answer.trial), answer, shown, at))
            except sa.exc.IntegrityError:
                # It is there: the database was lost before it could say so, or another server stored it.
                await self._take_up(live)
                return {**await self._view(live), "counted": self._is_stored(live, key, message)}
            live.answers[key] = answer
            live.state = views.to_view(state)
            live.shown_trial = None
            self.recent.add(live.record.id)
            return {**await self._view(live), "counted": True}

    def _is_stored(self, live: LiveSession, key: tuple[int, str, int], message: Answered) -> bool:
        return key in live.answers and live.answers[key].value == message.value

    async def _take_up(self, live: LiveSession) -> None:
        """What the database has, in place of what is in memory."""
        fresh = await asyncio.to_thread(self._load, live.participant)
        live.state, live.answers = fresh.state, fresh.answers

    def _at_question(self, state: Session, key: tuple[int, str, int]) -> Session | None:
        """The state at a question, past the films that the page has shown; None where another question is due."""
        while (step := current(state)).kind not in ("answer", "done", "form", "consent"):
            state = advanced(state)
        return state if step.kind == "answer" and (step.trial, step.item, step.attempt) == key else None

    async def happened(self, live: LiveSession, message: Happened) -> None:
        """Another event, reported by the page."""
        await self._page_event(live, message.kind, message.detail)

    async def _page_event(self, live: LiveSession, kind: str, detail: Mapping[str, Any]) -> None:
        """Store what a page told or caused, unless it was too much already."""
        if live.events < MOST_EVENTS:
            await self._note(live, kind, detail)

    async def _note(self, live: LiveSession, kind: str, detail: Mapping[str, Any] | None = None) -> None:
        """Store an event of a session."""
        live.events += 1
        await self.writer.put([event_row(live.record, kind, detail, datetime.now(UTC))])

    # What is shown

    async def _view(self, live: LiveSession) -> dict[str, Any]:
        step = current(live.state)
        if self.ahead is not None:
            self.ahead.want(due.stimulus for due in views.films_due(live.state))
        view = views.view(live.state, live.participant, self.film_bytes)
        live.shown_trial = (step.trial, step.attempt) if step.slot == 1 else None
        if step.kind in ("debrief", "done"):
            # All is answered: who closes the page over the debriefing has finished, too.
            if not live.finished:
                await self._note(live, "finished")
                if (how := outcome(live.state)) != "finished":
                    await self._note(live, how)
                live.finished = True
            view["withdrawal_code"] = live.participant.withdrawal_code
        if step.kind == "done":
            code, url = self.settings.completion(outcome(live.state))
            view |= {"completion_code": code, "completion_url": url}
            # Nothing more will change: the memory is for those who are in progress.
            self._forget(live.record.id)
        return view

    async def film(self, live: LiveSession, name: str) -> Film | None:
        """A film that a participant may load now; a damaged one is a fault that is noted."""
        step = self._film_step(live, name)
        if step is None:
            return None
        if self.ahead is not None:
            try:
                await self.ahead.ready(step.stimulus)
            except StimulusError as error:
                log.warning("%s", error)
        video = self.videos.get(step.stimulus, {})
        path = self.manifest.folder / str(video.get("file", ""))
        try:
            size = path.stat().st_size if video else None
        except OSError:
            size = None
        if size is None or size != video["bytes"]:
            detail = {"what": "film damaged", "stimulus": step.stimulus, "bytes": size, "expected": video.get("bytes")}
            await self._page_event(live, "fault", detail)
            # The event records which one it is: a page must not learn it.
            raise SessionError("Expected the film whole, found it damaged; the researcher has to render again.")
        return Film(path, name, size, self.frames[step.stimulus], self.film_bytes)

    def _film_step(self, live: LiveSession, name: str) -> Step | None:
        for step in views.films_due(live.state):
            if secrets.compare_digest(views.film_name(live.participant, step).encode(), name.encode()):
                return step
        return None

    async def withdraw(self, code: str) -> bool:
        """Delete a participant's data by the withdrawal code."""
        session_id = await asyncio.to_thread(people.withdraw, self.responses, code)
        if session_id is not None:
            self._forget(session_id)
        return session_id is not None

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
