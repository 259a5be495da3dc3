"""Showing: which frame a flip shall show, and how well a stimulus was shown. Pure arithmetic on times.

The frame rate of a study and that of a display are two things: a motion of 30 frames a second on a display of 60 Hz
holds each frame for two flips, on one of 144 Hz for four or five. So the frame is chosen by time, at every flip.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

LONGEST_GAP_FRAMES = 1.5
"""A frame that stood longer than this is a fault in the presentation: the trial is shown again."""

_JITTER_FLIPS = 0.25


def frame_at(flip_s: float, onset_s: float, fps: float, period_s: float) -> int:
    """The frame that a flip at `flip_s` shall show; half a flip early counts as due, so that jitter moves nothing."""
    return int((flip_s - onset_s + 0.5 * period_s) * fps)


@dataclass(frozen=True)
class Showing:
    """What was presented of one stimulus.

    Parameters
    ----------
    stimulus
        Its id.
    fps
        Frames per second of the stimulus.
    period_s
        Seconds between flips.
    frames, flips_s
        For every flip the frame that it showed and its time.
    frames_in_all
        Frames of the stimulus.
    ended_s
        The flip that took the last frame away; None before there was one.
    faults
        What else went wrong: focus lost, resized.
    """

    stimulus: str
    fps: float
    period_s: float
    frames: tuple[int, ...]
    flips_s: tuple[float, ...]
    frames_in_all: int
    ended_s: float | None = None
    faults: tuple[str, ...] = ()

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
        """The longest time that one picture stood, in frames of the stimulus."""
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
        """Whether every picture stood for at most 1.5 frames (and a quarter of a flip, for jitter), to the end."""
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
