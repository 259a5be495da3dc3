"""How a study was carried out: presentations, checks and exclusions in; tables, a figure and sentences out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from study.counting import counted
from study.report import tables, words
from study.report.drawing import BLUE, FAINT, ORANGE, add_mark, new_figure, quiet_grid, style, to_svg

if TYPE_CHECKING:
    import pandas as pd

Result = Mapping[str, Any]

LONGEST_GAP_FRAMES = 1.5
"""A longer time between two frames makes a presentation faulty. [frames]"""


def presentation_table(presentations: pd.DataFrame) -> tables.Table:
    """Return how well stimuli were shown, by what timed them."""
    rows = []
    for method, part in presentations.groupby("method", sort=True):
        counted = part[part["frames_presented"].notna() & part["frames_expected"].notna()]
        expected, seen = counted["frames_expected"].sum(), counted["frames_presented"].sum()
        gaps = part["longest_gap_frames"].dropna()
        rows.append(
            {
                "timed_by": str(method),
                "shown": len(part),
                "badly": int((~part["shown_well"].astype(bool)).sum()),
                "again": int((part["attempt"] > 1).sum()),
                "frames_lost": int(max(expected - seen, 0)) if len(counted) else None,
                "frames_lost_percent": 100 * max(1 - seen / expected, 0.0) if expected else None,
                "median_gap": float(gaps.median()) if len(gaps) else None,
                "longest_gap": float(gaps.max()) if len(gaps) else None,
            }
        )
    return tables.make(
        "presentation",
        "How stimuli were shown. Presentations by what timed them; how many were faulty (a gap of more than "
        f"{LONGEST_GAP_FRAMES:g} frames, a frame missing, or hidden) and how many showed a trial again; frames that "
        "were "
        "not seen; and the longest time between two frames, in frames (1 is perfect).",
        "timed_by shown badly again frames_lost frames_lost_percent median_gap longest_gap",
        rows,
    )


def presentation_figure(presentations: pd.DataFrame, name: str, mark: str) -> str | None:
    """Draw the longest gap of every presentation; None where none was measured."""
    import numpy as np

    gaps = presentations["longest_gap_frames"].dropna().to_numpy(dtype=np.float64)
    if not len(gaps):
        return None
    most = max(float(gaps.max()), 2.0)
    with style():
        figure, axes = new_figure(7.2, 2.1)
        edges = np.linspace(0, most, 41)
        counts, _, bars = axes.hist(gaps, bins=edges.tolist(), color=FAINT, edgecolor="white", linewidth=0.5)
        for bar, left in zip(bars, edges, strict=False):
            if left >= LONGEST_GAP_FRAMES:
                bar.set_facecolor(ORANGE)
        axes.axvline(LONGEST_GAP_FRAMES, color=BLUE, linewidth=1.2)
        axes.annotate(
            f"{LONGEST_GAP_FRAMES:g} frames", (LONGEST_GAP_FRAMES, float(counts.max())), xytext=(4, -3),
            textcoords="offset points", color=BLUE, fontsize=8.5, va="top",
        )  # fmt: skip
        axes.set_xlim(0, most)
        axes.set_xlabel("longest time between two frames of a presentation, frames")
        axes.set_title("presentations")
        quiet_grid(axes)
        add_mark(figure, mark)
        over = int((gaps > LONGEST_GAP_FRAMES).sum())
        spoken = (
            f"{counted(len(gaps), 'presentation')}, median {np.median(gaps):.2f} frames, longest "
            f"{gaps.max():.2f}; "
            f"{over} over {LONGEST_GAP_FRAMES:g} frames"
        )
        return to_svg(figure, name, "Longest gap between frames of each presentation", spoken)


def checks_sentence(checks: pd.DataFrame) -> str:
    """Return how attention checks were answered; nothing where there were none."""
    if not len(checks):
        return ""
    passed = int((checks["answer"].notna() & (checks["answer"] == checks["expected"])).sum())
    people = checks["participant"].nunique()
    asked = counted(len(checks), "attention check")
    return f"{passed} of {asked} by {counted(people, 'participant')} were passed."


def exclusion_sentence(analysis: Result) -> str:
    """Return what was left out, in words."""
    found = analysis["exclusions"]
    if not found["rules"]:
        return "The protocol states no rules of exclusion; nobody and nothing was left out."
    if not found["answers_left_out"]:
        return (
            f"By the {counted(len(found['rules']), 'rule')} of exclusion that the protocol stated before there "
            "was "
            "data, nobody and nothing was left out."
        )
    return (
        f"By rules that the protocol stated before there was data, "
        f"{counted(found['answers_left_out'], 'answer')} of "
        f"{analysis['quality']['trials']:,} are left out of all results above; "
        f"{counted(len(found['participants']), 'participant')} wholly. Results with and without stand side by "
        "side "
        "below."
    )


def exclusion_tables(analysis: Result) -> tuple[tables.Table, ...]:
    """Return the rules with what each left out, and where anything was, results with and without side by side."""
    found, everything = analysis["exclusions"], analysis["without_exclusions"]
    if not found["rules"]:
        return ()
    rules = tables.make(
        "exclusion_rules",
        "Rules of exclusion, as the protocol stated them before there was data, and what each left out. What breaks "
        "several rules counts under the first.",
        "rule participants answers",
        found["rules"],
    )
    if everything is None:
        return (rules,)
    other = {row["result"]: row for row in _main_results(everything)}
    rows = []
    kept = {row["result"]: row for row in _main_results(analysis)}
    for result in dict.fromkeys([*kept, *other]):
        beside = {f"all_{key}": value for key, value in other.get(result, {}).items() if key != "result"}
        rows.append({"result": result, **kept.get(result, {}), **beside})
    return rules, tables.make(
        "exclusions",
        "Main results by the rules of exclusion, and of all answers, with 95% intervals over participants.",
        "result value low high p_value all_value all_low all_high all_p_value",
        rows,
        headings={"value": "by the rules"},
    )


def _main_results(analysis: Result) -> Iterator[dict[str, Any]]:
    """One row a result: thresholds, preferences, comparisons on a scale, mean ratings."""
    for study, found in analysis["jnd"].items():
        thresholds = found["model"]["jnd"] if found["model"] else found["published"]
        for side, threshold in thresholds.items():
            result = f"{words.readable(study)}: threshold, {side} [frames]"
            ends = {end: threshold["interval"][end] for end in ("low", "high")}
            yield {"result": result, "value": threshold["frames"], **ends}
    for study, comparisons in analysis["preference"].items():
        for compared in comparisons:
            people = compared["participants"]
            methods = f"{words.readable(compared['method_a'])} over {words.readable(compared['method_b'])}"
            ends = {end: people[end] for end in ("low", "high", "p_value")}
            yield {"result": f"{words.readable(study)}: {methods} [%]", "value": people["mean_percent"], **ends}
    for study, questions in analysis["pair_ratings"].items():
        for question in questions:
            people = question["participants"]
            what = words.readable(": ".join(filter(None, (question["item"], question["of"]))))
            ends = {end: people[end] for end in ("low", "high", "p_value")}
            yield {"result": f"{words.readable(study)}: {what}", "value": people["mean"], **ends}
    for study, ratings in analysis["ratings"].items():
        for rated in ratings:
            what = words.readable(": ".join(filter(None, (rated["item"], rated["method"]))))
            ends = {end: rated[end] for end in ("low", "high")}
            yield {"result": f"{words.readable(study)}: {what}", "value": rated["mean"], **ends}
