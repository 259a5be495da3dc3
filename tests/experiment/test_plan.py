"""The plan: drawn once, balanced, the same wherever it is drawn."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from toys import FakeStimuli

from study.errors import SessionError
from study.experiment.plan import Plan, draw_plan, groups_of, plan_from_json
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.tasks.trial import Trial


def real(plan: Plan) -> list[Any]:
    """The trials that count."""
    return [trial for trial in plan.trials if trial.role == "trial"]


def test_the_jnd_study_has_42_pairs_in_both_orders(
    jnd_protocol: Protocol, make_stimuli: Callable[[Protocol], FakeStimuli]
) -> None:
    """2004 section 4.2: 7 lengths x 2 orders x 3 motions."""
    plan = draw_plan(jnd_protocol, make_stimuli(jnd_protocol).pairs, "p01")
    assert [trial.role for trial in plan.trials] == ["practice"] * 4 + ["trial"] * 42
    assert [trial.trial for trial in plan.trials] == list(range(1, 47))
    shown = Counter((trial.motion, trial.difference_frames, trial.a_first) for trial in real(plan))
    assert set(shown.values()) == {1}
    assert {difference for _, difference, _ in shown} == {-15, -10, -5, 0, 5, 10, 20}
    for trial in real(plan):
        reference = trial.stimuli[0] if trial.a_first else trial.stimuli[1]
        assert reference == f"{trial.motion}-k"
        if trial.difference_frames == 0:
            assert trial.stimuli[0] == trial.stimuli[1]
        else:
            assert trial.stimuli[0] != trial.stimuli[1]


def test_pairs_and_orders_are_randomised(
    jnd_protocol: Protocol, make_stimuli: Callable[[Protocol], FakeStimuli]
) -> None:
    pairs = make_stimuli(jnd_protocol).pairs
    plans = [draw_plan(jnd_protocol, pairs, f"p{number:02d}") for number in range(40)]
    assert len({tuple(trial.pair for trial in real(plan)) for plan in plans}) == 40
    # Where each pair's first showing has the reference first: about half, over 40 x 21 of them (sd 14.5).
    first = sum(
        next(trial for trial in real(plan) if trial.pair == pair.name).a_first
        for plan in plans
        for pair in pairs
        if pair.motion not in jnd_protocol.studies[0].practice_transitions
    )
    assert abs(first - 420) < 75
    # The pair in the first trial differs over participants about as a fair draw of 21 would have it.
    assert len({real(plan)[0].pair for plan in plans}) > 10


def test_the_same_seed_and_participant_give_the_same_plan(toy_protocol: Protocol, toy_stimuli: FakeStimuli) -> None:
    plan = draw_plan(toy_protocol, toy_stimuli.pairs, "p01")
    assert draw_plan(toy_protocol, toy_stimuli.pairs, "p01") == plan
    assert draw_plan(toy_protocol, toy_stimuli.pairs, "p02").trials != plan.trials
    assert draw_plan(toy_protocol, toy_stimuli.pairs, "p01", seed=6).trials != plan.trials


def test_another_process_draws_the_same_plan(
    jnd_protocol: Protocol, make_stimuli: Callable[[Protocol], FakeStimuli], repository: Path
) -> None:
    """Nothing hangs on hash randomisation, on the clock or on anything else outside seed and name."""
    code = (
        "import sys; sys.path.insert(0, 'tests/experiment');import toys as c;"
        "from study.experiment.plan import draw_plan;"
        "from study.experiment.protocol.whole import find_protocol, load_protocol;"
        "p = load_protocol(find_protocol('blend_length_jnd'));print(draw_plan(p, c.pairs_of(p), 'p07').to_json())"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=repository, capture_output=True, text=True, check=True)
    plan = draw_plan(jnd_protocol, make_stimuli(jnd_protocol).pairs, "p07")
    assert plan_from_json(run.stdout) == plan


def test_a_known_plan_never_changes(jnd_protocol: Protocol, make_stimuli: Callable[[Protocol], FakeStimuli]) -> None:
    """A change here means that stored seeds no longer give the plans that participants saw."""
    plan = draw_plan(jnd_protocol, make_stimuli(jnd_protocol).pairs, "p01", seed=1)
    assert [(trial.motion[:4], trial.difference_frames, trial.a_first) for trial in real(plan)[:6]] == KNOWN


KNOWN = [
    ("walk", 20, True),
    ("stan", 10, False),
    ("walk", 10, True),
    ("runn", 0, False),
    ("runn", -15, True),
    ("walk", 20, False),
]


def test_studies_come_in_order_and_repeats_one_after_another(toy_protocol: Protocol, toy_stimuli: FakeStimuli) -> None:
    plan = draw_plan(toy_protocol, toy_stimuli.pairs, "p01")
    assert [trial.study for trial in plan.trials] == ["jnd"] * 6 + ["liking"] * 2
    studies = tuple(s.model_copy(update={"repeats": 3}) for s in toy_protocol.studies)
    thrice = draw_plan(toy_protocol.model_copy(update={"studies": studies}), toy_stimuli.pairs, "p01")
    assert [trial.repeat for trial in thrice.trials] == [1] * 6 + [2] * 6 + [3] * 6 + [1, 1, 2, 2, 3, 3]


def test_random_study_order_keeps_studies_whole(toy_protocol: Protocol, toy_stimuli: FakeStimuli) -> None:
    mixed = toy_protocol.model_copy(update={"study_order": "random"})
    orders = {
        tuple(dict.fromkeys(trial.study for trial in draw_plan(mixed, toy_stimuli.pairs, f"p{n}").trials))
        for n in range(12)
    }
    assert orders == {("jnd", "liking"), ("liking", "jnd")}


def test_balanced_order_shows_half_each_way(toy_protocol: Protocol, toy_stimuli: FakeStimuli) -> None:
    studies = (toy_protocol.studies[0], toy_protocol.studies[1].model_copy(update={"order": "balanced"}))
    balanced = toy_protocol.model_copy(update={"studies": studies})
    for number in range(8):
        plan = draw_plan(balanced, toy_stimuli.pairs, f"p{number}")
        assert sorted(trial.a_first for trial in plan.trials[6:]) == [False, True]


def test_the_odd_pair_of_a_balanced_order_goes_either_way(
    toy_protocol: Protocol, make_stimuli: Callable[[Protocol], FakeStimuli]
) -> None:
    """Three pairs: one way is shown twice, and which way is drawn anew for every participant."""
    third = """
[[transitions]]
name = "quick_slow"
category = "walking"
source = "quick"
destination = "slow"

[[studies]]"""
    text = toy_protocol.text.replace("\n[[studies]]", third, 1)
    text = text.replace('comparison = "fixed"', 'comparison = "fixed"\norder = "balanced"')
    protocol = parse_protocol(text)
    pairs = make_stimuli(protocol).pairs
    first = Counter()
    for number in range(60):
        trials = draw_plan(protocol, pairs, f"p{number}").trials
        shown = [trial.a_first for trial in trials if trial.study == "liking"]
        assert len(shown) == 3
        first[sum(shown)] += 1
    assert set(first) == {1, 2}
    assert min(first.values()) > 15  # 30 expected, standard deviation 3.9


def test_preference_trials_say_which_method_is_first(toy_protocol: Protocol, toy_stimuli: FakeStimuli) -> None:
    for number in range(8):
        for trial in draw_plan(toy_protocol, toy_stimuli.pairs, f"p{number}").trials[6:]:
            assert trial.methods == ("geodesic", "fixed")
            a, b = f"{trial.motion}-k", f"{trial.motion}-fixed"
            assert trial.stimuli == ((a, b) if trial.a_first else (b, a))
            assert trial.members == ((0, 1) if trial.a_first else (1, 0))


def test_rating_trials_rotate_by_group(
    rating_protocol: Protocol, make_stimuli: Callable[[Protocol], FakeStimuli]
) -> None:
    """2003 section 4.2: two groups, each shown the stimuli in its own order."""
    pairs = make_stimuli(rating_protocol).pairs
    rated = [pair.stimuli[0] for pair in pairs if pair.study == "rating"]
    for group in range(2):
        trials = draw_plan(rating_protocol, pairs, "p01", group=group).trials
        shown = [trial.stimuli[0] for trial in trials if trial.study == "rating"]
        assert shown == rated[group:] + rated[:group]
        assert all(len(trial.stimuli) == 1 for trial in trials if trial.study == "rating")


def test_rated_pairs_say_which_method_is_first(
    pair_rating_protocol: Protocol, make_stimuli: Callable[[Protocol], FakeStimuli]
) -> None:
    """2003 section 4.2: half the participants see the original first, half the optimised one."""
    pairs = make_stimuli(pair_rating_protocol).pairs
    own = {pair.motion: pair for pair in pairs if pair.study == "compared"}
    assert len(own) == 2
    assert groups_of(pair_rating_protocol, pairs) == 2
    for group in range(2):
        plan = draw_plan(pair_rating_protocol, pairs, "p01", group=group)
        trials = [trial for trial in plan.trials if trial.study == "compared"]
        assert {trial.motion for trial in trials} == set(own)
        for trial in trials:
            a, b = own[trial.motion].stimuli
            assert (*trial.methods, trial.a_first) == ("geodesic", "cut", group == 0)
            assert trial.stimuli == ((a, b) if group == 0 else (b, a))


def test_a_plan_survives_its_json(rating_protocol: Protocol, make_stimuli: Callable[[Protocol], FakeStimuli]) -> None:
    plan = draw_plan(rating_protocol, make_stimuli(rating_protocol).pairs, "p01")
    assert plan_from_json(plan.to_json()) == plan


EARLIER = {
    "trial": 1, "study": "s", "task": "same-different", "repeat": 2, "pair": "s/walk/+5", "motion": "walk",
    "category": "c", "first": "b", "second": "a", "difference_frames": 5, "reference_first": False,
    "method_a": "geodesic", "method_b": "geodesic", "a_first": None, "role": "trial", "expected": "",
}  # fmt: skip


def test_a_plan_of_version_1_is_read() -> None:
    """It had two slots at most, under keys of their own."""
    liked = {**EARLIER, "task": "preference", "difference_frames": None, "reference_first": None, "a_first": True}
    liked |= {"first": "a", "second": "b", "method_b": "fixed"}
    rated = {**liked, "task": "rating", "second": "", "method_b": "", "a_first": None}
    plan = {"protocol": "p", "protocol_sha256": "0", "participant": "p01", "seed": 3, "group": 0}
    text = json.dumps({"version": 1, **plan, "trials": [EARLIER, liked, rated]})
    trials = plan_from_json(text).trials
    assert trials[0] == Trial(
        1, "s", "same-different", 2, "s/walk/+5", "walk", "c", ("b", "a"), (1, 0), ("geodesic", "geodesic"), 5
    )
    assert (trials[1].stimuli, trials[1].members, trials[1].methods) == (("a", "b"), (0, 1), ("geodesic", "fixed"))
    assert (trials[2].stimuli, trials[2].members, trials[2].methods) == (("a",), (0,), ("geodesic",))


def test_what_is_no_plan_is_refused(toy_protocol: Protocol, toy_stimuli: FakeStimuli) -> None:
    with pytest.raises(SessionError, match="Expected a participant's name, found none"):
        draw_plan(toy_protocol, toy_stimuli.pairs, " ")
    with pytest.raises(SessionError, match="Expected pairs for the study 'liking', found none"):
        draw_plan(toy_protocol, toy_stimuli.pairs[:3], "p01")
    text = draw_plan(toy_protocol, toy_stimuli.pairs, "p01").to_json()
    with pytest.raises(SessionError, match="Expected a plan of version 2 or older, found 9"):
        plan_from_json(text.replace('"version":2', '"version":9'))
    with pytest.raises(SessionError, match="Expected a stored plan"):
        plan_from_json("{}")
