"""Yes or no by equal-variance signal detection: sensitivity and criterion in, the chance of a "yes" out.

One percept with unit normal noise is compared with a criterion; it lies d' higher where there is something to see
(Green & Swets 1966; Macmillan & Creelman 2005, chapter 1). With the criterion `c` above what nothing leaves,

    P("yes") = lapse / 2 + (1 - lapse) Phi(d' - c).
"""

from __future__ import annotations

import numpy as np

from study.arrays import FloatArray

BEST_D_PRIME = 1.3489795003921634
"""The d' at which an observer with the best criterion is right in 75% of the trials, half of which show nothing."""


def said_yes(d_prime: FloatArray, criterion: float | FloatArray, lapse: float | FloatArray) -> FloatArray:
    """Return P("yes") in the shape of the arguments, broadcast.

    Parameters
    ----------
    criterion
        Of the same-different task, in standard deviations of one percept. It is compared with a difference to either
        side, `c` with one percept: `c` is half of it, and a criterion of 2 gives 16% false alarms in both tasks.
    """
    from scipy.special import ndtr

    return np.asarray(lapse / 2 + (1 - lapse) * ndtr(d_prime - criterion / 2))
