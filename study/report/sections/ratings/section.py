"""A rating study on the page: `rating_table` and `rating_anova` in, headline, figure, tables and notes out.

2003 section 4.2: a two-way analysis of variance, method by order of presentation; beside it each participant's own
difference between the methods, the mixed design, ranks, and an ordinal model.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from study.counting import counted
from study.report import figures, tables, words
from study.report.sections.section import Drawing, Headline, Section
from study.report.tables import Table

Result = Mapping[str, Any]


def ratings_section(
    name: str,
    title: str,
    rows: Sequence[Result],
    variance: Sequence[Result] = (),
    cells: Sequence[Result] = (),
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
    rows, variance, cells
        From `rating_table`, `rating_anova` and `rating_cells`.
    mark
        What every figure says about its data.
    points
        Of the scale, which is counted from 0.
    alpha
        Level of significance.
    """
    return Section(
        anchor=f"study-{name}",
        title=title,
        headlines=(_headline(title, rows, variance, points, alpha),),
        drawings=tuple(_drawings(name, rows, cells, mark, points)),
        tables=(
            means_table(name, rows),
            *((variance_table(name, variance), difference_table(name, variance)) if variance else ()),
        ),
        notes=tuple(dict.fromkeys(note for question in variance for note in _notes(question))),
        folded=tuple(_folded(name, variance, cells)),
        readings=tuple(_readings(variance)),
    )


def _drawings(name: str, rows: Sequence[Result], cells: Sequence[Result], mark: str, points: int) -> list[Drawing]:
    if not rows:
        return []
    scale = f"on a scale of 0 to {points - 1} with 95% intervals over participants (Student’s t)"
    place = f"study-{name}-ratings"
    drawings = [Drawing(f"{name}_ratings", figures.ratings_figure(rows, place, mark, points), f"Mean ratings {scale}.")]
    if cells:
        svg = figures.cells_figure(cells, f"study-{name}-cells", mark, points)
        drawings.append(Drawing(f"{name}_cells", svg, f"Mean ratings by method and by which was seen first, {scale}."))
    return drawings


# In words


def _headline(title: str, rows: Sequence[Result], variance: Sequence[Result], points: int, alpha: float) -> Headline:
    if not rows:
        return Headline(f"{title}: there are no ratings.", "")
    known = [question for question in variance if question["difference"] and question["difference"]["mean"] is not None]
    if not known:
        highest = _highest(rows, points)
        return Headline(highest.statement, " ".join(filter(None, (highest.detail, _tests(variance)))))
    return _of_one(known[0], points, alpha) if len(known) == 1 else _of_several(known, alpha)


def _highest(rows: Sequence[Result], points: int) -> Headline:
    """The highest mean, or the only one, or that there is no highest."""
    top = max(row["mean"] for row in rows)
    best = [row for row in rows if row["mean"] == top]
    what = words.joined([words.readable(": ".join(filter(None, (row["item"], row["method"])))) for row in best])
    verb = "were rated alike," if len(best) > 1 else "was rated" if len(rows) == 1 else "was rated highest,"
    row = best[0]
    size = f"{counted(row['answers'], 'answer')} of {counted(row['participants'], 'participant')}"
    return Headline(
        f"{words.sentence(what)} {verb} {top:.2f} on average, on a scale of 0 to {points - 1}.",
        f"{size}; 95% interval over participants {words.interval(row['low'], row['high'], 2)}.",
    )


def _of_one(question: Result, points: int, alpha: float) -> Headline:
    """By how much one method was rated higher than the other."""
    difference = question["difference"]
    first, second = _methods(question)
    if difference["mean"] < 0:
        first, second = second, first
    size = f"{counted(question['answers'], 'answer')} of {counted(question['participants'], 'participant')}"
    if difference["mean"] == 0:
        statement = f"{words.sentence(first)} and {second} were rated alike on average, on a scale of 0 to {points - 1}"
    else:
        statement = (
            f"{words.sentence(first)} was rated {abs(difference['mean']):.2f} points higher than {second} on "
            "average, on "
            f"a scale of 0 to {points - 1}"
        )
    if difference["p_value"] is not None:
        told = "this is not chance" if difference["p_value"] < alpha else "this can’t be told from chance"
        statement += f"; across participants {told} ({words.p(difference['p_value'])})"
    return Headline(f"{statement}.", f"{size}. {_tests([question])}")


def _of_several(known: Sequence[Result], alpha: float) -> Headline:
    """In how many questions one method was rated higher."""
    first, second = _methods(known[0])
    up = [question for question in known if question["difference"]["mean"] > 0]
    down = [question for question in known if question["difference"]["mean"] < 0]
    if len(down) > len(up):
        first, second, up = second, first, down
    if not up:
        return Headline(f"{words.sentence(first)} and {second} were rated alike on average.", _tests(known))
    clear = sum(1 for question in up if _significant(question, alpha))
    return Headline(
        f"{words.sentence(first)} was rated higher than {second} in {len(up)} of "
        f"{counted(len(known), 'question')}, in {clear or 'none'} of them significantly at {alpha:g} across "
        f"{counted(known[0]['participants'], 'participant')}.",
        _tests(known),
    )


def _methods(question: Result) -> tuple[str, str]:
    """The two methods of a difference, which `rating_anova` names as "a minus b"."""
    first, _, second = str(question["difference"]["of"]).partition(" minus ")
    return words.readable(first), words.readable(second)


def _significant(question: Result, alpha: float) -> bool:
    """By each participant's own difference, the corrected test."""
    p_value = question["difference"]["p_value"]
    return p_value is not None and p_value < alpha


def _tests(questions: Sequence[Result]) -> str:
    """The tests of every question: as published and over participants."""
    parts = []
    for question in questions:
        found = [f"as published {_f(question['anova'][0])}"] if question["anova"] else []
        if question["difference"] and question["difference"]["p_value"] is not None:
            found.append(f"over participants {_difference(question['difference'])}")
        found += _omnibus(question)
        name = words.sentence(words.readable(question["item"]) or "rating")
        parts.append(f"{name}: {'; '.join(found) or 'no test can be made'}.")
    return " ".join(parts)


def _omnibus(question: Result) -> list[str]:
    """Whether more than two methods differ at all, by participants' means and by ranks."""
    if len(question["differences"]) < 2:
        return []
    ranks = question["ranks"]["participants"]
    effects = [row for row in question["mixed_design"]["effects"] if row["source"] == "method"]
    found = [
        f"all methods over participants {_f({**row, 'p_value': row['corrected_p_value']})} (corrected by Greenhouse "
        "and Geisser)"
        for row in effects
    ]
    return [*found, *([f"by ranks (Friedman) {words.p(ranks['p_value'])}"] if ranks else [])]


def _f(row: Result) -> str:
    if row["f"] is None:
        return "no F, for the ratings do not vary"
    degrees = f"{row['degrees_of_freedom']}, {row['error_degrees_of_freedom']}"
    return f"F({degrees}) = {row['f']:.2f}, {words.p(row['p_value'])}"


def _difference(found: Result) -> str:
    text = words.decimals(found["mean"], 2)
    if found["t"] is None:
        tested = found["p_value"] is not None
        return f"{text} for every participant, {found['test']} {words.p(found['p_value'])}" if tested else text
    interval = f"[{words.bare_interval(found, 2)}]"
    return f"{text} {interval}, t({found['degrees_of_freedom']}) = {words.decimals(found['t'], 2)}, {_p_of(found)}"


def _p_of(difference: Result) -> str:
    """The p-value of a difference, adjusted where there are several."""
    adjusted = difference["holm_p_value"] > difference["p_value"]
    return f"{words.p(difference['holm_p_value'])} adjusted by Holm" if adjusted else words.p(difference["p_value"])


def _notes(question: Result) -> list[str]:
    """Why something could not be had."""
    parts = [
        question["note"],
        *(question[key]["note"] for key in ("mixed_design", "ranks", "ordinal") if question[key]),
    ]
    return [f"{words.sentence(note)}." for note in parts if note]


def _readings(variance: Sequence[Result]) -> list[dict[str, Any]]:
    return [
        {
            "result": f"{words.readable(question['item']) or 'rating'}: {words.readable(difference['of'])}",
            "published": _f(question["anova"][0]) if question["anova"] else "–",
            "corrected": _difference(difference) if difference["mean"] is not None else "–",
        }
        for question in variance
        for difference in question["differences"]
    ]


# Tables


def means_table(name: str, rows: Sequence[Result]) -> Table:
    """Return mean ratings by question and method."""
    return tables.make(
        f"{name}_ratings",
        "Ratings by question and method. Mean over participants of their means, with its standard error and 95% "
        "interval (Student’s t); standard deviation and median of all answers.",
        "item method answers participants mean standard_error low high standard_deviation median",
        [{**row, "item": words.readable(row["item"]), "method": words.readable(row["method"])} for row in rows],
    )


_VARIANCE = "item source degrees_of_freedom error_degrees_of_freedom"
_EFFECT = "partial_eta_squared partial_omega_squared effect_low effect_high"


def _by_question(questions: Sequence[Result], rows_of: Callable[[Result], Sequence[Result]]) -> list[dict[str, Any]]:
    return [{**row, "item": words.readable(question["item"])} for question in questions for row in rows_of(question)]


def variance_table(name: str, questions: Sequence[Result]) -> Table:
    """Return the analysis of variance as published."""
    return tables.make(
        f"{name}_anova",
        "As published: two-way analysis of variance between subjects, method by order of presentation. 2003 section "
        "4.2, "
        "type III sums of squares. It takes the ratings of one participant for independent; the next table does not. "
        "Effect sizes with 90% intervals.",
        f"{_VARIANCE} sum_of_squares mean_square f p_value {_EFFECT}",
        _by_question(questions, lambda question: question["anova"]),
    )


def difference_table(name: str, questions: Sequence[Result]) -> Table:
    """Return the difference of the methods over participants."""
    return tables.make(
        f"{name}_differences",
        "Corrected: difference of each participant’s own ratings of two methods. Mean, 95% interval, and t test (the "
        "exact sign test where all participants differ alike); p-values of several pairs adjusted by Holm’s method.",
        "item of mean low high t degrees_of_freedom p_value holm_p_value",
        _by_question(questions, lambda question: question["differences"]),
    )


def _folded(name: str, variance: Sequence[Result], cells: Sequence[Result]) -> list[Table]:
    """The cells of the design, and whatever other analyses could be made; those without a row are left out."""
    cells_table = tables.make(
        f"{name}_cells",
        "Ratings by method and by order of presentation. Order: the method that a participant saw first. Means over "
        "participants with standard errors and 95% intervals (Student’s t).",
        "item method order answers participants mean standard_error low high",
        [{**row, **{key: words.readable(row[key]) for key in ("item", "method", "order")}} for row in cells],
    )
    type_ii = tables.make(
        f"{name}_anova_type_ii",
        "The published analysis by type II sums of squares. It differs where the cells hold unequal numbers of "
        "answers.",
        f"{_VARIANCE} sum_of_squares mean_square f p_value {_EFFECT}",
        _by_question(variance, lambda question: question["type_ii"] or []),
    )
    mixed = tables.make(
        f"{name}_mixed_design",
        "Mixed design: participants as random. Methods (and motions, where everybody rated all) vary within "
        "participants, the order between them; p corrected by Greenhouse and Geisser’s epsilon.",
        f"{_VARIANCE} f p_value epsilon corrected_p_value generalized_eta_squared {_EFFECT}",
        _by_question(variance, lambda question: question["mixed_design"]["effects"]),
    )
    ranks = tables.make(
        f"{name}_ranks",
        "The same on ranks. The published design by ANOVA-type statistics, and the methods over participants.",
        "item source test f chi_square degrees_of_freedom error_degrees_of_freedom p_value",
        _by_question(variance, _rank_rows),
        headings={"source": "effect"},
    )
    ordinal = tables.make(
        f"{name}_ordinal",
        "Ordinal mixed model. Points of the scale as ordered only, participants as random: effects in logits (above 0: "
        "rated higher), as odds ratios, with 95% intervals.",
        "item effect value standard_error low high odds_ratio p_value",
        _by_question(variance, lambda question: _ordinal_rows(question["ordinal"] or {})),
        headings={"value": "logits"},
    )
    return [table for table in (cells_table, type_ii, mixed, ranks, ordinal) if table.rows]


def _rank_rows(question: Result) -> list[dict[str, Any]]:
    ranks = question["ranks"]
    rows = [{**row, "test": "ANOVA-type"} for row in ranks["between"]]
    return [
        *rows,
        *([{"source": "method, over participants", **ranks["participants"]}] if ranks["participants"] else []),
    ]


def _ordinal_rows(ordinal: Result) -> list[dict[str, Any]]:
    return [
        {
            **effect,
            "effect": words.readable(effect["name"]),
            **{end: effect["interval"][end] for end in ("low", "high")},
        }
        for effect in ordinal.get("effects", ())
    ]
