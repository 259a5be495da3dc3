"""Which of two methods participants find more natural: answers of a preference task in, percentages and tests out.

As published (2004 section 5.2, Table 2): percent favouring and chi-square with one degree of freedom over all answers.
The answers of a participant are not independent, so the test to believe takes one number a participant; the
intraclass correlation and the design effect say how far the two can differ.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from study.analysis import estimates
from study.analysis.estimates import Interval, NotFitted
from study.analysis.headline import Headline
from study.analysis.preference.answers import preference_answers
from study.analysis.preference.bradley_terry import BradleyTerry, fit_bradley_terry
from study.analysis.preference.default_test import DefaultTest, default_test
from study.analysis.preference.motions import MotionsAsSample, motions_as_sample
from study.analysis.preference.no_effect import MARGIN, NoEffect, no_preference
from study.analysis.preference.order import ONE_ORDER, OrderEffect, order_effect
from study.analysis.preference.participants import ParticipantTests, participant_tests
from study.analysis.preference.published import MotionPreference, Published, by_motion, without_ties
from study.analysis.study_result import Settings
from study.counting import counted

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Comparison:
    """Two methods compared.

    `published` leaves `ties` out, the other tests take them as half an answer; `default` is the test that the sentence
    in `answer` rests on.
    """

    method_a: str
    method_b: str
    published: Published
    ties: int
    participants: ParticipantTests
    clustering: estimates.Clustering
    motions: tuple[MotionPreference, ...]
    motions_as_sample: MotionsAsSample
    order: OrderEffect
    no_preference: NoEffect
    default: DefaultTest
    answer: str


@dataclass(frozen=True)
class Preference:
    """The result of a preference study: each pair of methods, and strengths where more than two were compared."""

    keys: ClassVar[Mapping[str, str]] = {"preference": "comparisons", "bradley_terry": "strengths"}

    comparisons: tuple[Comparison, ...]
    strengths: BradleyTerry | NotFitted | None

    def sentences(self, alpha: float) -> list[str]:
        """Return the preferences in words, written at the level of significance of the analysis, and the strengths."""
        del alpha
        told = [compared.answer for compared in self.comparisons]
        return [*told, strengths_in_words(self.strengths)] if self.strengths else told

    def headlines(self, study: str, alpha: float, confidence: float) -> list[Headline]:
        """Return each comparison's share by the default test."""
        del alpha
        return [
            Headline(
                study=study,
                statement=compared.answer,
                estimate=compared.default.percent,
                unit=f"percent favouring {compared.method_a} over {compared.method_b}",
                interval=Interval(compared.default.low, compared.default.high, confidence),
                p=compared.default.p_value,
                p_adjusted=compared.default.p_value,
                test=compared.default.test,
                generalises_to=compared.default.generalises_to,
                note=compared.default.note or compared.published.note,
            )
            for compared in self.comparisons
        ]


def compare(
    answers: pd.DataFrame,
    confidence: float = 0.95,
    alpha: float = 0.05,
    *,
    margin: float = MARGIN,
) -> tuple[Comparison, ...]:
    """Analyse every pair of methods that was compared, in the order of first appearance.

    Parameters
    ----------
    alpha
        Level of significance that the sentence in `answer` speaks of.
    margin
        Of the equivalence test: the difference from an even split that still counts as none (0.1 is 40 to 60%).
    """
    given = preference_answers(answers)
    results = []
    for (method_a, method_b), part in given.groupby(["method_a", "method_b"], sort=False):
        by_participant = part.groupby(part["participant"].astype(str))["chose_a"].agg(["sum", "count"])
        chosen, shown = (by_participant[name].to_numpy(dtype=np.float64) for name in ("sum", "count"))
        names = str(method_a), str(method_b)
        published = without_ties(part, confidence)
        participants = participant_tests(chosen, shown, confidence)
        order = order_effect(part, confidence)
        motions = motions_as_sample(part, confidence)
        default = default_test(participants, motions)
        results.append(
            Comparison(
                *names,
                published=published,
                ties=int((part["chose_a"] == 0.5).sum()),
                participants=participants,
                clustering=estimates.clustering(chosen, shown),
                motions=by_motion(part, confidence),
                motions_as_sample=motions,
                order=order,
                no_preference=no_preference(chosen[shown > 0] / shown[shown > 0], margin, alpha),
                default=default,
                answer=_order_in_words(*names, order, alpha) or _in_words(*names, published, default, order, alpha),
            )
        )
    return tuple(results)


def analyse_preference(answers: pd.DataFrame, name: str, settings: Settings) -> Preference:
    """Analyse one preference study by the preregistered settings."""
    del name
    compared = compare(answers, settings.confidence, settings.alpha, margin=settings.margin)
    return Preference(compared, strengths(answers, settings.confidence))


def strengths(
    answers: pd.DataFrame, confidence: float = 0.95, reference: str | None = None
) -> BradleyTerry | NotFitted | None:
    """Return Bradley-Terry strengths of the methods of one study; None where only two were compared.

    `reference` as `fit_bradley_terry` takes it.

    With two methods the strengths say nothing that their percentage does not.
    """
    given = preference_answers(answers)
    if len({*given["method_a"].astype(str), *given["method_b"].astype(str)}) < 3:
        return None
    ordered = "a_first" in given.columns and given["a_first"].notna().all()
    a_first = given["a_first"].astype(bool).to_numpy() if ordered else np.ones(len(given), dtype=bool)
    a, b = given["method_a"].astype(str).to_numpy(), given["method_b"].astype(str).to_numpy()
    first, second = np.where(a_first, a, b), np.where(a_first, b, a)
    chosen = given["chose_a"].to_numpy(dtype=np.float64)
    favoured = np.where(a_first, chosen, 1 - chosen)
    found = fit_bradley_terry(
        [str(name) for name in first],
        [str(name) for name in second],
        favoured,
        np.ones(len(given)),
        tied=chosen == 0.5,
        with_order=bool(ordered),
        reference=reference,
        confidence=confidence,
        participants=[str(name) for name in given["participant"]],
        motions=[str(name) for name in given["motion"]] if "motion" in given.columns else None,
    )
    return NotFitted(found) if isinstance(found, str) else found


def strengths_in_words(found: BradleyTerry | NotFitted) -> str:
    """Return the strengths of the methods in a sentence, and what can't be estimated."""
    if isinstance(found, NotFitted):
        return f"Strengths of the methods: {found.note}."
    parts = [
        f"{row.method} {row.value:+.2f}"
        + ("" if row.standard_error is None else f" ({row.interval.low:.2f} to {row.interval.high:.2f})")
        for row in found.strengths
        if row.value is not None and row.method != found.reference
    ]
    said = f"Strengths in logits beside {found.reference}: {', '.join(parts) or 'none is finite'}"
    return f"{said}. {found.note[:1].upper()}{found.note[1:]}." if found.note else f"{said}."


def _order_in_words(method_a: str, method_b: str, order: OrderEffect, alpha: float) -> str:
    """What is to be said in place of a preference where the order of presentation decided every answer."""
    if order.balanced_percent is None or order.first_percent not in (0.0, 100.0):
        return ""
    if (estimates.binomial_probability(0, order.answers) or 1.0) >= alpha:
        return ""
    place = "first" if order.first_percent else "second"
    return (
        f"Each of {counted(order.answers, 'answer')} favoured the one shown {place}: the order of presentation "
        f"decided, which says nothing about {method_a} and {method_b}."
    )


def _in_words(
    method_a: str,
    method_b: str,
    published: Published,
    default: DefaultTest,
    order: OrderEffect,
    alpha: float,
) -> str:
    """Who was favoured, how often, whether it can be told from chance, and what the order had to do with it."""
    if published.percent is None:
        return f"There are no answers that choose between {method_a} and {method_b}."
    p_value = default.p_value
    share = f"{published.percent:.1f}% of {counted(published.answers, 'answer')} favoured {method_a} over {method_b}"
    if p_value is None:
        said = f"{share}; one participant says nothing about others."
    else:
        verdict = "significant" if p_value < alpha else "not significant"
        said = f"{share}; across {default.generalises_to}, this is {verdict} (p {_p_in_words(p_value)})."
    if ONE_ORDER in order.note:
        return f"{said} {ONE_ORDER[0].upper()}{ONE_ORDER[1:]}."
    if order.p_value is not None and order.p_value < alpha:
        place, percent = ("first", order.first_percent or 0.0)
        if percent < 50:
            place, percent = "second", 100 - percent
        return (
            f"{said} The order of presentation mattered: {percent:.1f}% favoured the one shown {place} "
            f"(p {_p_in_words(order.p_value)})."
        )
    return said


def _p_in_words(p_value: float) -> str:
    return "< .001" if p_value < 0.001 else f"= {p_value:.3f}".replace("0.", ".", 1) if p_value < 1 else "= 1"
