"""A played state machine as a strip of poses: Koyama & Goto 2019, Figures 7 to 9 and 11."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from renderer.segments import Segment
    from study.transitions.one_hop.play import Played

# The hop beside the strip's own colours for source, blend and destination.
HOP_COLOUR = (196, 160, 0)
_MARGIN_S = 0.4


def strip_segments(played: Played) -> list[Segment]:
    """The stretches of the output with their colours: the state before the first transition, hops, and other states."""
    from renderer.segments import Segment

    parts = []
    for number, part in enumerate(played.segments):
        if part.kind == "hop":
            parts.append(Segment("hop", part.start, part.stop, HOP_COLOUR))
        else:
            name = "blend" if part.kind == "blend" else "destination" if number else "source"
            parts.append(Segment(name, part.start, part.stop))
    return parts


def draw_played(
    played: Played, out: Path, *, poses: int = 13, span: tuple[int, int] | None = None, height: int = 300
) -> None:
    """A PNG file, so many pixels high, of so many poses, evenly spaced.

    They go from shortly before the first blend to shortly after the last, or from frame to frame of a `span`, so that
    several strips show the same times.
    """
    from renderer.strip import render_strip
    from study.motion.clip import joint_positions
    from study.motion.drawing import figure_for

    clip, margin = played.clip, round(_MARGIN_S * played.clip.fps)
    blends = [part for part in played.segments if part.kind == "blend"]
    first = max(blends[0].start - margin, 0) if blends else 0
    last = min(blends[-1].stop + margin, clip.frames) - 1 if blends else clip.frames - 1
    first, last = span or (first, last)
    render_strip(
        out,
        joint_positions(clip, ends=True),
        figure_for(clip.skeleton),
        frames=sorted({round(first + (last - first) * k / max(poses - 1, 1)) for k in range(poses)}),
        segments=strip_segments(played),
        height=height,
    )
