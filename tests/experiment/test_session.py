"""The session: the order of steps, legal answers, missed ones, faulty showings, and taking up what was left."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from toys import FakeStimuli

from study.errors import SessionError
from study.experiment.plan import Plan, draw_plan, plan_from_json
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.experiment.session import (
    Session,
    advanced,
    answered,
    current,
    filled,
    missed,
    open_session,
    progress,
)
from study.experiment.steps import answer_keys


def to_question(session: Session) -> Any:
    while current(session).kind not in ("answer", "done"):
        session = advanced(session)
    return session


def run(session: Session, count: int | None = None, choose: Any = lambda step: step.legal[0], seen: Any = None) -> Any:
    """Answer `count` questions (all by default); the session after it and the answers."""
    answers = []
    while current(session).kind != "done" and (count is None or len(answers) < count):
        step = current(session)
        if seen is not None:
            seen.append(step)
        if step.kind == "answer":
            session, answer = answered(session, choose(step), 1.0)
            answers.append(answer)
        else:
            session = advanced(session)
    return session, answers


@pytest.fixture
def opened(toy_protocol: Protocol, toy_stimuli: FakeStimuli) -> Any:
    return open_session(toy_protocol, draw_plan(toy_protocol, toy_stimuli.pairs, "p01"))


def test_a_trial_is_first_gap_second_answer_pause(opened: Any) -> None:
    seen = []
    run(opened, seen=seen)
    kinds = [step.place for step in seen]
    assert kinds[:2] == ["instructions", "instructions"]
    assert kinds[2:7] == ["first", "gap", "second", "answer", "pause"]
    assert kinds[-1] == "debrief"
    assert kinds.count("answer") == 8
    for step in seen:
        if step.trial:
            trial = opened.trial(step.trial)
            assert step.study == trial.study
            assert step.stimulus == (trial.stimuli[step.slot - 1] if step.slot else "")
    with pytest.raises(SessionError, match="Expected a trial from 1 to 8 that is known, found 9"):
        opened.trial(9)
    durations = {step.kind: step.duration_s for step in seen}
    assert (durations["gap"], durations["answer"], durations["pause"]) == (1.0, 5.0, 1.0)
    assert [step.text for step in seen if step.kind == "instructions"] == ["Welcome.", "Some pairs are the same."]


def test_trials_come_in_the_order_of_the_plan(opened: Any) -> None:
    _, answers = run(opened)
    assert [answer.trial for answer in answers] == list(range(1, 9))


def test_only_legal_answers_in_the_answer_window_count(opened: Any) -> None:
    session = to_question(opened)
    assert current(session).legal == ("same", "different")
    with pytest.raises(SessionError, match="Expected one of same, different in trial 1, found 'first'"):
        answered(session, "first", 1.0)
    with pytest.raises(SessionError, match=r"response time from 0 to 5.0 s in trial 1, found 5.1 s"):
        answered(session, "same", 5.1)
    with pytest.raises(SessionError, match="found -1 s"):
        answered(session, "same", -1.0)
    session, answer = answered(session, "same", 5.0)
    assert (answer.value, answer.response_s, answer.attempt, answer.missed) == ("same", 5.0, 1, False)


def test_a_wrong_order_of_calls_is_refused(opened: Any) -> None:
    with pytest.raises(SessionError, match="Expected no answer now: the session is at 'instructions'"):
        answered(opened, "same", 1.0)
    with pytest.raises(SessionError, match="Expected no answer now"):
        missed(opened)
    session = to_question(opened)
    with pytest.raises(SessionError, match=r"Expected an answer to trial 1 .* can't be passed over"):
        advanced(session)
    after, _ = answered(session, "same", 1.0)
    with pytest.raises(SessionError, match="the session is at 'pause'"):
        answered(after, "same", 1.0)
    done, _ = run(opened)
    assert current(done).kind == "done"
    with pytest.raises(SessionError, match="the session is done"):
        advanced(done)


def test_a_missed_answer_is_recorded_and_not_asked_again(opened: Any) -> None:
    session, answer = missed(to_question(opened))
    assert (answer.value, answer.response_s, answer.missed) == (None, None, True)
    _, rest = run(session)
    assert [a.trial for a in rest] == list(range(2, 9))


@pytest.mark.parametrize("done", range(9))
def test_a_session_is_taken_up_where_it_stopped(opened: Any, done: int) -> None:
    """Whatever was answered before, the rest is the rest, in the same order."""
    _, whole = run(opened)
    _, before = run(opened, done)
    again = open_session(opened.protocol, opened.plan, before)
    assert progress(again) == (done, 8)
    _, after = run(again)
    assert before + after == whole


def test_taking_up_shows_the_instructions_of_the_study_but_not_the_welcome(opened: Any) -> None:
    _, before = run(opened, 2)
    seen = []
    run(open_session(opened.protocol, opened.plan, before), seen=seen)
    assert seen[0].text == "Some pairs are the same."
    assert seen[1].place == "first"
    assert seen[1].trial == 3


def test_a_badly_shown_trial_comes_again_at_the_end_of_its_study(opened: Any) -> None:
    session, faulty = answered(to_question(opened), "same", 1.0, shown_well=False)
    _, rest = run(session)
    assert [(a.trial, a.attempt) for a in rest][4:] == [(6, 1), (1, 2), (7, 1), (8, 1)]
    for count in range(9):
        before = [faulty, *rest[:count]]
        _, after = run(open_session(opened.protocol, opened.plan, before))
        assert [faulty, *rest] == before + after


def test_a_trial_is_not_repeated_for_ever(opened: Any) -> None:
    session = opened
    answers = []
    while current(session := to_question(session)).kind != "done":
        session, answer = answered(session, current(session).legal[0], 1.0, shown_well=False)
        answers.append(answer)
    assert len(answers) == 16
    assert {answer.attempt for answer in answers} == {1, 2}
    assert current(open_session(opened.protocol, opened.plan, answers)).kind == "debrief"


def test_a_rated_pair_shows_both_and_then_asks_every_item(
    pair_rating_protocol: Protocol, make_stimuli: Callable[[Protocol], FakeStimuli]
) -> None:
    plan = draw_plan(pair_rating_protocol, make_stimuli(pair_rating_protocol).pairs, "p01")
    seen = []
    run(open_session(pair_rating_protocol, plan), choose=lambda step: step.legal[-1], seen=seen)
    asked = [step for step in seen if step.study == "compared" and step.kind == "answer"]
    assert [step.item for step in asked] == ["better", "natural"] * 2
    assert {(step.legal, step.duration_s) for step in asked} == {(("0", "1", "2", "3", "4"), None)}
    assert (asked[0].low, asked[0].middle, asked[0].high) == ("much worse", "the same", "much better")
    steps = [step for step in seen if step.trial == asked[0].trial]
    assert [step.place for step in steps] == ["first", "gap", "second", "answer", "answer", "pause"]
    trial = plan.trials[asked[0].trial - 1]
    assert (steps[0].stimulus, steps[2].stimulus) == trial.stimuli


def test_rating_asks_every_item_without_time_limit(
    rating_protocol: Protocol, make_stimuli: Callable[[Protocol], FakeStimuli]
) -> None:
    plan = draw_plan(rating_protocol, make_stimuli(rating_protocol).pairs, "p01")
    seen = []
    _, answers = run(open_session(rating_protocol, plan), choose=lambda step: step.legal[-1], seen=seen)
    rated = [step for step in seen if step.study == "rating" and step.kind == "answer"]
    assert [(step.item, step.legal, step.duration_s) for step in rated[:2]] == [
        ("natural", ("0", "1", "2", "3", "4"), None),
        ("noticeable", ("0", "1", "2", "3", "4"), None),
    ]
    assert (rated[0].low, rated[0].high) == ("not at all", "very")
    kinds = [step.place for step in seen if step.trial == rated[0].trial]
    assert kinds == ["first", "answer", "answer", "pause"]
    half = answers[: [a.item for a in answers].index("natural") + 1]
    _, rest = run(open_session(rating_protocol, plan, half), choose=lambda step: step.legal[-1])
    assert half + rest == answers


@pytest.mark.parametrize(("every", "expected"), [(3, [3, 6]), (4, [4]), (2, [2, 4, 6]), (8, []), (1, [*range(1, 8)])])
def test_breaks_come_after_so_many_of_eight_trials_and_never_after_the_last(
    toy_protocol: Protocol, toy_stimuli: FakeStimuli, every: int, expected: list[int]
) -> None:
    text = toy_protocol.text.replace("[points]", f"[timing]\nbreak_after = {every}\n\n[points]").replace(
        "[texts]", '[texts]\nbreak_text = "Rest."'
    )
    protocol = parse_protocol(text)
    session = open_session(protocol, draw_plan(protocol, toy_stimuli.pairs, "p01"))
    seen = []
    run(session, seen=seen)
    before = [seen[i - 1].trial for i, step in enumerate(seen) if step.kind == "break"]
    assert before == expected


def test_another_protocol_or_stray_answers_are_refused(opened: Any) -> None:
    other = parse_protocol(opened.protocol.text + "# changed\n")
    with pytest.raises(SessionError, match="Expected the protocol under which the plan was drawn"):
        open_session(other, opened.plan)
    _, answers = run(opened, 1)
    from dataclasses import replace

    with pytest.raises(SessionError, match=r"trials 1 to 8, found trials \[99\]"):
        open_session(opened.protocol, opened.plan, [replace(answers[0], trial=99)])


PEOPLE = """
consent = { text = "Do you agree?" }
keys = { same = "g" }

[[form]]
name = "age"
label = "Age"
kind = "number"
least = 18
required = true

[[form]]
name = "vision"
label = "Vision"
kind = "choice"
choices = ["good", "poor"]

[stimuli]"""


@pytest.fixture
def with_people(toy_protocol: Protocol, toy_stimuli: FakeStimuli) -> Any:
    text = toy_protocol.text.replace("[stimuli]", PEOPLE.lstrip(), 1).replace(
        'order = "both"', 'order = "both"\npractice = 4\nattention_checks = 2'
    )
    protocol = parse_protocol(text)
    return protocol, draw_plan(protocol, toy_stimuli.pairs, "p01")


def test_consent_and_form_come_first_and_once(with_people: Any) -> None:
    protocol, plan = with_people
    session = open_session(protocol, plan)
    assert (current(session).kind, current(session).text) == ("consent", "Do you agree?")
    session = advanced(session)
    assert current(session).kind == "form"
    with pytest.raises(SessionError, match="call filled"):
        advanced(session)
    for values, why in (
        ({}, "age to be filled in"),
        ({"age": "17"}, "from 18 to inf as age, found '17'"),
        ({"age": "nan"}, "from 18 to inf"),
        ({"age": "20", "vision": "none"}, "one of good, poor as vision"),
        ({"age": "20", "other": "1"}, "fields age, vision, found 'other'"),
    ):
        with pytest.raises(SessionError, match=why):
            filled(session, values)
    session, values = filled(session, {"age": " 30 ", "vision": ""})
    assert values == {"age": "30"}
    assert current(session).kind == "instructions"
    with pytest.raises(SessionError, match="Expected no form now"):
        filled(session, {"age": "30"})
    assert current(open_session(protocol, plan, passed=("consent",))).kind == "form"
    assert current(open_session(protocol, plan, passed=("consent", "form"))).kind == "instructions"


def test_practice_gets_feedback_and_checks_ask_for_what_they_say(with_people: Any) -> None:
    protocol, plan = with_people
    assert [trial.role for trial in plan.trials[:4]] == ["practice"] * 4
    assert sorted(bool(trial.difference_frames) for trial in plan.trials[:4]) == [False, False, True, True]
    checks = [trial for trial in plan.trials if trial.role == "check"]
    assert len(checks) == 2
    seen = []
    run(open_session(protocol, plan, passed=("consent", "form")), seen=seen)
    assert [step.kind for step in seen].count("feedback") == 4
    said = {step.text for step in seen if step.kind == "feedback"}
    assert said == {"That was right.", "That was not right: the answer is “Different”."}
    for trial in checks:
        step = next(step for step in seen if step.trial == trial.trial and step.kind == "answer")
        assert step.text.endswith(f"Please answer: {trial.expected.capitalize()}")
    assert answer_keys(protocol, ("same", "different")) == {"same": "g", "different": "d"}
    assert "10" not in answer_keys(protocol, [str(i) for i in range(11)])


def test_practice_and_checks_leave_the_trials_as_they_are(with_people: Any, opened: Any) -> None:
    from dataclasses import replace

    def trials(plan: Plan) -> list[Any]:
        return [replace(trial, trial=0) for trial in plan.trials if trial.role == "trial"]

    assert trials(with_people[1]) == trials(opened.plan)


def test_practice_is_not_repeated(with_people: Any) -> None:
    protocol, plan = with_people
    session = open_session(protocol, plan, passed=("consent", "form"))
    _, answer = answered(to_question(session), "same", 1.0, shown_well=False)
    assert answer.trial == 1
    assert current(to_question(open_session(protocol, plan, [answer], passed=("consent", "form")))).trial == 2


PRACTISING = (
    'order = "both"',
    'order = "both"\npractice = 2\npractice_transitions = ["still_slow"]',
)


@pytest.fixture
def practising(toy_protocol: Protocol, make_stimuli: Callable[[Protocol], FakeStimuli]) -> Any:
    protocol = parse_protocol(toy_protocol.text.replace(*PRACTISING))
    return open_session(protocol, draw_plan(protocol, make_stimuli(protocol).pairs, "p01"))


def test_the_end_of_practice_is_said_once(practising: Any) -> None:
    seen = []
    run(practising, seen=seen)
    over = [i for i, step in enumerate(seen) if step.text == practising.protocol.texts.practice_over]
    assert len(over) == 1
    assert [step.role for step in seen[: over[0]] if step.trial][-1] == "practice"
    assert (seen[over[0] + 1].place, seen[over[0] + 1].role, seen[over[0] + 1].trial) == ("first", "trial", 3)
    _, one = run(practising, 1)
    for answers, said in ((one, True), (run(practising, 2)[1], True), (run(practising, 5)[1], False)):
        again = open_session(practising.protocol, practising.plan, answers)
        assert any(step.text == practising.protocol.texts.practice_over for step in again.steps) == said


def test_an_example_can_have_a_transition_of_its_own(
    toy_protocol: Protocol, make_stimuli: Callable[[Protocol], FakeStimuli]
) -> None:
    own = (
        '[[transitions]]\nname = "walk_on"\ncategory = "walking"\nsource = "slow"\ndestination = "slow"\n\n[[studies]]'
    )
    text = toy_protocol.text.replace(*PRACTISING).replace("[[studies]]", own, 1)
    text = text.replace('["still_slow"]', '["still_slow", "walk_on"]\nexample_transition = "walk_on"')
    protocol = parse_protocol(text)
    for participant in ("p01", "p02", "p03"):
        plan = plan_from_json(draw_plan(protocol, make_stimuli(protocol).pairs, participant).to_json())
        assert [trial.motion for trial in plan.practice("jnd")] == ["still_slow"] * 2
        steps = open_session(protocol, plan).steps
        (example,) = (step for step in steps if step.kind == "instructions" and step.study == "jnd" and step.stimulus)
        assert example.stimulus.startswith("walk_on")
        assert example.stimulus in plan.stimuli
        assert not any(step.stimulus.startswith("walk_on") for step in steps if step.kind == "stimulus")


def test_practice_and_example_show_transitions_of_their_own(practising: Any) -> None:
    plan = practising.plan
    assert [trial.motion for trial in plan.trials if trial.role == "practice"] == ["still_slow"] * 2
    assert {trial.motion for trial in plan.trials if trial.study == "jnd" and trial.role == "trial"} == {"slow_quick"}
    (example,) = (step for step in practising.steps if step.kind == "instructions" and step.stimulus)
    assert example.stimulus.startswith("still_slow")
    # Another study, which names no transitions, does not show what is kept for practice.
    assert {trial.motion for trial in plan.trials if trial.study == "liking"} == {"slow_quick"}
