"""How a study was carried out, and by whom: presentations, checks, exclusions and sessions in; tables and words out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from study.analysis.analyse import Analysis, Results
from study.analysis.confidence import HowSure
from study.analysis.quality import Quality
from study.counting import counted, noun
from study.experiment.store.anonymous import BEGINNING
from study.report import tables, words
from study.report.drawing import BLUE, FAINT, ORANGE, Picture, new_figure, picture_of, quiet_grid
from study.report.sections.section import About

if TYPE_CHECKING:
    import pandas as pd


LONGEST_GAP_FRAMES = 1.5
"""A longer time between two frames is a display failure. [frames]"""


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
        "How stimuli were shown. Presentations by what timed them; how many were display failures (a gap of more than "
        f"{LONGEST_GAP_FRAMES:g} frames, a frame missing, or hidden) and how many showed a trial again; frames that "
        "were not shown; and the longest time between two frames, in frames (1 is perfect).",
        "timed_by shown badly again frames_lost frames_lost_percent median_gap longest_gap",
        rows,
    )


def presentation_figure(presentations: pd.DataFrame, name: str, mark: str) -> Picture | None:
    """Draw the longest gap of every presentation; None where none was measured."""
    gaps = presentations["longest_gap_frames"].dropna().to_numpy(dtype=np.float64)
    if not len(gaps):
        return None
    most = max(float(gaps.max()), 2.0)
    with new_figure(7.2, 2.1) as (figure, axes):
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
        over = int((gaps > LONGEST_GAP_FRAMES).sum())
        spoken = (
            f"{counted(len(gaps), 'presentation')}, median {np.median(gaps):.2f} frames, longest {gaps.max():.2f}; "
            f"{over} over {LONGEST_GAP_FRAMES:g} frames"
        )
        return picture_of(figure, name, "Longest gap between frames of each presentation", spoken, mark)


def checks_sentence(checks: pd.DataFrame) -> str:
    """Return how attention checks were answered; nothing where there were none."""
    if not len(checks):
        return ""
    passed = int((checks["answer"].notna() & (checks["answer"] == checks["expected"])).sum())
    people = checks["participant"].nunique()
    asked = counted(len(checks), "attention check")
    return f"{passed} of {asked} by {counted(people, 'participant')} were passed."


def sure_table(about: About, rows: Sequence[HowSure]) -> tables.Table:
    """Return how sure participants were of their choices."""
    return tables.make(
        f"{about.name}_how_sure",
        "How sure participants were of their answers, from 0. Mean over participants of their means, with its standard "
        "error and 95% interval (Student’s t).",
        "answer answers participants mean standard_error low high",
        [vars(row) for row in rows],
    )


def quality_sentence(quality: Quality) -> str:
    """Return how complete and how quick the answers are, and who is flagged."""
    text = (
        f"{quality.missed:,} of {counted(quality.trials, 'question')} had no response ({quality.missed_percent:.1f}%), "
        f"{quality.too_fast:,} answered sooner than {quality.fastest_s:g} s."
    )
    if times := quality.response_s:
        text += (
            f" Half of the answers came within {times['50']:.2f} s, nine in ten between {times['5']:.2f} and "
            f"{times['95']:.2f} s."
        )
    if quality.shown_badly:
        text += f" {counted(quality.shown_badly, 'answer')} followed a stimulus that stalled or was hidden."
    return text + (
        f" {counted(quality.flagged, 'participant')} {noun(quality.flagged, 'is', 'are')} flagged, which excludes no "
        f"one, for one of these reasons: {'; '.join(quality.rules)}."
    )


def exclusion_sentence(analysis: Analysis) -> str:
    """Return what was excluded, in words."""
    found = analysis.exclusions
    if not found.rules:
        return "The protocol states no rules of exclusion; no participant and no response was excluded."
    if not found.answers_left_out:
        return (
            f"By the {counted(len(found.rules), 'rule')} of exclusion that the protocol preregistered, no "
            "participant and no response was excluded."
        )
    return (
        f"By rules preregistered in the protocol, {counted(found.answers_left_out, 'answer')} of "
        f"{analysis.quality.trials:,} are excluded from all results above; "
        f"{counted(len(found.participants), 'participant')} entirely. Results with and without are given side by side "
        "below."
    )


def exclusion_tables(analysis: Analysis) -> tuple[tables.Table, ...]:
    """Return the rules with what each excluded and, if anything was excluded, results with and without side by side."""
    found, everything = analysis.exclusions, analysis.without_exclusions
    if not found.rules:
        return ()
    rules = tables.make(
        "exclusion_rules",
        "Rules of exclusion, as preregistered in the protocol, and what each excluded. What breaks "
        "several rules counts under the first.",
        "rule participants answers",
        [vars(rule) for rule in found.rules],
    )
    if everything is None:
        return (rules,)
    kept, other = (_main_results(results, analysis) for results in (analysis, everything))
    rows = [
        {f"all_{key}": value for key, value in other.get(result, {}).items()}
        | kept.get(result, {})
        | {"result": words.sentence(words.readable(result))}
        for result in dict.fromkeys([*kept, *other])
    ]
    return rules, tables.make(
        "exclusions",
        "Main results after exclusions, and for all responses, with confidence intervals as in the headlines.",
        "result value low high p_value all_value all_low all_high all_p_value",
        rows,
        headings={"value": "by the rules"},
    )


def _main_results(results: Results, analysis: Analysis) -> dict[str, dict[str, float | None]]:
    """The headline numbers of every study."""
    return {
        f"{one.study}: {one.unit}": {"value": one.estimate, "p_value": one.p}
        | {"low": one.interval.low, "high": one.interval.high}
        for one in results.headlines(analysis.alpha, analysis.confidence)
    }


def participant_table(analysis: Analysis, sessions: pd.DataFrame) -> tables.Table:
    """Return one row a participant: when, how many answers, how fast, what was noticed."""
    started = {}
    if len(sessions) and "started_at" in sessions and (sessions["started_at"] != BEGINNING).any():
        started = {str(row.participant): str(row.started_at)[:16] for row in sessions.itertuples()}
    left_out = {one.participant: one.reason for one in analysis.exclusions.participants}
    rows = [
        vars(row)
        | {"kind": "simulated" if row.simulated else "person"}
        | {"started": started.get(row.participant, ""), "left_out": left_out.get(row.participant, "")}
        for row in analysis.quality.table
    ]
    hidden = {
        "kind": analysis.data != "mixed",
        "left_out": not left_out,
        "started": not started,
        "shown_badly": not analysis.quality.shown_badly,
        "too_fast": not analysis.quality.too_fast,
        "false_alarms same_pairs": not any(row.same_pairs for row in analysis.quality.table),
    }
    return tables.make(
        "participants",
        "Participants. Flags follow the rules above and exclude no one."
        + (" The last column says who was excluded, and why." if left_out else ""),
        "participant kind started trials answered missed median_response_s too_fast shown_badly false_alarms "
        "same_pairs flags left_out",
        rows,
        files_only=" ".join(keys for keys, hide in hidden.items() if hide),
    )
