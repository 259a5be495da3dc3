"""Ratings on a scale of points: an observer's parameters in, mean scores out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class RatingObserver:
    """Ratings: a normal variable around the middle of the scale plus the method's utility, cut into points.

    Of a pair, the utility of the second less that of the first. `participant_sd` is how participants differ in how high
    they rate; of pairs, in by how much they find the comparison the better.
    """

    noise_sd: float = 0.9
    utility_weight: float = 0.3
    participant_sd: float = 0.3


def stretch(points: int) -> float:
    """How many points of a scale one of the observer's is: 1 of a scale with buttons, 25 of a slider of 0 to 100."""
    return 25.0 if points > 11 else 1.0


def mean_score(observer: RatingObserver, apart: float, points: int, seen: float = 1.0) -> float:
    """Mean over participants of what is rated, in points from 0.

    Parameters
    ----------
    apart
        Its utility; of a pair, that of the comparison less that of the reference.
    points
        Of the scale.
    seen
        Of a pair, how visible its difference is, 0 to 1.
    """
    from scipy.special import ndtr

    middle = (points - 1) / 2 + seen * observer.utility_weight * apart
    spread = np.hypot(observer.noise_sd, seen * observer.participant_sd)
    # The mean of a whole number from 0 is the sum of the chances to reach each point; points are reached by rounding.
    return float(ndtr((middle - np.arange(points - 1) - 0.5) / spread).sum())
