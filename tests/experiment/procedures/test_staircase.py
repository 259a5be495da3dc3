"""Staircases in a session: folds that depend on seed and answers alone, and observers that share no code with them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from study.experiment.procedures.procedure import Course, Procedure
from study.experiment.procedures.staircase import Staircase
from study.experiment.protocol.errors import KeyMismatchError
from study.experiment.protocol.studies import procedure_of
from study.tasks.answer import Answer
from study.tasks.trial import Pair, Trial

SETTINGS = Staircase(start_frames=12, most_frames=20, steps_frames=(4, 2, 1))


def pairs_for(settings: Staircase, motions: tuple[str, ...] = ("walk",)) -> tuple[Pair, ...]:
    return tuple(
        Pair(
            f"jnd/{motion}/{level:+d}",
            "jnd",
            "same-different",
            motion,
            motion,
            (f"{motion}-k", f"{motion}{level:+d}" if level else f"{motion}-k"),
            ("geodesic", "geodesic"),
            level,
        )
        for motion in motions
        for level in settings.differences()
    )


def begun(settings: Staircase, seed: int = 1, motions: tuple[str, ...] = ("walk",), repeats: int = 1) -> Procedure:
    most = settings.trials(len(motions), repeats)[1]
    course = Course("jnd", 5, most, settings, pairs_for(settings, motions), ((0, 1), (1, 0)), repeats)
    return settings.begun(course, np.random.default_rng(seed))


Respond = Callable[[Trial], str | None]


def run(procedure: Procedure, respond: Respond) -> tuple[list[Trial], list[Answer]]:
    """All trials and answers of one participant."""
    trials: list[Trial] = []
    answers: list[Answer] = []
    while due := procedure.next(answers):
        assert len(due) == 1
        trials.append(due[0])
        value = respond(due[0])
        answers.append(Answer(due[0].trial, "", 1, value, None if value is None else 1.0))
    return trials, answers


def chance(seed: int, share: float = 0.7, missed: float = 0.05) -> Respond:
    rng = np.random.default_rng(seed)

    def respond(trial: Trial) -> str | None:
        if rng.random() < missed:
            return None
        different = bool(trial.difference_frames) == bool(rng.random() < share)
        return "different" if different else "same"

    return respond


def test_trials_are_numbered_in_order_and_show_what_they_say() -> None:
    trials, _ = run(begun(SETTINGS, motions=("walk", "run")), chance(1))
    assert [trial.trial for trial in trials] == list(range(5, 5 + len(trials)))
    for trial in trials:
        reference, comparison = (trial.stimuli[trial.members.index(member)] for member in (0, 1))
        level = trial.difference_frames or 0
        assert reference == f"{trial.motion}-k"
        assert comparison == (f"{trial.motion}{level:+d}" if level else reference)
    assert {trial.members for trial in trials} == {(0, 1), (1, 0)}
    assert {trial.motion for trial in trials} == {"walk", "run"}
    first = {}
    for trial in trials:
        if trial.difference_frames:
            first.setdefault((trial.motion, trial.difference_frames > 0), abs(trial.difference_frames))
    assert first == {(motion, longer): 12 for motion in ("walk", "run") for longer in (True, False)}


@pytest.mark.parametrize("seed", range(6))
def test_the_same_seed_and_answers_give_the_same_trials_from_any_place_on(seed: int) -> None:
    """Resuming is folding again: after any number of answers a fresh procedure gives the trial that came."""
    trials, answers = run(begun(SETTINGS, seed), chance(seed))
    for place in range(len(trials)):
        assert begun(SETTINGS, seed).next(answers[:place]) == (trials[place],)
    assert begun(SETTINGS, seed).next(answers) == ()
    other, _ = run(begun(SETTINGS, seed + 100), chance(seed))
    assert [trial.difference_frames for trial in other] != [trial.difference_frames for trial in trials]


@pytest.mark.parametrize("settings", [SETTINGS, replace(SETTINGS, side="longer", catch_every=0, down=1, up_times=3)])
def test_candidates_name_the_trial_that_comes(settings: Staircase) -> None:
    procedure = begun(settings, 3)
    trials, answers = run(procedure, chance(8))
    for place in range(len(trials) - 1):
        candidates = procedure.candidates(answers[:place])
        assert trials[place + 1] in candidates
        assert len(candidates) <= 3
    assert None in procedure.candidates(answers[:-1])
    assert procedure.candidates(answers) == (None,)


@pytest.mark.parametrize("seed", range(8))
def test_trials_lie_between_the_fewest_and_the_most(seed: int) -> None:
    settings = replace(SETTINGS, most_trials=17 + seed, catch_every=(0, 2, 3, 5)[seed % 4])
    fewest, most = settings.trials(2, 1)
    count = len(run(begun(settings, seed, ("walk", "run")), chance(seed, 0.5 + 0.05 * seed))[0])
    assert fewest <= count <= most


def test_the_fewest_trials_are_reached_by_whoever_turns_at_once() -> None:
    settings = replace(SETTINGS, down=1, catch_every=0, side="longer", reversals=4, averaged=2)
    turns = iter([True, False] * 20)
    trials, _ = run(begun(settings), lambda _: "different" if next(turns) else "same")
    assert len(trials) == settings.trials(1, 1)[0] == 5


def test_trials_without_a_difference_stand_one_in_each_block_and_move_nothing() -> None:
    settings = replace(SETTINGS, catch_every=4, side="longer")
    trials, _ = run(begun(settings, 2), chance(2))
    for start in range(0, len(trials) - 3, 4):
        assert sum(trial.difference_frames == 0 for trial in trials[start : start + 4]) == 1
    lies = run(begun(settings, 2), lambda _: "different")[0]
    levels = [trial.difference_frames for trial in lies if trial.difference_frames]
    assert levels[:4] == [12, 12, 8, 8]


def test_differences_are_all_that_may_come_and_no_others() -> None:
    settings = Staircase(start_frames=16, most_frames=24, least_frames=2, steps_frames=(8, 4, 2), side="shorter")
    assert settings.differences() == (*range(-24, 0, 2), 0)
    assert replace(settings, catch_every=0, side="both").differences() == tuple(
        sorted(sign * level for level in range(2, 25, 2) for sign in (-1, 1))
    )
    seen = {trial.difference_frames for seed in range(40) for trial in run(begun(settings, seed), chance(seed))[0]}
    assert seen <= set(settings.differences())


def test_staircases_are_interleaved_evenly() -> None:
    counts: Counter[tuple[str, bool]] = Counter()
    for seed in range(30):
        trials, _ = run(begun(SETTINGS, seed, ("walk", "run")), chance(seed))
        counts.update((one.motion, one.difference_frames > 0) for one in trials[:40] if one.difference_frames)
    total = sum(counts.values())
    assert all(abs(count - total / 4) < 4 * math.sqrt(total * 3 / 16) for count in counts.values())


def test_progress_never_falls_and_ends_at_its_end() -> None:
    procedure = begun(SETTINGS, 4, ("walk", "run"))
    _, answers = run(procedure, chance(4))
    shares = [procedure.progress(answers[:place]) for place in range(len(answers) + 1)]
    done, most = zip(*shares, strict=True)
    assert list(done) == sorted(done)
    assert (done[0], done[-1], set(most)) == (0, most[0], {SETTINGS.trials(2, 1)[1]})


@pytest.mark.parametrize(
    ("keys", "target"),
    [({"down": 2}, 0.7071), ({"down": 3}, 0.7937), ({"down": 1, "up_times": 3}, 0.75), ({"down": 1}, 0.5)],
)
def test_thresholds_are_those_of_the_observer(keys: dict[str, int], target: float) -> None:
    """Mean of the last reversals over people whose curve is written here, against the target in closed form."""
    settings = Staircase(
        start_frames=30, most_frames=60, steps_frames=(8, 4, 2, 1), reversals=20, averaged=16, most_trials=400,
        side="longer", **keys,
    )  # fmt: skip
    middle, width = 20.0, 5.0
    means = []
    for seed in range(40):
        rng = np.random.default_rng([seed, 7])

        def respond(trial: Trial, rng: np.random.Generator = rng) -> str:
            seen = 1 / (1 + math.exp(-((trial.difference_frames or 0) - middle) / width))
            return "different" if rng.random() < seen else "same"

        trials, _ = run(begun(settings, seed), respond)
        levels = [trial.difference_frames for trial in trials if trial.difference_frames]
        steps = [(a, b) for a, b in pairwise(levels) if a != b]
        turns = [now[0] for before, now in pairwise(steps) if (now[1] > now[0]) != (before[1] > before[0])]
        means.append(float(np.mean(turns[-15:])))
    expected = middle + width * math.log(target / (1 - target))
    assert float(np.mean(means)) == pytest.approx(expected, abs=0.7)


def test_settings_say_what_is_wrong() -> None:
    table = {"name": "staircase", "start_frames": 12, "most_frames": 20}
    assert procedure_of(table) == replace(SETTINGS, steps_frames=(4, 2, 1))
    for bad, key, words in (
        ({"start_frames": 30}, "start_frames", "from least_frames to most_frames, 1 to 20, found 30"),
        ({"down": 11}, "down", "expected at most 10, found 11"),
        ({"steps_frames": [4, 0]}, "steps_frames", "expected at least 1 in frames, found 0"),
        ({"start_frames": 1.5}, "start_frames", "expected a whole number in frames, found 1.5"),
        ({"start_frames": True}, "start_frames", "expected a whole number in frames, found True"),
        ({"side": "left"}, "side", "'both', 'shared', 'shorter' or 'longer', found 'left'"),
        ({"side": "longest"}, "side", "did you mean 'longer'"),
        ({"name": "staircases"}, "name", "did you mean 'staircase'"),
        ({"revesals": 3}, "revesals", "unknown key; did you mean 'reversals'"),
        ({"xyz": 3}, "xyz", "unknown key; valid keys here: start_frames"),
        ({"steps_frames": 3}, "steps_frames", "expected a list"),
        ({"steps_frames": []}, "steps_frames", "expected one step or more"),
        ({"averaged": 9}, "averaged", "at most the 8 reversals, found 9"),
        ({"catch_every": 1}, "catch_every", "leaves no other trial"),
    ):
        with pytest.raises(KeyMismatchError, match=words) as raised:
            procedure_of(table | bad)
        assert raised.value.location[0] == key
    with pytest.raises(KeyMismatchError, match="expected this key, found none"):
        procedure_of({"name": "staircase", "start_frames": 3})
