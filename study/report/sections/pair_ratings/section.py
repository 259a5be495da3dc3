"""A study in which pairs were rated, on the page: `pair_ratings` in, headline, figure, tables and notes out.

2003 Table 2 gives mean and standard deviation of all answers; beside them are tests over one score a participant.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from study.analysis.analyse import Analysis
from study.analysis.crossed import OVER_BOTH
from study.analysis.ratings.analyse import PairRatings
from study.analysis.ratings.pairs import PairQuestion, ScoreTest
from study.counting import counted
from study.report import tables, words
from study.report.references import AS_SAMPLES, CLARK_1973, SATTERTHWAITE_1946
from study.report.sections.pair_ratings.figures import likert_figure
from study.report.sections.section import About, Drawing, Headline, Section, SectionKind
from study.report.tables import Table
from study.transitions.methods.method import WANG_2003


def pair_ratings_section(result: PairRatings, about: About) -> Section | None:
    """Return the section of a study in which pairs were rated; None without a question."""
    if not result.questions:
        return None
    questions = result.questions
    name, top = about.name, len(questions[0].distribution) - 1
    scale = f"on a scale of 0 to {top}; {questions[0].middle:g} means that both were the same"
    caption = (
        f"How {_other(questions[0])} compares with {_reference(questions[0])}, {scale}. Bars: answers at each point "
        "with their counts, signed as comparison minus reference. Squares: mean over participants with confidence "
        "interval (Student’s t)."
    )
    svg = likert_figure(questions, f"study-{name}-compared", about.mark, about.ends)
    return Section(
        anchor=f"study-{name}",
        title=about.title,
        headlines=(_headline(questions, top, about.alpha),),
        drawings=(Drawing(f"{name}_compared", svg, caption),),
        tables=(published_table(name, questions), corrected_table(name, questions)),
        notes=tuple(dict.fromkeys(note for question in questions for note in _notes(question))),
        folded=(points_table(name, questions),),
    )


def _other(question: PairQuestion) -> str:
    return words.readable(question.method_b)


def _reference(question: PairQuestion) -> str:
    return words.readable(question.method_a)


def _item(question: PairQuestion) -> str:
    return words.readable(question.item) or "rating"


# In words


def _headline(questions: Sequence[PairQuestion], top: int, alpha: float) -> Headline:
    first = questions[0]
    scale = f"on a scale of 0 to {top}, where {first.middle:g} means no difference"
    detail = " ".join(_in_words(question) for question in questions)
    known = [question.participants for question in questions]
    if len(questions) == 1:
        (test,) = known
        statement = f"Compared with {_reference(first)}, {_other(first)} was rated {test.mean:.2f} on average, {scale}"
        if test.p_value is not None:
            told = "this is significant" if test.p_value < alpha else "this is not significant"
            statement += f"; across {test.generalises_to}, {told} ({words.p(test.p_value)})"
        return Headline(f"{statement}.", f"{_size(questions)}. {detail}")
    detail = f"{_size(questions)}, {scale}. {detail}"
    up = [test for test in known if (test.mean or 0.0) > first.middle]
    down = [test for test in known if (test.mean or 0.0) < first.middle]
    side, which = ("above", up) if len(up) >= len(down) else ("below", down)
    if not which:
        return Headline(
            f"{words.sentence(_other(first))} was rated the same as {_reference(first)} on average.", detail
        )
    clear = sum(1 for test in which if test.p_value is not None and test.p_value < alpha)
    return Headline(
        f"Compared with {_reference(first)}, {_other(first)} was rated {side} the middle of the scale in "
        f"{len(which)} of {counted(len(questions), 'question')}, in {clear or 'none'} of them significantly at "
        f"{alpha:g} across {counted(known[0].participants, 'participant')}.",
        detail,
    )


def _size(questions: Sequence[PairQuestion]) -> str:
    answers = sum(question.answers for question in questions)
    people = max(question.participants.participants for question in questions)
    return f"{counted(answers, 'answer')} of {counted(people, 'participant')}"


def _in_words(question: PairQuestion) -> str:
    return f"{words.sentence(_item(question))}: {_corrected(question.participants)}."


def _corrected(test: ScoreTest) -> str:
    """Mean and interval over participants, and the test against the middle."""
    if test.t is None:
        told = "no test can be made" if test.p_value is None else f"{test.test} {words.p(test.p_value)}"
        return f"{words.decimals(test.mean, 2)}, {told}"
    interval = words.bare_interval(test.low, test.high, 2)
    return (
        f"{words.decimals(test.mean, 2)} [{interval}], t({test.degrees_of_freedom:.3g}) = {words.decimals(test.t, 2)}, "
        f"{words.p(test.p_value or 0.0)}"
    )


def _notes(question: PairQuestion) -> list[str]:
    """Why something could not be had."""
    notes = (question.participants.note, question.order_note)
    return [f"{words.sentence(note)}." for note in notes if note]


# Tables


def published_table(name: str, questions: Sequence[PairQuestion]) -> Table:
    """Return what 2003 Table 2 gives of each question."""
    return tables.make(
        f"{name}_published",
        f"As published (2003 Table 2): how {_other(questions[0])} compares with {_reference(questions[0])}. Mean and "
        "standard deviation of all answers, signed as comparison minus reference.",
        "item answers mean standard_deviation",
        [vars(question.published) | {"item": _item(question), "answers": question.answers} for question in questions],
    )


def corrected_table(name: str, questions: Sequence[PairQuestion]) -> Table:
    """Return how the methods compare in each question, over participants."""
    return tables.make(
        f"{name}_corrected",
        "Corrected: mean score with confidence interval, and tests against the middle of the scale, "
        f"{questions[0].middle:g}, by Student’s t and, of one mean a participant, by Wilcoxon’s signed ranks.",
        "item test participants mean low high t degrees_of_freedom p_value signed_rank_p_value",
        [vars(question.participants) | {"item": _item(question)} for question in questions],
    )


def points_table(name: str, questions: Sequence[PairQuestion]) -> Table:
    """Return how many answers each point of the scale has."""
    return tables.make(
        f"{name}_points",
        "Answers at each point of the scale, signed as comparison minus reference.",
        "item point answers",
        [
            {"item": _item(question), "point": int(point), "answers": count}
            for question in questions
            for point, count in question.distribution.items()
        ],
    )


# Beside the section


def _methods(found: Collection[PairRatings], analysis: Analysis) -> str:
    del analysis
    both = any(question.participants.test == OVER_BOTH for result in found for question in result.questions)
    return (
        "The sign of comparisons on a scale was reversed where the order was reversed, so that scores compare the "
        "comparison with the reference. Mean scores were tested against the middle of the scale by Student’s t"
        f"{f', {AS_SAMPLES},' if both else ''} and by Wilcoxon’s signed ranks over participants."
    )


KIND = SectionKind(pair_ratings_section, _methods, lambda _: {WANG_2003, CLARK_1973, SATTERTHWAITE_1946})
