"""How many participants a study needs: a function that simulates and analyses studies in, a curve and a number out.

Power is counted, not computed from a formula: studies are simulated through the real plan, analysed by the real
analysis, and those that find what there is to find are counted. Nothing here knows how a study is run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from renderer.workers import Where, run_jobs
from study.analysis.estimates import Interval, wilson_interval
from study.arrays import BoolArray, IntArray
from study.counting import counted
from study.errors import AnalysisError

Run = Callable[[np.random.Generator, int, Sequence[int]], BoolArray]
"""From a generator, a number of studies and rising numbers of participants: what each study found, shape (studies,
sizes). One simulation may serve every size, by its first so many participants."""


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
    """A power curve."""

    points: tuple[PowerPoint, ...]
    """One a number of participants, rising."""
    target: float
    """The power asked for."""
    needed: int | None
    """Participants from which on the power is reached, by linear interpolation between the points, made monotone;
    None where no number tried was enough."""
    note: str = ""
    """Where the number lies outside those tried."""


def power_curve(
    run: Run,
    sizes: Sequence[int],
    *,
    studies: int = 200,
    target: float = 0.8,
    seed: int = 0,
    at_once: int = 1,
    workers: Where = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Power:
    """Simulate studies and count those that find what is there.

    Parameters
    ----------
    run
        Simulates and analyses. Where one simulation serves every size, the points of a curve are not independent of
        each other.
    sizes
        Numbers of participants.
    studies
        Simulated studies.
    target
        Power asked for.
    seed, at_once
        The same seed and number of studies at once give the same numbers.
    workers
        Processes or the address of a Dask scheduler, as `renderer.workers.run_jobs` takes them; `run` is sent to them.

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
    batches = [(first, min(at_once, studies - first)) for first in range(0, studies, at_once)]
    done = 0
    for number, told in run_jobs(partial(_batch, run, wanted, seed), batches, workers):
        found += told
        done += batches[number][1]
        if progress:
            progress(done, studies)
    points = tuple(
        PowerPoint(size, int(count), studies, count / studies, wilson_interval(int(count), studies))
        for size, count in zip(wanted, found, strict=True)
    )
    needed, note = _needed(points, target)
    return Power(points, target, needed, note)


def _batch(run: Run, sizes: Sequence[int], seed: int, batch: tuple[int, int]) -> IntArray:
    """How many studies of a batch (its first, and how many) found it, by size."""
    first, count = batch
    return np.asarray(run(np.random.default_rng([seed, first]), count, sizes).sum(axis=0))


def _needed(points: Sequence[PowerPoint], target: float) -> tuple[int | None, str]:
    sizes = np.array([point.participants for point in points], dtype=np.float64)
    rising = np.maximum.accumulate([point.power for point in points])
    if rising[-1] < target:
        return None, f"{counted(points[-1].participants, 'participant is', 'participants are')} not enough; try more"
    at = int(np.flatnonzero(rising >= target)[0])
    if at == 0:
        return points[0].participants, f"{counted(points[0].participants, 'participant')} or fewer; try fewer"
    part = (target - rising[at - 1]) / (rising[at] - rising[at - 1])
    return math.ceil(sizes[at - 1] + part * (sizes[at] - sizes[at - 1]) - 1e-9), ""
