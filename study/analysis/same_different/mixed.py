"""Observers who differ, in a same-different study: counts by participant in, the typical observer's thresholds out.

Every participant has their own sensitivity and criterion under the differencing rule (`fits`): both are
log-normal over people, so that "typical" is the median observer. The mean curve of people who differ is flatter than
anybody's, and crosses 75% further out than the typical observer does; one curve fitted to all answers follows neither
quite. This model says both: the typical observer's threshold, and where the mean of all people's curves crosses.

Where motions are known, each has its own sensitivity on each side. Thresholds are those of a motion whose logarithm is
the mean, so that motions that differ don't flatten the curve; with three or more the interval takes them for a
sample (`crossed.between_motions`). Log sensitivities that answers leave open (a motion that everybody tells) are kept
in reach of the others' mean by a normal penalty with a standard deviation of 1, which hardly moves the rest.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from study.analysis import estimates
from study.analysis.crossed import BOTH, FEWEST_MOTIONS, BetweenMotions, between_motions
from study.analysis.headline import holds_for
from study.analysis.same_different import fits
from study.analysis.same_different.counts import (
    SIDES,
    Counts,
    Side,
    Threshold,
    both_sides,
    log_threshold,
    sides_in_words,
)
from study.analysis.same_different.model import held_lapse, lapse_caution, why_no_fit
from study.analysis.same_different.observers import (
    ALIKE,
    AVOIDANCE,
    LARGEST_SPREAD,
    REACH,
    People,
    cannot_tell,
    covariance_of,
    curves,
    gradient_of,
    maximise,
    people_of,
)
from study.arrays import FloatArray, IntArray
from study.counting import counted
from study.models.differencing import Kind, criterion_free_delta

FEWEST_PEOPLE = 3
METHOD = "mixed differencing model; Student interval of the logarithm"
NO_SAMPLE = BetweenMotions(0.0, 0.0, 0.0)
"""Motions that stand for themselves alone."""
MANY_UNABLE = 0.1
"""The share of participants without sensitivity from which on the result is cautioned."""


@dataclass(frozen=True)
class MixedThresholds:
    """What the mixed model says."""

    typical: dict[Side, Threshold]
    """The median observer's threshold, by side."""
    criterion_free: dict[Side, Threshold]
    """The difference at which the median observer's sensitivity allows that share of right answers, by side: that of an
    observer with the best criterion."""
    population: dict[Side, Threshold]
    """Where the mean of all people's curves crosses, by side: what percentages of a large group would show."""
    these_motions: dict[Side, Threshold]
    """The median observer's threshold with an interval for other people and these motions."""
    generalises_to: str
    """What the intervals of the others hold for."""
    motion_spread: dict[Side, float]
    """Standard deviation across motions of the logarithm of the threshold, by side; none where motions are no sample,
    0 where they differ no more than chance has it."""
    sensitivity_spread: float
    criterion_spread: float
    """`sensitivity_spread`, `criterion_spread`: standard deviations over people of the logarithms."""
    criterion: float
    lapse: float
    """`criterion`, `lapse`: the typical observer's criterion, and everybody's lapse rate."""
    log_likelihood: float
    alike_log_likelihood: float
    """`log_likelihood`, `alike_log_likelihood`: of this model (with its penalty), and of one without individual
    differences."""
    curve: tuple[tuple[float, float], ...]
    """The median observer's: points (difference in frames, percent) for drawing."""
    alike_p_value: float
    """Likelihood-ratio test that people are alike. A spread of none is the least there can be, so the ratio is half
    of the time 0; the mixture of chi-square distributions takes that into account."""
    unable: tuple[str, ...] = ()
    """Participants whose answers come rather from an observer who can't tell at all than from this distribution."""
    able: dict[Side, Threshold] = field(default_factory=dict)
    """The median observer's threshold without them; empty where there are none, or too few others."""
    note: str = ""
    """What to be careful about."""


@dataclass(frozen=True, eq=False)
class _Doubt:
    """How sure the parameters of the mean motion are: their covariance, the point it was taken at, how many people it
    rests on, and what motions add on each side.
    """

    covariance: FloatArray
    point: FloatArray
    participants: int
    motions: tuple[BetweenMotions, ...]


def fit_mixed_thresholds(
    counts: Counts, *, level: float = 0.75, confidence: float = 0.95, lapse: float | None = None
) -> MixedThresholds | str:
    """Fit the differencing model with a sensitivity and a criterion for each participant.

    Parameters
    ----------
    level
        Share of "different" at threshold.
    lapse
        The lapse rate, held; estimated where it is None, and levels are enough for it.

    Returns
    -------
    MixedThresholds or str
        A sentence that says why where nothing can be fitted.

    Notes
    -----
    Maximum likelihood. Standard errors come from the curvature of the marginal likelihood, so they hold if people are
    as the model has them; `model.fit_model` asks less of them and describes the group's curve. With few
    people the likeliest spread is often none, which would make the rest look too sure, so the curvature is taken where
    the likelihood times the root of the spread of sensitivity is highest (after Chung, Rabe-Hesketh, Dorie, Gelman &
    Liu 2013).
    """
    answered = counts.shown.sum(axis=1) > 0
    reason = why_no_fit(counts)
    if not reason and answered.sum() < FEWEST_PEOPLE:
        few = counted(int(answered.sum()), "participant is", "participants are")
        reason = f"{few} too few to estimate individual differences; at least {FEWEST_PEOPLE}"
    if reason:
        return reason
    people, sides = people_of(counts, answered)
    together = replace(people, frames=_by_side(people, len(sides)))
    held, why = held_lapse(together.frames, lapse)
    group, alike = (_one_curve(part, held) for part in (together, people))
    if group.held[0, 2:].any() or group.held[0, 0]:
        return "the group's sensitivity or criterion is at its bound: individual differences cannot be estimated"
    slopes = np.log(group.slopes[0])[people.side_of]
    slopes = np.clip(np.log(alike.slopes[0]), slopes - 1.5 * REACH, slopes + 1.5 * REACH)
    lapses = (0.0, fits.LARGEST_LAPSE) if held is None else (held, held)
    begin = np.concatenate([np.log(group.criterion), group.lapse, slopes, [0.2, 0.2]])
    bounds = [(math.log(1e-3), math.log(9.0)), lapses, *((slope - 3, slope + 3) for slope in slopes)]
    point, value, settled = maximise(people, begin, [*bounds, *[(0.0, LARGEST_SPREAD)] * 2], 0.0)
    near = np.concatenate([point[:-2], np.maximum(point[-2:-1], 0.1), point[-1:]])
    wary, _, _ = maximise(people, near, [*bounds, (2 * ALIKE, LARGEST_SPREAD), (0.0, LARGEST_SPREAD)], AVOIDANCE)
    doubt = _doubt(wary, people, len(sides), held is not None)
    mean = _of_mean_motion(people.side_of) @ point
    median = replace(together, sensitivity=np.zeros(1), criterion=np.zeros(1), log_mass=np.zeros(1))
    here = replace(doubt, motions=(NO_SAMPLE,) * len(sides))
    ratio = 2 * (value - float(alike.log_likelihood[0]))
    sampled = bool(np.bincount(people.side_of).min() >= FEWEST_MOTIONS)
    unable = cannot_tell(point, people)
    answering = np.array(counts.participants)[answered]
    names = tuple(str(name) for name in answering[unable])
    able: dict[Side, Threshold] = {}
    if names:
        others = fit_mixed_thresholds(_without(counts, names), level=level, confidence=confidence, lapse=lapse)
        if isinstance(others, MixedThresholds):
            names, able = (*names, *others.unable), others.able or others.typical
    settled_note = "" if settled else "the search for the maximum did not converge"
    notes = (why, lapse_caution(float(point[1]), held), settled_note, _in_words(names, len(unable), able))
    return MixedThresholds(
        typical=_thresholds(mean, doubt, median, sides, level, confidence),
        criterion_free=_thresholds(mean, doubt, median, sides, level, confidence, "criterion_free"),
        population=_thresholds(mean, doubt, together, sides, level, confidence),
        these_motions=_thresholds(mean, here, median, sides, level, confidence),
        generalises_to=BOTH if sampled else holds_for(len(people.shown)),
        motion_spread={side: one.deviation for side, one in zip(sides, doubt.motions, strict=True) if sampled},
        sensitivity_spread=float(point[-2]),
        criterion_spread=float(point[-1]),
        criterion=math.exp(point[0]),
        lapse=float(point[1]),
        curve=_curve(mean, median, counts.differences, sides),
        log_likelihood=value,
        alike_log_likelihood=float(alike.log_likelihood[0]),
        alike_p_value=_alike_probability(max(ratio, 0.0)),
        unable=names,
        able=able,
        note="; ".join(filter(None, notes)),
    )


def _without(counts: Counts, names: Collection[str]) -> Counts:
    kept = np.array([name not in names for name in counts.participants])
    who = tuple(name for name in counts.participants if name not in names)
    return replace(counts, participants=who, different=counts.different[kept], shown=counts.shown[kept])


def _in_words(unable: Sequence[str], people: int, able: dict[Side, Threshold]) -> str:
    """What to be careful about where more than the odd one can't tell."""
    if len(unable) < max(2, MANY_UNABLE * people):
        return ""
    return (
        f"{len(unable)} of {counted(people, 'participant')} answer as if they could not tell any difference, which "
        "people who differ log-normally seldom do: the intervals are not to be trusted; without these participants the "
        f"threshold is {sides_in_words(able) or 'not to be had'}"
    )


def _curve(
    point: FloatArray, median: People, differences: FloatArray, sides: list[Side]
) -> tuple[tuple[float, float], ...]:
    line = np.linspace(differences.min(), differences.max(), 201)
    share = curves(point, median, both_sides(line)[:, [SIDES.index(side) for side in sides]])[0][0]
    return tuple((float(x), 100 * float(y)) for x, y in zip(line, share, strict=True))


def _one_curve(people: People, lapse: float | None) -> fits.Fits:
    """The differencing model of all answers as one person's."""
    return fits.fit(people.frames, people.different.sum(axis=0)[None], people.shown.sum(axis=0)[None], lapse=lapse)


def _by_side(people: People, sides: int) -> FloatArray:
    """Sizes of the differences with one column a side, shape (levels, sides)."""
    return np.asarray(people.frames @ (people.side_of[:, None] == np.arange(sides)))


def _of_mean_motion(side_of: IntArray) -> FloatArray:
    """What turns parameters with a log slope for each motion of a side into those with the mean of these."""
    sides = int(side_of.max()) + 1
    turned = np.zeros((sides + 4, len(side_of) + 4))
    turned[:2, :2] = turned[-2:, -2:] = np.eye(2)
    turned[2:-2, 2:-2] = (np.arange(sides)[:, None] == side_of) / np.bincount(side_of)[:, None]
    return turned


def _doubt(point: FloatArray, people: People, sides: int, lapse_held: bool) -> _Doubt:
    covariance, turned = covariance_of(point, people, lapse_held), _of_mean_motion(people.side_of)
    places = [2 + np.flatnonzero(people.side_of == side) for side in range(sides)]
    between = tuple(between_motions(point[own], covariance[np.ix_(own, own)]) for own in places)
    return _Doubt(turned @ covariance @ turned.T, turned @ point, len(people.shown), between)


def _log_threshold(point: FloatArray, people: People, place: int, level: float, kind: Kind) -> tuple[float, FloatArray]:
    """Log threshold (frames) of the people on the grid, and its derivatives; infinite where there is none.

    Where the mean curve m crosses at x, d log x / d parameter = -(d m / d parameter) / (d m / d log x), and a change of
    the logarithm of x does what one of the logarithm of the slope does.
    """
    if kind == "criterion_free":  # sensitivity alone decides it
        return math.log(criterion_free_delta(level)) - float(point[2 + place]), -np.eye(len(point))[2 + place]
    mass = np.exp(people.log_mass)[:, None]
    alone = np.zeros((1, people.frames.shape[1]))

    def mean_at(log_frames: float) -> tuple[float, FloatArray]:
        alone[0, place] = math.exp(log_frames)
        share, *by = curves(point, people, alone)
        return float((mass * share).sum()), gradient_of(mass, tuple(by), point, people, alone)

    low, high = -float(point[2 + place]) - 5.0, -float(point[2 + place]) + 4.0
    if mean_at(low)[0] >= level or mean_at(high)[0] < level:
        return math.inf, np.zeros(len(point))
    while high - low > 1e-8:
        middle = (low + high) / 2
        low, high = (middle, high) if mean_at(middle)[0] < level else (low, middle)
    _, gradient = mean_at(high)
    return high, -gradient / gradient[2 + place]


def _thresholds(
    point: FloatArray,
    doubt: _Doubt,
    people: People,
    sides: list[Side],
    level: float,
    confidence: float,
    kind: Kind = "different",
) -> dict[Side, Threshold]:
    """Thresholds of the people on the grid; one person there is the median observer."""
    result: dict[Side, Threshold] = {}
    for place, side in enumerate(sides):
        largest, nothing = float(people.frames[:, place].max()), estimates.Interval(None, None, confidence)
        log_found, gradient = _log_threshold(point, people, place, level, kind)
        if not math.isfinite(log_found):
            note = f"{100 * level:g}% is not crossed: false alarms lie above it, or lapses keep the curve below it"
            result[side] = Threshold(side, None, None, nothing, "not estimable", METHOD, note)
            continue
        variance, freedom = _variance(doubt, gradient, doubt.motions[place])
        error = math.sqrt(variance) if variance > 0 else None
        times = estimates.t_quantile(confidence, freedom)
        result[side] = log_threshold(side, math.exp(log_found), error, times, largest, METHOD, confidence)
    return result


def _variance(doubt: _Doubt, gradient: FloatArray, motions: BetweenMotions) -> tuple[float, float]:
    """Variance of the log threshold, and its degrees of freedom.

    The part that comes from people's differing rests on as many of them as there are, less one, that from motions'
    on as many motions; the part that comes from single answers rests on many (Satterthwaite 1946). Maximum likelihood
    takes the first part too small by one participant, as it does every variance.
    """
    variance, others = float(gradient @ doubt.covariance @ gradient), doubt.participants - 1
    between = float(doubt.point[-2] ** 2 + (gradient[0] * doubt.point[-1]) ** 2) / others
    variance += between / doubt.participants
    if not variance > 0:
        return 0.0, math.inf
    spread = min(between, variance) ** 2 / others + motions.satterthwaite
    variance += motions.added
    return variance, variance**2 / max(spread, 1e-6 * variance**2)


def _alike_probability(ratio: float) -> float:
    """Two spreads tested at their bound: weights 1/4, 1/2, 1/4 of chi-square with 0, 1 and 2 degrees of freedom."""
    if ratio <= 0:
        return 1.0
    return 0.5 * estimates.chi_square_probability(ratio, 1) + 0.25 * estimates.chi_square_probability(ratio, 2)
