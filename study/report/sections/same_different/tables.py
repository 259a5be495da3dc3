"""Tables of a same-different study: its result in, thresholds, percentages and sensitivities out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from study.analysis.same_different.analyse import MotionThresholds, SameDifferent
from study.analysis.same_different.counts import PRINTED, Side, Threshold
from study.report import words
from study.report.sections.section import About
from study.report.tables import Table, make

USED = ("median observer", "median observer, best criterion", "linear interpolation (as published)")
"""The estimates that stand in the open; of one or two participants the group's take the first two places."""


def _threshold_rows(entry: SameDifferent | MotionThresholds, fps: float) -> list[dict[str, Any]]:
    """One row an estimate of the thresholds, of all motions together or of one: both sides beside each other."""
    kinds: list[tuple[str, Mapping[Side, Threshold]]] = []
    if isinstance(entry, SameDifferent) and (mixed := entry.mixed):
        kinds += [("median observer", mixed.typical), ("median observer, best criterion", mixed.criterion_free)]
        kinds += [("median observer, for these motions", mixed.these_motions)] if mixed.motion_spread else []
        kinds += [("all observers’ mean", mixed.population)]
    if model := entry.model:
        kinds += [("group’s curve", model.jnd), ("group’s curve, best criterion", model.corrected)]
    kinds.append(("linear interpolation (as published)", entry.published))
    if isinstance(entry, SameDifferent) and (staircases := entry.staircases):
        share = f"{100 * staircases.target:.1f}%"
        kinds.append((f"{staircases.title}s, {staircases.estimate} ({share})", staircases.thresholds))
    rows = []
    for label, thresholds in kinds:
        row: dict[str, Any] = {"estimate": label, "remark": _remarks(thresholds)}
        for side, found in thresholds.items():
            row |= {side: found.frames, f"{side}_low": found.interval.low, f"{side}_high": found.interval.high}
            row[f"{side}_seconds"] = found.frames / fps if found.frames is not None else None
            row[f"{side}_standard_error"] = found.standard_error
        rows.append(row)
    return rows


def _remarks(thresholds: Mapping[Side, Threshold]) -> str:
    return "; ".join(f"{side}: {found.note}" for side, found in thresholds.items() if found.note)


_SHORTER, _LONGER = (
    f"{side} {side}_seconds {side}_standard_error {side}_low {side}_high" for side in ("shorter", "longer")
)
_THRESHOLDS = f"estimate {_SHORTER} {_LONGER} remark"
_FILES_ONLY = "shorter_seconds shorter_standard_error longer_seconds longer_standard_error"


def threshold_tables(name: str, result: SameDifferent, fps: float) -> tuple[Table, Table]:
    """Return the thresholds, one row an estimate: those that are used most, and the others."""
    percent = f"{100 * result.level:.0f}%"
    rows = _threshold_rows(result, fps)
    used = [row for row in rows if row["estimate"] in USED or (not result.mixed and "group" in row["estimate"])]
    used += [row for row in rows if result.staircases and row is rows[-1]]
    hidden = _FILES_ONLY + ("" if any(row["remark"] for row in rows) else " remark")
    return make(
        f"{name}_thresholds",
        f"The just noticeable difference in frames, with confidence intervals. Where {percent} of the answers are "
        f"“different”. Best criterion: the difference at which an observer with the best criterion would be right in "
        f"{percent} of same and different pairs; it alone does not move with the false-alarm rate. Linear "
        "interpolation between the levels (Fieller’s interval) depends on the levels and is biased for a curved "
        "function. A dash: beyond the levels shown.",
        _THRESHOLDS,
        used,
        files_only=hidden,
    ), make(
        f"{name}_other_thresholds",
        "Other estimates of the just noticeable difference, in frames. Of the median observer for these motions alone, "
        "and where the mean of all observers’ curves crosses (mixed model); on one curve fitted to all answers "
        "(jackknife over participants).",
        _THRESHOLDS,
        [row for row in rows if row not in used],
        files_only=hidden,
    )


def motion_table(name: str, result: SameDifferent, about: About) -> Table:
    """Return the thresholds for every motion, as shares of its k too."""
    rows = []
    for motion in result.motions:
        k = about.lengths.get(motion.motion)
        for row in _threshold_rows(motion, about.fps):
            shares = {f"{side}_share": 100 * row[side] / k for side in PRINTED if k and row.get(side) is not None}
            found = {"motion": words.readable(motion.motion), "answers": motion.answers, "reference_frames": k}
            rows.append(found | row | shares)
    return make(
        f"{name}_thresholds_by_motion",
        "Thresholds for every motion by itself, in frames, and in percent of k, its reference’s blend length (Weber "
        "fraction).",
        f"motion answers reference_frames {_THRESHOLDS.replace(' longer ', ' shorter_share longer ', 1)} longer_share",
        rows,
        files_only=f"answers {_FILES_ONLY} remark",
    )


def own_table(name: str, result: SameDifferent) -> Table:
    """Return what each participant's responses give by themselves."""
    return make(
        f"{name}_participants",
        "Every participant by themselves. Thresholds in frames, criterion in standard deviations of an impression, and "
        "lapse rate in percent, by a differencing model of their own responses.",
        "participant answers shorter longer criterion lapse_percent remark",
        [vars(own) | {"lapse_percent": own.lapse and 100 * own.lapse, "remark": own.note} for own in result.own],
    )


def percent_table(name: str, result: SameDifferent) -> Table:
    """Return the percentages of Figure 6."""
    return make(
        f"{name}_percent_different",
        "Answers “different” by difference in blend length. Mean and standard error over participants; Wilson’s "
        "interval with answers treated as independent.",
        "difference_frames participants answers different percent standard_error:one low:one high:one",
        [vars(row) for row in result.percent_different],
    )


def d_prime_table(name: str, result: SameDifferent) -> Table:
    """Return sensitivity at every level."""
    return make(
        f"{name}_d_prime",
        "Sensitivity at every level. Under the differencing rule, against the pairs without a difference; answers "
        "pooled, treated as independent; one half added to each count. Beside it what the same answers mean under the "
        "rule of independent observations.",
        "difference_frames d_prime standard_error low high criterion d_prime_independent",
        [vars(row) for row in result.d_prime],
    )
