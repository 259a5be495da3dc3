"""How many participants a study needs: functions that simulate and analyse come in, a curve and a number go out.

Power is counted, not computed from a formula: studies are simulated through the real plan, analysed by the real
analysis, and those that find what there is to find are counted. Nothing here knows how a study is run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.analysis.estimates import Interval, wilson_interval
from study.errors import AnalysisError

FloatArray = NDArray[np.float64]
Simulate = Callable[[np.random.Generator, int], Any]
Finds = Callable[[Any, int], bool]


@dataclass(frozen=True)
class PowerPoint:
    """How often studies with this many participants found it."""

    participants: int
    found: int
    studies: int
    power: float
    interval: Interval


@dataclass(frozen=True)
class Power:
    """A power curve.

    Attributes
    ----------
    points
        One a number of participants, rising.
    target
        The power asked for.
    needed
        Participants from which on the power is reached, along straight lines between the points, made to rise; None
        where no number tried was enough.
    note
        Where the number lies outside those tried.
    """

    points: tuple[PowerPoint, ...]
    target: float
    needed: int | None
    note: str = ""


def power_curve(
    simulate: Simulate,
    finds: Finds,
    sizes: Sequence[int],
    *,
    studies: int = 200,
    target: float = 0.8,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Power:
    """Simulate studies and count those that find what is there.

    Parameters
    ----------
    simulate
        From a generator and a number of participants, the answers of a study.
    finds
        From these answers and a number of participants, whether the study's first so many would have found it. So one
        simulation serves every number, and the points of one curve are not independent of each other.
    sizes
        Numbers of participants.
    studies
        Simulated studies.
    target
        Power asked for.

    Raises
    ------
    AnalysisError
        When nothing can be simulated with these numbers.
    """
    wanted = sorted(set(sizes))
    if not wanted or wanted[0] < 2:
        raise AnalysisError(f"expected numbers of participants from 2 on, found {list(sizes)}")
    if studies < 1 or not 0 < target < 1:
        raise AnalysisError(f"expected studies from 1 on and a power between 0 and 1, found {studies} and {target:g}")
    found = np.zeros(len(wanted), dtype=int)
    for number in range(studies):
        data = simulate(np.random.default_rng([seed, number]), wanted[-1])
        found += np.array([finds(data, size) for size in wanted])
        if progress:
            progress(number + 1, studies)
    points = tuple(
        PowerPoint(size, int(count), studies, count / studies, wilson_interval(int(count), studies))
        for size, count in zip(wanted, found, strict=True)
    )
    needed, note = _needed(points, target)
    return Power(points, target, needed, note)


def _needed(points: Sequence[PowerPoint], target: float) -> tuple[int | None, str]:
    sizes = np.array([point.participants for point in points], dtype=np.float64)
    rising = np.maximum.accumulate([point.power for point in points])
    if rising[-1] < target:
        return None, f"{points[-1].participants} participants are not enough; try more"
    at = int(np.flatnonzero(rising >= target)[0])
    if at == 0:
        return points[0].participants, f"{points[0].participants} participants or fewer; try fewer"
    part = (target - rising[at - 1]) / (rising[at] - rising[at - 1])
    return math.ceil(sizes[at - 1] + part * (sizes[at] - sizes[at - 1]) - 1e-9), ""


def logit_normal(share: float, correlation: float) -> tuple[float, float]:
    """Return mean and standard deviation, in logits, of participants with this mean share and correlation.

    Parameters
    ----------
    share
        Mean share over participants, between 0 and 1.
    correlation
        Intraclass correlation of their answers: variance of the participants' shares over share x (1 - share).

    Raises
    ------
    AnalysisError
        When share or correlation can't be.
    """
    if not 0 < share < 1 or not 0 <= correlation <= 0.9:
        raise AnalysisError(
            f"expected a share between 0 and 1 and a correlation from 0 to 0.9, found {share:g} and {correlation:g}"
        )
    from scipy.optimize import brentq

    centre = math.log(share / (1 - share))
    if correlation == 0:
        return centre, 0.0
    points, weights = np.polynomial.hermite_e.hermegauss(61)
    weights = weights / weights.sum()

    def shares(mean: float, spread: float) -> FloatArray:
        return np.asarray(1 / (1 + np.exp(-(mean + spread * points))), dtype=np.float64)

    def mean_for(spread: float) -> float:
        return float(brentq(lambda mean: float(weights @ shares(mean, spread)) - share, -60, 60))

    def excess(spread: float) -> float:
        own = shares(mean_for(spread), spread)
        return float(weights @ (own - share) ** 2) / (share * (1 - share)) - correlation

    spread = float(brentq(excess, 1e-6, 25.0))
    return mean_for(spread), spread
