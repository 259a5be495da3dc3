"""QUEST+: after each answer, ask the level whose answer is expected to tell most about the parameters (Watson 2017).

A grid of parameters, a prior over it and the chance of a "yes" at each level and point come in; counts of answers give
the posterior, and the posterior gives the next level. Watson asks for the least expected entropy of the posterior. That
is the level with the most mutual information between its answer and the parameters, the entropy of the answer less its
mean entropy at each point, which takes two products of a matrix and a vector instead of a posterior for every answer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import ClassVar

import numpy as np

from study.arrays import FloatArray, IntArray
from study.models.detection import BEST_D_PRIME, said_yes
from study.models.differencing import criterion_free_delta, detected
from study.models.forced import FORCED, Forced
from study.models.population import LEAST_CRITERION
from study.models.tracks import Found, Rule

TINY = 1e-12

DROP = 0.5 * 3.841458820694124
"""Half of the 95% point of a chi-square with one degree of freedom."""

ROUNDED = 10
"""Digits of the information that count: levels that tell the same, but for rounding, are alike on every machine."""


@dataclass(frozen=True, eq=False)
class QuestPlus:
    """What is asked and what may be true: levels, and a grid of parameters."""

    axes: tuple[FloatArray, ...]
    """The values of each parameter; a point of the grid is one of each, the last axis changing fastest."""
    chances: FloatArray
    """`(levels, points)`: probability of a "yes" at each level and point, above 0 and below 1."""
    prior: FloatArray
    """`(points,)`: adds to one."""

    @cached_property
    def _logs(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        with np.errstate(divide="ignore"):
            return np.log(self.chances), np.log1p(-self.chances), np.log(self.prior)

    @cached_property
    def _entropies(self) -> FloatArray:
        return entropy(self.chances)

    def likelihood(self, yes: IntArray, no: IntArray) -> FloatArray:
        """Return its logarithm at each point, shape (points,), after so many answers at each level, shape (levels,)."""
        return np.asarray(yes @ self._logs[0] + no @ self._logs[1])

    def posterior(self, yes: IntArray, no: IntArray) -> FloatArray:
        """Return the mass at each point, shape (points,), after so many answers at each level, shape (levels,)."""
        log = self._logs[2] + self.likelihood(yes, no)
        mass = np.exp(log - log.max())
        return np.asarray(mass / mass.sum())

    def information(self, posterior: FloatArray) -> FloatArray:
        """Return what an answer at each level is expected to tell of the parameters, in nats, shape (levels,)."""
        return entropy(self.chances @ posterior) - self._entropies @ posterior

    def information_on(self, axis: int, posterior: FloatArray) -> FloatArray:
        """Return what an answer is expected to tell of one parameter, whatever it tells of the others (Prins 2013)."""
        sizes = [*map(len, self.axes)]
        chances = np.moveaxis(self.chances.reshape(-1, *sizes), axis + 1, 1).reshape(len(self.chances), sizes[axis], -1)
        split = np.moveaxis(posterior.reshape(sizes), axis, 0).reshape(sizes[axis], -1)
        mass = split.sum(axis=1)
        yes = np.einsum("lpo,po->lp", chances, split) / np.maximum(mass, TINY)
        return np.asarray(entropy(yes @ mass) - entropy(yes) @ mass)

    def next_level(self, posterior: FloatArray) -> int:
        """Return the number of the level to ask; of several that tell as much, the first."""
        return int(np.argmax(np.round(self.information(posterior), ROUNDED)))

    def marginal(self, posterior: FloatArray, axis: int) -> FloatArray:
        """Return the mass at each value of one parameter."""
        return np.asarray(posterior.reshape([*map(len, self.axes)]).sum(axis=self._others(axis)))

    def profile(self, likelihood: FloatArray, axis: int) -> FloatArray:
        """Return the greatest log-likelihood at each value of one parameter, whatever the others are."""
        return np.asarray(likelihood.reshape([*map(len, self.axes)]).max(axis=self._others(axis)))

    def _others(self, axis: int) -> tuple[int, ...]:
        return tuple(place for place in range(len(self.axes)) if place != axis)


def entropy(yes: FloatArray) -> FloatArray:
    """Return the entropy in nats of an answer that is "yes" with this probability."""
    yes = np.clip(yes, TINY, 1 - TINY)
    return -(yes * np.log(yes) + (1 - yes) * np.log1p(-yes))


def median(values: FloatArray, mass: FloatArray) -> float:
    """Return where a marginal has come to one half, linear between the middles of its steps."""
    return float(np.interp(0.5, np.cumsum(mass) - mass / 2, values))


def likelihood_interval(values: FloatArray, profile: FloatArray) -> tuple[float, float]:
    """Return the ends of the 95% interval by the profile of the log-likelihood, linear between its values.

    It has the values at which the answers are not much less likely than at the best one: twice the difference of the
    logarithms is at most the 95% point of a chi-square with one degree of freedom (Wilks 1938). An end beyond the grid
    is that of the grid.
    """
    over = profile - profile.max() + DROP
    first, last = np.flatnonzero(over >= 0)[[0, -1]]
    ends = (first - 1, first, values[0]), (last + 1, last, values[-1])
    low, high = (
        float(np.interp(0.0, over[[out, within]], values[[out, within]])) if 0 <= out < len(values) else float(end)
        for out, within, end in ends
    )
    return low, high


@dataclass(frozen=True)
class Asked:
    """Where a track of QUEST+ stands: answers right and wrong at each level, those without a difference first."""

    right: tuple[int, ...]
    wrong: tuple[int, ...]
    trials: int = 0
    """Of its own, those without an answer among them."""
    left: tuple[int, ...] | None = None
    """The levels of the constant stimuli that are still to come; None before they began."""


@dataclass(frozen=True)
class QuestRule(Rule):
    """QUEST+ over differences of blend length, in a task with a model of deciding.

    The threshold is sought, criterion and lapse rate are nuisances that are summed over. Trials that show no difference
    tell of the nuisances, and count for every track of a participant.
    """

    title: ClassVar[str] = "QUEST+ track"
    task: str
    """`same-different`: the differencing model; the threshold is criterion-free. Or `yes-no`, likewise; else one of
    `FORCED`."""
    levels: tuple[int, ...]
    """The differences that may be asked, in frames, from the least."""
    threshold_frames: float
    threshold_spread: float
    """`threshold_frames`, `threshold_spread`: median of the prior, and standard deviation of the natural logarithm."""
    criterion: float
    criterion_spread: float
    """`criterion`, `criterion_spread`: mean and standard deviation of the prior, for same-different; yes-no takes
    half of both (`models.detection`)."""
    most_lapses: float
    """The prior of the lapse rate falls in a straight line, to nothing just beyond this."""
    slope_spread: float
    """In forced choices d' grows with the difference to a power; its median is 1, this its natural logarithm's
    standard deviation."""
    least_trials: int
    trials: int
    narrow: float
    """`least_trials`, `trials`, `narrow`: a track stops after at least and at most so many trials, between them once
    the upper end of its threshold's 95% interval is at most so many times the lower; 1 for never."""
    shared: bool = False
    then_constant: tuple[float, ...] = ()
    then_repeats: int = 1
    """`then_constant`, `then_repeats`: constant stimuli at the end, among `trials`: at which multiples of the threshold
    found, and how often each."""

    @property
    def target(self) -> float:
        """Half of the way from chance to never wrong."""
        return DECIDING[self.task].target

    @property
    def adaptive_trials(self) -> int:
        """The most trials before constant stimuli."""
        return self.trials - len(self.then_constant) * self.then_repeats

    @property
    def estimate(self) -> str:
        """How a track's threshold is found."""
        return "median of the posterior"

    def meaning(self, right: str) -> str:
        """What holds at the threshold: in same-different and yes-no, whatever a participant's own criterion is."""
        if not DECIDING[self.task].has_criterion:
            return super().meaning(right)
        return f"an observer with the best criterion would be right in {100 * self.target:.0f}% of the trials"

    def begin(self) -> Asked:
        """Nothing was asked."""
        none = (0,) * (len(self.levels) + 1)
        return Asked(none, none)

    def due(self, track: Asked) -> int:
        """The level that is expected to tell most, or the next of the constant stimuli."""
        return track.left[0] if track.left else _most_telling(self, track.right, track.wrong)

    def after(self, track: Asked, level: int, right: bool | None) -> Asked:
        """One answer more at this level."""
        place = self.levels.index(level) + 1
        later = replace(self._counted(track, place, right), trials=track.trials + 1)
        if track.left is not None:
            return replace(later, left=track.left[1:])
        return replace(later, left=self._constant(later)) if self.then_constant and self._knows(later) else later

    def beside(self, track: Asked, right: bool) -> Asked:
        """One answer more where there was no difference."""
        return self._counted(track, 0, right)

    def _counted(self, track: Asked, place: int, right: bool | None) -> Asked:
        if right is None:
            return track
        counts = list(track.right if right else track.wrong)
        counts[place] += 1
        return replace(track, right=tuple(counts)) if right else replace(track, wrong=tuple(counts))

    def over(self, track: Asked) -> bool:
        """After its most trials or once it knows enough, and after the constant stimuli then."""
        return track.left == () if self.then_constant else self._knows(track)

    def _constant(self, track: Asked) -> tuple[int, ...]:
        """Levels around the threshold, in an order that the answers so far decide as a seed does."""
        wanted = np.repeat(self.then_constant, self.then_repeats) * self.found(track).frames
        nearest = np.array(self.levels)[np.abs(np.subtract.outer(wanted, self.levels)).argmin(axis=1)]
        return tuple(np.random.default_rng([*track.right, *track.wrong]).permutation(nearest).tolist())

    def _knows(self, track: Asked) -> bool:
        if track.trials >= self.adaptive_trials:
            return True
        if track.trials < self.least_trials or self.narrow == 1:
            return False
        found = self.found(track)
        return (found.high or np.inf) <= self.narrow * (found.low or 0.0)

    def asked(self, track: Asked) -> int:
        """All trials of its own so far."""
        return track.trials

    def found(self, track: Asked) -> Found:
        """Median and standard deviation of the posterior of the threshold; 95% interval by its profile likelihood."""
        return _found(self, track.right, track.wrong)

    def posterior(self, track: Asked) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The values of the threshold's grid, and the posterior of each, whatever the nuisances are."""
        quest = _grid(self)
        mass = quest.marginal(quest.posterior(np.array(track.right), np.array(track.wrong)), 0)
        return tuple(np.exp(quest.axes[0]).round(3).tolist()), tuple(mass.round(5).tolist())


@dataclass(frozen=True)
class Deciding:
    """How a task is decided, for QUEST+."""

    target: float
    """The share of right answers at threshold; with a criterion, that of an observer with the best one."""
    has_criterion: bool
    right: Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
    """Chances of right answers, given the difference over the threshold (0 for none), the criterion or else the slope,
    and the lapse rate."""


def _same_different(over: FloatArray, criterion: FloatArray, lapse: FloatArray) -> FloatArray:
    different = lapse / 2 + (1 - lapse) * detected(criterion_free_delta(0.75) * over, criterion)
    return np.where(over > 0, different, 1 - different)


def _yes_no(over: FloatArray, criterion: FloatArray, lapse: FloatArray) -> FloatArray:
    yes = said_yes(BEST_D_PRIME * over, criterion, lapse)
    return np.where(over > 0, yes, 1 - yes)


def _forced(forced: Forced, over: FloatArray, slope: FloatArray, lapse: FloatArray) -> FloatArray:
    return forced.with_lapses(forced.at_threshold * over**slope, lapse)


DECIDING = {
    "same-different": Deciding(0.75, True, _same_different),
    "yes-no": Deciding(0.75, True, _yes_no),
    **{name: Deciding(forced.halfway, False, partial(_forced, forced)) for name, forced in FORCED.items()},
}
"""By the task."""

THRESHOLDS, CRITERIA, SLOPES, LAPSES = 41, 19, 9, 5
WIDE, STRICTEST = 3.0, 5.0
"""`WIDE`: standard deviations of its prior that the threshold's grid goes on either side; `STRICTEST`: those that the
criterion's goes up, since strict participants say little of theirs and an interval must not end where the grid does."""
LOOSE_CRITERION, LOOSE_SLOPE = 4.0, 2.0
"""In intervals their priors count as if they were so many times as wide. As they are, they say more than most answers
do: intervals of participants who are stricter than the prior says held 99% of the thresholds instead of 95%. Without
them intervals would be too short of participants who never lapse. There all lapse rates are as likely."""


@lru_cache(maxsize=64)
def _grid(rule: QuestRule) -> QuestPlus:
    """The grid of a rule: the logarithm of the threshold, the criterion or else the slope, the lapse rate.

    Most people hardly lapse. Were all rates as likely, thresholds of those who never do would come out 10% low.
    """
    steps = np.linspace(-WIDE, WIDE, THRESHOLDS)
    logs = np.log(rule.threshold_frames) + rule.threshold_spread * steps
    lapses = np.linspace(0, rule.most_lapses, LAPSES)
    seldom = LAPSES - 0.5 - np.arange(LAPSES)
    others, off = _criteria(rule) if DECIDING[rule.task].has_criterion else _slopes(rule)
    threshold, other, lapse = (part.ravel() for part in np.meshgrid(np.exp(logs), others, lapses, indexing="ij"))
    frames = np.array([0, *rule.levels], dtype=np.float64)[:, None]
    right = DECIDING[rule.task].right(frames / threshold, other, lapse)
    prior = (np.exp(-0.5 * (steps[:, None, None] ** 2 + off[:, None] ** 2)) * seldom).ravel()
    return QuestPlus((logs, others, lapses), np.clip(right, 1e-9, 1 - 1e-9), prior / prior.sum())


def _criteria(rule: QuestRule) -> tuple[FloatArray, FloatArray]:
    """Values, and how many standard deviations of the prior they are off its middle."""
    low, high = (rule.criterion + rule.criterion_spread * end for end in (-2.5, STRICTEST))
    criteria = np.linspace(max(low, LEAST_CRITERION), high, CRITERIA)
    return criteria, (criteria - rule.criterion) / rule.criterion_spread


def _slopes(rule: QuestRule) -> tuple[FloatArray, FloatArray]:
    """Likewise; one value where no other is likely."""
    off = np.linspace(-WIDE, WIDE, SLOPES) if rule.slope_spread else np.zeros(1)
    return np.exp(rule.slope_spread * off), off


@lru_cache(maxsize=20_000)
def _most_telling(rule: QuestRule, right: tuple[int, ...], wrong: tuple[int, ...]) -> int:
    """The level to ask next: remembered, since a session is folded anew at each answer."""
    quest = _grid(rule)
    told = quest.information_on(0, quest.posterior(np.array(right), np.array(wrong)))[1:]
    return rule.levels[int(np.argmax(np.round(told, ROUNDED)))]


@lru_cache(maxsize=20_000)
def _found(rule: QuestRule, right: tuple[int, ...], wrong: tuple[int, ...]) -> Found:
    """The threshold so far, remembered likewise."""
    quest = _grid(rule)
    counts = np.array(right), np.array(wrong)
    mass, frames = quest.marginal(quest.posterior(*counts), 0), np.exp(quest.axes[0])
    spread = float(np.sqrt(mass @ frames**2 - (mass @ frames) ** 2))
    criterion = DECIDING[rule.task].has_criterion
    off = _criteria(rule)[1] / LOOSE_CRITERION if criterion else _slopes(rule)[1] / LOOSE_SLOPE
    loose = np.repeat(-0.5 * off**2, LAPSES)
    likely = quest.likelihood(*counts) + np.tile(loose, len(frames))
    ends = likelihood_interval(quest.axes[0], quest.profile(likely, 0))
    middle, low, high = map(float, np.exp([median(quest.axes[0], mass), *ends]))
    return Found(middle, spread, low, high)
