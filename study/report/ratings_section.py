"""A rating study on the page: `rating_table` and `rating_anova` in, headline, figure, tables and notes out.

2003 section 4.2: a two-way analysis of variance, method by order of presentation; beside it each participant's own
difference between the methods.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from study.report import figures, tables, words
from study.report.sections import Drawing, Headline, Section
from study.report.tables import Table

Result = Mapping[str, Any]


def ratings_section(
    name: str,
    title: str,
    rows: Sequence[Result],
    variance: Sequence[Result] = (),
    *,
    mark: str,
    points: int,
    alpha: float = 0.05,
) -> Section:
    """Return the section of a rating study: means, and where two methods or more were rated, their comparison.

    Parameters
    ----------
    name, title
        Of the study.
    rows, variance
        From `rating_table` and `rating_anova`.
    mark
        What every figure says about its data.
    points
        Of the scale, which is counted from 0.
    alpha
        Level of significance.
    """
    drawing = Drawing(
        f"{name}_ratings",
        figures.ratings_figure(rows, f"study-{name}-ratings", mark, points),
        f"Mean ratings on a scale of 0 to {points - 1} with 95% intervals over participants (Student’s t).",
    )
    compared = (_variance_table(name, variance), _difference_table(name, variance)) if variance else ()
    return Section(
        anchor=f"study-{name}",
        title=title,
        headlines=(_headline(title, rows, variance, points, alpha),),
        drawings=(drawing,) if rows else (),
        tables=(_means_table(name, rows), *compared),
        notes=tuple(dict.fromkeys(question["note"] for question in variance if question["note"])),
        readings=tuple(_readings(title, variance)),
    )


def _headline(title: str, rows: Sequence[Result], variance: Sequence[Result], points: int, alpha: float) -> Headline:
    if not rows:
        return Headline(f"{title}: there are no ratings.", "")
    return _compared(variance, alpha) or _highest(rows, points)


def _highest(rows: Sequence[Result], points: int) -> Headline:
    """The highest mean, or the only one, or that there is no highest."""
    top = max(row["mean"] for row in rows)
    best = [row for row in rows if row["mean"] == top]
    what = words.joined([words.readable(": ".join(filter(None, (row["item"], row["method"])))) for row in best])
    if len(rows) == 1:
        statement = f"{words.sentence(what)} was rated {top:.2f} on average, on a scale of 0 to {points - 1}."
    elif len(best) > 1:
        statement = f"{words.sentence(what)} were rated alike, {top:.2f} on average, on a scale of 0 to {points - 1}."
    else:
        statement = f"{words.sentence(what)} was rated highest, {top:.2f} on average, on a scale of 0 to {points - 1}."
    row = best[0]
    size = f"{words.number(row['answers'], 'answer')} of {words.number(row['participants'], 'participant')}"
    return Headline(statement, f"{size}; 95% interval over participants {words.interval(row['low'], row['high'], 2)}.")


def _compared(questions: Sequence[Result], alpha: float) -> Headline | None:
    """In how many questions one method was rated higher, and its F; None where there is no pair of methods."""
    known = [
        question for question in questions if question["difference"] and question["difference"]["mean"] is not None
    ]
    if not known:
        return None
    # "a minus b", as `rating_anova` names it.
    first, _, second = str(known[0]["difference"]["of"]).partition(" minus ")
    up = [question for question in known if question["difference"]["mean"] > 0]
    down = [question for question in known if question["difference"]["mean"] < 0]
    if len(down) > len(up):
        first, second, up = second, first, down
    first, second = words.readable(first), words.readable(second)
    if not up:
        return Headline(f"{words.sentence(first)} and {second} were rated alike on average.", _tests(known))
    clear = [question for question in up if _significant(question, alpha)]
    statement = (
        f"{words.sentence(first)} was rated higher than {second} in {len(up)} of "
        f"{words.number(len(known), 'question')}, in {len(clear)} significantly at {alpha:g}."
    )
    return Headline(statement, _tests(known))


def _significant(question: Result, alpha: float) -> bool:
    """By each participant's own difference, the corrected test."""
    p_value = question["difference"]["p_value"]
    return p_value is not None and p_value < alpha


def _tests(questions: Sequence[Result]) -> str:
    """Both tests of every question: as published and over participants."""
    parts = []
    for question in questions:
        text = words.sentence(words.readable(question["item"]) or "rating") + ": "
        found = [f"as published {_f(question['anova'][0])}"] if question["anova"] else []
        difference = question["difference"]
        if difference["t"] is not None:
            found.append(f"over participants {_t(difference)}")
        parts.append(text + ("; ".join(found) or "no test") + ".")
    return " ".join(parts)


def _f(row: Result) -> str:
    if row["f"] is None:
        return "no F (no spread)"
    degrees = f"{row['degrees_of_freedom']}, {row['error_degrees_of_freedom']}"
    return f"F({degrees}) = {row['f']:.2f}, {words.p(row['p_value'])}"


def _t(difference: Result) -> str:
    return (
        f"t({difference['degrees_of_freedom']}) = {words.decimals(difference['t'], 2)}, "
        f"{words.p(difference['p_value'])}"
    )


def _readings(title: str, variance: Sequence[Result]) -> list[dict[str, Any]]:
    rows = []
    for question in variance:
        difference = question["difference"]
        item = words.readable(question["item"]) or "rating"
        corrected = "–"
        if difference and difference["mean"] is not None:
            corrected = f"{words.decimals(difference['mean'], 2)} [{words.bare_interval(difference, 2)}]"
            corrected += f"; {_t(difference)}" if difference["t"] is not None else ""
        rows.append(
            {
                "result": f"{title}: {item}, {words.readable(difference['of']) if difference else 'methods'}",
                "published": _f(question["anova"][0]) if question["anova"] else "–",
                "corrected": corrected,
            }
        )
    return rows


def _means_table(name: str, rows: Sequence[Result]) -> Table:
    return tables.make(
        f"{name}_ratings",
        "Ratings: mean over participants of their means, with its standard error and 95% interval (Student’s t), and "
        "standard deviation and median of all answers.",
        "item method answers participants mean standard_error low high standard_deviation median",
        [{**row, "item": words.readable(row["item"]), "method": words.readable(row["method"])} for row in rows],
    )


def _variance_table(name: str, questions: Sequence[Result]) -> Table:
    return tables.make(
        f"{name}_anova",
        "As published: two-way between-subjects analysis of variance, method by order of presentation (2003 section "
        "4.2). It takes the ratings of one participant for independent; the next table does not.",
        "item source degrees_of_freedom error_degrees_of_freedom sum_of_squares mean_square f p_value "
        "partial_eta_squared",
        [{**row, "item": words.readable(question["item"])} for question in questions for row in question["anova"]],
    )


def _difference_table(name: str, questions: Sequence[Result]) -> Table:
    return tables.make(
        f"{name}_differences",
        "Corrected: difference of each participant’s own ratings of the two methods, mean, 95% interval, and t test.",
        "item of mean low high t degrees_of_freedom p_value",
        [
            {**question["difference"], "item": words.readable(question["item"])}
            for question in questions
            if question["difference"]
        ],
    )
