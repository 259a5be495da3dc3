"""Observer models: how a simulated participant judges, and what an analysis should find of it.

Parameters come in; probabilities and the truth that follows from them go out. The same-different observer follows the
differencing model: each stimulus leaves a percept with unit normal noise, and the answer is "different" where the
percepts lie further apart than a criterion. A difference of `n` frames moves the percepts apart by `n` times the
observer's d' a frame, which differs between shorter and longer blends. Defaults: 2004 section 5.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.errors import SessionError
from study.experiment.protocol.whole import Protocol, StudySpec
from study.transitions.methods.registry import METHODS

FloatArray = NDArray[np.float64]

LEAST_CRITERION = 0.2
"""No participant's criterion lies below this: at 0 a person would say "different" always."""


@dataclass(frozen=True)
class SameDifferentObserver:
    """Same-different by the differencing model.

    Parameters
    ----------
    d_prime_shorter, d_prime_longer
        Sensitivity a frame of difference, for comparisons shorter and longer than the reference; above 0.
    criterion
        Distance of percepts beyond which the answer is "different", in noise units; above 0.
    lapse
        Proportion of trials answered without having looked, half of them "different".
    log_sensitivity_sd, criterion_sd
        How participants differ: standard deviations of the logarithm of both sensitivities together, and of the
        criterion.
    """

    d_prime_shorter: float
    d_prime_longer: float
    criterion: float = 2.0
    lapse: float = 0.02
    log_sensitivity_sd: float = 0.15
    criterion_sd: float = 0.15


@dataclass(frozen=True)
class PreferenceObserver:
    """Choice by utilities: log-odds of choosing a over b are the difference of the methods' utilities.

    `order_bias` is the log-odds that the first of two equal stimuli is chosen; `participant_sd` the standard
    deviation over participants of their preference between methods. The default utilities give 2004 Table 2.
    """

    utility: Mapping[str, float] = field(default_factory=lambda: {one.name: one.utility for one in METHODS.values()})
    order_bias: float = 0.1
    lapse: float = 0.01
    participant_sd: float = 0.0


@dataclass(frozen=True)
class RatingObserver:
    """Ratings: a normal variable around the middle of the scale plus the method's utility, cut into points.

    Of a pair, the utility of the second less that of the first. `participant_sd` is how participants differ in how high
    they rate; of pairs, in by how much they find the comparison the better.
    """

    noise_sd: float = 0.9
    utility_weight: float = 0.3
    participant_sd: float = 0.3


@dataclass(frozen=True)
class ObserverSettings:
    """All that a simulated participant is: how they judge, how fast, and how often they miss an answer.

    Response times are log-normal: median and standard deviation of the logarithm; those beyond the answer window are
    missed, besides a proportion `missed` of inattention. Of all showings a proportion `badly_shown` stalls, so that the
    trial comes again, and a proportion `careless` of the participants looks at nothing: they answer at random and fast,
    attention checks too. `truth` is of those who look.
    """

    same_different: SameDifferentObserver
    preference: PreferenceObserver = PreferenceObserver()
    rating: RatingObserver = RatingObserver()
    response_median_s: float = 1.2
    response_log_sd: float = 0.35
    missed: float = 0.005
    badly_shown: float = 0.0
    careless: float = 0.0

    def __post_init__(self) -> None:
        for name in ("missed", "badly_shown", "careless"):
            share = getattr(self, name)
            if not 0.0 <= share <= 1.0:
                raise SessionError(f"Expected {name} as a share from 0 to 1, found {share:g}; change it.")


def default_observer(shorter_frames: float = 8.0, longer_frames: float = 7.0) -> ObserverSettings:
    """The observer of 2004 section 5.1: over participants, 75% "different" at 8 frames shorter and 7 longer."""
    unit = SameDifferentObserver(1.0, 1.0)
    # Thresholds scale with 1 / d': the crossing of an observer with a d' of 1 a frame gives the others. Rounded, so
    # that a database is taken up again under another version of scipy.
    crossing = _crossing(unit, 0.75, unit.d_prime_longer)
    shorter, longer = round(crossing / shorter_frames, 9), round(crossing / longer_frames, 9)
    return ObserverSettings(replace(unit, d_prime_shorter=shorter, d_prime_longer=longer))


def knowing(settings: ObserverSettings, protocol: Protocol) -> ObserverSettings:
    """The observer with the utilities that a protocol gives to methods of its own, where it has none for them."""
    own = {method.name: method.utility for method in protocol.methods}
    if not own:
        return settings
    preference = replace(settings.preference, utility={**own, **settings.preference.utility})
    return replace(settings, preference=preference)


def probability_different(observer: SameDifferentObserver, difference_frames: float | FloatArray) -> FloatArray:
    """Probability of "different" for one observer without deviations, in the shape of the differences."""
    differences = np.asarray(difference_frames, dtype=np.float64)
    slope = np.where(differences < 0, observer.d_prime_shorter, observer.d_prime_longer)
    return _different(np.abs(differences) * slope, observer.criterion, observer.lapse)


def _different(distance: FloatArray, criterion: float | FloatArray, lapse: float) -> FloatArray:
    from scipy.special import ndtr

    # The difference of two unit-normal percepts has standard deviation sqrt 2.
    spread = np.sqrt(2.0)
    seen = ndtr((distance - criterion) / spread) + ndtr((-distance - criterion) / spread)
    return np.asarray(lapse / 2 + (1 - lapse) * seen)


def population_different(observer: SameDifferentObserver, difference_frames: float | FloatArray) -> FloatArray:
    """Probability of "different" over all participants: the mean over their sensitivities and criteria."""
    differences = np.asarray(difference_frames, dtype=np.float64)
    slope = np.where(differences < 0, observer.d_prime_shorter, observer.d_prime_longer)
    nodes, weights = np.polynomial.hermite_e.hermegauss(31)
    weights = weights / weights.sum()
    sensitivity = np.exp(observer.log_sensitivity_sd * nodes)[:, None]
    criterion = np.maximum(observer.criterion + observer.criterion_sd * nodes, LEAST_CRITERION)[None, :]
    distance = (np.abs(differences) * slope)[..., None, None] * sensitivity
    chances = _different(distance, criterion, observer.lapse)
    return np.asarray(np.einsum("...sc,s,c->...", chances, weights, weights))


def _crossing(observer: SameDifferentObserver, level: float, slope: float) -> float:
    """The difference in frames at which the population reaches a level, at a slope in d' a frame."""
    from scipy.optimize import brentq

    straight = replace(observer, d_prime_shorter=slope, d_prime_longer=slope)

    def above(frames: float) -> float:
        return float(population_different(straight, frames)) - level

    if above(0.0) >= 0 or above(60.0 / slope) <= 0:
        raise SessionError(
            f"Expected an observer that reaches {level:.0%} 'different' at some difference, found "
            f"{level + above(0.0):.1%} at none and {level + above(60.0 / slope):.1%} at most; change the criterion."
        )
    return float(brentq(above, 0.0, 60.0 / slope, xtol=1e-10))


def truth(protocol: Protocol, settings: ObserverSettings) -> dict[str, Any]:
    """What an analysis should find: parameters, true thresholds, and what the paper's reading of the curve would give.

    `threshold_*_frames` are the differences at which the population says "different" at the protocol's threshold.
    `interpolated_*_frames` is what joining the protocol's levels by straight lines gives with endless data: it lies
    off the true value where the curve bends between levels. Rounded to six digits, so that it is the same everywhere.
    """
    found: dict[str, Any] = {"observer": asdict(settings)}
    observer, level = settings.same_different, protocol.analysis.threshold
    jnd: dict[str, Any] = {
        "level": level,
        "threshold_shorter_frames": -round(_crossing(observer, level, observer.d_prime_shorter), 6),
        "threshold_longer_frames": round(_crossing(observer, level, observer.d_prime_longer), 6),
        "false_alarms": round(float(population_different(observer, 0.0)), 6),
    }
    studies: dict[str, Any] = {}
    for study in protocol.studies:
        if study.task == "same-different":
            studies[study.name] = {**jnd, **_interpolated(observer, study.differences_frames, level)}
        elif study.task == "preference":
            studies[study.name] = {"favouring_a": round(preference_probability(settings.preference, study), 6)}
        elif study.paired:
            studies[study.name] = {"mean_score": round(mean_score(settings, study), 6)}
    return {**found, "studies": studies}


def _interpolated(observer: SameDifferentObserver, levels: Sequence[int], level: float) -> dict[str, float | None]:
    found: dict[str, float | None] = {}
    for side, sign in (("shorter", -1), ("longer", 1)):
        x = np.sort([abs(d) for d in levels if d * sign >= 0]).astype(float)
        chances = population_different(observer, sign * x) if len(x) else x
        reached = len(x) > 0 and chances[0] < level <= chances[-1]
        found[f"interpolated_{side}_frames"] = round(sign * float(np.interp(level, chances, x)), 6) if reached else None
    return found


def preference_probability(observer: PreferenceObserver, study: StudySpec) -> float:
    """Probability over participants and both orders that method a (the reference) is chosen."""
    from scipy.special import expit

    nodes, weights = np.polynomial.hermite_e.hermegauss(31)
    leaning = lean(observer, study.reference, study.comparison or study.reference) + observer.participant_sd * nodes
    both = 0.5 * (expit(leaning + observer.order_bias) + expit(leaning - observer.order_bias))
    chosen = float((both * weights).sum() / weights.sum())
    return observer.lapse / 2 + (1 - observer.lapse) * chosen


def mean_score(settings: ObserverSettings, study: StudySpec) -> float:
    """Mean over participants of how the comparison is rated against the reference, in points from 0."""
    from scipy.special import ndtr

    apart = lean(settings.preference, study.comparison or study.reference, study.reference)
    middle = (study.scale_points - 1) / 2 + settings.rating.utility_weight * apart
    spread = np.hypot(settings.rating.noise_sd, settings.rating.participant_sd)
    # The mean of a whole number from 0 is the sum of the chances to reach each point; points are reached by rounding.
    return float(ndtr((middle - np.arange(study.scale_points - 1) - 0.5) / spread).sum())


def lean(observer: PreferenceObserver, method_a: str, method_b: str) -> float:
    """Log-odds of choosing method a over b, order apart."""
    return observer.utility.get(method_a, 0.0) - observer.utility.get(method_b, 0.0)
