"""The test of a preference that headlines, families and `segue power` rest on: the one that generalises furthest.

With three motions or more it is Student's t over participants and motions (`crossed`); with fewer, over participants,
and the result holds for these motions alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from study.analysis.crossed import BOTH, OVER_BOTH, general_p_values
from study.analysis.headline import holds_for
from study.analysis.preference.participants import default_p_values
from study.arrays import FloatArray

if TYPE_CHECKING:
    from study.analysis.preference.motions import MotionsAsSample
    from study.analysis.preference.participants import ParticipantTests


@dataclass(frozen=True)
class DefaultTest:
    """The share of the first method with the interval and the test that hold for what `generalises_to` names.

    `percent` is of all answers if motions are a sample, otherwise the mean over participants; what can't be given is
    None, and `note` says why.
    """

    percent: float | None
    low: float | None
    high: float | None
    p_value: float | None
    test: str
    generalises_to: str
    note: str


def default_test(people: ParticipantTests, motions: MotionsAsSample) -> DefaultTest:
    """Choose between the tests that were made."""
    if (both := motions.both) is not None:
        return DefaultTest(both.percent, both.low, both.high, both.p_value, OVER_BOTH, BOTH, "")
    return DefaultTest(
        people.mean_percent, people.low, people.high, people.p_value, people.test, holds_for(people.participants),
        people.note,
    )  # fmt: skip


def p_values_of_studies(chosen: ArrayLike, shown: ArrayLike) -> FloatArray:
    """Return the p-values of the default test of many studies at once.

    Parameters
    ----------
    chosen, shown : array_like, shape (..., participants, motions)
        How often each participant favoured the first method in each motion, of how many answers.

    Returns
    -------
    ndarray, shape (...)
        NaN where no test can be made.
    """
    yes, total = np.asarray(chosen, dtype=np.float64), np.asarray(shown, dtype=np.float64)
    people = default_p_values(yes.sum(axis=-1), total.sum(axis=-1))
    return general_p_values(people, yes, total, 0.5)
