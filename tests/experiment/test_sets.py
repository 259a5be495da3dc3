"""Sets of pairs: every pair is in one, and each is as balanced as it can be. All by counting."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from itertools import combinations
from pathlib import Path

import pytest
from toys import FakeStimuli

from study.apps.cli.play import the_plan
from study.errors import ProtocolError
from study.experiment.plan import draw_plan, groups_of
from study.experiment.protocol.whole import find_protocol, load_protocol, parse_protocol
from study.experiment.sets import own_set, round_robin
from study.experiment.store.responses import open_responses
from study.experiment.store.sessions import begin_session
from study.tasks.trial import Pair


def pairs_of(methods: int, motions: int) -> list[Pair]:
    names = [f"method{n}" for n in range(methods)]
    return [
        Pair(f"{motion} {a} {b}", "s", "preference", f"motion{motion}", "", (a, b), (a, b))
        for motion in range(motions)
        for a, b in combinations(names, 2)
    ]


@pytest.mark.parametrize("methods", range(3, 10))
def test_no_method_stands_twice_in_a_round(methods: int) -> None:
    compared = [pair.methods for pair in pairs_of(methods, 1)]
    order = round_robin(compared)
    assert sorted(map(sorted, order)) == sorted(map(sorted, compared))
    games = methods // 2
    for start in range(0, len(order), games):
        assert len(frozenset.union(*order[start : start + games])) == 2 * games


@pytest.mark.parametrize(("methods", "motions", "sets"), [
    (7, 8, 4), (7, 7, 7), (7, 14, 7), (5, 5, 5), (4, 6, 3), (6, 5, 5), (3, 4, 2), (8, 3, 4),
])  # fmt: skip
def test_sets_are_equal_balanced_and_hold_each_pair_once(methods: int, motions: int, sets: int) -> None:
    pairs = pairs_of(methods, motions)
    found = [own_set(pairs, sets, number) for number in range(sets)]
    assert sorted(pair.name for one in found for pair in one) == sorted(pair.name for pair in pairs)
    assert own_set(pairs, sets, sets + 1) == found[1]
    for one in found:
        assert len(one) == len(pairs) // sets
        by_methods = Counter(pair.methods for pair in one)
        if motions % sets == 0:  # then each pair of methods is seen equally often, at other motions
            assert set(by_methods.values()) == {motions // sets}
            assert len(by_methods) == methods * (methods - 1) // 2
        by_motion = Counter(pair.motion for pair in one)
        assert max(by_motion.values()) - min(by_motion.values()) <= 1
        for motion in by_motion:
            shown = Counter(name for pair in one if pair.motion == motion for name in pair.methods)
            assert max(shown.values()) - min(shown.get(f"method{n}", 0) for n in range(methods)) <= 2


def test_a_participant_of_transitions_today_sees_each_two_methods_in_locomotion_and_in_dance(
    make_stimuli: Callable[..., FakeStimuli],
) -> None:
    protocol = load_protocol(find_protocol("transitions_today"))
    pairs = make_stimuli(protocol).pairs
    assert groups_of(protocol, pairs) == 4
    seen: Counter[tuple[str, tuple[str, ...]]] = Counter()
    for group in range(8):
        plan = draw_plan(protocol, pairs, f"p{group}", group=group)
        trials = [trial for trial in plan.trials if trial.role == "trial"]
        assert len(trials) == protocol.trials_of(protocol.studies[0]) == 42
        assert sum(trial.a_first for trial in trials) == 21
        assert set(Counter((trial.methods, trial.category) for trial in trials).values()) == {1}
        seen.update((trial.motion, trial.methods) for trial in trials)
    assert len(seen) == 168
    assert set(seen.values()) == {2}


TEXT = """
name = "many"
title = "Many"
seed = 1

[[transitions]]
name = "walk_run"
category = "walking"
source = "walk"
destination = "run"

[[studies]]
name = "natural"
task = "preference"
reference = "geodesic"
comparison = "fixed"
others = ["cut"]
"""


@pytest.mark.parametrize(("change", "message"), [
    (("others = [\"cut\"]", "others = [\"cut\", \"fixed\"]"), "expected each method once .* found 'fixed' twice"),
    (("others = [\"cut\"]", "others = [\"cutt\"]"), "found 'cutt'; did you mean 'cut'"),
    (("others = [\"cut\"]", "others = [\"cut\"]\nsets = 2"), "expected sets that divide the 3 pairs of methods"),
    (("others = [\"cut\"]", "others = [\"cut\"]\nsets = 3\norder = \"by-group\""), "another order than by-group"),
    (("others = [\"cut\"]", "others = [\"cut-lee2002\"]"), "'geodesic' and 'fixed' and 'cut-lee2002'; change one"),
    (("task = \"preference\"", "task = \"rating\""), "expected others in preference and parallel-rating studies only"),
])  # fmt: skip
def test_what_does_not_fit_is_refused(change: tuple[str, str], message: str) -> None:
    parse_protocol(TEXT)
    with pytest.raises(ProtocolError, match=message):
        parse_protocol(TEXT.replace(*change))


def test_in_the_laboratory_sets_fill_one_after_another(
    tmp_path: Path, make_stimuli: Callable[..., FakeStimuli]
) -> None:
    protocol = load_protocol(find_protocol("transitions_today"))
    stimuli = make_stimuli(protocol)
    with open_responses(tmp_path) as responses:
        groups = []
        for name in ("p1", "p2", "p3", "p4", "p5", "p6"):
            plan = the_plan(responses, protocol, stimuli, name, None, 2 if name == "p1" else None)
            begin_session(responses, protocol, plan)
            groups.append(plan.group)
        assert groups == [2, 0, 1, 3, 0, 1]
        assert the_plan(responses, protocol, stimuli, "p4", None, None).group == 3, "who comes back keeps the set"
