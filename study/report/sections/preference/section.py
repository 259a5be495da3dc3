"""A preference study on the page: comparisons from `compare` in, headlines, figures, tables and notes out.

2004 section 5.2 and Table 2: percent favouring and chi-square over all answers, beside tests that know who answered.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

from study.analysis.analyse import Analysis
from study.analysis.confirmatory import ConfirmatoryTest
from study.analysis.crossed import OVER_BOTH
from study.analysis.estimates import Interval
from study.analysis.preference.analyse import Comparison, Preference, strengths_in_words
from study.analysis.preference.bradley_terry import BradleyTerry
from study.analysis.preference.no_effect import NoEffect
from study.counting import counted
from study.report import tables, words
from study.report.references import (
    AS_SAMPLES,
    BRADLEY_1952,
    CAMERON_2011,
    CLARK_1973,
    DAVIDSON_1970,
    HOLM_1979,
    SATTERTHWAITE_1946,
    SCHUIRMANN_1987,
    WILSON_1927,
)
from study.report.sections.preference.figures import preference_figure, strengths_figure
from study.report.sections.section import About, Drawing, Headline, Section, SectionKind
from study.report.tables import Table

MOST_PAIRS = 3
"""Pairs of methods that have a figure and tables of their own each: all of three methods."""


def preference_section(result: Preference, about: About) -> Section | None:
    """Return the section of a preference study; None without a comparison."""
    comparisons, name = result.comparisons, about.name
    if not comparisons:
        return None
    if isinstance(result.strengths, BradleyTerry) and len(comparisons) > MOST_PAIRS:
        return _section_of_many(result, result.strengths, about)
    drawings, shown, folded, notes = [], [], [], []
    for place, comparison in enumerate(comparisons):
        suffix = f"_{place + 1}" if len(comparisons) > 1 else ""
        motions = sorted(comparison.motions, key=lambda row: about.place(row.motion))
        ordered = replace(comparison, motions=tuple(motions))
        drawings.append(_drawing(f"{name}_forest{suffix}", ordered, about.mark))
        shown.append(preference_table(name + suffix, ordered))
        folded += [make(name + suffix, ordered) for make in (motion_table, order_table, no_preference_table)]
        notes += _notes(ordered)
    if result.strengths is not None:
        shown += [strengths_table(name, result.strengths)] if isinstance(result.strengths, BradleyTerry) else []
        notes += [f"Strengths of the methods: {result.strengths.note}."] if result.strengths.note else []
    return Section(
        anchor=f"study-{name}",
        title=about.title,
        headlines=tuple(headline(comparison, about) for comparison in comparisons),
        drawings=tuple(drawings),
        tables=tuple(shown),
        notes=tuple(notes),
        folded=tuple(folded),
    )


def _section_of_many(result: Preference, found: BradleyTerry, about: About) -> Section:
    """The section of many pairs of methods: strengths, with a row for each pair in place of a part of its own."""
    caption = (
        f"Strengths of the methods in logits beside {words.readable(found.reference)}, with confidence intervals over "
        f"{_whose(found)}. A difference of 1 is a choice of 73 to 27%, of 2 one of 88 to 12%."
    )
    return Section(
        anchor=f"study-{about.name}",
        title=about.title,
        headlines=(Headline(words.readable(strengths_in_words(found)), f"{about.interval}s over {_whose(found)}."),),
        drawings=(
            Drawing(f"{about.name}_strengths", strengths_figure(found, f"study-{about.name}", about.mark), caption),
        ),
        tables=(strengths_table(about.name, found), pairs_table(about.name, result.comparisons)),
        notes=tuple([f"Strengths of the methods: {found.note}."] if found.note else []),
        folded=(),
    )


def _whose(found: BradleyTerry) -> str:
    """What the intervals of strengths take for samples, with how many there are."""
    if found.participants is None:
        return "independent answers"
    motions = f" and {counted(found.motions, 'motion')}" if found.motions else ""
    return f"{counted(found.participants, 'participant')}{motions}"


def _drawing(name: str, comparison: Comparison, mark: str) -> Drawing:
    caption = (
        "Answers that favoured the first method, for every motion pair with Wilson’s interval; below, all answers "
        f"as if independent (Wilson), and the default test ({comparison.default.test}). At the right, how many "
        "favoured it of how many answers."
    )
    return Drawing(name, preference_figure(comparison, f"study-{name}", mark), caption)


def methods_of(comparison: Comparison | ConfirmatoryTest) -> tuple[str, str]:
    """Return the two methods as words."""
    return words.readable(comparison.method_a), words.readable(comparison.method_b)


# In words


def headline(comparison: Comparison, about: About) -> Headline:
    """Return a preference as a statement and what it rests on."""
    published, people, found = comparison.published, comparison.participants, comparison.default
    parts = []
    if found.low is not None:
        parts.append(
            f"{found.percent:.1f}%; {about.interval} over {found.generalises_to}: "
            f"{words.interval(found.low, found.high, unit='%')}; {counted(people.participants, 'participant')}, "
            f"{counted(len(comparison.motions), 'motion')}."
        )
    elif people.note:
        parts.append(f"{words.sentence(people.note)}.")
    if published.chi_square is not None and published.p_value is not None:
        parts.append(
            f"As published: chi-square(1, N = {published.answers}) = {published.chi_square:.2f}, "
            f"{words.p(published.p_value)}."
        )
    return Headline(words.readable(comparison.answer), " ".join(parts))


def _percents(interval: Interval) -> list[float | None]:
    """The ends of an interval of a share, in percent."""
    return [None if end is None else 100 * end for end in (interval.low, interval.high)]


def _notes(comparison: Comparison) -> list[str]:
    """What the preference rests on, one sentence each."""
    people, order, clusters = comparison.participants, comparison.order, comparison.clustering
    first, second = methods_of(comparison)
    notes = [
        f"{counted(people.for_a, 'participant')} leant towards {first}, {people.for_b} towards {second}, "
        f"{people.undecided} towards neither."
    ]
    if comparison.ties:
        notes.append(
            f"{counted(comparison.ties, 'answer')} chose neither: excluded from the published test, half for each in "
            "the others."
        )
    if clusters.design_effect is not None and clusters.intraclass_correlation is not None:
        correlation = words.signed(clusters.intraclass_correlation, 3, plus=False)
        answers = comparison.published.answers
        notes.append(
            f"Answers of one participant correlate by {correlation}: the pooled test counts "
            f"{counted(answers, 'answer')} as informative as "
            f"{min(clusters.effective_answers or 0.0, answers):.0f} independent ones (design effect "
            f"{clusters.design_effect:.2f})."
        )
    if order.first_percent is not None:
        test = f", {words.p(order.p_value)} over participants" if order.p_value is not None else ""
        notes.append(f"The transition shown first was favoured in {order.first_percent:.1f}% of the answers{test}.")
    notes += _no_preference(comparison.no_preference)
    return notes


def _no_preference(found: NoEffect) -> list[str]:
    """The evidence for no preference, where it could be weighed."""
    if found.equivalence_p_value is None:
        return []
    text = (
        f"Evidence for no preference: two one-sided tests over participants for a share within {_margin(found)} give "
        f"{words.p(found.equivalence_p_value)}"
    )
    return [f"{text}."]


def _margin(found: NoEffect) -> str:
    return f"{50 - 100 * found.margin:g} to {50 + 100 * found.margin:g}%"


# Tables


def preference_table(name: str, comparison: Comparison) -> Table:
    """Return the tests of a preference, as published and corrected."""
    first, second = methods_of(comparison)
    pooled, people, both = comparison.published, comparison.participants, comparison.motions_as_sample.both
    low, high = _percents(pooled.interval)
    rows: list[dict[str, Any]] = [
        {"reading": "as published", "percent": pooled.percent, "low": low, "high": high, "p_value": pooled.p_value}
        | {"test": f"chi-square(1, N = {pooled.answers})", "statistic": pooled.chi_square},
        {"reading": "as published, exact", "test": "binomial", "p_value": pooled.exact_p_value},
        vars(people) | {"reading": "participants", "percent": people.mean_percent, "statistic": people.t}
        | {"test": people.test if people.t is None else f"t({people.degrees_of_freedom})"},
        {"reading": "participants, by ranks", "test": "Wilcoxon", "p_value": people.wilcoxon_p_value},
    ]  # fmt: skip
    if both is not None:
        test = {"test": f"t({both.degrees_of_freedom:.3g})", "statistic": both.t}
        rows.insert(0, vars(both) | {"reading": "participants and motions"} | test)
    return tables.make(
        f"{name}_preference",
        f"Percent favouring {first} over {second}. Participants and motions: both taken for samples. Participants: "
        "each one’s percentage, which holds for these motions. As published: all answers as independent (Wilson’s "
        f"interval), which a participant’s are not. The default test is {comparison.default.test}.",
        "reading percent low:one high:one test statistic p_value",
        rows,
    )


def motion_table(name: str, comparison: Comparison) -> Table:
    """Return the preference for every motion."""
    rows = [vars(row) | {"motion": words.readable(row.motion)} for row in comparison.motions]
    return tables.make(
        f"{name}_preference_by_motion",
        "Every motion pair. Percentages with Wilson’s intervals.",
        "motion favouring answers percent low:one high:one",
        rows,
    )


def order_table(name: str, comparison: Comparison) -> Table:
    """Return the effect of the order of presentation, by percentages and by the models."""
    order, (first, second) = comparison.order, methods_of(comparison)
    rows: list[dict[str, Any]] = [
        {"reading": f"{first} shown first: favouring {first}", "percent": order.percent_a_first},
        {"reading": f"{second} shown first: favouring {first}", "percent": order.percent_a_second},
        {"reading": "favouring the one shown first", "percent": order.first_percent, "p_value": order.p_value},
    ]
    if order.balanced_percent is not None:
        rows.append({"reading": f"mean of both orders: favouring {first}", "percent": order.balanced_percent})
    return tables.make(
        f"{name}_order",
        "How far the order of presentation decided. Percentages of answers, with Student’s t over participants.",
        "reading percent p_value",
        rows,
    )


def no_preference_table(name: str, comparison: Comparison) -> Table:
    """Return the evidence for no preference: the equivalence test with its margin, and the Bayes factor."""
    found = comparison.no_preference
    low, high = _percents(found.interval)
    row = {
        "margin": _margin(found),
        "percent": comparison.participants.mean_percent,
        "low": low,
        "high": high,
        "equivalence_p_value": found.equivalence_p_value,
    }
    return tables.make(
        f"{name}_no_preference",
        "Evidence for no preference. Two one-sided t tests over participants (Schuirmann) that the share lies within "
        f"{_margin(found)}, whose {100 * found.interval.confidence:g}% interval then lies in it.",
        "margin percent low:one high:one equivalence_p_value",
        [row],
    )


def strengths_table(name: str, found: BradleyTerry) -> Table:
    """Return Bradley-Terry strengths of more than two methods."""
    rows = [
        vars(row) | {"low": row.interval.low, "high": row.interval.high, "method": words.readable(row.method)}
        for row in [*found.strengths, *filter(None, (found.order, found.ties))]
    ]
    return tables.make(
        f"{name}_strengths",
        "Strengths of the methods (Bradley-Terry, logits beside the reference), and what being shown first adds; equal "
        "is the logarithm of Davidson’s ν, how readily two were called equal; "
        f"intervals are over {_whose(found)}.",
        "method value standard_error low high",
        rows,
        headings={"value": "strength"},
    )


def pairs_table(name: str, comparisons: Sequence[Comparison]) -> Table:
    """Return a row for each pair of methods, by its own answers alone."""
    rows = [
        {
            "comparison": " over ".join(methods_of(one)),
            "answers": one.published.answers,
            "percent": one.default.percent,
            "low": one.default.low,
            "high": one.default.high,
            "test": one.default.test,
            "p_value": one.default.p_value,
        }
        for one in comparisons
    ]
    return tables.make(
        f"{name}_pairs",
        "Each pair of methods by its own answers alone.",
        "comparison answers percent low:one high:one test p_value",
        rows,
    )


def confirmatory_table(tests: Sequence[ConfirmatoryTest]) -> Table | None:
    """Return the confirmatory tests, adjusted together; None where there are none."""
    if not tests:
        return None
    rows = [
        vars(test) | {"comparison": " over ".join(methods_of(test)), "study": words.readable(test.study)}
        for test in tests
    ]
    return tables.make(
        "confirmatory",
        f"The confirmatory family. The default test of {counted(len(rows), 'comparison')}, p-values adjusted "
        "together by Holm’s method, so that the chance of any false finding among them stays at the level of "
        "significance.",
        "study comparison test p_value holm_p_value",
        rows,
    )


# Beside the section


def _methods(found: Collection[Preference], analysis: Analysis) -> str:
    count = len(analysis.confirmatory)
    family = f" P-values were adjusted by Holm’s method over {count} comparisons." if count > 1 else ""
    tests = {compared.default.test for result in found for compared in result.comparisons}
    test = "Student’s t of each participant’s percentage against 50%, which holds for the motions shown"
    if OVER_BOTH in tests:
        test = f"Student’s t of the percentage against 50%, {AS_SAMPLES}"
        if len(tests) > 1:
            test += "; where fewer than three motions were shown, by Student’s t over participants"
    several = [result.strengths for result in found if isinstance(result.strengths, BradleyTerry)]
    strengths = (
        " Strengths of the methods are those of a Bradley-Terry model with an effect of order, by maximum likelihood; "
        f"their intervals are over {_whose(several[0])}."
        if several
        else ""
    )
    if any(one.ties for one in several):
        strengths += " Ties are part of the model (Davidson 1970)."
    neither = (
        " A response that neither was better counted half for each, and was left out of the tests of all responses."
        if any(compared.ties for result in found for compared in result.comparisons)
        else ""
    )
    return (
        f"Preferences were tested by {test}.{neither}{family} Chi-square and exact binomial tests of all responses are "
        "given as published, with Wilson’s intervals. Evidence for no preference is an equivalence test "
        f"(Schuirmann 1987).{strengths}"
    )


def _references(found: Collection[Preference]) -> set[str]:
    fitted = [result.strengths for result in found if isinstance(result.strengths, BradleyTerry)]
    several = {BRADLEY_1952} if fitted else set()
    several |= {DAVIDSON_1970} if any(one.ties for one in fitted) else set()
    several |= {CAMERON_2011} if any(one.motions for one in fitted) else set()
    several |= {CLARK_1973, SATTERTHWAITE_1946}
    return {WILSON_1927, HOLM_1979, SCHUIRMANN_1987} | several


KIND = SectionKind(
    preference_section,
    _methods,
    _references,
)
