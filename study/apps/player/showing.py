"""Showing: which frame a flip shall show, and how well a stimulus was shown. Pure arithmetic on times.

The frame rate of a study and that of a display are two things: a motion of 30 frames a second on a display of 60 Hz
holds each frame for two flips, on one of 144 Hz for four or five. So the frame is chosen by time, at every flip.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from study.errors import SessionError
from study.experiment.steps import Step
from study.experiment.store.answers import Presentation
from study.tasks.trial import PLACES

LONGEST_GAP_FRAMES = 1.5
"""A frame that is shown longer than this is a display failure: the trial is repeated."""

_JITTER_FLIPS = 0.25
_SAME_RATE = 0.01
"""Relative difference of frame rates that counts as none: a motion that is 1% faster is not noticed."""


def frame_at(flip_s: float, onset_s: float, fps: float, period_s: float) -> int:
    """The frame that a flip at `flip_s` shall show; half a flip early counts as due, so that jitter moves nothing."""
    return int((flip_s - onset_s + 0.5 * period_s) * fps)


@dataclass(frozen=True)
class Rate:
    """How a display of one rate shows motions of another; made by `find_rate`."""

    fps: float
    """Frames per second as they are shown: the study's, or the display's divided by a whole number where that is nearly
    the same (29.97 for 30 on 59.94 Hz), so that every frame is shown equally long."""
    shortest_flips: int
    longest_flips: int
    """Number of flips for which a frame is shown."""

    @property
    def even(self) -> bool:
        """Whether all frames are shown equally long."""
        return self.shortest_flips == self.longest_flips


def find_rate(fps: float, refresh_hz: float) -> Rate:
    """How motions of `fps` frames a second are shown at `refresh_hz`.

    Raises
    ------
    SessionError
        For a display that is slower than the motions, and for one on which some frames would be shown for more than 1.5
        of theirs: one flip and two in turn jerk.
    """
    flips = refresh_hz / fps
    whole = round(flips)
    if whole >= 1 and abs(flips / whole - 1.0) < _SAME_RATE:
        return Rate(refresh_hz / whole, whole, whole)
    shortest, longest = math.floor(flips), math.ceil(flips)
    if shortest == 0 or longest > LONGEST_GAP_FRAMES * flips:
        raise SessionError(
            f"Expected a display that shows {fps:g} frames a second evenly, found one of {refresh_hz:.4g} Hz; set it "
            f"to a multiple of {fps:g} Hz, or to at least {2 * fps:g} Hz."
        )
    return Rate(fps, shortest, longest)


@dataclass(frozen=True)
class Showing:
    """What was presented of one stimulus."""

    stimulus: str
    """Its id."""
    fps: float
    """Frames per second of the stimulus."""
    period_s: float
    """Seconds between flips."""
    frames: tuple[int, ...]
    flips_s: tuple[float, ...]
    """For every flip the frame that it showed and its time."""
    frames_in_all: int
    """Frames of the stimulus."""
    ended_s: float | None = None
    """The flip that took the last frame away; None before there was one."""
    faults: tuple[str, ...] = ()
    """What else went wrong: focus lost, resized."""

    @property
    def presented(self) -> tuple[tuple[int, float], ...]:
        """Each frame that was shown, with the time of its first flip."""
        pairs = zip(self.frames, self.flips_s, strict=True)
        first: dict[int, float] = {}
        for frame, at in pairs:
            first.setdefault(frame, at)
        return tuple(first.items())

    @property
    def last_frame_s(self) -> float:
        """When the last frame was presented; reaction times run from here."""
        return self.presented[-1][1]

    @property
    def longest_gap_frames(self) -> float:
        """The longest time for which one frame was shown, in frames of the stimulus."""
        times = [at for _, at in self.presented]
        if self.ended_s is not None:
            times.append(self.ended_s)
        return max((b - a for a, b in pairwise(times)), default=0.0) * self.fps

    @property
    def dropped_flips(self) -> int:
        """Flips of the display that passed without one of ours."""
        return sum(max(0, round((b - a) / self.period_s) - 1) for a, b in pairwise(self.flips_s))

    @property
    def shown_well(self) -> bool:
        """Whether every frame was shown for at most 1.5 frame durations (and a quarter of a flip, for jitter)."""
        allowed = LONGEST_GAP_FRAMES + _JITTER_FLIPS * self.period_s * self.fps
        whole = bool(self.frames) and self.frames[0] == 0 and self.frames[-1] == self.frames_in_all - 1
        return whole and not self.faults and self.longest_gap_frames <= allowed

    def detail(self) -> dict[str, Any]:
        """For the record: times in milliseconds from the first flip."""
        onset = self.flips_s[0] if self.flips_s else 0.0
        return {
            "stimulus": self.stimulus,
            "onset_s": round(onset, 6),
            "frames": [frame for frame, _ in self.presented],
            "at_ms": [round((at - onset) * 1000, 2) for _, at in self.presented],
            "ended_ms": None if self.ended_s is None else round((self.ended_s - onset) * 1000, 2),
            "flips": len(self.flips_s),
            "dropped_flips": self.dropped_flips,
            "skipped_frames": self.frames_in_all - len(self.presented),
            "longest_gap_frames": round(self.longest_gap_frames, 3),
            "faults": list(self.faults),
            "shown_well": self.shown_well,
        }


def presentations(
    step: Step,
    showings: Sequence[Showing],
    sizes: Sequence[Mapping[str, Any]],
    at_once: int,
    method: str,
    faults: Sequence[str],
) -> list[Presentation]:
    """The records of what a trial showed.

    Parameters
    ----------
    sizes
        How large each was (`picture_size.size_shown`).
    at_once
        How many were shown at once, maybe several times; 0 where one came after the other.
    faults
        Of the trial as a whole.
    """
    rows = []
    for number, (showing, size) in enumerate(zip(showings, sizes, strict=True)):
        played = {"play": 1 + number // at_once, "apart_frames": 0.0} if at_once else {}
        detail = {**showing.detail(), **size, **played, "faults": [*showing.faults, *faults]}
        rows.append(
            Presentation(
                step.trial,
                step.attempt,
                PLACES[number % (at_once or len(showings))],
                showing.stimulus,
                method,
                showing.frames_in_all,
                len(showing.presented),
                round(showing.longest_gap_frames, 4),
                showing.shown_well and not faults,
                detail,
            )
        )
    return rows
