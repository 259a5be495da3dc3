"""Attention checks that end a session, orders by Latin square, blocks by transition."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from toys import TOY_PROTOCOL, FakeStimuli

from study.errors import ProtocolError
from study.experiment.plan import draw_plan, groups_of
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.experiment.session import advanced, answered, current, missed, open_session, outcome
from study.models.latin_square import latin_square
from study.tasks.answer import Answer
from study.tasks.registry import right_answer

MakeStimuli = Callable[[Protocol], FakeStimuli]


def protocol_with(rule: str = "", checks: int = 3, top: str = "") -> Protocol:
    text = TOY_PROTOCOL.replace('order = "both"', f'order = "both"\nattention_checks = {checks}')
    return parse_protocol(f"{top}{text}\n[failed_checks]\n{rule}\n")


def walk(
    protocol: Protocol, plan: Any, passes: Callable[[int], bool], *, shown_well: bool = True
) -> tuple[list[Answer], str]:
    """Answers and outcome of somebody who passes the checks of these numbers; killed and resumed after each answer."""
    stored: list[Answer] = []
    session, seen = open_session(protocol, plan), 0
    while (step := current(session)).kind != "done":
        if step.kind != "answer":
            session = advanced(session)
            continue
        trial = session.trial(step.trial)
        value = step.legal[0]
        if trial.role == "check":
            value = trial.expected if passes(seen) else next(one for one in step.legal if one != trial.expected)
            seen += 1
        session, answer = answered(session, value, 0.5, shown_well=shown_well)
        stored.append(answer)
        again = open_session(protocol, plan, stored)
        assert outcome(again) == outcome(session)
        left = [one.trial for one in session.steps[session.position :] if one.kind == "answer"]
        assert [one.trial for one in again.steps if one.kind == "answer"] == left
    return stored, outcome(session)


def test_one_check_too_many_ends_the_session_and_is_its_outcome(make_stimuli: MakeStimuli) -> None:
    protocol = protocol_with("most = 1")
    plan = draw_plan(protocol, make_stimuli(protocol).pairs, "p01")
    checks = [trial.trial for trial in plan.trials if trial.role == "check"]
    stored, how = walk(protocol, plan, lambda seen: seen == 0)
    assert (how, stored[-1].trial) == ("failed-checks", checks[2])
    stored, how = walk(protocol, plan, lambda seen: seen != 0)
    assert (how, stored[-1].trial) == ("finished", plan.trials[-1].trial)


def test_a_rule_that_flags_lets_the_session_go_on(make_stimuli: MakeStimuli) -> None:
    protocol = protocol_with('most = 0\nthen = "flag"')
    plan = draw_plan(protocol, make_stimuli(protocol).pairs, "p01")
    stored, how = walk(protocol, plan, lambda _: False)
    assert (how, stored[-1].trial) == ("failed-checks", plan.trials[-1].trial)


def test_a_missed_check_is_failed_and_a_badly_shown_one_counts_for_nothing(make_stimuli: MakeStimuli) -> None:
    protocol = protocol_with("most = 0", checks=1)
    plan = draw_plan(protocol, make_stimuli(protocol).pairs, "p01")
    _, how = walk(protocol, plan, lambda _: False, shown_well=False)
    assert how == "finished"
    session = open_session(protocol, plan)
    while current(session).kind != "answer" or session.trial(current(session).trial).role != "check":
        session = advanced(session) if current(session).kind != "answer" else missed(session)[0]
    session, _ = missed(session)
    assert outcome(session) == "failed-checks"


def test_the_rule_needs_attention_checks() -> None:
    with pytest.raises(ProtocolError, match=r"failed_checks.most: expected attention_checks in a study with this rule"):
        protocol_with("most = 1", checks=0)


@pytest.mark.parametrize("size", range(1, 8))
def test_in_a_latin_square_everything_stands_everywhere_and_follows_everything_equally_often(size: int) -> None:
    rows = latin_square(size)
    assert len(rows) == (size if size % 2 == 0 or size == 1 else 2 * size)
    for place in range(size):
        column = [row[place] for row in rows]
        assert {column.count(number) for number in range(size)} == {len(rows) // size}
    followed = [pair for row in rows for pair in pairwise(row)]
    assert {followed.count((a, b)) for a in range(size) for b in range(size) if a != b} <= {len(rows) // max(size, 1)}


def test_studies_stand_in_the_order_of_the_group(make_stimuli: MakeStimuli) -> None:
    protocol = protocol_with(top='study_order = "latin-square"\n')
    pairs = make_stimuli(protocol).pairs
    names = [study.name for study in protocol.studies]
    rows = latin_square(len(names))
    assert groups_of(protocol, pairs) % len(rows) == 0
    for group in range(2 * len(rows)):
        plan = draw_plan(protocol, pairs, f"p{group}", group=group)
        shown = list(dict.fromkeys(trial.study for trial in plan.trials))
        assert shown == [names[place] for place in rows[group % len(rows)]]


def test_blocks_hold_the_trials_of_a_transition_together(make_stimuli: MakeStimuli) -> None:
    text = TOY_PROTOCOL.replace('transitions = ["slow_quick"]\n', "").replace(
        'order = "both"', 'order = "both"\nblocks = true\nrepeats = 2'
    )
    protocol = parse_protocol(text)
    pairs = make_stimuli(protocol).pairs
    seen = set()
    for number in range(12):
        plan = draw_plan(protocol, pairs, f"p{number}")
        motions = [trial.motion for trial in plan.trials if trial.study == "jnd"]
        blocks = [motion for before, motion in zip(["", *motions], motions, strict=False) if motion != before]
        assert len(blocks) == len(set(blocks)) > 1
        seen.add(tuple(blocks))
    assert len(seen) > 1


@pytest.mark.parametrize(("right_in", "rounds"), [((2,), 1), ((1, 2), 2), ((0, 1, 0, 2), 3)])
def test_practice_comes_again_until_enough_of_a_round_is_right(
    make_stimuli: MakeStimuli, right_in: tuple[int, ...], rounds: int
) -> None:
    """So many right answers of two in each round, at most three rounds; killed and resumed after each answer."""
    more = 'order = "both"\npractice = 2\npractice_until = 1.0\nconfidence_points = 3'
    protocol = parse_protocol(TOY_PROTOCOL.replace('order = "both"', more))
    plan = draw_plan(protocol, make_stimuli(protocol).pairs, "p01")
    own = [trial.trial for trial in plan.practice("jnd")]
    stored: list[Answer] = []
    read: list[str] = []
    session = open_session(protocol, plan)
    while (step := current(session)).kind != "done":
        if step.kind != "answer":
            read.append(step.text)
            session = advanced(session)
            continue
        trial, value = session.trial(step.trial), step.legal[0]
        if trial.role == "practice" and not step.item:
            right = right_answer(trial)
            wanted = own.index(step.trial) < right_in[step.attempt - 1]
            value = next(one for one in step.legal if (one == right) == wanted)
        session, answer = answered(session, value, 0.5)
        stored.append(answer)
        again = open_session(protocol, plan, stored)
        left = [(one.trial, one.attempt, one.item) for one in session.steps[session.position :] if one.kind == "answer"]
        assert [(one.trial, one.attempt, one.item) for one in again.steps if one.kind == "answer"] == left
    practised = [(one.trial, one.attempt) for one in stored if one.trial in own and not one.item]
    assert practised == [(number, attempt) for attempt in range(1, rounds + 1) for number in own]
    assert read.count(protocol.texts.practice_again) == rounds - 1
    assert read.count(protocol.texts.practice_over) == 1


def test_practice_until_needs_a_task_with_right_answers() -> None:
    text = TOY_PROTOCOL.replace('order = "both"', 'order = "both"\npractice_until = 0.8')
    with pytest.raises(ProtocolError, match=r"practice_until: expected practice, and a task with right answers"):
        parse_protocol(text)
