"""The effect of a preference study: a share of answers for the first method, over participants who differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq
from scipy.special import expit

from study.analysis.analyse import Analysis
from study.analysis.estimates import NotFitted
from study.analysis.exclusions import exclude
from study.analysis.preference.analyse import Preference, strengths
from study.analysis.preference.bradley_terry import BradleyTerry, fit_bradley_terry
from study.analysis.preference.default_test import p_values_of_studies
from study.arrays import BoolArray, FloatArray
from study.errors import AnalysisError
from study.experiment.protocol.studies import AnalysisSettings
from study.experiment.protocol.whole import StudySpec
from study.models.choice import PreferenceObserver, lean
from study.power.curve import Run
from study.power.design import Design, Effect, kept_of, motions_of, times
from study.tasks.observer import ObserverSettings, default_observer


def preference_effect(study: StudySpec, options: Mapping[str, float], decided: AnalysisSettings) -> Effect:
    """Return a mean share over participants, their correlation, and what being shown first adds."""
    share, correlation, bias, alpha = options["share"], options["correlation"], options["order_bias"], decided.alpha
    spread = options.get("motion_sd", 0.0)
    stated = {"share": share, "correlation": correlation, "order_bias": bias}
    effect = Effect(
        observer=preference_observer(study, share, correlation, bias, options["missed"], spread),
        stated=stated | ({"motion_sd": spread} if spread else {}),
        icc=correlation,
        test=f"Student's t over participants and motions at {alpha:g}",
        aim=f"find a preference of {100 * share:g}% at the level {alpha:g}",
        study=lambda design: preference_study(design, alpha, share, spread),
        found=lambda analysis: preference_found(analysis, study.name, share, alpha),
        with_motions=lambda design, motions: preference_study(design, alpha, share, spread, motions),
        motion_sd=spread,
    )
    if not study.others:
        return effect
    return replace(
        effect,
        test=f"Bradley-Terry strengths over participants and motions at {alpha:g}",
        aim=f"find that {study.reference} is chosen over {study.comparison} in {100 * share:g}% at the level "
        f"{alpha:g}, where all other methods are as {study.comparison}",
        study=lambda design: strengths_study(design, alpha, share, spread),
        analysed=lambda design, answers, checks: strengths(
            exclude(answers, design.rules, checks)[0], 1 - alpha, study.comparison
        ),
        found=lambda fitted: _apart(fitted, study.reference, share),
        with_motions=None,
        slow=True,
    )


def preference_found(analysis: Analysis, name: str, share: float, alpha: float) -> bool:
    """Return whether the default test found the preference, in the right direction."""
    result = analysis.of(Preference).get(name)
    test = result.comparisons[0].default if result and result.comparisons else None
    if test is None or test.p_value is None or test.percent is None:
        return False
    return test.p_value < alpha and (share == 0.5 or (test.percent > 50) == (share > 0.5))


def preference_observer(
    study: StudySpec, share: float, correlation: float, order_bias: float, missed: float, motion_sd: float = 0.0
) -> ObserverSettings:
    """An observer whose shares have this mean over participants and motions, orders balanced.

    The intraclass correlation is that of the answers to one motion; motions differ by `motion_sd`, in logits.
    """
    mean, spread = logit_normal(share, correlation, order_bias)
    mean = mean_logit(share, float(np.hypot(spread, motion_sd)), order_bias) if motion_sd else mean
    utility: dict[str, float] = {study.reference: mean, study.comparison or "": 0.0}
    preference = PreferenceObserver(utility=utility, order_bias=order_bias, lapse=0.0, participant_sd=spread)
    return replace(default_observer(), preference=preference, missed=missed)


def logit_normal(share: float, correlation: float, order_bias: float = 0.0) -> tuple[float, float]:
    """Return mean and standard deviation, in logits, of participants with this mean share and correlation.

    Parameters
    ----------
    share
        Mean share over participants, between 0 and 1.
    correlation
        Intraclass correlation of their answers: variance of the participants' shares over share x (1 - share).
    order_bias
        Logits for what is shown first; shares are the means of both orders.

    Raises
    ------
    AnalysisError
        When share or correlation can't be.
    """
    if not 0 < share < 1 or not 0 <= correlation <= 0.9:
        raise AnalysisError(
            f"expected a share between 0 and 1 and a correlation from 0 to 0.9, found {share:g} and {correlation:g}"
        )

    def excess(spread: float) -> float:
        own, weights = _shares(mean_logit(share, spread, order_bias), spread, order_bias)
        return float(weights @ (own - share) ** 2) / (share * (1 - share)) - correlation

    spread = float(brentq(excess, 1e-6, 25.0)) if correlation else 0.0
    return mean_logit(share, spread, order_bias), spread


def _shares(mean: float, spread: float, order_bias: float) -> tuple[FloatArray, FloatArray]:
    """Shares over both orders of those who lean by a normal deviate, and the weights of these."""
    points, weights = np.polynomial.hermite_e.hermegauss(61)
    both = [expit(mean + spread * points + bias) for bias in (order_bias, -order_bias)]
    return np.asarray(np.mean(both, axis=0), dtype=np.float64), weights / weights.sum()


def mean_logit(share: float, spread: float, order_bias: float) -> float:
    """Return the mean in logits at which leanings with this standard deviation have this mean share."""

    def off(mean: float) -> float:
        own, weights = _shares(mean, spread, order_bias)
        return float(weights @ own) - share

    return float(brentq(off, -60, 60))


def preference_study(
    design: Design, alpha: float, share: float, motion_sd: float = 0.0, motions: int | None = None
) -> Run:
    """Whether the default test finds the preference, in the right direction (2004 section 5.2).

    Parameters
    ----------
    motion_sd
        Standard deviation across motions of the leaning, in logits.
    motions
        How many are shown, each as often as each is in the plans; theirs where it is None.
    """
    trials, typical = design.trials(), design.settings.preference
    signs = np.array([[1.0 if trial.a_first else -1.0 for trial in own] for own in trials])
    of_motion = motions_of(trials)
    if motions is not None:
        each = max(round(of_motion.shape[1] / of_motion.shape[2]), 1)
        of_motion = np.broadcast_to(np.repeat(np.eye(motions), each, axis=0), (len(trials), each * motions, motions))
        signs = np.where((np.arange(each * motions) + np.arange(len(trials))[:, None]) % 2, 1.0, -1.0)
    leaning = lean(typical, design.study.reference, design.study.comparison or "")

    def run(rng: np.random.Generator, studies: int, sizes: Sequence[int]) -> BoolArray:

        people = max(sizes)
        own = leaning + typical.participant_sd * rng.standard_normal((studies, people, 1))
        if motion_sd:
            by_motion = motion_sd * rng.standard_normal((studies, of_motion.shape[2]))
            own = own + np.einsum("sm,ptm->spt", by_motion, of_motion[:people])
        chance = expit(own + typical.order_bias * signs[:people])
        chose_a = rng.random(chance.shape) < chance
        response_s, given = times(design, rng, np.abs(2 * chance - 1))
        kept = kept_of(design, rng, response_s, given)
        chosen, shown = (
            np.einsum("spt,ptm->spm", answers.astype(np.float64), of_motion[:people])
            for answers in (chose_a & kept, kept)
        )
        return np.column_stack([_found(chosen[:, :size], shown[:, :size], share, alpha) for size in sizes])

    return run


def strengths_study(design: Design, alpha: float, share: float, motion_sd: float = 0.0) -> Run:
    """Whether Bradley-Terry strengths tell the reference from the comparison, in the right direction.

    Motions differ in how they suit each method, so that any two methods differ by `motion_sd` logits.
    """
    trials, typical = design.trials(), design.settings.preference
    a, b = (np.array([[trial.methods[k] for trial in own] for own in trials]) for k in (0, 1))
    first = np.array([[trial.a_first for trial in own] for own in trials])
    motions = np.array([[trial.motion for trial in own] for own in trials])
    people = np.broadcast_to(np.array([plan.participant for plan in design.plans])[:, None], motions.shape)
    apart = np.vectorize(lambda *pair: lean(typical, *pair))(a, b)
    shown, other = np.where(first, a, b), np.where(first, b, a)
    reference, comparison = design.study.reference, design.study.comparison or ""
    names, places = np.unique(np.stack([a, b]), return_inverse=True)
    films, where = np.unique(motions, return_inverse=True)

    def tells(size: int, kept: BoolArray, chose_first: BoolArray) -> bool:
        rows = kept[:size]
        which, against, who, what = (
            [str(name) for name in each[:size][rows]] for each in (shown, other, people, motions)
        )
        found = fit_bradley_terry(
            which,
            against,
            chose_first[:size][rows],
            np.ones(int(rows.sum())),
            reference=comparison,
            confidence=1 - alpha,
            participants=who,
            motions=what,
        )
        return _apart(found, reference, share)

    def run(rng: np.random.Generator, studies: int, sizes: Sequence[int]) -> BoolArray:
        count = max(sizes)
        own = typical.participant_sd * rng.standard_normal((studies, count, 1))
        if motion_sd:
            suits = motion_sd / np.sqrt(2.0) * rng.standard_normal((studies, len(films), len(names)))
            sides = (suits[:, where.reshape(a.shape), side.reshape(a.shape)] for side in places.reshape(2, -1))
            own = own + np.subtract(*sides)[:, :count]
        towards_a = apart[:count] + own
        chance = expit(np.where(first[:count], towards_a, -towards_a) + typical.order_bias)
        chose_first = rng.random(chance.shape) < chance
        kept = kept_of(design, rng, *times(design, rng, np.abs(2 * chance - 1)))
        return np.array([[tells(size, kept[n], chose_first[n]) for size in sizes] for n in range(studies)])

    return run


def _apart(found: BradleyTerry | NotFitted | str | None, reference: str, share: float) -> bool:
    """Whether the reference's strength lies beyond that of the comparison, which is 0, in the right direction."""
    if not isinstance(found, BradleyTerry):
        return False
    low, high = next((row.interval.low, row.interval.high) for row in found.strengths if row.method == reference)
    return low is not None and high is not None and (low > 0 if share > 0.5 else high < 0)


def _found(chosen: FloatArray, shown: FloatArray, share: float, alpha: float) -> BoolArray:
    """Significant, and towards the method that is really favoured (either way where none is)."""
    mean = chosen.sum(axis=(1, 2)) / np.maximum(shown.sum(axis=(1, 2)), 1)
    towards = (mean > 0.5) == (share > 0.5) if share != 0.5 else np.ones(len(chosen), dtype=bool)
    return np.asarray((p_values_of_studies(chosen, shown) < alpha) & towards)
