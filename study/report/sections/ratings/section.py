"""A rating study on the page: `rating_table` and `rating_anova` in, headline, figure, tables and notes out.

2003 section 4.2: a two-way analysis of variance, method by order of presentation; beside it each participant's own
difference between the methods, the mixed design, and ranks.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import Any

from study.analysis.analyse import Analysis
from study.analysis.crossed import OVER_BOTH
from study.analysis.ratings.analyse import ParallelRatings, Ratings
from study.analysis.ratings.comparisons import MethodDifference, Question
from study.analysis.ratings.table import MeanRating, MethodRating
from study.analysis.variance.repeated_measures import WithinEffect
from study.analysis.variance.two_way import VarianceEffect
from study.counting import counted
from study.report import tables, words
from study.report.references import AS_SAMPLES, CLARK_1973, HOLM_1979, JONELL_2021, SATTERTHWAITE_1946
from study.report.sections.ratings import figures
from study.report.sections.section import About, Drawing, Headline, Section, SectionKind
from study.report.tables import Table
from study.transitions.methods.method import WANG_2003


def ratings_section(result: Ratings, about: About) -> Section | None:
    """Return the section of a rating study: means, and where two methods or more were rated, their comparison."""
    name, questions = about.name, result.questions
    if not result.table:
        return None
    return Section(
        anchor=f"study-{name}",
        title=about.title,
        headlines=(_headline(result, about),),
        drawings=tuple(_drawings(result, about)),
        tables=(
            means_table(name, result.table),
            *([variance_table(name, questions)] if any(question.anova for question in questions) else []),
            *([difference_table(name, questions)] if questions else []),
        ),
        notes=tuple(dict.fromkeys(note for question in questions for note in _notes(question))),
        folded=tuple(_folded(name, result)),
    )


def _drawings(result: Ratings, about: About) -> list[Drawing]:
    name, mark, points = about.name, about.mark, about.points
    scale = f"on a scale of 0 to {points - 1} with confidence intervals over participants (Student’s t)"
    svg = figures.ratings_figure(result.table, f"study-{name}-ratings", mark, points)
    return [Drawing(f"{name}_ratings", svg, f"Mean ratings {scale}.")]


# In words


def _headline(result: Ratings, about: About) -> Headline:
    known = [
        (question, difference)
        for question in result.questions
        if (difference := question.difference) and difference.mean is not None
    ]
    if not known:
        highest = _highest(result.table, about)
        return Headline(highest.statement, " ".join(filter(None, (highest.detail, _tests(result.questions)))))
    return _of_one(*known[0], about.points, about.alpha) if len(known) == 1 else _of_several(known, about.alpha)


def _highest(rows: Sequence[MethodRating], about: About) -> Headline:
    """The highest mean, or the only one, or that there is no highest."""
    top = max(row.mean or 0.0 for row in rows)
    best = [row for row in rows if row.mean == top]
    what = words.joined([words.readable(": ".join(filter(None, (row.item, row.method)))) for row in best])
    verb = "were rated alike," if len(best) > 1 else "was rated" if len(rows) == 1 else "was rated highest,"
    row = best[0]
    size = f"{counted(row.answers, 'answer')} of {counted(row.participants, 'participant')}"
    return Headline(
        f"{words.sentence(what)} {verb} {top:.2f} on average, on a scale of 0 to {about.points - 1}.",
        f"{size}; {about.interval} over participants {words.interval(row.low, row.high, 2)}.",
    )


def _of_one(question: Question, difference: MethodDifference, points: int, alpha: float) -> Headline:
    """By how much one method was rated higher than the other."""
    first, second = _two_of(difference)
    mean = difference.mean or 0.0
    if mean < 0:
        first, second = second, first
    size = f"{counted(question.answers, 'answer')} of {counted(question.participants, 'participant')}"
    if mean == 0:
        statement = f"{words.sentence(first)} and {second} had equal mean ratings, on a scale of 0 to {points - 1}"
    else:
        statement = (
            f"{words.sentence(first)} was rated {abs(mean):.2f} points higher than {second} on average, on "
            f"a scale of 0 to {points - 1}"
        )
    if difference.p_value is not None:
        told = "this is significant" if difference.p_value < alpha else "this is not significant"
        statement += f"; across {difference.generalises_to}, {told} ({words.p(difference.p_value)})"
    return Headline(f"{statement}.", f"{size}. {_tests([question])}")


def _of_several(known: Sequence[tuple[Question, MethodDifference]], alpha: float) -> Headline:
    """In how many questions one method was rated higher."""
    first, second = _two_of(known[0][1])
    up = [difference for _, difference in known if (difference.mean or 0.0) > 0]
    down = [difference for _, difference in known if (difference.mean or 0.0) < 0]
    tests = _tests([question for question, _ in known])
    if len(down) > len(up):
        first, second, up = second, first, down
    if not up:
        return Headline(f"{words.sentence(first)} and {second} had equal mean ratings.", tests)
    clear = sum(difference.p_value is not None and difference.p_value < alpha for difference in up)
    return Headline(
        f"{words.sentence(first)} was rated higher than {second} in {len(up)} of "
        f"{counted(len(known), 'question')}, in {clear or 'none'} of them significantly at {alpha:g} across "
        f"{known[0][1].generalises_to}.",
        tests,
    )


def _two_of(difference: MethodDifference) -> tuple[str, str]:
    """The two methods of a difference, which `rating_anova` names as "a minus b"."""
    first, _, second = difference.of.partition(" minus ")
    return words.readable(first), words.readable(second)


def _tests(questions: Sequence[Question]) -> str:
    """The tests of every question: as published and over participants."""
    parts = []
    for question in questions:
        found = [f"as published {_f(question.anova[0], question.anova[0].p_value)}"] if question.anova else []
        if question.difference and question.difference.p_value is not None:
            found.append(f"over {question.difference.generalises_to}: {_difference(question.difference)}")
        found += _omnibus(question)
        name = words.sentence(words.readable(question.item) or "rating")
        parts.append(f"{name}: {'; '.join(found) or 'no test can be made'}.")
    return " ".join(parts)


def _omnibus(question: Question) -> list[str]:
    """Whether more than two methods differ at all, by participants' means and by ranks."""
    if len(question.differences) < 2:
        return []
    ranks = question.ranks.participants
    effects = [row for row in question.mixed_design.effects if row.source == "method"]
    found = [
        f"all methods over participants {_f(row, row.corrected_p_value)} (corrected by Greenhouse and Geisser)"
        for row in effects
    ]
    return [*found, *([f"by ranks (Friedman) {words.p(ranks.p_value)}"] if ranks else [])]


def _f(row: VarianceEffect | WithinEffect, p_value: float | None) -> str:
    if row.f is None or p_value is None:
        return "no F, since the ratings do not vary"
    degrees = f"{row.degrees_of_freedom}, {row.error_degrees_of_freedom}"
    return f"F({degrees}) = {row.f:.2f}, {words.p(p_value)}"


def _difference(found: MethodDifference) -> str:
    text = words.decimals(found.mean, 2)
    if found.t is None:
        return text if found.p_value is None else f"{text} for every participant, {found.test} {words.p(found.p_value)}"
    interval = f"[{words.bare_interval(found.low, found.high, 2)}]"
    return f"{text} {interval}, t({found.degrees_of_freedom:.3g}) = {words.decimals(found.t, 2)}, {_p_of(found)}"


def _p_of(difference: MethodDifference) -> str:
    """The p-value of a difference, adjusted where there are several."""
    raw, adjusted = difference.p_value or 0.0, difference.holm_p_value or 0.0
    return f"{words.p(adjusted)} adjusted by Holm" if adjusted > raw else words.p(raw)


def _notes(question: Question) -> list[str]:
    """Why something could not be had."""
    parts = [question.note, question.mixed_design.note, question.ranks.note]
    return [f"{words.sentence(note)}." for note in parts if note]


# Tables


def means_table(name: str, rows: Sequence[MethodRating]) -> Table:
    """Return mean ratings by question and method."""
    return tables.make(
        f"{name}_ratings",
        "Ratings by question and method. Mean over participants of their means, with its standard error and "
        "confidence interval (Student’s t); standard deviation and median of all answers.",
        "item method answers participants mean standard_error low high standard_deviation median",
        [_readable(row) for row in rows],
    )


_VARIANCE = "item source degrees_of_freedom error_degrees_of_freedom"
_EFFECT = "partial_eta_squared effect_low effect_high"


def _readable(row: MeanRating) -> dict[str, Any]:
    return vars(row) | {"item": words.readable(row.item), "method": words.readable(row.method)}


def _by_question(
    questions: Sequence[Question], rows_of: Callable[[Question], Sequence[object]]
) -> list[dict[str, Any]]:
    return [vars(row) | {"item": words.readable(question.item)} for question in questions for row in rows_of(question)]


def variance_table(name: str, questions: Sequence[Question]) -> Table:
    """Return the analysis of variance as published."""
    return tables.make(
        f"{name}_anova",
        "As published: two-way analysis of variance between subjects, method by order of presentation. 2003 section "
        "4.2, "
        "type III sums of squares. It treats the ratings of one participant as independent; the next table does not. "
        "Effect sizes with intervals that exclude 0 where F is significant (of 1 − 2 alpha).",
        f"{_VARIANCE} sum_of_squares mean_square f p_value {_EFFECT}",
        _by_question(questions, lambda question: question.anova),
    )


def difference_table(name: str, questions: Sequence[Question]) -> Table:
    """Return the difference of the methods over participants."""
    return tables.make(
        f"{name}_differences",
        "Corrected: difference between each participant’s ratings of two methods, of the same motion where motions are "
        "a sample too. Mean, confidence interval, and test; p-values of several pairs adjusted by Holm’s method.",
        "item of test mean low high t degrees_of_freedom p_value holm_p_value",
        _by_question(questions, lambda question: question.differences),
    )


def _folded(name: str, result: Ratings) -> list[Table]:
    """Whatever other analyses could be made; those without a row are omitted."""
    mixed = tables.make(
        f"{name}_mixed_design",
        "Mixed design: participants as random. Methods (and motions, if everybody rated all) vary within "
        "participants, the order between them; p corrected by Greenhouse and Geisser’s epsilon.",
        f"{_VARIANCE} f p_value epsilon corrected_p_value {_EFFECT}",
        _by_question(result.questions, lambda question: question.mixed_design.effects),
    )
    ranks = tables.make(
        f"{name}_ranks",
        "The methods over participants, on ranks.",
        "item test f chi_square degrees_of_freedom error_degrees_of_freedom p_value",
        _by_question(result.questions, lambda question: [over] if (over := question.ranks.participants) else []),
    )
    return [table for table in (mixed, ranks) if table.rows]


# Beside the section


def _methods(found: Collection[Ratings], analysis: Analysis) -> str:
    del analysis
    rows = [row for result in found for question in result.questions for row in question.differences]
    several = f", {AS_SAMPLES}" if any(row.test == OVER_BOTH for row in rows) else ""
    return (
        "Ratings were compared by the two-way between-subjects analysis of variance of 2003 (method by order; type "
        "III sums of squares), and by Student’s t of each participant’s "
        f"differences{several}."
    )


KIND = SectionKind(ratings_section, _methods, lambda _: {WANG_2003, CLARK_1973, SATTERTHWAITE_1946})


def parallel_section(result: ParallelRatings, about: About) -> Section | None:
    """Return the section of ratings on one page: as of any rating study, with each participant's values and ranks."""
    section = ratings_section(result, about)
    if section is None:
        return None
    rows = [vars(row) | {"method": words.readable(row.method)} for row in result.participants]
    own = tables.make(
        f"{about.name}_participants",
        "Each participant’s mean value of a method, and its mean rank among those on one page; 1 is the highest.",
        "participant method answers mean rank",
        rows,
    )
    return replace(section, folded=(*section.folded, own))


def _parallel_methods(found: Collection[ParallelRatings], analysis: Analysis) -> str:
    del analysis
    rows = [row for result in found for question in result.questions for row in question.differences]
    several = f", {AS_SAMPLES}" if any(row.test == OVER_BOTH for row in rows) else ""
    return (
        "Values that were given beside each other (Jonell et al. 2021) were compared by Student’s t of each "
        f"participant’s differences between two methods{several}; p-values of the pairs were adjusted by Holm’s "
        "method. Ranks of the methods over participants were compared by Friedman’s test."
    )


PARALLEL = SectionKind(
    parallel_section, _parallel_methods, lambda _: {JONELL_2021, HOLM_1979, CLARK_1973, SATTERTHWAITE_1946}
)
