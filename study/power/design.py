"""Studies for `segue power`: a protocol's real plans and stated effects in, functions that simulate and analyse out.

Answers come from the observer models of `segue simulate`, answer window, inattention and the protocol's exclusions
included. Hundreds of studies are drawn and analysed at once; `whole_sessions` sends one study after another through the
session itself and the whole analysis, which takes hundreds of times as long and finds the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from study.analysis.exclusions import Rules, exclude
from study.analysis.preference.participants import default_p_values, student_p_values
from study.experiment.observers import person, respond
from study.models.choice import PreferenceObserver
from study.models.ordinal import RatingObserver
from study.models.population import probability_different
from study.power.curve import Run, logit_normal
from study.tasks.observer import ObserverSettings, default_observer
from study.tasks.registry import answer_columns, task_of

if TYPE_CHECKING:
    import pandas as pd

    from study.experiment.plan import Plan
    from study.experiment.protocol.whole import Protocol, StudySpec
    from study.tasks.trial import Trial

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Design:
    """What is simulated.

    Attributes
    ----------
    protocol, study
        Of the sitting, and which of its studies.
    plans
        Real plans, one a participant, at least as many as the largest study has.
    settings
        The observer that the stated effects amount to.
    rules
        What the protocol leaves out.
    """

    protocol: Protocol
    study: StudySpec
    plans: tuple[Plan, ...]
    settings: ObserverSettings
    rules: Rules

    def trials(self, role: str = "trial") -> list[list[Trial]]:
        """The study's own trials of each plan."""
        return [
            [trial for trial in plan.trials if trial.study == self.study.name and trial.role == role]
            for plan in self.plans
        ]

    @property
    def window_s(self) -> float | None:
        """How long an answer may take; ratings have no limit."""
        return self.protocol.timing.answer_s if task_of(self.study).timed else None


def preference_observer(
    study: StudySpec, share: float, correlation: float, order_bias: float, missed: float
) -> ObserverSettings:
    """An observer whose shares over participants have this mean and intraclass correlation, orders balanced."""
    mean, spread = logit_normal(share, correlation, order_bias)
    utility: dict[str, float] = {study.reference: mean, study.comparison or "": 0.0}
    preference = PreferenceObserver(utility=utility, order_bias=order_bias, lapse=0.0, participant_sd=spread)
    return replace(default_observer(), preference=preference, missed=missed)


def same_different_observer(shorter: float, longer: float, spread: float, missed: float) -> ObserverSettings:
    """An observer with these thresholds over participants, who differ by `spread`."""
    settings = default_observer(shorter, longer)
    typical = replace(settings.same_different, log_sensitivity_sd=spread, criterion_sd=spread)
    return replace(settings, same_different=typical, missed=missed)


def rating_observer(study: StudySpec, difference: float, correlation: float, missed: float) -> ObserverSettings:
    """An observer who rates the comparison higher by `difference` points before they are rounded to the scale."""
    typical = RatingObserver()
    spread = typical.noise_sd * np.sqrt(correlation / (1 - correlation))
    utility: dict[str, float] = {study.comparison or "": difference / typical.utility_weight}
    return replace(
        default_observer(),
        preference=PreferenceObserver(utility=utility),
        rating=replace(typical, participant_sd=float(spread)),
        missed=missed,
    )


def preference_study(design: Design, alpha: float, share: float) -> Run:
    """Whether the test over participants finds the preference, in the right direction (2004 section 5.2)."""
    trials, typical = design.trials(), design.settings.preference
    signs = np.array([[1.0 if trial.a_first else -1.0 for trial in own] for own in trials])
    lean = typical.utility[design.study.reference] - typical.utility.get(design.study.comparison or "", 0.0)

    def run(rng: np.random.Generator, studies: int, sizes: Sequence[int]) -> BoolArray:
        from scipy.special import expit

        people = max(sizes)
        own = lean + typical.participant_sd * rng.standard_normal((studies, people, 1))
        chance = expit(own + typical.order_bias * signs[:people])
        chose_a = rng.random(chance.shape) < chance
        response_s, given = _times(design, rng, np.abs(2 * chance - 1))
        kept = _kept(design, rng, response_s, given)
        chosen, shown = (chose_a & kept).sum(axis=2), kept.sum(axis=2)
        return np.column_stack(
            [_found(chosen[:, :size].astype(float), shown[:, :size].astype(float), share, alpha) for size in sizes]
        )

    return run


def _found(chosen: FloatArray, shown: FloatArray, share: float, alpha: float) -> BoolArray:
    """Significant, and towards the method that is really favoured (either way where none is)."""
    people = np.maximum((shown > 0).sum(axis=1), 1)
    mean = (chosen / np.maximum(shown, 1)).sum(axis=1) / people
    towards = (mean > 0.5) == (share > 0.5) if share != 0.5 else np.ones(len(chosen), dtype=bool)
    return np.asarray((default_p_values(chosen, shown) < alpha) & towards)


def rating_study(design: Design, alpha: float, difference: float) -> Run:
    """Whether the t test over participants finds how the methods differ, for one question.

    Of each participant's own difference of the two methods' ratings; where pairs are rated, of the mean score less the
    middle of the scale.
    """
    if task_of(design.study).slots > 1:
        return _pair_rating_study(design, alpha, difference)
    trials, rating = design.trials(), design.settings.rating
    sides = np.array([[1.0 if trial.methods[0] == design.study.comparison else 0.0 for trial in own] for own in trials])
    points = design.study.scale_points

    def run(rng: np.random.Generator, studies: int, sizes: Sequence[int]) -> BoolArray:
        people = max(sizes)
        leniency = rating.participant_sd * rng.standard_normal((studies, people, 1))
        middle = (points - 1) / 2 + difference * sides[:people] + leniency
        given = np.clip(np.round(middle + rating.noise_sd * rng.standard_normal(middle.shape)), 0, points - 1)
        response_s, answered = _times(design, rng, np.full(middle.shape, 0.5))
        kept = _kept(design, rng, response_s, answered)
        means, seen = [], np.ones(kept.shape[:2], dtype=bool)
        for side in (1.0, 0.0):
            rows = kept & (sides[:people] == side)
            count = rows.sum(axis=2)
            seen &= count > 0
            means.append((given * rows).sum(axis=2) / np.maximum(count, 1))
        return _apart(means[0] - means[1], seen, sizes, alpha, difference)

    return run


def _pair_rating_study(design: Design, alpha: float, difference: float) -> Run:
    """Scores of the comparison against the reference; whether a trial showed one or the other first changes nothing."""
    trials, rating = design.trials(), design.settings.rating
    shown, points = len(trials[0]), design.study.scale_points

    def run(rng: np.random.Generator, studies: int, sizes: Sequence[int]) -> BoolArray:
        people, middle = max(sizes), (points - 1) / 2
        leaning = middle + difference + rating.participant_sd * rng.standard_normal((studies, people, 1))
        noise = rating.noise_sd * rng.standard_normal((studies, people, shown))
        given = np.clip(np.round(leaning + noise), 0, points - 1)
        response_s, answered = _times(design, rng, np.full(given.shape, 0.5))
        kept = _kept(design, rng, response_s, answered)
        count = kept.sum(axis=2)
        apart = (given * kept).sum(axis=2) / np.maximum(count, 1) - middle
        return _apart(apart, count > 0, sizes, alpha, difference)

    return run


def _apart(apart: FloatArray, seen: BoolArray, sizes: Sequence[int], alpha: float, difference: float) -> BoolArray:
    """Significant, and in the right direction (either way where there is no difference), for each number of people."""
    found = []
    for size in sizes:
        there = seen[:, :size]
        p_value = student_p_values(apart[:, :size], there, 0.0)
        mean = (apart[:, :size] * there).sum(axis=1)
        towards = (mean > 0) == (difference > 0) if difference else np.ones(len(apart), dtype=bool)
        found.append((p_value < alpha) & towards)
    return np.column_stack(found)


def same_different_study(design: Design, precision: float, level: float) -> Run:
    """Whether the model's intervals of both thresholds are as narrow as asked (half their width, in frames)."""
    from study.analysis.same_different.interpolation import Counts
    from study.analysis.same_different.model import ModelFit, fit_model

    asked = np.array([[float(trial.difference_frames or 0) for trial in own] for own in design.trials()])
    levels = np.unique(asked)

    def narrow(different: FloatArray, shown: FloatArray) -> bool:
        there = shown.sum(axis=1) > 0
        names = tuple(str(place) for place in range(int(there.sum())))
        fit = fit_model(Counts(names, levels, different[there], shown[there]), level=level) if names else ""
        ends = [found.interval for found in fit.jnd.values()] if isinstance(fit, ModelFit) else []
        return bool(ends) and all(
            end.low is not None and end.high is not None and end.high - end.low <= 2 * precision for end in ends
        )

    def run(rng: np.random.Generator, studies: int, sizes: Sequence[int]) -> BoolArray:
        people = max(sizes)
        found = np.zeros((studies, len(sizes)), dtype=bool)
        for number in range(studies):
            seed = int(rng.integers(2**31))
            who = [
                person(design.settings, f"power-{place:03}", seed).settings.same_different for place in range(people)
            ]
            chance = np.array([probability_different(one, own) for one, own in zip(who, asked, strict=False)])
            different = rng.random(chance.shape) < chance
            response_s, given = _times(design, rng, np.abs(2 * chance - 1)[None])
            kept = _kept(design, rng, response_s, given)[0]
            at = asked[:people, :, None] == levels
            shown = (at & kept[:, :, None]).sum(axis=1).astype(float)
            yes = (at & (kept & different)[:, :, None]).sum(axis=1).astype(float)
            found[number] = [narrow(yes[:size], shown[:size]) for size in sizes]
        return found

    return run


def _times(design: Design, rng: np.random.Generator, ease: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Response times in seconds, and which answers were given in time (as `observers.respond` draws them)."""
    settings = design.settings
    median = settings.response_median_s * (1.5 - 0.5 * ease)
    response_s = median * np.exp(settings.response_log_sd * rng.standard_normal(ease.shape))
    inattentive = rng.random(ease.shape) < settings.missed
    late = inattentive | (response_s > design.window_s) if design.window_s is not None else np.zeros(ease.shape, bool)
    return response_s, np.asarray(~late)


def _kept(design: Design, rng: np.random.Generator, response_s: FloatArray, given: BoolArray) -> BoolArray:
    """Which answers the analysis counts: those given, and not left out by the protocol's rules."""
    if design.rules == Rules():
        return given
    import pandas as pd

    studies, people, trials = given.shape
    who = np.repeat(np.arange(studies * people), trials)
    table = pd.DataFrame(
        {
            "participant": who,
            "answer": _words(given, "given"),
            "response_s": np.where(given.ravel(), response_s.ravel(), np.nan),
        }
    )
    kept = exclude(table, design.rules, _checks(design, rng, studies, people))
    left = np.zeros(len(table), dtype=bool)
    left[kept.answers.index.to_numpy()] = True
    return np.asarray(given & left.reshape(given.shape))


def _checks(design: Design, rng: np.random.Generator, studies: int, people: int) -> pd.DataFrame:
    """Answers to attention checks: right wherever they were given in time."""
    import pandas as pd

    count = len(design.trials("check")[0])
    _, given = _times(design, rng, np.ones((studies, people, count)))
    who = np.repeat(np.arange(studies * people), count)
    return pd.DataFrame({"participant": who, "answer": _words(given, "right"), "expected": "right"})


def _words(given: BoolArray, word: str) -> NDArray[np.object_]:
    """The word where an answer was given, None where not."""
    words: NDArray[np.object_] = np.array([None, word], dtype=object)
    return np.asarray(words[given.ravel().astype(int)], dtype=object)


def whole_sessions(design: Design, verdict: Any) -> Run:
    """Studies one after another, each participant through a whole session, each study through the whole analysis.

    `verdict` says of a result of `analyse` whether the study found what there is.
    """
    import pandas as pd

    from study.analysis.analyse import analyse

    settings = design.protocol.analysis

    def run(rng: np.random.Generator, studies: int, sizes: Sequence[int]) -> BoolArray:
        found = np.zeros((studies, len(sizes)), dtype=bool)
        for number in range(studies):
            seed = int(rng.integers(2**31))
            parts = [_sitting(design, plan, seed) for plan in design.plans[: max(sizes)]]
            for place, size in enumerate(sizes):
                table = pd.concat(parts[:size], ignore_index=True)
                answers, checks = table[table["role"] == "trial"], table[table["role"] == "check"]
                result = analyse(
                    answers,
                    threshold=settings.threshold,
                    alpha=settings.alpha,
                    rules=design.rules,
                    checks=checks,
                    scale_points=design.protocol.scale_points,
                    resamples=10,
                )
                found[number, place] = verdict(result)
        return found

    return run


def _sitting(design: Design, plan: Plan, seed: int) -> pd.DataFrame:
    """A simulated participant's answers to the study, through the session that real front ends run."""
    import pandas as pd

    from study.experiment.session import open_session, walk

    who = person(design.settings, plan.participant, seed)
    own = [trial for trial in plan.trials if trial.study == design.study.name]
    state = open_session(
        design.protocol, replace(plan, trials=_renumbered(own), courses=()), passed=("consent", "form")
    )
    rows = [
        {"participant": plan.participant, **answer_columns(trial, answer)}
        for trial, answer in walk(state, partial(respond, who))
    ]
    return pd.DataFrame(rows)


def _renumbered(trials: Sequence[Trial]) -> tuple[Trial, ...]:
    return tuple(replace(trial, trial=number) for number, trial in enumerate(trials, start=1))
