"""Cells for same-different studies: groups of observers with known thresholds, and what became of every estimate.

`2004` are cells in the design of the 2004 study (7 levels, 6 answers each) with 8, 20 and 35 people who are alike or
differ; `other` are designs written down before any of them was run, unlike it in levels, thresholds, criterion and
rates.

*Spread* is the standard deviation between people of log sensitivity (so of log thresholds, but for the criterion) and
of the criterion. There are two truths: the threshold of the median observer, and where the mean curve of endlessly many
such people crosses 75%. They are one and the same where people are alike.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from study.analysis.same_different.counts import Counts
from study.analysis.same_different.interpolation import crossing_of_lines, crossings
from study.analysis.same_different.mixed import fit_mixed_thresholds
from study.analysis.same_different.model import fit_model

SIDES = ("shorter", "longer")


@dataclass(frozen=True)
class Group:
    """People, their typical thresholds in frames, their spread, and the levels with the answers at each."""

    name: str
    people: int
    spread: float
    levels: tuple[float, ...] = (-15.0, -10.0, -5.0, 0.0, 5.0, 10.0, 20.0)
    answers: int = 6
    shorter: float = 8.0
    longer: float = 7.0
    criterion: float = 2.0
    lapse: float = 0.02


DESIGN_2004 = tuple(
    Group(f"2004-{people}-{spread:g}", people, spread) for people in (8, 20, 35) for spread in (0.0, 0.15, 0.3)
)
OTHER = (
    Group("other-12-0.2", 12, 0.2, (-18.0, -12.0, -6.0, 0.0, 6.0, 12.0, 18.0), 4, 9.5, 11.0, 1.5, 0.04),
    Group("other-24-0.25", 24, 0.25, (-16.0, -8.0, 0.0, 8.0, 16.0), 10, 10.0, 6.5, 2.4, 0.0),
    Group("other-16-0.1", 16, 0.1, (-12.0, -9.0, -6.0, -3.0, 0.0, 3.0, 6.0, 9.0, 12.0), 3, 6.0, 7.5, 1.8, 0.03),
    Group("other-1-0", 1, 0.0, (-15.0, -10.0, -5.0, 0.0, 5.0, 10.0, 20.0), 20, 9.0, 8.0, 1.7, 0.02),
    Group("other-10-0.4", 10, 0.4, (-20.0, -14.0, -8.0, 0.0, 8.0, 14.0, 20.0), 8, 9.0, 9.0, 2.2, 0.01),
)


def chances(group, levels, factor, criterion):
    """P("different") at these levels of observers with these sensitivities (1: typical) and criteria."""
    delta = np.linspace(0, 12, 120001)
    tails = ndtr((delta - group.criterion) / np.sqrt(2)) + ndtr((-delta - group.criterion) / np.sqrt(2))
    unit = np.interp(0.75, group.lapse / 2 + (1 - group.lapse) * tails, delta)
    distance = factor[:, None] * unit * np.where(levels < 0, -levels / group.shorter, levels / group.longer)
    tails = ndtr((distance - criterion[:, None]) / np.sqrt(2)) + ndtr((-distance - criterion[:, None]) / np.sqrt(2))
    return group.lapse / 2 + (1 - group.lapse) * tails


def draw_people(rng, group, count):
    factor = np.exp(group.spread * rng.normal(size=count))
    return factor, np.maximum(group.criterion + group.spread * rng.normal(size=count), 0.2)


def truths(group):
    """By side: the median observer's threshold, the crossing of the group's curve, and of straight lines on it."""
    rng, levels = np.random.default_rng(0), np.array(group.levels)
    mean = chances(group, levels, *draw_people(rng, group, 300_000)).mean(axis=0)
    people = draw_people(rng, group, 20_000)
    found = {}
    for side, sign, typical in (("shorter", -1, group.shorter), ("longer", 1, group.longer)):
        line = np.linspace(0.6, 1.8, 121) * typical
        curve = crossing_of_lines(line, chances(group, sign * line, *people).mean(axis=0))
        order = np.argsort(sign * levels)[np.sort(sign * levels) >= 0]
        lines = crossing_of_lines(sign * levels[order], mean[order])
        found[side] = (typical, float(curve), float(lines))
    return found


def run(group, studies, seed):
    """Simulate and fit: a list of rows of the table, one for each side and estimate."""
    rng, levels = np.random.default_rng([seed, sum(group.name.encode())]), np.array(group.levels)
    true = truths(group)
    kinds = (("curve of the group", 1), ("mixed: median observer", 0), ("mixed: group", 1), ("straight lines", 2))
    rows = {(side, kind): [] for side in SIDES for kind, _ in kinds}
    spent, spreads = [], []
    names = tuple(map(str, range(group.people)))
    for _ in range(studies):
        share = chances(group, levels, *draw_people(rng, group, group.people))
        different = rng.binomial(group.answers, share).astype(float)
        counts = Counts(names, levels, different, np.full(different.shape, float(group.answers)))
        clocks = [time.process_time()]
        fit = fit_model(counts)
        clocks.append(time.process_time())
        mixed = fit_mixed_thresholds(counts)
        clocks.append(time.process_time())
        spent.append(np.diff(clocks))
        read = crossings(counts, resamples=2)
        if not isinstance(mixed, str):
            spreads.append((mixed.sensitivity_spread, mixed.alike_p_value < 0.05))
        for side in SIDES:
            one = None if isinstance(fit, str) else fit.jnd[side]
            two = (None, None) if isinstance(mixed, str) else (mixed.typical[side], mixed.population[side])
            found = (one, *two, read[side])
            for (kind, which), threshold in zip(kinds, found, strict=True):
                rows[side, kind].append(verdict(threshold, true[side][which]))
    milliseconds = 1000 * np.median(spent, axis=0)
    spread, alike = np.mean(spreads, axis=0) if spreads else (np.nan, np.nan)
    return [
        summary(group, studies, seed, side, kind, true[side][which], rows[side, kind])
        | {"spread found": float(spread), "differ at 5%": float(alike)}
        | {"ms fit": float(milliseconds[0]), "ms mixed": float(milliseconds[1])}
        for side in SIDES
        for kind, which in kinds
    ]


def verdict(threshold, truth):
    """Estimate, standard error, whether the interval holds the truth, whether it has an open end, and whether it is."""
    if threshold is None:
        return np.nan, np.nan, np.nan, np.nan, 0.0
    low, high = threshold.interval.low, threshold.interval.high
    inside = (low is None or low <= truth) and (high is None or truth <= high)
    return (
        np.nan if threshold.frames is None else threshold.frames,
        np.nan if threshold.standard_error is None else threshold.standard_error,
        float(inside),
        float(low is None or high is None),
        1.0,
    )


def summary(group, studies, seed, side, kind, truth, rows):
    value, error, inside, is_open, fitted = np.array(rows, dtype=float).T
    known = value[np.isfinite(value)]
    covered = float(np.nanmean(inside)) if fitted.any() else np.nan
    return {"cell": group.name, "side": side, "estimate": kind, "studies": studies, "seed": seed, "true": truth,
            "mean": float(known.mean()) if len(known) else np.nan,
            "bias": float(known.mean() - truth) if len(known) else np.nan,
            "bias error": float(known.std() / len(known) ** 0.5) if len(known) else np.nan,
            "sd": float(known.std()) if len(known) else np.nan,
            "se": float(np.nanmean(error)) if np.isfinite(error).any() else np.nan,
            "covers": covered, "error": (covered * (1 - covered) / studies) ** 0.5,
            "open": float(np.nanmean(is_open)) if fitted.any() else np.nan, "fitted": float(fitted.mean())}  # fmt: skip
