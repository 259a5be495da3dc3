"""Cells for psychometric functions: observers with known thresholds, placements of levels, and what became of a fit.

Three sets, so that a prior chosen on one can be judged on another:

- `first`: the cells with which the prior of the overdispersion was chosen;
- `check`: written down before any of them was run, unlike the first in levels, widths, rates, sigmoids and placements;
- `confirm`: written down after `check` had led to another prior of the lapse rate, before they were run, with lapse
  rates that this prior holds for unlikely;
- `drawn:SEED`: drawn at random from the ranges in `drawn_cells`, by a seed, so that nobody chose them.

`prior` is no cell of observers: truths are drawn from the priors that the analysis uses, so that 95% has to come out
but for errors of the grid (simulation-based calibration, Talts et al. 2018).
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from scipy.stats import gumbel_l, logistic, norm

from study.analysis.psychometric.likelihood import fit_likelihood
from study.analysis.psychometric.model import LARGEST_GUESS, LARGEST_LAPSE, make_model
from study.analysis.psychometric.posterior import even_edges, fit_psychometric, quantiles
from study.models import posterior_grid

PEERS = {"normal": norm, "logistic": logistic, "gumbel": gumbel_l, "weibull": gumbel_l}


@dataclass(frozen=True)
class Cell:
    """One observer in one design.

    Levels are in any unit; for Weibull threshold and width are those of the logarithm of the level. `correlation` is
    that of answers at one level, beyond the binomial. `up` > 0 makes a staircase: `up` right answers in a row make it
    harder, a wrong one easier, `answers` trials in all. `fitted` is the sigmoid of the analysis where it is not the
    observer's; `held` rates are known to the analysis.
    """

    name: str
    task: str
    levels: tuple[float, ...]
    answers: int
    threshold: float
    width: float
    lapse: float
    guess: float = 0.5
    sigmoid: str = "normal"
    correlation: float = 0.0
    up: int = 0
    fitted: str = ""
    held: bool = False


def steps(count):
    return tuple(float(place) for place in range(1, count + 1))


def old(name, task, count, answers, correlation):
    guess = 0.5 if task == "2afc" else 0.05
    return Cell(name, task, steps(count), answers, (count + 1) / 2, 3.0, 0.02, guess, correlation=correlation)


RISING = tuple(float(level) for level in np.round(0.02 * 1.6 ** np.arange(8), 4))

FIRST = (
    old("first-2afc-5x20", "2afc", 5, 20, 0.0),
    old("first-2afc-7x40", "2afc", 7, 40, 0.0),
    old("first-2afc-7x40-corr", "2afc", 7, 40, 0.02),
    old("first-yesno-7x20", "yes-no", 7, 20, 0.0),
    old("first-yesno-7x50", "yes-no", 7, 50, 0.0),
    old("first-yesno-7x50-corr", "yes-no", 7, 50, 0.02),
)
CHECK = (
    Cell("2afc-4x25-logistic", "2afc", steps(4), 25, 2.9, 2.0, 0.0, sigmoid="logistic"),
    Cell("2afc-5x10-shallow", "2afc", steps(5), 10, 3.0, 4.0, 0.03),
    Cell("2afc-6x30-gumbel-low", "2afc", steps(6), 30, 2.5, 3.5, 0.05, sigmoid="gumbel"),
    Cell("2afc-8x20-weibull", "2afc", RISING, 20, float(np.log(0.15)), 1.6, 0.01, sigmoid="weibull"),
    Cell("2afc-7x100-logistic", "2afc", steps(7), 100, 3.4, 2.5, 0.02, sigmoid="logistic"),
    Cell("2afc-8x15-uneven", "2afc", (0.0, 1.0, 2.0, 2.5, 3.0, 3.5, 4.0, 6.0), 15, 2.7, 2.2, 0.04),
    Cell("2afc-9x50-steep-high", "2afc", steps(9), 50, 6.5, 1.5, 0.02),
    Cell("2afc-staircase-60", "2afc", steps(9), 60, 4.5, 4.0, 0.02, up=2),
    Cell("2afc-staircase-150", "2afc", steps(9), 150, 5.2, 3.0, 0.03, sigmoid="logistic", up=3),
    Cell("4afc-6x20", "4afc", steps(6), 20, 3.2, 3.0, 0.02, guess=0.25),
    Cell("2afc-7x40-unlike", "2afc", steps(7), 40, 4.3, 3.0, 0.02, sigmoid="logistic", fitted="normal"),
    Cell("yesno-5x20-logistic", "yes-no", steps(5), 20, 2.6, 3.0, 0.03, 0.1, sigmoid="logistic"),
    Cell("yesno-9x10", "yes-no", steps(9), 10, 5.5, 4.0, 0.0, 0.02),
    Cell("yesno-4x40-gumbel", "yes-no", steps(4), 40, 2.2, 2.0, 0.05, 0.15, sigmoid="gumbel"),
    Cell("yesno-7x100-guessing", "yes-no", steps(7), 100, 4.8, 3.5, 0.02, 0.2),
    Cell("yesno-8x30-weibull", "yes-no", RISING, 30, float(np.log(0.1)), 1.8, 0.02, 0.05, sigmoid="weibull"),
    Cell("yesno-staircase-80", "yes-no", steps(9), 80, 5.3, 3.5, 0.02, 0.06, up=1),
    Cell("yesno-5x20-held", "yes-no", steps(5), 20, 2.8, 2.5, 0.0, 0.0, sigmoid="logistic", held=True),
    Cell("2afc-6x60-corr", "2afc", steps(6), 60, 3.2, 3.0, 0.02, correlation=0.01),
    Cell("yesno-6x40-corr", "yes-no", steps(6), 40, 3.2, 3.0, 0.02, 0.1, correlation=0.04),
)

CONFIRM = (
    Cell("c-2afc-7x30-lapse0.1", "2afc", steps(7), 30, 3.7, 3.0, 0.1),
    Cell("c-2afc-5x15-lapse0", "2afc", steps(5), 15, 2.7, 2.5, 0.0, sigmoid="logistic"),
    Cell("c-2afc-6x20-lapse0.06", "2afc", steps(6), 20, 4.1, 3.0, 0.06, sigmoid="gumbel"),
    Cell("c-2afc-9x12", "2afc", steps(9), 12, 4.2, 5.0, 0.03, sigmoid="logistic"),
    Cell("c-3afc-5x40", "3afc", steps(5), 40, 3.3, 2.5, 0.02, guess=1 / 3),
    Cell("c-2afc-8x60-weibull", "2afc", RISING, 60, float(np.log(0.08)), 1.4, 0.03, sigmoid="weibull"),
    Cell("c-2afc-staircase-100", "2afc", steps(8), 100, 4.0, 3.5, 0.04, up=2),
    Cell("c-yesno-6x25-lapse0.08", "yes-no", steps(6), 25, 3.4, 3.0, 0.08, 0.12, sigmoid="logistic"),
    Cell("c-yesno-8x15", "yes-no", steps(8), 15, 4.1, 4.5, 0.01, 0.08),
    Cell("c-yesno-5x60-gumbel", "yes-no", steps(5), 60, 3.1, 2.6, 0.03, 0.03, sigmoid="gumbel"),
    Cell("c-yesno-7x35-guess0.25", "yes-no", steps(7), 35, 4.4, 3.2, 0.02, 0.25),
)


def drawn_cells(seed, count=12):
    """Cells that nobody chose: 4 to 9 levels, 10 to 100 answers each, thresholds over the middle 60% of the levels."""
    rng, cells = np.random.default_rng(seed), []
    for place in range(count):
        task = ("2afc", "yes-no")[place % 2]
        levels = int(rng.integers(4, 10))
        answers = int(np.exp(rng.uniform(np.log(10), np.log(100))))
        threshold = float(1 + (levels - 1) * rng.uniform(0.2, 0.8))
        width = float(np.exp(rng.uniform(np.log(1.2), np.log(levels - 1))))
        guess = 0.5 if task == "2afc" else float(rng.uniform(0, 0.2))
        sigmoid = str(rng.choice(["normal", "logistic", "gumbel"]))
        lapse = float(rng.uniform(0, 0.06))
        name = f"drawn{seed}-{task.replace('-', '')}-{levels}x{answers}-{sigmoid}"
        cells.append(Cell(name, task, steps(levels), answers, threshold, width, lapse, guess, sigmoid))
    return tuple(cells)


def chance(cell, levels):
    """P("yes") of the observer, by scipy's distributions."""
    axis = np.log(levels) if cell.sigmoid == "weibull" else np.asarray(levels)
    peer = PEERS[cell.sigmoid]
    scale = cell.width / (peer.ppf(0.95) - peer.ppf(0.05))
    seen = peer.cdf((axis - cell.threshold) / scale + peer.ppf(0.5))
    return cell.guess + (1 - cell.guess - cell.lapse) * seen


def draw(cell, rng):
    """One study: levels, answers "yes", answers."""
    levels = np.array(cell.levels)
    share = chance(cell, levels)
    if cell.up:
        return levels, *staircase(cell, share, rng)
    if cell.correlation:
        size = 1 / cell.correlation - 1
        share = rng.beta(share * size, (1 - share) * size)
    return levels, rng.binomial(cell.answers, share).astype(float), np.full(len(levels), float(cell.answers))


def staircase(cell, share, rng):
    """`up` answers "yes" in a row go one level down, a "no" one up; the first trial is the easiest."""
    yes, shown, place, row = np.zeros(len(share)), np.zeros(len(share)), len(share) - 1, 0
    for right in rng.random(cell.answers):
        shown[place] += 1
        if right < share[place]:
            yes[place] += 1
            row += 1
            if row == cell.up:
                place, row = max(place - 1, 0), 0
        else:
            place, row = min(place + 1, len(share) - 1), 0
    return yes, shown


def model_of(cell):
    sigmoid = cell.fitted or cell.sigmoid
    if cell.task == "yes-no":
        rates = {"guess": cell.guess, "lapse": cell.lapse} if cell.held else {}
        return make_model("yes-no", sigmoid=sigmoid, **rates)
    return make_model("2afc", sigmoid=sigmoid, choices=int(cell.task[0]))


def run(cell, studies, seed, profile=True):
    """Simulate and fit: a dict of what the table shows, with Monte Carlo standard errors where they matter."""
    rng, model = np.random.default_rng([seed, sum(cell.name.encode())]), model_of(cell)
    truth = float(np.exp(cell.threshold)) if cell.sigmoid == "weibull" else cell.threshold
    rows, spent = [], []
    for _ in range(studies):
        levels, yes, shown = draw(cell, rng)
        started = time.process_time()
        fit = fit_psychometric(levels, yes, shown, model)
        spent.append(time.process_time() - started)
        if isinstance(fit, str):
            rows.append((np.nan, 0.0, 0.0, 1.0, np.nan))
            continue
        best = fit_likelihood(levels, yes, shown, model).interval if profile else None
        rows.append((on_axis(fit.threshold.value, cell), *missed(fit.threshold.interval, truth),
                     None in (fit.threshold.interval.low, fit.threshold.interval.high),
                     1 - sum(missed(best, truth)) if best else np.nan))  # fmt: skip
    value, below, above, is_open, held = np.array(rows, dtype=float).T
    axis = np.log(cell.levels) if cell.sigmoid == "weibull" else np.array(cell.levels)
    error = (value[np.isfinite(value)] - cell.threshold) / np.median(np.diff(axis))
    covered = 1 - below.mean() - above.mean()
    return {"cell": cell.name, "studies": studies, "seed": seed, "covers": covered,
            "error": (covered * (1 - covered) / studies) ** 0.5, "below": below.mean(), "above": above.mean(),
            "open": is_open.mean(), "no value": float(np.mean(~np.isfinite(value))), "bias": error.mean(),
            "bias error": error.std() / len(error) ** 0.5, "median bias": float(np.median(error)),
            "ms": 1000 * float(np.median(spent)), "profile": held.mean()}  # fmt: skip


def on_axis(value, cell):
    return np.nan if value is None else float(np.log(value)) if cell.sigmoid == "weibull" else value


def missed(interval, truth):
    """Whether the whole interval lies below the truth, and above it; open ends reach on for ever."""
    below = interval.high is not None and interval.high < truth
    above = interval.low is not None and interval.low > truth
    return float(below), float(above)


def run_prior(task, studies, seed):
    """Truths drawn from the analysis' own priors, 5 levels, 25 answers: intervals have to cover 95%."""
    rng, levels, model = np.random.default_rng([seed, 1]), np.arange(1.0, 6), make_model(task)
    outer, inner = posterior_grid.prior_limits(levels)
    covered = []
    for _ in range(studies):
        threshold, log_width = (tapered(rng, *ends) for ends in zip(outer, inner, strict=True))
        lapse = truncated(rng, posterior_grid.LAPSE_POWER, LARGEST_LAPSE)
        guess = 0.5 if task == "2afc" else truncated(rng, posterior_grid.GUESS_POWER, LARGEST_GUESS)
        seen = norm.cdf((levels - threshold) / np.exp(log_width) * 2 * norm.ppf(0.95))
        share = guess + (1 - guess - lapse) * seen
        excess = rng.beta(1, posterior_grid.OVERDISPERSION_POWER)
        size = 1 / max(excess, 1e-3) ** 2 - 1
        yes = rng.binomial(25, rng.beta(np.maximum(share * size, 1e-9), np.maximum((1 - share) * size, 1e-9)))
        fit = fit_psychometric(levels, yes, np.full(5, 25), model)
        low, high = interval_of_grid(fit.grid)
        covered.append(low <= threshold <= high)
    share = float(np.mean(covered))
    return {"cell": f"prior-{task}", "studies": studies, "seed": seed, "covers": share,
            "error": (share * (1 - share) / studies) ** 0.5}  # fmt: skip


def interval_of_grid(grid):
    """The interval before its ends are said to be open."""
    return quantiles(even_edges(grid.nodes[0]), grid.marginals[0], (0.025, 0.975))


def tapered(rng, outer, inner):
    """A draw that is flat inside and falls as a cosine outside, by rejection."""
    while True:
        value = rng.uniform(*outer)
        below = max((inner[0] - value) / (inner[0] - outer[0]), 0.0)
        above = max((value - inner[1]) / (outer[1] - inner[1]), 0.0)
        if rng.random() < 0.5 + 0.5 * np.cos(np.pi * max(below, above)):
            return value


def truncated(rng, power, largest):
    while True:
        rate = rng.beta(1, power)
        if rate < largest:
            return rate
