"""One section a study: results of the analysis in; headlines, figures, tables and notes out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from study.report import course, figures, tables, words
from study.report.tables import Table

Result = Mapping[str, Any]


@dataclass(frozen=True)
class Drawing:
    """A figure with its caption; `svg` is markup of our own making."""

    svg: str
    caption: str


@dataclass(frozen=True)
class Section:
    """One study on the page.

    `headline` and `detail` stand at the top of the page too; `tables` are shown, `folded` are there to open.
    """

    anchor: str
    title: str
    task: str
    headlines: tuple[tuple[str, str], ...]
    drawings: tuple[Drawing, ...]
    tables: tuple[Table, ...]
    notes: tuple[str, ...]
    folded: tuple[Table, ...] = ()


# Same-different


def jnd_section(
    name: str, title: str, result: Result, *, fps: float, data: str, mark: str, known: Result | None
) -> Section:
    """Return the section of a same-different study.

    Parameters
    ----------
    name, title
        Of the study.
    result
        From `analyse`.
    fps
        Frames per second, for seconds beside frames.
    data, mark
        Who answered, and what every figure says about it.
    known
        True thresholds of simulated observers; None otherwise.
    """
    anchor = f"study-{name}"
    truth = _true_places(known)
    drawings = [
        Drawing(
            figures.same_different_figure(result, f"{anchor}-curve", mark),
            "Answers “different” by the difference in blend length from k, the length that the reference method "
            "gives. Points are means over participants with one standard error; dashed lines join them, as in 2004. "
            "The blue curve is the model, its drop lines the thresholds, the bars at their feet 95% intervals.",
        ),
        Drawing(
            figures.thresholds_figure(result, f"{anchor}-thresholds", mark, truth),
            "The just noticeable difference with 95% intervals, over participants. Where there is no bar, the "
            "interval reaches beyond the levels shown.",
        ),
    ]
    if len(result["motions"]) > 1:
        drawings.append(
            Drawing(figures.motions_figure(result, f"{anchor}-motions", mark), "The same for every motion by itself.")
        )
    shown = [threshold_table(name, result, fps)]
    by_motion = [motion_threshold_table(name, result, fps)] if len(result["motions"]) > 1 else []
    if known:
        shown.append(recovery_table(name, result, known))
    return Section(
        anchor=anchor,
        title=title,
        task="same-different",
        headlines=(words.jnd_headline(result, fps, data),),
        drawings=tuple(drawings),
        tables=tuple(shown),
        notes=tuple(words.jnd_notes(result)),
        folded=(percent_table(name, result), *by_motion, d_prime_table(name, result)),
    )


def _true_places(known: Result | None) -> dict[str, float]:
    keys = ("threshold_shorter_frames", "threshold_longer_frames")
    return {key: known[key] for key in keys if key in known} if known else {}


_THRESHOLD_COLUMNS: tuple[tuple[str, str, tables.Kind], ...] = (
    ("estimate", "estimate", "text"),
    ("side", "blend is", "text"),
    ("frames", "frames", "two"),
    ("seconds", "seconds", "three"),
    ("standard_error", "standard error", "two"),
    ("low", "95% from", "two"),
    ("high", "to", "two"),
    ("remark", "remark", "text"),
)


def _threshold_rows(entry: Result, fps: float) -> list[dict[str, Any]]:
    kinds = [("straight lines (as published)", entry["published"])]
    if entry["model"]:
        kinds.append(("model", entry["model"]["jnd"]))
        kinds.append(("best criterion (model)", entry["model"]["corrected"]))
    rows = []
    for label, thresholds in kinds:
        for side in ("longer", "shorter"):
            if side not in thresholds:
                continue
            found = thresholds[side]
            rows.append(
                {
                    "estimate": label,
                    "side": side,
                    "frames": found["frames"],
                    "seconds": found["frames"] / fps if found["frames"] is not None else None,
                    "standard_error": found["standard_error"],
                    "low": found["interval"]["low"],
                    "high": found["interval"]["high"],
                    "remark": found["note"],
                }
            )
    return rows


def threshold_table(name: str, result: Result, fps: float) -> Table:
    """Return the thresholds as published and corrected."""
    percent = f"{100 * result['level']:.0f}%"
    caption = (
        f"The just noticeable difference, as published and corrected. Straight lines: where {percent} of the answers "
        "are “different”, read off between the levels; this moves with the rate of false alarms and cuts the corners "
        f"of the curve. Model: the same {percent} on the fitted curve. Best criterion: the difference at which an "
        f"observer with the best criterion would be right in {percent} of same and different pairs, whatever the "
        "criterion people took. Intervals are over participants; a dash where they reach beyond the levels shown."
    )
    rows = _threshold_rows(result, fps)
    columns = [column for column in _THRESHOLD_COLUMNS if column[0] != "remark" or any(row["remark"] for row in rows)]
    return tables.make(f"{name}_thresholds", caption, columns, rows)


def motion_threshold_table(name: str, result: Result, fps: float) -> Table:
    """Return the thresholds for every motion."""
    rows = []
    for motion in result["motions"]:
        base = {"motion": words.readable(motion["motion"]), "answers": motion["answers"]}
        rows += [{**base, **row} for row in _threshold_rows(motion, fps)]
    columns: list[tuple[str, str, tables.Kind]] = [
        ("motion", "motion", "text"),
        ("answers", "answers", "count"),
        *_THRESHOLD_COLUMNS,
    ]
    return tables.make(
        f"{name}_thresholds_by_motion",
        "Thresholds for every motion by itself, in frames.",
        columns,
        rows,
        files_only=("answers", "seconds", "remark"),
    )


def percent_table(name: str, result: Result) -> Table:
    """Return the percentages of Figure 6."""
    return tables.make(
        f"{name}_percent_different",
        "Answers “different” by difference in blend length. Mean and standard error over participants; Wilson’s "
        "interval of the answers as if independent.",
        [
            ("difference_frames", "frames from k", "count"),
            ("participants", "participants", "count"),
            ("answers", "answers", "count"),
            ("different", "different", "count"),
            ("percent", "percent", "one"),
            ("standard_error", "standard error", "one"),
            ("low", "95% from", "one"),
            ("high", "to", "one"),
        ],
        result["percent_different"],
    )


def d_prime_table(name: str, result: Result) -> Table:
    """Return sensitivity at every level."""
    return tables.make(
        f"{name}_d_prime",
        "Sensitivity at every level under the differencing rule, against the pairs without a difference. Answers "
        "pooled, taken as independent; one half added to each count.",
        [
            ("difference_frames", "frames from k", "count"),
            ("d_prime", "d-prime", "two"),
            ("standard_error", "standard error", "two"),
            ("low", "95% from", "two"),
            ("high", "to", "two"),
            ("criterion", "criterion", "two"),
        ],
        result["d_prime"],
    )


def recovery_table(name: str, result: Result, known: Result) -> Table:
    """Return the thresholds that the simulated observers had beside those that were found."""
    rows = []
    for side in ("longer", "shorter"):
        for label, thresholds, key in (
            ("differencing model", result["model"]["jnd"] if result["model"] else {}, f"threshold_{side}_frames"),
            ("straight lines", result["published"], f"interpolated_{side}_frames"),
        ):
            truth = known.get(key)
            found = thresholds.get(side)
            if truth is None or found is None or found["frames"] is None:
                continue
            error = found["standard_error"]
            away = found["frames"] - abs(truth)
            rows.append(
                {
                    "estimate": label,
                    "side": side,
                    "known": abs(truth),
                    "found": found["frames"],
                    "standard_error": error,
                    "distance": away,
                    "standard_errors": away / error if error else None,
                }
            )
    return tables.make(
        f"{name}_recovery",
        "What the simulated observers had and what was found, in frames. For straight lines the known value is where "
        "they would cross with endless data.",
        [
            ("estimate", "estimate", "text"),
            ("side", "blend is", "text"),
            ("known", "known", "two"),
            ("found", "found", "two"),
            ("standard_error", "standard error", "two"),
            ("distance", "off by", "two"),
            ("standard_errors", "in standard errors", "two"),
        ],
        rows,
    )


# Preferences


def preference_section(
    name: str, title: str, comparisons: Sequence[Result], *, mark: str, strengths: Result | None = None
) -> Section:
    """Return the section of a preference study."""
    anchor = f"study-{name}"
    drawings, shown, folded, notes = [], [], [], []
    for place, comparison in enumerate(comparisons):
        suffix = f"_{place + 1}" if len(comparisons) > 1 else ""
        svg = figures.preference_figure(comparison, f"{anchor}-forest{suffix}", mark)
        drawings.append(
            Drawing(
                svg,
                "Answers that favoured the first method, for every motion pair with Wilson’s 95% interval; below, all "
                "answers as if independent, and the mean over participants with its interval.",
            )
        )
        shown.append(preference_table(name + suffix, comparison))
        folded.append(preference_motion_table(name + suffix, comparison))
        notes += words.preference_notes(comparison)
    if strengths is not None and strengths.get("strengths"):
        shown.append(course.strengths_table(name, strengths))
    headlines = tuple(words.preference_headline(comparison) for comparison in comparisons)
    return Section(anchor, title, "preference", headlines, tuple(drawings), tuple(shown), tuple(notes), tuple(folded))


def _model_rows(models: Result | None) -> list[dict[str, Any]]:
    """The mixed model and the estimating equations, where they could be fitted."""
    if not models:
        return []
    names = (("mixed", "a typical participant", "logistic mixed model"), ("gee", "the population", "GEE"))
    return [
        {"reading": reading, "test": test, **{key: models[name][key] for key in ("percent", "low", "high", "p_value")}}
        for name, reading, test in names
        if models[name]["percent"] is not None
    ]


def preference_table(name: str, comparison: Result) -> Table:
    """Return the tests of a preference, as published and with the participant as the unit."""
    pooled, people, order = comparison["published"], comparison["participants"], comparison["order"]
    rows: list[dict[str, Any]] = [
        {
            "reading": "as published",
            "percent": pooled["percent"],
            "low": 100 * pooled["interval"]["low"],
            "high": 100 * pooled["interval"]["high"],
            "test": f"chi-square(1, N = {pooled['answers']})",
            "statistic": pooled["chi_square"],
            "p_value": pooled["p_value"],
        },
        {"reading": "as published, exact", "test": "binomial", "p_value": pooled["exact_p_value"]},
        {
            "reading": "corrected",
            "percent": people["mean_percent"],
            "low": people["low"],
            "high": people["high"],
            "test": f"t({people['degrees_of_freedom']})" if people["t"] is not None else people["test"],
            "statistic": people["t"],
            "p_value": people["p_value"],
        },
        {"reading": "corrected, by ranks", "test": "Wilcoxon", "p_value": people["wilcoxon_p_value"]},
        {
            "reading": "corrected, pooled",
            "test": f"F(1, {people['participants'] - 1})",
            "statistic": people["robust_chi_square"],
            "p_value": people["robust_p_value"],
        },
        {"reading": "orders balanced", "percent": order.get("balanced_percent")},
        *_model_rows(comparison.get("models")),
    ]
    return tables.make(
        f"{name}_preference",
        f"Percent favouring {words.readable(comparison['method_a'])} over {words.readable(comparison['method_b'])}. "
        "As published: all answers as independent, which a participant’s answers are not. Corrected: one share a "
        "participant, by Student’s t and by ranks; and the pooled percentage with its variance over participants. "
        "Orders balanced: the mean of the percentages with the first method shown first and second. A typical "
        "participant and the population: models with a term for the order, which differ where participants do.",
        [
            ("reading", "reading", "text"),
            ("percent", "percent", "one"),
            ("low", "95% from", "one"),
            ("high", "to", "one"),
            ("test", "test", "text"),
            ("statistic", "statistic", "two"),
            ("p_value", "p", "p"),
        ],
        rows,
    )


def preference_motion_table(name: str, comparison: Result) -> Table:
    """Return the preference for every motion."""
    rows = [{**row, "motion": words.readable(row["motion"])} for row in comparison["motions"]]
    return tables.make(
        f"{name}_preference_by_motion",
        "For every motion pair: Wilson’s 95% interval, chi-square(1) as published, exact binomial test, and the "
        "latter adjusted over the motions by Holm’s method.",
        [
            ("motion", "motion", "text"),
            ("favouring", "favouring", "count"),
            ("answers", "answers", "count"),
            ("percent", "percent", "one"),
            ("low", "95% from", "one"),
            ("high", "to", "one"),
            ("chi_square", "chi-square", "two"),
            ("p_value", "p", "p"),
            ("exact_p_value", "exact p", "p"),
            ("holm_p_value", "Holm p", "p"),
        ],
        rows,
    )


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

    `rows` are those of `rating_table`, `variance` those of `rating_anova`.
    """
    table = tables.make(
        f"{name}_ratings",
        "Ratings: mean over participants of their means, with its standard error and 95% interval.",
        [
            ("item", "question", "text"),
            ("method", "method", "text"),
            ("answers", "answers", "count"),
            ("participants", "participants", "count"),
            ("mean", "mean", "two"),
            ("standard_error", "standard error", "two"),
            ("low", "95% from", "two"),
            ("high", "to", "two"),
            ("median", "median", "one"),
        ],
        [{**row, "item": words.readable(row["item"])} for row in rows],
    )
    best = max(rows, key=lambda row: row["mean"]) if rows else None
    headline = (
        (f"{words.sentence(words.readable(best['method']))} was rated highest, {best['mean']:.2f} on average.", "")
        if best
        else None
    )
    headline = _compared(variance, alpha) or headline
    drawing = Drawing(
        figures.ratings_figure(rows, f"study-{name}-ratings", mark, points), "Mean ratings with 95% intervals."
    )
    compared = (_variance_table(name, variance), _difference_table(name, variance)) if variance else ()
    return Section(
        f"study-{name}",
        title,
        "rating",
        (headline,) if headline else (),
        (drawing,) if rows else (),
        (table, *compared),
        tuple(dict.fromkeys(question["note"] for question in variance if question["note"])),
    )


def _compared(questions: Sequence[Result], alpha: float) -> tuple[str, str] | None:
    """In how many questions one method was rated higher, with the F of each; None where there is no pair of methods."""
    known = [question for question in questions if question["difference"] and question["anova"]]
    if not known:
        return None
    # "a minus b", as `rating_anova` names it.
    first, _, second = str(known[0]["difference"]["of"]).partition(" minus ")
    up = [question for question in known if question["difference"]["mean"] > 0]
    if 2 * len(up) < len(known):
        first, second = second, first
        up = [question for question in known if question["difference"]["mean"] < 0]
    clear = [q for q in up if q["anova"][0]["p_value"] is not None and q["anova"][0]["p_value"] < alpha]
    statement = (
        f"{words.sentence(words.readable(first))} was rated higher than {words.readable(second)} in {len(up)} of "
        f"{words.number(len(known), 'question')}, in {len(clear)} significantly at {alpha:g}."
    )
    tests = [
        f"{words.readable(question['item']) or 'rating'}: F({row['degrees_of_freedom']}, "
        f"{row['error_degrees_of_freedom']}) = {row['f']:.2f}"
        for question in known
        if (row := question["anova"][0])["f"] is not None
    ]
    return statement, "; ".join(tests)


def _variance_table(name: str, questions: Sequence[Result]) -> Table:
    return tables.make(
        f"{name}_anova",
        "Two-way between-subjects analysis of variance, method by order of presentation (2003 section 4.2). It takes "
        "the ratings of one participant for independent; the next table does not.",
        [
            ("item", "question", "text"),
            ("source", "source", "text"),
            ("degrees_of_freedom", "df", "count"),
            ("error_degrees_of_freedom", "error df", "count"),
            ("sum_of_squares", "SS", "two"),
            ("mean_square", "MS", "two"),
            ("f", "F", "two"),
            ("p_value", "p", "p"),
            ("partial_eta_squared", "partial eta squared", "two"),
        ],
        [
            {"error_degrees_of_freedom": None, "f": None, "p_value": None, "partial_eta_squared": None}
            | {**row, "item": words.readable(question["item"])}
            for question in questions
            for row in question["anova"]
        ],
    )


def _difference_table(name: str, questions: Sequence[Result]) -> Table:
    return tables.make(
        f"{name}_differences",
        "Difference of each participant's own ratings of the two methods: mean, 95% interval, and t test.",
        [
            ("item", "question", "text"),
            ("of", "difference", "text"),
            ("mean", "mean", "two"),
            ("low", "95% from", "two"),
            ("high", "to", "two"),
            ("t", "t", "two"),
            ("degrees_of_freedom", "df", "count"),
            ("p_value", "p", "p"),
        ],
        [
            {**question["difference"], "item": words.readable(question["item"])}
            for question in questions
            if question["difference"]
        ],
    )
