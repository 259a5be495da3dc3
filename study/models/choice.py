"""Choice between two methods by their utilities: an observer's parameters in, chances and true shares out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from study.arrays import FloatArray
from study.models.sigmoids import logistic


@dataclass(frozen=True)
class PreferenceObserver:
    """Choice by utilities: log-odds of choosing a over b are the difference of the methods' utilities, times how
    visible the difference of the two stimuli is.

    `order_bias` is the log-odds that the first of two equal stimuli is chosen; `participant_sd` the standard
    deviation over participants of their preference between methods; `ties` Davidson's nu, where neither may be chosen.
    """

    utility: Mapping[str, float]
    order_bias: float = 0.1
    lapse: float = 0.01
    participant_sd: float = 0.0
    ties: float = 0.8


def lean(observer: PreferenceObserver, method_a: str, method_b: str) -> float:
    """Log-odds of choosing method a over b, order apart."""
    return observer.utility.get(method_a, 0.0) - observer.utility.get(method_b, 0.0)


def chance_of_first(observer: PreferenceObserver, towards_first: float) -> float:
    """Chance that the first of two is chosen, where the log-odds for it are `towards_first` besides the order's."""
    chance = float(logistic(np.asarray(towards_first + observer.order_bias)))
    return observer.lapse / 2 + (1 - observer.lapse) * chance


def chance_of_neither(observer: PreferenceObserver, towards_first: float) -> float:
    """Chance that two are called equal, where that may be said (Davidson 1970); those who lapse choose."""
    leaning = towards_first + observer.order_bias
    return (1 - observer.lapse) * observer.ties / (2 * float(np.cosh(leaning / 2)) + observer.ties)


def share_of_more(apart: FloatArray) -> float:
    """Mean chance that the second of two is chosen by an observer who chooses what seems to have more of a property.

    `apart (pairs,)` is how much more the second one has, in standard deviations of one percept; two noisy percepts are
    compared (Macmillan & Creelman 2005, chapter 7: two-alternative forced choice).
    """
    from scipy.special import ndtr

    return float(ndtr(apart / np.sqrt(2.0)).mean())


def preference_probability(observer: PreferenceObserver, method_a: str, method_b: str, seen: float = 1.0) -> float:
    """Probability over participants and both orders that method a is chosen, where the difference is seen so far."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(31)
    leaning = seen * (lean(observer, method_a, method_b) + observer.participant_sd * nodes)
    both = 0.5 * (logistic(leaning + observer.order_bias) + logistic(leaning - observer.order_bias))
    chosen = float((both * weights).sum() / weights.sum())
    return observer.lapse / 2 + (1 - observer.lapse) * chosen
