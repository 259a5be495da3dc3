"""How far intervals and tests can be trusted: simulated studies with known truth through the real analysis.

Run it from the repository: `python benchmarks/calibration.py [studies] [same-different|preference]`; 2,000 studies a
cell take some minutes. Observers are drawn here, by code that the analysis does not use. The design is 2004's: 35
people (or fewer), 6 answers at each of 7 levels, or 8 preferences.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from scipy.special import ndtr
from scipy.stats import beta

from study.analysis.preference import participant_tests, published_test
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


if __name__ == "__main__":
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    wanted = sys.argv[2] if len(sys.argv) > 2 else "all"
    if wanted in ("all", "preference"):
        preference(number)
    if wanted in ("all", "same-different"):
        same_different(number)
