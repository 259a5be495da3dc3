"""Up-down rules against the published tables, brute force, and simulated observers that share no code with them."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from study.models.up_down import Track, UpDown, fewest_trials, folded, moved, reachable, stopped, target


def rule_of(down: int = 1, up: int = 1, up_times: int = 1, steps: tuple[int, ...] = (1,), **others: int) -> UpDown:
    keys = {"start": 50, "least": 1, "most": 100, **others}
    return UpDown(**keys, steps=steps, down=down, up=up, up_times=up_times)


# Levitt (1971), Table I: which responses (+ right, - wrong) since the last change step up and which step down, and the
# probability of a positive response at convergence.
TABLE_I = [
    (1, 1, ("-",), ("+",), 0.5),
    (2, 1, ("+-", "-"), ("++",), 0.707),
    (1, 2, ("--",), ("-+", "+"), 0.293),
    (3, 1, ("++-", "+-", "-"), ("+++",), 0.794),
    (4, 1, ("+++-", "++-", "+-", "-"), ("++++",), 0.841),
    (1, 4, ("----",), ("---+", "--+", "-+", "+"), 0.159),
]


@pytest.mark.parametrize(("down", "up", "ups", "downs", "probability"), TABLE_I)
def test_transformed_rules_are_those_of_levitt(
    down: int, up: int, ups: tuple[str, ...], downs: tuple[str, ...], probability: float
) -> None:
    rule = rule_of(down, up)
    for groups, after in ((ups, 51), (downs, 49)):
        for group in groups:
            answers = [sign == "+" for sign in group]
            assert folded(rule, answers[:-1]).level == 50
            assert folded(rule, answers).level == after
    assert target(rule) == pytest.approx(probability, abs=5e-4)


def test_weighted_rules_are_those_of_kaernbach() -> None:
    """Kaernbach (1991), Eq. 1: steps up times 1 - p are steps down times p; his 75% has steps of 3 and 1."""
    rule = rule_of(up_times=3, steps=(2,))
    assert target(rule) == pytest.approx(0.75, abs=1e-9)
    assert folded(rule, [True]).level == 48
    assert folded(rule, [False]).level == 56
    for times in (1, 2, 4, 9):
        p = target(rule_of(up_times=times))
        assert times * (1 - p) == pytest.approx(p)


def test_a_sequence_by_hand() -> None:
    """One up, two down from 20 in steps of 4, 2 and 1: a level a line, its answers, and where it turns."""
    rule = rule_of(down=2, start=20, least=1, most=30, steps=(4, 2, 1))
    lines = [(20, "++"), (16, "++"), (12, "-"), (14, "++"), (13, "+-"), (14, "++"), (13, "++"), (12, "-"), (13, "")]
    track = Track(20)
    for level, answers in lines:
        assert track.level == level
        for sign in answers:
            track = moved(track, rule, sign == "+")
    # Down from 20 to 12, up at 12, down at 14, up at 13, down at 14, up at 12.
    assert track.reversals == (12, 14, 13, 14, 12)
    assert track.trials == 14


def test_no_answer_asks_again_and_counts_as_a_trial() -> None:
    rule = rule_of(down=2)
    track = folded(rule, [True, None, True])
    assert (track.level, track.trials) == (49, 3)
    assert folded(rule, [None] * 4) == Track(50, trials=4)


def test_limits_hold_and_a_step_against_them_turns_nothing() -> None:
    rule = rule_of(start=3, least=1, most=5, steps=(2,))
    assert [folded(rule, [True] * n).level for n in range(4)] == [3, 1, 1, 1]
    assert folded(rule, [True] * 9).reversals == ()
    assert folded(rule, [True] * 9 + [False]).reversals == (1,)
    assert folded(rule, [False] * 3).level == 5


def test_it_stops_after_its_reversals_or_its_trials() -> None:
    rule = rule_of(reversals=3, trials=10)
    alternating = [n % 2 == 0 for n in range(10)]
    assert [stopped(folded(rule, alternating[:n]), rule) for n in range(6)] == [False] * 4 + [True] * 2
    assert not stopped(folded(rule, [True] * 9), rule)
    assert stopped(folded(rule, [True] * 10), rule)


RULES = [
    rule_of(down, up, times, steps, start=start, least=2, most=17, reversals=3, trials=9)
    for down, up in ((1, 1), (2, 1), (1, 2), (2, 2))
    for times in (1, 3)
    for steps in ((1,), (4, 2), (5, 3))
    for start in (2, 9, 16)
]


def brute(rule: UpDown) -> tuple[set[int], int]:
    """The levels that come in any sequence of answers up to a length, and the shortest one that reaches its end."""
    levels, shortest = set(), rule.trials
    ahead = {Track(rule.start)}
    for length in range(1, 13):
        levels |= {track.level for track in ahead}
        ahead = {moved(track, rule, right) for track in ahead for right in (True, False)}
        if any(len(track.reversals) >= rule.reversals for track in ahead):
            shortest = min(shortest, length)
    return levels, shortest


@pytest.mark.parametrize("rule", RULES)
def test_reachable_levels_and_fewest_trials_against_all_sequences(rule: UpDown) -> None:
    levels, shortest = brute(rule)
    assert levels <= set(reachable(rule))
    assert fewest_trials(rule) == shortest


@pytest.mark.parametrize("rule", RULES)
def test_every_reachable_level_comes_after_some_answers(rule: UpDown) -> None:
    """All states that any answers lead to; of the reversals only those are kept that the size of a step hangs on."""
    seen, ahead = set(), {Track(rule.start)}
    while ahead:
        seen |= ahead
        after = {moved(track, rule, right) for track in ahead for right in (True, False)}
        ahead = {replace(one, trials=0, reversals=(0,) * min(len(one.reversals), 2)) for one in after} - seen
    assert {track.level for track in seen} == set(reachable(rule))


@pytest.mark.parametrize(("down", "up"), [*itertools.product((1, 2, 3), (1, 2, 3))])
def test_the_target_balances_steps_down_and_up(down: int, up: int) -> None:
    """By a chain over the counts of answers in a row, step by step, at several ratios of the steps."""
    for times in (1, 2, 3):
        p = target(rule_of(down, up, times))
        chances = {(0, 0): 1.0}
        steps_down = 0.0
        for _ in range(4000):
            after: dict[tuple[int, int], float] = {}
            for (right, wrong), chance in chances.items():
                if right + 1 == down:
                    steps_down += chance * p
                else:
                    after[right + 1, 0] = after.get((right + 1, 0), 0.0) + chance * p
                if wrong + 1 < up:
                    after[0, wrong + 1] = after.get((0, wrong + 1), 0.0) + chance * (1 - p)
            chances = after
        assert steps_down == pytest.approx((1 - steps_down) * times, abs=1e-6)


@pytest.mark.parametrize(("down", "up", "times"), [(1, 1, 1), (2, 1, 1), (3, 1, 1), (1, 1, 3), (1, 2, 1)])
def test_staircases_settle_where_an_observer_has_the_target(down: int, up: int, times: int) -> None:
    """An observer of a logistic curve, written here: the mean level is where the curve has the rule's target."""
    rule = rule_of(down, up, times, start=500, least=1, most=1000, reversals=10_000, trials=100_000)
    rng = np.random.default_rng([down, up, times])
    middle, width = 430.0, 60.0
    levels, rights = [], 0
    track = Track(rule.start)
    for trial in range(40_000):
        right = bool(rng.random() < 1 / (1 + math.exp(-(track.level - middle) / width)))
        if trial >= 4000:
            levels.append(track.level)
            rights += right
        track = moved(track, rule, right)
    aim = target(rule)
    expected = middle + width * math.log(aim / (1 - aim))
    assert float(np.mean(levels)) == pytest.approx(expected, abs=9.0)
    if (down, up) == (1, 1):
        assert rights / len(levels) == pytest.approx(aim, abs=0.01)
