"""Store: where a player's answers and events go, each committed before the player goes on.

If the database is away for a moment (a server that restarts), the player waits, so that no session is lost.
Nothing is written before `begin`, which the player calls once the participant has agreed to take part (at once where
nobody is asked): who declines leaves nothing behind.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from study.experiment.plan import Plan
from study.experiment.protocol.whole import Protocol
from study.experiment.store.answers import (
    Presentation,
    event_counts,
    record_answer,
    record_event,
    record_form,
    stored_answers,
)
from study.experiment.store.databases import patiently
from study.experiment.store.responses import Responses
from study.experiment.store.sessions import SessionRecord, begin_session, find_session
from study.tasks.answer import Answer
from study.tasks.trial import Trial


class ResponsesStore:
    """One participant's session in a database of responses."""

    def __init__(
        self, responses: Responses, protocol: Protocol, plan: Plan, library: str, library_synthetic: bool
    ) -> None:
        self._responses, self._protocol, self._plan = responses, protocol, plan
        self._library, self._synthetic = library, library_synthetic
        self._record: SessionRecord | None = None
        self._waiting: list[tuple[str, Mapping[str, Any] | None]] = []

    def before(self) -> tuple[tuple[Answer, ...], tuple[str, ...], bool]:
        """What was stored before: answers, what happened (`consent`, `form`, ...), and whether it was finished."""
        record = find_session(self._responses, self._plan.participant)
        if record is None:
            return (), (), False
        answers = stored_answers(self._responses, record.id)
        happened = event_counts(self._responses, record)
        return answers, tuple(happened), "finished" in happened

    def begin(self) -> None:
        """Write the session down, or take up the one that there is, with the events that waited for it."""
        if self._record is not None:
            return
        self._record = patiently(
            lambda: begin_session(
                self._responses, self._protocol, self._plan, library=self._library, library_synthetic=self._synthetic
            ),
            self._responses.place,
        )
        waiting, self._waiting = self._waiting, []
        for kind, detail in waiting:
            self.event(kind, detail)

    def answer(self, trial: Trial, answer: Answer, shown: Sequence[Presentation]) -> None:
        """Commit an answer; it is on disk when this returns."""
        record = self._begun()
        patiently(lambda: record_answer(self._responses, record, trial, answer, shown), self._responses.place)

    def form(self, values: Mapping[str, str], study: str) -> None:
        """Commit a form: the one at the start, or one after a study."""
        record = self._begun()
        patiently(lambda: record_form(self._responses, record, values, study), self._responses.place)

    def event(self, kind: str, detail: Mapping[str, Any] | None = None) -> None:
        """Commit an event, or keep it until the session begins."""
        record = self._record
        if record is None:
            self._waiting.append((kind, detail))
        else:
            patiently(lambda: record_event(self._responses, record, kind, detail), self._responses.place)

    def _begun(self) -> SessionRecord:
        self.begin()
        assert self._record is not None, "begin sets it"
        return self._record
