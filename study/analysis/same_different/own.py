"""Each participant's own differencing model: counts in; thresholds, criterion and lapse rate of each out."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from study.analysis.conditions import SLOPE, OwnEstimate
from study.analysis.same_different.counts import Counts
from study.analysis.same_different.model import ModelFit, fit_model


@dataclass(frozen=True)
class OwnThresholds:
    """One participant's thresholds in frames; None where they can't be had, and `note` says why."""

    participant: str
    answers: int
    shorter: float | None = None
    longer: float | None = None
    criterion: float | None = None
    lapse: float | None = None
    note: str = ""


def own_thresholds(counts: Counts, level: float, lapse: float | None = None) -> tuple[OwnThresholds, ...]:
    """Return what each participant's responses give by themselves."""
    return tuple(_told(name, answers, found) for name, answers, found in _fits(counts, level, lapse))


def own_estimates(counts: Counts, condition: str, level: float, lapse: float | None = None) -> Iterator[OwnEstimate]:
    """Return each participant's thresholds and slopes in one condition, with their errors, to compare conditions."""
    for name, _, found in _fits(counts, level, lapse):
        if isinstance(found, str):
            continue
        for side, threshold in found.jnd.items():
            slope, error = found.slopes[side], found.slope_errors[side]
            if threshold.frames is not None:
                what = f"threshold of {side} blends"
                yield OwnEstimate(name, condition, what, threshold.frames, threshold.standard_error)
                yield OwnEstimate(name, condition, f"{SLOPE}, {side} blends", math.log(slope), error and error / slope)


def _fits(counts: Counts, level: float, lapse: float | None) -> Iterator[tuple[str, int, ModelFit | str]]:
    for place, name in enumerate(counts.participants):
        rows = slice(place, place + 1)
        own = replace(counts, participants=(name,), different=counts.different[rows], shown=counts.shown[rows])
        yield name, int(own.shown.sum()), fit_model(own, level=level, lapse=lapse)


def _told(name: str, answers: int, found: ModelFit | str) -> OwnThresholds:
    if isinstance(found, str):
        return OwnThresholds(name, answers, note=found)
    frames = {side: threshold.frames for side, threshold in found.jnd.items()}
    notes = [found.note, *(f"{side}: {one.note}" for side, one in found.jnd.items() if one.note)]
    shorter, longer = frames.get("shorter"), frames.get("longer")
    return OwnThresholds(name, answers, shorter, longer, found.criterion, found.lapse, "; ".join(filter(None, notes)))
