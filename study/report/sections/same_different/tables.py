"""Tables of a same-different study: its result in, thresholds, percentages and sensitivities out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from study.analysis.same_different.analyse import MotionThresholds, SameDifferent
from study.analysis.same_different.counts import Side, Threshold
from study.report import words
from study.report.tables import Table, make

SIDES: tuple[tuple[Side, str], ...] = (("longer", "+"), ("shorter", "−"))


def _threshold_rows(entry: SameDifferent | MotionThresholds, fps: float) -> list[dict[str, Any]]:
    """Every reading of the thresholds of all motions together, or of one."""
    kinds = [("linear interpolation (as published)", entry.published)]
    if model := entry.model:
        kinds += [("model", model.jnd), ("model", _profiled(entry))]
        kinds += [("model, best criterion", model.corrected), ("model, Abbott’s correction", model.guess_corrected)]
    if isinstance(entry, SameDifferent) and (staircases := entry.staircases):
        share = f"{100 * staircases.target:.1f}%"
        kinds.append((f"staircases, mean of the last {staircases.averaged} reversals ({share})", staircases.thresholds))
    if isinstance(entry, SameDifferent) and (mixed := entry.mixed):
        kinds += [("mixed model, median observer", mixed.typical), ("mixed model, group", mixed.population)]
    return [
        vars(found)
        | {"estimate": label, "interval": _interval_by(found), "remark": found.note}
        | {"seconds": found.frames / fps if found.frames is not None else None}
        | {"low": found.interval.low, "high": found.interval.high}
        for label, thresholds in kinds
        for side, _ in SIDES
        if (found := thresholds.get(side))
    ]


def _interval_by(threshold: Threshold) -> str:
    """What made the interval, as far as the method names it."""
    names = {
        "Fieller": "Fieller",
        "jackknife": "jackknife",
        "one participant": "one participant",
        "profile": "profile likelihood",
        "reversals": "Student’s t",
    }
    return next((name for part, name in names.items() if part in threshold.method), "curvature")


def _profiled(entry: SameDifferent | MotionThresholds) -> dict[Side, Threshold]:
    """The model's thresholds with intervals by profile likelihood; none for single motions."""
    if not isinstance(entry, SameDifferent) or entry.model is None:
        return {}
    jnd = entry.model.jnd
    return {
        side: replace(jnd[side], interval=found, standard_error=None, note="", method="profile")
        for side, found in entry.profile.items()
        if side in jnd
    }


_THRESHOLDS = "estimate side frames seconds standard_error low high interval remark"


def threshold_table(name: str, result: SameDifferent, fps: float) -> Table:
    """Return the thresholds as published and corrected."""
    percent = f"{100 * result.level:.0f}%"
    rows = _threshold_rows(result, fps)
    return make(
        f"{name}_thresholds",
        f"The just noticeable difference, as published and corrected. Linear interpolation: where {percent} of the "
        "answers "
        "are “different”, interpolated between the levels; this depends on the false-alarm rate and is biased for a "
        f"curved function. Model: the same {percent} on the fitted curve. Best criterion: the difference at which an "
        f"observer with the best criterion would be right in {percent} of same and different pairs, whatever "
        "criterion the participants used"
        ". Abbott: corrected for false alarms as guesses. Mixed model: participants with individual sensitivities and "
        "criteria: the median one, and the mean of all. Fieller’s and the "
        "jackknife’s intervals are over participants, the curvature’s rest on the mixed model; profile likelihood "
        "treats all answers as independent and is too narrow if participants differ"
        ". A dash: the interval reaches beyond the levels shown.",
        _THRESHOLDS,
        rows,
        headings={"interval": "interval by"},
        files_only="" if any(row["remark"] for row in rows) else "remark",
    )


def motion_table(name: str, result: SameDifferent, fps: float) -> Table:
    """Return the thresholds for every motion."""
    rows = [
        {"motion": words.readable(motion.motion), "answers": motion.answers, **row}
        for motion in result.motions
        for row in _threshold_rows(motion, fps)
    ]
    return make(
        f"{name}_thresholds_by_motion",
        "Thresholds for every motion by itself, in frames.",
        f"motion answers {_THRESHOLDS}",
        rows,
        headings={"interval": "interval by"},
        files_only="answers seconds remark",
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
        "pooled, treated as independent; one half added to each count.",
        "difference_frames d_prime standard_error low high criterion",
        [vars(row) for row in result.d_prime],
    )


def recovery_table(name: str, result: SameDifferent, known: Mapping[str, Any]) -> Table:
    """Return the thresholds that the simulated observers had beside those that were found."""
    rows = []
    for side, _ in SIDES:
        own = result.staircases.thresholds if result.staircases else {}
        for label, thresholds, truths, key in (
            ("differencing model", result.model.jnd if result.model else {}, known, f"threshold_{side}_frames"),
            ("linear interpolation", result.published, known, f"interpolated_{side}_frames"),
            ("staircases", own, known.get("staircase", {}), f"threshold_{side}_frames"),
        ):
            truth, found = truths.get(key), thresholds.get(side)
            if truth is None or found is None or found.frames is None:
                continue
            error, away = found.standard_error, found.frames - abs(truth)
            rows.append(
                {
                    "estimate": label,
                    "side": side,
                    "known": abs(truth),
                    "found": found.frames,
                    "standard_error": error,
                    "distance": away,
                    "standard_errors": away / error if error else None,
                }
            )
    return make(
        f"{name}_recovery",
        "What the simulated observers had and what was found, in frames. For linear interpolation the known value is "
        "the crossing with infinite data; for staircases it is where the observers reach their target.",
        "estimate side known found standard_error distance standard_errors",
        rows,
    )
