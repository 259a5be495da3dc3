"""Sessions whose trials depend on the answers: resumed anywhere they go on with the very same trials."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import pandas as pd
import pytest
from toys import QUEST, TOY_PROTOCOL, FakeStimuli, pairs_of, with_staircases

from study.errors import SessionError
from study.experiment.observers import person, respond, shown_well
from study.experiment.plan import Plan, draw_plan, plan_from_json
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.experiment.session import Session, advanced, answered, current, near, open_session, progress, walk
from study.experiment.simulation import simulate
from study.experiment.store.frames import answers_frame
from study.experiment.store.responses import open_responses
from study.experiment.store.sessions import find_session
from study.tasks.answer import Answer
from study.tasks.observer import default_observer
from study.tasks.trial import Trial

# Staircases between practice and another study, with breaks; the same in an order drawn for each participant.
TEXT = with_staircases(keys="practice = 2\nrepeats = 2\n") + "\n[timing]\nbreak_after = 5\nshow_again = 1\n"
TEXTS = {
    "in order": TEXT,
    "random order": TEXT.replace("seed = 5", 'seed = 5\nstudy_order = "random"'),
    "alone": with_staircases(TOY_PROTOCOL.split('\n[[studies]]\nname = "liking"')[0]),
    "by group": with_staircases(keys='order = "by-group"\n'),
    "then constant": with_staircases(table=QUEST + 'side = "shared"\nthen_constant = [0.5, 1.5]\nthen_repeats = 3\n'),
}


def protocol_of(case: str) -> Protocol:
    return parse_protocol(TEXTS[case])


def plan_of(protocol: Protocol, name: str = "p01", group: int = 0) -> Plan:
    return draw_plan(protocol, pairs_of(protocol), name, group=group)


def whole(protocol: Protocol, plan: Plan, badly_shown: float = 0.0) -> list[tuple[Trial, Answer]]:
    """A session of a simulated participant, from its start to its end."""
    who = person(replace(default_observer(4.0, 3.0), badly_shown=badly_shown, missed=0.05), plan.participant, 3)
    return list(walk(open_session(protocol, plan), partial(respond, who), partial(shown_well, who)))


@pytest.mark.parametrize("case", TEXTS)
@pytest.mark.parametrize("badly_shown", [0.0, 0.25])
def test_resumed_after_any_answer_the_session_goes_on_with_the_same_trials(case: str, badly_shown: float) -> None:
    protocol = protocol_of(case)
    plan = plan_of(protocol)
    given = whole(protocol, plan, badly_shown)
    answers = [answer for _, answer in given]
    who = person(replace(default_observer(4.0, 3.0), badly_shown=badly_shown, missed=0.05), "p01", 3)
    stored = plan_from_json(plan.to_json())
    assert stored == plan
    for place in range(len(given) + 1):
        state = open_session(protocol, stored, answers[:place])
        rest = list(walk(state, partial(respond, who), partial(shown_well, who)))
        assert rest == given[place:]


def test_numbers_are_kept_for_all_trials_that_may_come() -> None:
    """So that what a later study shows hangs on no answer."""
    protocol = protocol_of("in order")
    plan = plan_of(protocol)
    (course,) = plan.courses
    assert (course.first, course.most) == (3, protocol.trials_of(protocol.study("jnd")))
    assert [trial.trial for trial in plan.trials] == [1, 2, 3 + course.most, 4 + course.most]
    assert plan.last == 4 + course.most
    shown = [trial for trial, _ in whole(protocol, plan)]
    assert shown[:2] + shown[-2:] == list(plan.trials)
    assert [trial.trial for trial in shown[2:-2]] == list(range(3, len(shown) - 1))
    assert protocol.fewest_trials_of(protocol.study("jnd")) <= len(shown) - 4 < course.most


def test_order_by_group_is_that_of_the_group() -> None:
    staircases = protocol_of("by group")
    for group, members in ((0, (0, 1)), (1, (1, 0))):
        plan = plan_of(staircases, group=group)
        assert {trial.members for trial, _ in whole(staircases, plan) if trial.study == "jnd"} == {members}


def steps(session: Session) -> Iterator[Session]:
    """The states of a session on the way to its end, questions answered as well as can be."""
    while (step := current(session)).kind != "done":
        yield session
        if step.kind != "answer":
            session = advanced(session)
            continue
        trial = session.trial(step.trial)
        right = "different" if trial.difference_frames else "same"
        session = answered(session, right if trial.task == "same-different" else "first", 1.0)[0]
    yield session


def test_progress_rises_to_its_end_and_breaks_come_between() -> None:
    protocol = protocol_of("in order")
    states = list(steps(open_session(protocol, plan_of(protocol))))
    done, total = zip(*map(progress, states), strict=True)
    assert set(total) == {4 + protocol.trials_of(protocol.study("jnd"))}
    assert list(done) == sorted(done)
    assert (done[0], done[-1]) == (0, total[0])
    kinds = [current(state).kind for state in states]
    trials = [current(state).trial for state in states]
    breaks = [place for place, kind in enumerate(kinds) if kind == "break"]
    assert breaks
    for place in breaks:
        before = next(number for number in reversed(trials[:place]) if number)
        assert (before - 2) % 5 == 0
        assert any(trials[place:])
    assert sum(kind == "instructions" for kind in kinds) == 3  # welcome, the first study, practice that is over


def test_all_stimuli_that_come_were_named_ahead() -> None:
    protocol = protocol_of("in order")
    ahead: set[tuple[int, str]] = set()
    for state in steps(open_session(protocol, plan_of(protocol))):
        step = current(state)
        if step.slot and step.trial > 1:
            assert (step.slot, step.trial, step.stimulus) in ahead
        if step.slot == 1:
            own, after = near(state)
            assert {one.trial for one in own} == {step.trial}
            ahead = {(one.slot, one.trial, one.stimulus) for one in (*own, *after) if one.slot}
            assert len({one.trial for one in after}) <= 2
            assert len(after) <= 6


def test_answers_to_trials_that_were_not_asked_are_refused() -> None:
    protocol = protocol_of("in order")
    plan = plan_of(protocol)
    with pytest.raises(SessionError, match=r"Expected answers to the plan's trials 1 to \d+, found trials \[5\]"):
        open_session(protocol, plan, [Answer(5, "", 1, "same", 1.0)])


def test_simulated_sessions_are_stored_and_taken_up(tmp_path: Path) -> None:
    """Stopped after some answers, by an error, and run again: the table is that of an uninterrupted run."""
    protocol = protocol_of("in order")
    stimuli = FakeStimuli(pairs_of(protocol))
    tables: list[pd.DataFrame] = []
    for folder in ("whole", "stopped"):
        with open_responses(tmp_path / folder) as responses:

            def stop(done: int, total: int) -> None:
                assert done <= total
                if folder == "stopped" and done in (9, 31):  # noqa: B023
                    raise KeyboardInterrupt

            for _ in range(3):
                try:
                    simulate(protocol, stimuli, responses, 2, seed=4, progress=stop)
                except KeyboardInterrupt:
                    continue
            tables.append(answers_frame(responses, roles=("trial", "practice")).drop(columns="answered_at"))
            record = find_session(responses, "sim-001")
            assert record is not None
            assert record.plan == plan_of(protocol, "sim-001")
    assert tables[0].equals(tables[1])
    own = tables[0][tables[0]["study"] == "jnd"]
    assert own["difference_frames"].abs().max() <= 8
    assert len(own[own["role"] == "trial"]) > 2 * protocol.fewest_trials_of(protocol.study("jnd"))
