"""Hosting: the live sessions of a study, and every rule about them that is not HTTP.

A results folder and settings come in; views for the page go out.
"""

from __future__ import annotations

import asyncio
import logging
import re
import secrets
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa

from study.apps.server import views
from study.apps.server.films import Film, whole_bytes
from study.apps.server.limits import Guesses
from study.apps.server.links import VISIT, filled_in
from study.apps.server.live import ELSEWHERE, LiveSession, LiveSessions
from study.apps.server.messages import Answered, Begin, Done, Happened, RefusedError, presented
from study.apps.server.settings import Settings
from study.apps.server.writer import ElsewhereError, Writer
from study.errors import SessionError, StimulusError
from study.experiment.plan import draw_plan, groups_of
from study.experiment.protocol.whole import Protocol
from study.experiment.session import Session, advanced, answered, current, filled, missed, outcome
from study.experiment.steps import Step
from study.experiment.stimuli.manifest import Manifest
from study.experiment.stimuli.rendering import RenderAhead, known_beforehand
from study.experiment.store import participants as people
from study.experiment.store.answers import answer_rows, event_row, record_form
from study.experiment.store.participants import Participant
from study.experiment.store.responses import Responses

MOST_EVENTS = 2000
"""Events of a page that are stored for one session, so that a page can't fill the disk."""

READ = ("consent", "form", "instructions", "feedback", "break", "debrief")
"""Kinds of steps that are read; a page says when."""

NAME = re.compile(r"[A-Za-z0-9_-]{1,40}")

log = logging.getLogger("segue.serve")


class Host(LiveSessions):
    """A study that is being run."""

    def __init__(
        self,
        protocol: Protocol,
        manifest: Manifest,
        responses: Responses,
        settings: Settings,
        ahead: RenderAhead | None = None,
    ) -> None:
        super().__init__(protocol, manifest, responses, preview=settings.preview)
        self.settings, self.ahead = settings, ahead
        self.videos = manifest.videos if ahead is None else ahead.videos
        self.writer = Writer(responses.engine)
        self.cookie = f"segue-{protocol.sha256[:8]}"
        """Part of its name: browsers share cookies among all ports of a machine, which may serve several studies."""
        # The same at every start, whatever was rendered since: pages keep films over a restart.
        known = known_beforehand(protocol, manifest.pairs)
        room = 1 if known.issuperset(self.frames) else 2
        self.film_bytes = room * whole_bytes(int(self.videos.get(one, {}).get("bytes", 0)) for one in known)
        groups = settings.groups or groups_of(protocol, manifest.pairs)
        self.places = people.Places(groups, settings.most_participants, settings.dropped_after)
        self.guesses = Guesses()
        self.questions: dict[int, int] = {}
        # Arrivals at this server queue here, not as threads that wait for the database's lock.
        self._starting = asyncio.Lock()

    def close(self) -> None:
        """Finish all writes."""
        self.writer.close()
        if self.ahead is not None:
            self.ahead.close()

    # Who it is

    async def begin(self, token: str, message: Begin) -> tuple[dict[str, Any], str]:
        """A page was opened: the view that it shows, and the token that its cookie should hold."""
        kept = {name: value for name, value in message.parameters.items() if name in self.settings.parameters}
        parameters, unfilled = filled_in(kept, (*self.settings.identifying, VISIT))
        known = await self.look_up(token) if token and not self.settings.preview else None
        new = known is None or self._is_another(known, parameters)
        if known is None or new:
            async with self._starting:
                found, token = await self._admit(parameters, message.page)
            if isinstance(found, str):
                return {"kind": found}, ""
            known = found
        live = await self.taken_up(token, known)
        async with live.lock:
            if not await self.give_to(live, known, message):
                return {"kind": "elsewhere"}, token
            if new and unfilled:
                await self._page_event(live, "fault", {"what": "link not filled in", **unfilled})
            step = current(live.state)
            if step.slot == 1 and live.displayed:
                await self._page_event(live, "interrupted", {"trial": step.trial, "attempt": step.attempt})
            await self._page_event(live, "display", message.display.model_dump(mode="json"))
            live.displayed = True
            return {**await self._view(live), "session": views.session_name(live.participant)}, token

    def _is_another(self, known: Participant, parameters: Mapping[str, str]) -> bool:
        """Whether the link names another person than the cookie, as on a computer that several use."""
        stored = known.parameters
        return any(parameters[name] != stored.get(name) for name in self.settings.identifying if parameters.get(name))

    async def _admit(self, parameters: dict[str, str], page: str) -> tuple[Participant | str, str]:
        """A new participant, or one who returns with the identical link; or why not."""
        token = people.new_token()
        who = {name: parameters[name] for name in self.settings.identifying if name in parameters}
        known = await asyncio.to_thread(people.find_by_parameters, self.responses, who) if who else None
        if known is not None:
            # An identifier alone may be guessed; the recruiting service's number of this visit may not.
            if not parameters.get(VISIT) or parameters != dict(known.parameters):
                return "taken", ""
            self.forget(known.session_id)
            await asyncio.to_thread(people.give_token, self.responses, known, token, page)
            return replace(known, page=page), token
        name = parameters.get("participant", "")
        name = name if NAME.fullmatch(name) else f"web-{secrets.token_hex(5)}"
        return await asyncio.to_thread(self._arrive, people.Newcomer(name, token, parameters, who, page)), token

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

    # What is done

    async def done(self, live: LiveSession, message: Done) -> dict[str, Any]:
        """A page was read; sent twice, or late, it changes nothing."""
        async with live.lock:
            at = await self._at(
                live, lambda state: views.step_key(state) == message.step and current(state).kind in READ
            )
            if at is None:
                return await self._view(live)
            live.state, step = at, current(at)
            if step.kind == "consent" and message.declined:
                await asyncio.to_thread(people.erase, self.responses, live.record.id)
                self.forget(live.record.id)
                return {"kind": "declined"}
            if step.kind == "form":
                state, values = filled(live.state, message.values)
                await asyncio.to_thread(record_form, self.responses, live.record, values, step.study)
                live.events += 1
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

            def asks(state: Session) -> bool:
                step = current(state)
                return step.kind == "answer" and (step.trial, step.item, step.attempt) == key

            state = None if key in live.answers else await self._at(live, asks)
            if state is None:
                return {**await self._view(live), "counted": self._is_stored(live, key, message)}
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
            rows = answer_rows(live.record, state.trial(answer.trial), answer, shown, at)
            try:
                await self.writer.put(rows, {live.record.id: live.page})
            except ElsewhereError:
                await self.take_up(live)
                raise RefusedError(409, ELSEWHERE) from None
            except sa.exc.IntegrityError:
                # It is there: the database was lost before it could say so, or another server stored it.
                await self.take_up(live)
                return {**await self._view(live), "counted": self._is_stored(live, key, message)}
            live.answers[key] = answer
            live.state = views.to_view(state)
            self.recent.add(live.record.id)
            return {**await self._view(live), "counted": True}

    def _is_stored(self, live: LiveSession, key: tuple[int, str, int], message: Answered) -> bool:
        return key in live.answers and live.answers[key].value == message.value

    async def _at(self, live: LiveSession, fits: Callable[[Session], bool]) -> Session | None:
        """The state at the step that a message is about; None where another one is due."""
        # Who resumes reads the instructions again, so a session that was taken up may have pages that memory lacks.
        return views.ahead(live.state, fits) or views.ahead(await self.take_up(live), fits)

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
            self.forget(live.record.id)
        return view

    async def film(self, live: LiveSession, name: str) -> Film | None:
        """A film that a participant may load now; a damaged one is a fault that is noted."""
        step = self._film_step(live, name)
        if step is None:
            async with live.lock:
                await self.take_up(live)
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
            self.forget(session_id)
        return session_id is not None
