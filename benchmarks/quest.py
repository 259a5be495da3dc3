"""What QUEST+ saves against constant stimuli, and what a trial costs: `python benchmarks/quest.py [--people 300]`.

People with known thresholds answer, by two noisy percepts and a criterion (code of its own), the 42 pairs of 2004's
study one for one transition after another: seven levels, 18 pairs a side and six without a difference. Others like
them answer QUEST+, with one trial in seven without a difference. Both are read by the same posterior, so that only the
choice of trials differs. Printed are the root mean square of the thresholds' errors in natural logarithms, and the
trials that QUEST+ needs for the error of the 42 pairs. The second table is the time of one update and choice on grids
of several sizes; with `pip install questplus json_tricks xarray` (GPL, not a dependency), that of questplus in the same
run.
"""

from __future__ import annotations

import argparse
import importlib
import statistics
import time

import numpy as np

from study.models.quest_plus import QuestPlus, QuestRule

RULE = QuestRule("same-different", tuple(range(1, 21)), 8.0, 0.8, 2.0, 1.0, 0.1, 0.45, 1, 100, 1.0)
CONSTANT = {"shorter": (5, 10, 15), "longer": (5, 10, 20)}
DELTA = 2.5498586
"""d' at which an observer with the best criterion is right in 75% of the pairs, by scipy's normal distribution."""
COUNTS = (8, 10, 12, 14, 16, 18, 21, 24)


def percept(rng, frames, threshold, criterion, lapse):
    """Whether a pair is answered rightly."""
    first, second = rng.normal([0.0, DELTA * frames / threshold])
    different = abs(first - second) > criterion if rng.random() >= lapse else rng.random() < 0.5
    return bool(different == bool(frames))


def person(rng):
    threshold = 8.0 * np.exp(0.4 * rng.standard_normal())
    return threshold, max(0.3, 2.0 + 0.5 * rng.standard_normal()), rng.uniform(0, 0.06)


def constant(rng, who, levels):
    track = RULE.begin()
    for _ in range(6):
        track = RULE.beside(track, percept(rng, 0, *who))
        for level in levels:
            track = RULE.after(track, level, percept(rng, level, *who))
    return RULE.found(track).frames


def adaptive(rng, who):
    """Thresholds after each number of trials of `COUNTS`; a sixth as many beside them show no difference."""
    track, found = RULE.begin(), []
    for trial in range(1, max(COUNTS) + 1):
        if trial % 3 == 1:  # as many without a difference as with one level of the constant stimuli
            track = RULE.beside(track, percept(rng, 0, *who))
        level = RULE.due(track)
        track = RULE.after(track, level, percept(rng, level, *who))
        if trial in COUNTS:
            found.append(RULE.found(track).frames)
    return found


def saved(people):
    rng = np.random.default_rng(1)
    fixed, free = [], []
    for _ in range(people):
        who = person(rng)
        fixed += [np.log(constant(rng, who, levels) / who[0]) for levels in CONSTANT.values()]
        free += [np.log(np.array(adaptive(rng, who)) / who[0]) for _ in CONSTANT]

    def off(errors):
        return np.sqrt(np.mean(np.square(errors), axis=0))

    errors = off(np.array(free))
    print(f"constant stimuli, 18 trials a side: {off(np.array(fixed)):.3f}")
    for count, error in zip(COUNTS, errors, strict=True):
        print(f"QUEST+, {count:2} trials a side: {error:.3f}")
    needed = float(np.interp(-off(np.array(fixed)), -errors, COUNTS))
    print(f"QUEST+ needs {needed:.1f} trials for the error of 18: {needed / 18:.2f} of them")


def timed(work, times):
    seconds = []
    for _ in range(times):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return 1000 * statistics.median(seconds)


def weibull(levels, thresholds, slopes, lapses):
    t, s, lapse = (part.ravel() for part in np.meshgrid(thresholds, slopes, lapses, indexing="ij"))
    chances = 1 - lapse - (0.5 - lapse) * np.exp(-(10 ** (s * (levels[:, None] - t) / 20)))
    return QuestPlus((thresholds, slopes, lapses), np.clip(chances, 1e-9, 1 - 1e-9), np.full(len(t), 1 / len(t)))


def speed():
    levels = np.linspace(-40, 0, 30)
    for shape in ((30, 20, 4), (50, 20, 4)):
        axes = np.linspace(-40, 0, shape[0]), np.linspace(2, 5, shape[1]), np.linspace(0.01, 0.04, shape[2])
        quest, rng = weibull(levels, *axes), np.random.default_rng(0)
        yes, no = rng.integers(0, 4, (2, 30))
        ours = timed(lambda: quest.next_level(quest.posterior(yes, no)), 200)  # noqa: B023
        print(f"grid of {' x '.join(map(str, shape))} and 30 levels: {ours:.2f} ms a trial", end="")
        try:
            peer = importlib.import_module("questplus")
        except ImportError as missing:
            print(f" (no peer: {missing})")
            continue
        other = peer.QuestPlus(
            stim_domain={"intensity": levels},
            param_domain={"threshold": axes[0], "slope": axes[1], "lower_asymptote": 0.5, "lapse_rate": axes[2]},
            outcome_domain={"response": ["Correct", "Incorrect"]}, func="weibull", stim_scale="dB",
            stim_selection_method="min_entropy", param_estimation_method="mean",
        )  # fmt: skip

        def trial():
            other.update(stim={"intensity": other.next_stim["intensity"]}, outcome={"response": "Correct"})  # noqa: B023

        theirs = timed(trial, 15)
        print(f"; questplus {theirs:.1f} ms, {theirs / ours:.0f} times as long")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--people", type=int, default=300)
    saved(parser.parse_args().people)
    speed()


if __name__ == "__main__":
    main()
