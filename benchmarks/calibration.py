"""How far intervals and tests can be trusted: simulated studies with known truth through the real analysis.

Run it from the repository: `python benchmarks/calibration.py [studies] [preference|psychometric|mixed|same-different]`;
2,000 studies a cell take some minutes. Observers are drawn here, by code that the analysis does not use. In
2004's design: 35 people (or fewer), 6 answers at each of 7 levels, or 8 preferences.
"""

from __future__ import annotations

import sys
import time

import numpy as np
import pandas as pd
from scipy.special import ndtr
from scipy.stats import beta

from study.analysis.group_models import psychometric_mixed
from study.analysis.preference import participant_tests, published_test
from study.analysis.psychometric import fit_psychometric, make_model
from study.analysis.psychometric_likelihood import fit_likelihood
from study.analysis.same_different import Counts, crossing_of_lines, crossings
from study.analysis.same_different_model import ModelFit, fit_model

LEVELS = np.array([-15.0, -10, -5, 0, 5, 10, 20])
CRITERION, LAPSE = 2.0, 0.02
SIDES = (("shorter", 8.0), ("longer", 7.0))


def chances(scale, criterion):
    """P("different") at the levels for observers whose own thresholds would be 8 and 7 frames at scale 1."""
    delta = np.linspace(0, 10, 100001)
    tails = ndtr((delta - CRITERION) / np.sqrt(2)) + ndtr((-delta - CRITERION) / np.sqrt(2))
    unit = np.interp(0.75, LAPSE / 2 + (1 - LAPSE) * tails, delta)
    distance = scale[:, None] * unit * np.where(LEVELS < 0, -LEVELS / 8, LEVELS / 7)
    tails = ndtr((distance - criterion[:, None]) / np.sqrt(2)) + ndtr((-distance - criterion[:, None]) / np.sqrt(2))
    return LAPSE / 2 + (1 - LAPSE) * tails


def people(rng, count, spread):
    """Observers who differ in sensitivity (logarithm) and criterion by this standard deviation."""
    return chances(
        np.exp(spread * rng.normal(size=count)), np.maximum(CRITERION + spread * rng.normal(size=count), 0.2)
    )


def group_truth(spread):
    """Where the percentages of endlessly many such observers cross 75%: the curve itself, and straight lines."""
    rng = np.random.default_rng(0)
    mean = people(rng, 400_000, spread).mean(axis=0)
    lines = [crossing_of_lines(-LEVELS[3::-1], mean[3::-1]), crossing_of_lines(LEVELS[3:], mean[3:])]
    scale = np.exp(spread * rng.normal(size=4000))
    criterion = np.maximum(CRITERION + spread * rng.normal(size=4000), 0.2)
    factors = np.linspace(0.5, 2.0, 301)
    # All levels stretch alike, so one level stretched until it reaches 75% gives the threshold of the curve.
    curve = []
    for place in (2, 4):
        reached = [chances(scale * factor, criterion)[:, place].mean() for factor in factors * 1.6]
        curve.append(abs(LEVELS[place]) * np.interp(0.75, reached, factors * 1.6))
    return curve, [float(line) for line in lines]


def same_different(studies):
    """Coverage of 95% intervals, bias, and standard errors against the scatter of estimates."""
    print(f"{'people':>6} {'spread':>6} {'side':>8} {'truth':>6} {'mean':>6} {'sd':>5} {'se':>5} {'cover':>6}   lines: "
          f"{'truth':>6} {'mean':>6} {'cover':>6}")  # fmt: skip
    for count, spread in ((35, 0.0), (35, 0.15), (35, 0.3), (8, 0.0), (8, 0.15), (8, 0.3)):
        rng, (curve, lines) = np.random.default_rng(1), group_truth(spread)
        rows = {side: [] for side, _ in SIDES}
        started = time.perf_counter()
        for _ in range(studies):
            different = rng.binomial(6, people(rng, count, spread)).astype(float)
            counts = Counts(tuple(map(str, range(count))), LEVELS, different, np.full(different.shape, 6.0))
            fit, read = fit_model(counts), crossings(counts, resamples=2)
            for place, (side, _) in enumerate(SIDES):
                rows[side].append((*verdict(fit, side, curve[place]), *verdict(read, side, lines[place])))
        for place, (side, _) in enumerate(SIDES):
            mean, error, inside, read_mean, _, read_inside = np.array(rows[side], dtype=float).T
            print(f"{count:6} {spread:6} {side:>8} {curve[place]:6.2f} {np.nanmean(mean):6.2f} {np.nanstd(mean):5.2f} "
                  f"{np.nanmean(error):5.2f} {inside.mean():6.3f}          {lines[place]:6.2f} "
                  f"{np.nanmean(read_mean):6.2f} {read_inside.mean():6.3f}", flush=True)  # fmt: skip
        print(f"       {1000 * (time.perf_counter() - started) / studies:.0f} ms a study")


def verdict(found, side, truth):
    """Estimate, standard error, and whether the interval holds the truth; open ends hold all beyond."""
    if isinstance(found, str):
        return np.nan, np.nan, True
    threshold = found.jnd[side] if isinstance(found, ModelFit) else found[side]
    low, high = threshold.interval.low, threshold.interval.high
    inside = (low is None or low <= truth) and (high is None or truth <= high)
    return threshold.frames or np.nan, threshold.standard_error or np.nan, inside


def preference(studies):
    """Type I error at nominal .05 of the test over participants, the robust one, and the published pooled one."""
    print(f"{'correlation':>11} {'participants':>12} {'robust':>7} {'published':>9}")
    for correlation in (0.0, 0.1, 0.2, 0.3):
        rng, wrong = np.random.default_rng(2), []
        shape = 0.5 * (1 / correlation - 1) if correlation else None
        for _ in range(studies):
            own = beta.rvs(shape, shape, size=35, random_state=rng) if shape else np.full(35, 0.5)
            chosen = rng.binomial(8, own).astype(float)
            tests = participant_tests(chosen, np.full(35, 8.0))
            wrong.append((tests["p_value"], tests["robust_p_value"], published_test(int(chosen.sum()), 280).p_value))
        rates = (np.array(wrong, dtype=float) < 0.05).mean(axis=0)
        print(f"{correlation:11} {rates[0]:12.3f} {rates[1]:7.3f} {rates[2]:9.3f}", flush=True)


def psychometric(studies):
    """Coverage of posterior and profile intervals of thresholds, at small and usual sizes, and milliseconds a fit."""
    heads = ("task", "levels", "answers", "rho", "bias", "posterior", "ms", "profile", "ms")
    print(" ".join(f"{head:>9}" for head in heads))
    cells = (("2afc", 5, 20, 0.0), ("2afc", 7, 40, 0.0), ("2afc", 7, 40, 0.02),
             ("yes-no", 7, 20, 0.0), ("yes-no", 7, 50, 0.0), ("yes-no", 7, 50, 0.02))  # fmt: skip
    for task, count, answers, rho in cells:
        rng, levels, model = np.random.default_rng(4), np.arange(1.0, count + 1), make_model(task)
        guess, middle = (0.5, levels.mean()) if task == "2afc" else (0.05, levels.mean())
        share = guess + (1 - guess - 0.02) * ndtr((levels - middle) / 3 * 2 * 1.6449)
        rows, spent = [], np.zeros(2)
        for place in range(studies):
            own = rng.beta(share * (1 / rho - 1), (1 - share) * (1 / rho - 1)) if rho else share
            yes, shown = rng.binomial(answers, own), np.full(count, answers)
            started = time.perf_counter()
            fit = fit_psychometric(levels, yes, shown, model)
            spent[0] += time.perf_counter() - started
            row = [fit.threshold.value or np.nan, holds(fit.threshold.interval, middle)]
            if place < studies // 10:
                started = time.perf_counter()
                row.append(holds(fit_likelihood(levels, yes, shown, model).interval, middle))
                spent[1] += time.perf_counter() - started
            else:
                row.append(np.nan)
            rows.append(row)
        mean, inside, profile = np.nanmean(np.array(rows, dtype=float), axis=0)
        numbers = (mean - middle, inside, 1000 * spent[0] / studies, profile, 1000 * spent[1] / (studies // 10))
        print(f"{task:>9} {count:9} {answers:9} {rho:9} " + " ".join(f"{n:9.3f}" for n in numbers), flush=True)


def holds(interval, truth):
    """Whether an interval holds the truth; open ends hold all beyond."""
    return (interval.low is None or interval.low <= truth) and (interval.high is None or truth <= interval.high)


def mixed(studies):
    """Coverage and time of the mixed model's threshold: 8 participants, 7 levels, 30 answers each, 2AFC."""
    rng, inside, estimates = np.random.default_rng(5), [], []
    levels, who = np.tile(np.arange(7.0), 8), np.repeat(np.arange(8), 7)
    started = time.perf_counter()
    for _ in range(studies):
        own = rng.multivariate_normal([-3.0, 1.0], [[0.16, 0.0], [0.0, 0.04]], size=8)
        chance = 0.5 + 0.5 * ndtr(own[who, 0] + own[who, 1] * levels)
        table = pd.DataFrame({"participant": who, "level": levels, "yes": rng.binomial(30, chance), "shown": 30})
        found = psychometric_mixed(table, guess=0.5)
        if found["threshold"] is not None:
            inside.append(found["low"] <= 3.0 <= found["high"])
            estimates.append(found["threshold"])
    spent = 1000 * (time.perf_counter() - started) / studies
    print(f"mixed: {len(inside)} fitted, mean {np.mean(estimates):.3f} (true 3), covers {np.mean(inside):.3f}")
    print(f"{spent:.0f} ms a study")


if __name__ == "__main__":
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    wanted = sys.argv[2] if len(sys.argv) > 2 else "all"
    if wanted in ("all", "preference"):
        preference(number)
    if wanted in ("all", "psychometric"):
        psychometric(number)
    if wanted in ("all", "mixed"):
        mixed(number)
    if wanted in ("all", "same-different"):
        same_different(number)
