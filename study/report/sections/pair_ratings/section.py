"""A study in which pairs were rated, on the page: `pair_ratings` in, headline, figure, tables and notes out.

2003 Table 2 gives mean and standard deviation of all answers; beside them stands what one score a participant says.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from study.counting import counted
from study.report import tables, words
from study.report.sections.pair_ratings.figure import likert_figure
from study.report.sections.section import Drawing, Headline, Section
from study.report.tables import Table

Result = Mapping[str, Any]


def pair_ratings_section(
    name: str,
    title: str,
    questions: Sequence[Result],
    ends: Mapping[str, tuple[str, str]],
    *,
    mark: str,
    alpha: float = 0.05,
) -> Section:
    """Return the section of a study in which pairs were rated.

    Parameters
    ----------
    name, title
        Of the study.
    questions
        From `pair_ratings`; one at least.
    ends
        Words at the lowest and highest point of the scale, by question.
    mark
        What every figure says about its data.
    alpha
        Level of significance.
    """
    top = len(questions[0]["distribution"]) - 1
    scale = f"on a scale of 0 to {top}; {questions[0]['middle']:g} means that both were the same"
    caption = (
        f"How {_other(questions[0])} compares with {_reference(questions[0])}, {scale}. Bars: answers at each point "
        "with their counts, turned by the order of presentation. Squares: mean over participants with 95% interval "
        "(Student’s t)."
    )
    svg = likert_figure(questions, f"study-{name}-compared", mark, ends)
    return Section(
        anchor=f"study-{name}",
        title=title,
        headlines=(_headline(questions, top, alpha),),
        drawings=(Drawing(f"{name}_compared", svg, caption),),
        tables=(published_table(name, questions), corrected_table(name, questions)),
        notes=tuple(dict.fromkeys(note for question in questions for note in _notes(question))),
        folded=tuple(table for table in _folded(name, questions) if table.rows),
        readings=tuple(_readings(questions)),
    )


def _other(question: Result) -> str:
    return words.readable(str(question["method_b"]))


def _reference(question: Result) -> str:
    return words.readable(str(question["method_a"]))


def _item(question: Result) -> str:
    return words.readable(str(question["item"])) or "rating"


# In words


def _headline(questions: Sequence[Result], top: int, alpha: float) -> Headline:
    first = questions[0]
    scale = f"on a scale of 0 to {top}, where {first['middle']:g} means no difference"
    detail = " ".join(_in_words(question) for question in questions)
    known = [question["participants"] for question in questions]
    if len(questions) == 1:
        (test,) = known
        statement = (
            f"Compared with {_reference(first)}, {_other(first)} was rated {test['mean']:.2f} on average, {scale}"
        )
        if test["p_value"] is not None:
            told = "this is not chance" if test["p_value"] < alpha else "this can’t be told from chance"
            statement += f"; across participants {told} ({words.p(test['p_value'])})"
        return Headline(f"{statement}.", f"{_size(questions)}. {detail}")
    detail = f"{_size(questions)}, {scale}. {detail}"
    up = [test for test in known if test["mean"] > first["middle"]]
    down = [test for test in known if test["mean"] < first["middle"]]
    side, which = ("above", up) if len(up) >= len(down) else ("below", down)
    if not which:
        return Headline(
            f"{words.sentence(_other(first))} was rated the same as {_reference(first)} on average.", detail
        )
    clear = sum(1 for test in which if test["p_value"] is not None and test["p_value"] < alpha)
    return Headline(
        f"Compared with {_reference(first)}, {_other(first)} was rated {side} the middle of the scale in "
        f"{len(which)} of {counted(len(questions), 'question')}, in {clear or 'none'} of them significantly at "
        f"{alpha:g} across {counted(known[0]['participants'], 'participant')}.",
        detail,
    )


def _size(questions: Sequence[Result]) -> str:
    answers = sum(question["answers"] for question in questions)
    people = max(question["participants"]["participants"] for question in questions)
    return f"{counted(answers, 'answer')} of {counted(people, 'participant')}"


def _in_words(question: Result) -> str:
    return f"{words.sentence(_item(question))}: {_corrected(question['participants'])}."


def _corrected(test: Result) -> str:
    """Mean and interval over participants, and the test against the middle."""
    if test["t"] is None:
        return f"{words.decimals(test['mean'], 2)}, no test can be made"
    return (
        f"{words.decimals(test['mean'], 2)} [{words.bare_interval(test, 2)}], t({test['degrees_of_freedom']}) = "
        f"{words.decimals(test['t'], 2)}, {words.p(test['p_value'])}"
    )


def _published(found: Result) -> str:
    return f"{words.decimals(found['mean'], 2)} (SD {words.decimals(found['standard_deviation'], 2)})"


def _notes(question: Result) -> list[str]:
    """Why something could not be had."""
    return [f"{words.sentence(note)}." for key in ("participants", "order") if (note := question[key]["note"])]


def _readings(questions: Sequence[Result]) -> list[dict[str, Any]]:
    return [
        {
            "result": f"{_item(question)}: {words.readable(question['of'])}",
            "published": _published(question["published"]),
            "corrected": _corrected(question["participants"]),
        }
        for question in questions
    ]


# Tables


def published_table(name: str, questions: Sequence[Result]) -> Table:
    """Return what 2003 Table 2 gives of each question."""
    return tables.make(
        f"{name}_published",
        f"As published (2003 Table 2): how {_other(questions[0])} compares with {_reference(questions[0])}. Mean and "
        "standard deviation of all answers, turned by the order of presentation.",
        "item answers mean standard_deviation",
        [{"item": _item(question), "answers": question["answers"], **question["published"]} for question in questions],
    )


def corrected_table(name: str, questions: Sequence[Result]) -> Table:
    """Return how the methods compare in each question, over participants."""
    return tables.make(
        f"{name}_corrected",
        "Corrected: one mean score a participant. Mean with 95% interval, and tests against the middle of the scale, "
        f"{questions[0]['middle']:g}, by Student’s t and by Wilcoxon’s signed ranks.",
        "item participants mean low high t degrees_of_freedom p_value signed_rank_p_value",
        [{"item": _item(question), **question["participants"]} for question in questions],
    )


def _folded(name: str, questions: Sequence[Result]) -> list[Table]:
    counts = tables.make(
        f"{name}_points",
        "Answers at each point of the scale, turned by the order of presentation.",
        "item point answers",
        [
            {"item": _item(question), "point": int(point), "answers": count}
            for question in questions
            for point, count in question["distribution"].items()
        ],
    )
    orders = tables.make(
        f"{name}_orders",
        "Scores by which was shown first. Means over participants with 95% intervals (Student’s t).",
        "item order answers participants mean standard_error low high",
        [
            {**row, "item": _item(question), "order": words.readable(row["first"])}
            for question in questions
            for row in question["order"]["rows"]
        ],
    )
    effects = tables.make(
        f"{name}_order_effect",
        "Effect of the order. Analysis of variance of participants’ means between the groups of 2003; where "
        "participants saw both orders, of their own differences.",
        "item kind f degrees_of_freedom error_degrees_of_freedom p_value",
        [
            {"item": _item(question), **question["order"], "kind": f"{question['order']['kind']} participants"}
            for question in questions
            if question["order"]["f"] is not None
        ],
        headings={"kind": "orders vary"},
    )
    motions = tables.make(
        f"{name}_motions",
        "Scores by motion: one mean a participant against the middle of the scale, p adjusted over the motions by "
        "Holm’s method.",
        "item motion answers participants mean low high t degrees_of_freedom p_value holm_p_value",
        [{"item": _item(question), **row} for question in questions for row in question["motions"]],
    )
    return [counts, orders, effects, motions]
