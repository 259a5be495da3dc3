"""What is fitted to what: the model of a psychometric function, and counts at stimulus levels made fit for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from study.analysis.estimates import numbers
from study.arrays import FloatArray
from study.errors import AnalysisError
from study.models.sigmoids import Sigmoid, sigmoid_named

LARGEST_LAPSE = 0.25
LARGEST_GUESS = 0.5


@dataclass(frozen=True, eq=False)
class Data:
    """Counts at levels, rising; `yes` are right answers (2AFC) or answers "yes"."""

    levels: FloatArray
    yes: FloatArray
    shown: FloatArray


@dataclass(frozen=True)
class Model:
    """What is fitted."""

    sigmoid: Sigmoid
    """One of `sigmoids.SIGMOIDS`."""
    guess: float | None
    """Share of "yes" where nothing can be seen: one half in 2AFC; None where it is estimated (yes-no)."""
    lapse: float | None = None
    """Share of answers given blindly where everything can be seen; None where it is estimated."""
    overdispersion: bool = True
    """Whether performance may vary more between blocks or people than the binomial has it."""


def make_model(
    task: str = "2afc",
    *,
    sigmoid: str = "normal",
    choices: int = 2,
    guess: float | None = None,
    lapse: float | None = None,
    overdispersion: bool = True,
) -> Model:
    """Return the model of a task.

    Parameters
    ----------
    task
        "2afc" (guess rate 1 / `choices`) or "yes-no" (guess rate estimated unless given).
    sigmoid
        "normal", "logistic", "gumbel" or "weibull".
    guess, lapse
        Rates to hold; estimated where None (the guess rate of a forced choice is always held).

    Raises
    ------
    AnalysisError
        For an unknown task or sigmoid, or rates that can't be.
    """
    if task not in ("2afc", "yes-no"):
        raise AnalysisError(f"expected the task 2afc or yes-no, found {task!r}")
    if choices < 2:
        raise AnalysisError(f"expected at least 2 choices, found {choices}")
    held = 1 / choices if task == "2afc" and guess is None else guess
    for name, rate in (("guess", held), ("lapse", lapse)):
        if rate is not None and not 0 <= rate < 1:
            raise AnalysisError(f"expected a {name} rate from 0 to below 1, found {rate:g}")
    if (held or 0) + (lapse or 0) >= 1:
        raise AnalysisError(f"expected guess and lapse rate to add to less than 1, found {held} and {lapse}")
    return Model(sigmoid_named(sigmoid), held, lapse, overdispersion)


def tidy(levels: ArrayLike, yes: ArrayLike, shown: ArrayLike) -> Data:
    """Return counts by level, rising, equal levels put together, without levels that have no answers.

    Parameters
    ----------
    levels, yes, shown : array_like, shape (blocks,)

    Raises
    ------
    AnalysisError
        When shapes differ or counts can't be.
    """
    named = ((levels, "levels"), (yes, "yes"), (shown, "shown"))
    place, right, total = (numbers(part, name) for part, name in named)
    if place.ndim != 1 or place.shape != right.shape or place.shape != total.shape:
        raise AnalysisError(
            f"expected levels, yes and shown of one shape (blocks,), found {place.shape}, {right.shape}, {total.shape}"
        )
    if not (np.isfinite(place).all() and np.isfinite(right).all() and np.isfinite(total).all()):
        raise AnalysisError("expected finite levels and counts, found some that are not; leave those rows out")
    if (right < 0).any() or (right > total).any():
        at = int(np.flatnonzero((right < 0) | (right > total))[0])
        raise AnalysisError(f"expected 0 <= yes <= shown, found {right[at]:g} of {total[at]:g} at level {place[at]:g}")
    unique, index = np.unique(place[total > 0], return_inverse=True)
    sums = np.zeros((2, len(unique)))
    for row, part in zip(sums, (right, total), strict=True):
        np.add.at(row, index, part[total > 0])
    return Data(unique, sums[0], sums[1])


def why_no_fit(data: Data) -> str:
    """Return why nothing can be estimated; empty where something can."""
    if not len(data.levels):
        return "no answers"
    if len(data.levels) == 1:
        return f"one level only ({data.levels[0]:g}): threshold and width cannot be separated"
    return ""
