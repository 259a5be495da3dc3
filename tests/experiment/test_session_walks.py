"""Random walks through sessions: every path ends, loses no answer, and goes on after a kill as if there had been none.

Participants miss, films stall, programs are killed at any step, in a session with everything in it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from toys import TOY_PROTOCOL, TOY_RATING, FakeStimuli

from study.errors import SessionError
from study.experiment.plan import Plan, draw_plan
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.experiment.session import (
    Answer,
    Session,
    advanced,
    answered,
    current,
    filled,
    missed,
    open_session,
    progress,
    restarted,
)
from study.experiment.steps import form_event
from study.tasks.answer import CONFIDENCE
from study.tasks.trial import Trial

WALKS = 40
PASSED = frozenset({"consent", "form", "form/jnd"})
SHOW_AGAIN = (0, 1, 3)


def full_protocol(show_again: int) -> Any:
    """Consent, forms, practice in rounds, checks, breaks, three tasks, in one of them how sure participants are."""
    text = TOY_PROTOCOL + TOY_RATING
    form = 'form = [{ name = "seen", label = "What did you see?" }]'
    more = f'order = "both"\npractice = 2\npractice_until = 1.0\nattention_checks = 2\nconfidence_points = 3\n{form}'
    text = text.replace('order = "both"', more, 1)
    text = text.replace('question = "How was it?"', 'question = "How was it?"\npractice = 1\nattention_checks = 1')
    text = text.replace("[points]", f"[timing]\nbreak_after = 4\nshow_again = {show_again}\n\n[points]")
    text = text.replace("[stimuli]", 'form = [{ name = "age" }]\nconsent = { text = "{standard}" }\n\n[stimuli]', 1)
    return parse_protocol(text)


@dataclass
class Walker:
    """Somebody who does anything that is legal, each with a chance; what was answered is kept as a database would."""

    rng: np.random.Generator
    stalls: float
    misses: float
    dies: float
    stored: list[Answer] = field(default_factory=list)
    passed: set[str] = field(default_factory=set)
    steps: int = 0

    def step(self, session: Session) -> Session:
        """One step on, or at the same place again after a kill."""
        self.steps += 1
        if self.rng.random() < self.dies:
            return open_session(session.protocol, session.plan, self.stored, passed=self.passed)
        step = current(session)
        if step.kind == "form":
            session, _ = filled(session, {} if step.study else {"age": "30"})
        elif step.kind == "answer":
            well = self.rng.random() >= self.stalls
            if self.rng.random() < self.misses:
                session, answer = missed(session, shown_well=well)
            else:
                value = str(self.rng.choice(step.legal))
                session, answer = answered(session, value, float(self.rng.uniform(0, 5)), shown_well=well)
            self.stored.append(answer)
        elif step.place in ("gap", "second") and self.rng.random() < 0.05:
            session = restarted(session)
        else:
            session = advanced(session)
        if step.kind in ("consent", "form"):
            self.passed.add(form_event(step.study) if step.kind == "form" else step.kind)
        return session


def walk(protocol: Protocol, plan: Plan, walker: Walker) -> list[Answer]:
    session = open_session(protocol, plan)
    done = 0
    while current(session).kind != "done":
        before = len(walker.stored)
        session = walker.step(session)
        assert progress(session)[0] >= done, "what was finished stays finished"
        done = progress(session)[0]
        assert len(walker.stored) - before in (0, 1)
        assert walker.steps < 20_000, "a walk has to end"
    assert progress(session) == (len(plan.trials), len(plan.trials))
    return walker.stored


@pytest.fixture(params=SHOW_AGAIN)
def whole(request: pytest.FixtureRequest, make_stimuli: Callable[[Protocol], FakeStimuli]) -> Any:
    protocol = full_protocol(request.param)
    return protocol, make_stimuli(protocol).pairs


def asked_of(protocol: Protocol, trial: Trial) -> set[str]:
    study = protocol.study(trial.study)
    if trial.role == "check" or not study.items:
        return {"", CONFIDENCE} if study.confidence_points and trial.role != "check" else {""}
    return {item.name for item in study.items}


def test_every_walk_ends_with_every_question_answered_and_none_twice(whole: int) -> None:
    protocol, pairs = whole
    for number in range(WALKS):
        rng = np.random.default_rng([number, 1])
        plan = draw_plan(protocol, pairs, f"p{number}", group=number)
        stalls, misses, dies = rng.choice([0.0, 0.3, 1.0]), rng.choice([0.0, 0.3, 1.0]), rng.choice([0.0, 0.05, 0.2])
        stored = walk(protocol, plan, Walker(rng, stalls, misses, dies))
        showings = [(answer.trial, answer.attempt, answer.item) for answer in stored]
        assert len(set(showings)) == len(showings)
        for trial in plan.trials:
            own = [answer for answer in stored if answer.trial == trial.trial]
            attempts = sorted({answer.attempt for answer in own})
            study, practice = protocol.study(trial.study), trial.role == "practice"
            rounds = study.practice_most if study.practice_until else 1
            most = rounds if practice else 1 + protocol.timing.show_again
            assert attempts == list(range(1, len(attempts) + 1))
            assert 1 <= len(attempts) <= most
            for attempt in attempts:
                of_attempt = [answer for answer in own if answer.attempt == attempt]
                missed_choice = any(answer.missed and not answer.item for answer in of_attempt)
                asked = {""} if missed_choice else asked_of(protocol, trial)
                assert {answer.item for answer in of_attempt} == asked
                # Shown again only for a reason, and always where there is one and a showing left.
                badly = any(not answer.shown_well for answer in of_attempt)
                assert practice or badly or attempt == attempts[-1]
                assert practice or not badly or attempt < attempts[-1] or attempt == most


def test_an_interruption_changes_nothing_of_what_follows(whole: int) -> None:
    """After a kill at any answer the questions that are left are those, in the order, that were left before."""
    protocol, pairs = whole
    for number in range(6):
        rng = np.random.default_rng([number, 2])
        plan = draw_plan(protocol, pairs, f"p{number}", group=number)
        stored = walk(protocol, plan, Walker(rng, stalls=0.4, misses=0.1, dies=0.0))
        for count in range(len(stored) + 1):
            session = open_session(protocol, plan, stored[:count], passed=PASSED)
            for answer in stored[count:]:
                while current(session).kind != "answer":
                    session = advanced(session)
                step = current(session)
                assert (step.trial, step.attempt, step.item) == (answer.trial, answer.attempt, answer.item)
                if answer.value is None:
                    session, _ = missed(session, shown_well=answer.shown_well)
                else:
                    session, _ = answered(session, answer.value, answer.response_s, shown_well=answer.shown_well)
            while current(session).kind != "done":
                assert current(session).kind != "answer"
                session = advanced(session)


def test_a_machine_on_which_everything_stalls_lets_the_participant_go(whole: int) -> None:
    protocol, pairs = whole
    plan = draw_plan(protocol, pairs, "p1")
    stored = walk(protocol, plan, Walker(np.random.default_rng(3), stalls=1.0, misses=0.0, dies=0.0))
    once = {trial.trial: len(asked_of(protocol, trial)) for trial in plan.trials if trial.role != "practice"}
    given = sum(answer.trial in once for answer in stored)
    assert given == (1 + protocol.timing.show_again) * sum(once.values())


def test_the_same_seed_gives_the_same_answers_however_often_it_is_killed(whole: int) -> None:
    """The walker's own draws belong to the question, so that a kill changes no answer."""
    protocol, pairs = whole
    plan = draw_plan(protocol, pairs, "p1")

    def answer_of(session: Session) -> Any:
        step = current(session)
        rng = np.random.default_rng([step.trial, step.attempt, len(step.item)])
        if rng.random() < 0.2:
            return missed(session, shown_well=rng.random() < 0.6)
        return answered(session, str(rng.choice(step.legal)), rng.uniform(0, 5), shown_well=rng.random() < 0.6)

    def run(kills: Any) -> Any:
        stored: list[Answer] = []
        session = open_session(protocol, plan, passed=PASSED)
        while current(session).kind != "done":
            if kills.random() < 0.15:
                session = open_session(protocol, plan, stored, passed=PASSED)
            if current(session).kind == "answer":
                session, answer = answer_of(session)
                stored.append(answer)
            elif current(session).kind != "done":
                session = advanced(session)
        return stored

    class Never:
        def random(self) -> float:
            return 1.0

    alone = run(Never())
    for seed in range(8):
        assert run(np.random.default_rng(seed)) == alone


def test_an_item_after_a_bad_showing_keeps_the_whole_trial_to_be_shown_again(
    make_stimuli: Callable[[Protocol], FakeStimuli],
) -> None:
    """The first item says that the film stalled; killed, shown well, and the second answered: it comes again."""
    protocol = full_protocol(1)
    plan = draw_plan(protocol, make_stimuli(protocol).pairs, "p1")
    trial = next(trial for trial in plan.trials if trial.study == "rating" and trial.role == "trial")
    stored = [
        Answer(other.trial, item, 1, "0", 1.0)
        for other in plan.trials[: trial.trial - 1]
        for item in sorted(asked_of(protocol, other))
    ]
    stored.append(Answer(trial.trial, "natural", 1, "2", 1.0, shown_well=False))
    session = open_session(protocol, plan, stored, passed=PASSED)
    while current(session).kind != "answer":
        session = advanced(session)
    assert (current(session).trial, current(session).item) == (trial.trial, "noticeable")
    session, second = answered(session, "2", 1.0)
    assert any((step.trial, step.attempt) == (trial.trial, 2) for step in session.steps)
    resumed = open_session(protocol, plan, [*stored, second], passed=PASSED)
    assert any((step.trial, step.attempt) == (trial.trial, 2) for step in resumed.steps)


@pytest.mark.parametrize("response_s", [float("nan"), float("inf"), -0.001])
def test_times_that_are_none_are_refused(make_stimuli: Callable[[Protocol], FakeStimuli], response_s: float) -> None:
    protocol = full_protocol(0)
    session = open_session(protocol, draw_plan(protocol, make_stimuli(protocol).pairs, "p1"), passed=PASSED)
    while current(session).kind != "answer":
        session = advanced(session)
    with pytest.raises(SessionError, match="Expected a response time from 0 to 5"):
        answered(session, current(session).legal[0], response_s)
