"""A played state machine as a strip of poses: Koyama & Goto 2019, Figures 7 to 9 and 11."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from renderer.segments import Segment
    from study.transitions.one_hop.play import Played

# The hop beside the strip's own colours for source, blend and destination.
HOP_COLOUR = (196, 160, 0)


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
    played: Played,
    out: Path,
    *,
    poses: int = 13,
    margin_s: float = 0.4,
    span: tuple[int, int] | None = None,
    height: int = 300,
) -> None:
    """A strip as a PNG file.

    Parameters
    ----------
    played, out
        What to draw, and where to.
    poses
        How many, evenly spaced.
    margin_s
        How long before the first blend the strip starts, and after the last one it ends.
    span
        The first and the last frame of the strip instead, so that several strips show the same times.
    height
        Of the picture, pixels.
    """
    from renderer.strip import render_strip
    from study.motion.clip import joint_positions
    from study.motion.drawing import figure_for

    clip, margin = played.clip, round(margin_s * played.clip.fps)
    blends = [part for part in played.segments if part.kind == "blend"]
    first = max(blends[0].start - margin, 0) if blends else 0
    last = min(blends[-1].stop + margin, clip.frames) - 1 if blends else clip.frames - 1
    first, last = span or (first, last)
    frames = sorted({round(first + (last - first) * k / max(poses - 1, 1)) for k in range(poses)})
    render_strip(
        out,
        joint_positions(clip, ends=True),
        figure_for(clip.skeleton),
        frames=frames,
        segments=strip_segments(played),
        height=height,
    )
