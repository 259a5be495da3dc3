"""How a study went: answers and presentations in; learning over trials, bad presentations, exclusions out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from study.report import tables, words
from study.report.drawing import BLUE, FAINT, ORANGE, TEAL, add_mark, new_figure, quiet_grid, style, to_svg

if TYPE_CHECKING:
    import pandas as pd

Result = Mapping[str, Any]
PARTS = 6
FEWEST_ANSWERS = 12


def learning_table(answers: pd.DataFrame) -> tables.Table:
    """Return, for sixths of each study's trials, how participants answered: right (same-different), or the first."""
    rows = [row for (study, task), part in _studies(answers) for row in _course(str(study), str(task), part)]
    return tables.make(
        "learning",
        "Over the course of each study, in sixths of its trials: right answers (same-different) or answers for the one "
        "shown first (preference), means over participants with standard errors.",
        [
            ("study", "study", "text"),
            ("part", "sixth", "count"),
            ("what", "percent of", "text"),
            ("percent", "percent", "one"),
            ("standard_error", "standard error", "one"),
            ("answers", "answers", "count"),
        ],
        rows,
    )


def _studies(answers: pd.DataFrame) -> Any:
    return answers.groupby(["study", "task"], sort=False)


def _course(study: str, task: str, part: pd.DataFrame) -> list[dict[str, Any]]:
    """Percentages by sixth of one study; none for ratings, nor where there are too few trials to part."""
    given = part[part["answer"].notna()]
    if task not in ("same-different", "preference") or len(given) < FEWEST_ANSWERS:
        return []
    place = part.groupby("participant")["trial"].rank(method="first")
    most = place.groupby(part["participant"]).transform("max")
    if most.max() < PARTS:
        return []
    sixth = np.ceil(place / most * PARTS).loc[given.index]
    if task == "same-different":
        counted = ((given["answer"] == "different") == (given["difference_frames"] != 0)).astype(float)
    else:
        counted = (given["answer"] == "first").astype(float)
    shares = counted.groupby([given["participant"].astype(str), sixth]).mean().unstack()
    sizes = counted.groupby(sixth).size()
    rows = []
    for number in shares.columns:
        column = shares[number].dropna()
        error = 100 * float(column.std(ddof=1)) / len(column) ** 0.5 if len(column) > 1 else None
        what = "right answers" if task == "same-different" else "answers for the first"
        mean = 100 * float(column.mean())
        rows.append({"study": study, "part": int(number), "what": what, "percent": mean})
        rows[-1] |= {"standard_error": error, "answers": int(sizes[number])}
    return rows


def learning_figure(table: tables.Table, name: str, mark: str) -> str | None:
    """The table as lines; None where there is nothing to draw."""
    if not table.rows:
        return None
    studies = list(dict.fromkeys(str(row["study"]) for row in table.rows))
    with style():
        figure, axes = new_figure(7.2, 2.6)
        axes.axhline(50, color=FAINT, linewidth=0.9, linestyle=(0, (4, 3)))
        for place, study in enumerate(studies):
            own = [row for row in table.rows if row["study"] == study]
            x = [row["part"] + 0.06 * (place - (len(studies) - 1) / 2) for row in own]
            errors = [row["standard_error"] or 0.0 for row in own]
            colour = (BLUE, ORANGE, TEAL)[place % 3]
            label = f"{words.readable(study)}: {own[0]['what']}"
            axes.errorbar(x, [row["percent"] for row in own], yerr=errors, color=colour, marker="o", markersize=4,
                          linewidth=1.3, elinewidth=1, label=label)  # fmt: skip
        axes.set_xticks(range(1, PARTS + 1))
        axes.set_xlabel("sixth of the study")
        axes.set_ylim(0, 100)
        axes.set_title("percent")
        quiet_grid(axes)
        axes.legend(loc="lower right", fontsize=8.5)
        add_mark(figure, mark)
        spoken = "; ".join(
            f"{words.readable(study)} from {own[0]['percent']:.0f}% to {own[-1]['percent']:.0f}%"
            for study in studies
            if (own := [row for row in table.rows if row["study"] == study])
        )
        return to_svg(figure, name, "Answers over the course of each study", spoken)


def presentation_table(presentations: pd.DataFrame) -> tables.Table:
    """Return how well stimuli were shown, by what timed them."""
    rows = []
    for method, part in presentations.groupby("method", sort=True):
        expected, seen = part["frames_expected"].sum(), part["frames_presented"].sum()
        measured = part["longest_gap_frames"].dropna()
        rows.append(
            {
                "method": str(method),
                "shown": len(part),
                "badly": int((~part["shown_well"].astype(bool)).sum()),
                "frames_lost_percent": 100 * (1 - seen / expected)
                if expected and part["frames_presented"].any()
                else None,
                "median_gap": float(measured.median()) if len(measured) else None,
                "longest_gap": float(measured.max()) if len(measured) else None,
            }
        )
    return tables.make(
        "presentation",
        "How stimuli were shown: presentations by what timed them, how many were faulty, frames that were not seen, "
        "and the longest time between two frames, in frames (1 is perfect).",
        [
            ("method", "timed by", "text"),
            ("shown", "presentations", "count"),
            ("badly", "faulty", "count"),
            ("frames_lost_percent", "frames lost, %", "two"),
            ("median_gap", "longest gap, median", "two"),
            ("longest_gap", "longest gap of all", "two"),
        ],
        rows,
    )


def exclusion_sentence(analysis: Result) -> str:
    """Return what was left out, in words."""
    found = analysis["exclusions"]
    if not found["rules"]:
        return "The protocol states no rules of exclusion; nobody and nothing was left out."
    parts = [
        f"{rule['rule']}: {words.number(rule['answers'], 'answer')}"
        + (f" of {words.number(rule['participants'], 'participant')}" if rule["participants"] else "")
        for rule in found["rules"]
    ]
    total = words.number(found["answers_left_out"], "answer")
    text = f"By rules that the protocol stated before there was data, {total} left out ({'; '.join(parts)})."
    return text if not found["answers_left_out"] else text + " Results with and without stand side by side below."


def exclusion_table(analysis: Result) -> tables.Table | None:
    """Return the main results with and without exclusions; None where nothing was left out."""
    other = analysis["without_exclusions"]
    if other is None:
        return None
    rows = [*_compared(analysis, "by the rules"), *_compared(other, "of all answers")]
    rows.sort(key=lambda row: (row["result"],))
    return tables.make(
        "exclusions",
        "Main results by the rules of exclusion, and of all answers.",
        [
            ("result", "result", "text"),
            ("answers", "answers", "text"),
            ("value", "value", "two"),
            ("low", "95% from", "two"),
            ("high", "to", "two"),
            ("p_value", "p", "p"),
        ],
        rows,
    )


def _compared(analysis: Result, answers: str) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    for study, found in analysis["jnd"].items():
        thresholds = found["model"]["jnd"] if found["model"] else found["published"]
        for side, threshold in thresholds.items():
            result = f"{words.readable(study)}: threshold, {side} [frames]"
            ends = {end: threshold["interval"][end] for end in ("low", "high")}
            rows.append({"result": result, "answers": answers, "value": threshold["frames"], **ends})
    for study, comparisons in analysis["preference"].items():
        for compared in comparisons:
            people = compared["participants"]
            methods = f"{words.readable(compared['method_a'])} over {words.readable(compared['method_b'])}"
            row = {"result": f"{words.readable(study)}: {methods} [%]", "answers": answers}
            ends = {end: people[end] for end in ("low", "high", "p_value")}
            rows.append({**row, "value": people["mean_percent"], **ends})
    for study, ratings in analysis["ratings"].items():
        for rated in ratings:
            result = (
                f"{words.readable(study)}: {words.readable(': '.join(filter(None, (rated['item'], rated['method']))))}"
            )
            rows.append({"result": result, "answers": answers, "value": rated["mean"], "low": rated["low"]})
            rows[-1]["high"] = rated["high"]
    return rows


def strengths_table(name: str, found: Result) -> tables.Table:
    """Return Bradley-Terry strengths of more than two methods."""
    rows: Sequence[dict[str, Any]] = [
        {**row, **row["interval"], "method": words.readable(row["method"])}
        for row in [*found.get("strengths", []), *([found["order"]] if found.get("order") else [])]
    ]
    return tables.make(
        f"{name}_strengths",
        "Strengths of the methods (Bradley-Terry, logits beside the reference), and what being shown first adds; all "
        "answers as independent.",
        [
            ("method", "method", "text"),
            ("value", "strength", "two"),
            ("standard_error", "standard error", "two"),
            ("low", "95% from", "two"),
            ("high", "to", "two"),
        ],
        rows,
    )
