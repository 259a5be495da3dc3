"""Which frames a blend takes: its window in the source and in the destination, and whether the clips supply it.

The three ways to name a transition that Wang & Bodenheimer 2004 compare in section 2:

- `"start-end"` (theirs, the default): frame `i` starts the blend and frame `j` ends it, so source frames
  `i .. i+b-1` meet destination frames `j-b+1 .. j`, and a longer blend enters the destination earlier.
- `"centre"`: frames `i` and `j` meet in the middle, whatever the length (frame `b // 2` of the blend).
- `"left"`: frames `i` and `j` both start the blend, as in Lee et al. 2002.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from study.counting import counted
from study.errors import TransitionError
from study.motion.clip import Clip
from study.transitions.distances import on_joints_of

SPECIFICATIONS = ("start-end", "centre", "left")


@dataclass(frozen=True)
class Window:
    """The frames of one blend, each stretch half-open as a slice counts them."""

    source_start: int
    destination_start: int
    blend_frames: int

    @property
    def source_stop(self) -> int:
        """One past the last source frame in the blend."""
        return self.source_start + self.blend_frames

    @property
    def destination_stop(self) -> int:
        """One past the last destination frame in the blend."""
        return self.destination_start + self.blend_frames


def window(start_frame: int, end_frame: int, blend_frames: int, specification: str = "start-end") -> Window:
    """The frames that a blend of `blend_frames` takes; they may lie outside the clips."""
    if blend_frames < 1:
        raise TransitionError(f"Expected a blend of at least 1 frame, got {blend_frames}.")
    if specification == "start-end":
        return Window(start_frame, end_frame - blend_frames + 1, blend_frames)
    if specification == "centre":
        return Window(start_frame - blend_frames // 2, end_frame - blend_frames // 2, blend_frames)
    if specification == "left":
        return Window(start_frame, end_frame, blend_frames)
    raise TransitionError(f"Expected a specification of {', '.join(SPECIFICATIONS)}, got {specification!r}.")


def joined_at(source: Clip, destination: Clip, start_frame: int, end_frame: int) -> Clip:
    """The destination on the source's joints (see `on_joints_of`).

    Raises
    ------
    TransitionError
        Where they are on different rigs, or the start frame is not in the source, or the end frame in the destination.
    """
    destination = on_joints_of(source, destination)
    for what, frame, clip, kind in (
        ("start", start_frame, source, "source"),
        ("end", end_frame, destination, "destination"),
    ):
        if not 0 <= frame < clip.frames:
            raise TransitionError(
                f"Expected the {what} frame from 0 to {clip.frames - 1} in the {kind} {clip.name or 'clip'}, "
                f"got {frame}."
            )
    return destination


def shortfall(source: Clip, destination: Clip, frames: Window) -> str:
    """In words, the frames that the clips lack for a window; empty where they lack none."""
    ours, theirs = (frames.source_start, frames.source_stop), (frames.destination_start, frames.destination_stop)
    return "; ".join((*lacking(source, "source", *ours), *lacking(destination, "destination", *theirs)))


def lacking(clip: Clip, kind: str, start: int, stop: int) -> Iterator[str]:
    """What a clip lacks of a stretch of frames, as a slice counts them, in words."""
    name = f"the {kind} {clip.name}" if clip.name else f"the {kind}"
    if start < 0:
        yield f"{name} lacks {counted(-start, 'frame')} before its first (needs frame {start})"
    if stop > clip.frames:
        yield (
            f"{name} lacks {counted(stop - clip.frames, 'frame')} after its last (needs frames to {stop - 1}, has them "
            f"to {clip.frames - 1})"
        )


def held(available: int, shortest: int, longest: int) -> tuple[int, str]:
    """The longest length to consider where the clips supply `available` frames, and a note on those that were excluded.

    The one rule for candidate lengths, whichever method chooses among them: what the clips don't supply is not
    considered. Where they don't supply the shortest either, that is the one to refuse, with `shortfall`.
    """
    if available >= longest:
        return longest, ""
    if available < shortest:
        return shortest, ""
    return available, f"the clips supply blends of up to {counted(available, 'frame')}; {longest} were asked for"


def longest_available(
    source: Clip, destination: Clip, start_frame: int, end_frame: int, specification: str = "start-end"
) -> int:
    """The longest blend, in frames, that both clips supply; 0 where not even one frame fits."""
    after_start, after_end = source.frames - start_frame, destination.frames - end_frame
    if specification == "start-end":
        return max(0, min(after_start, end_frame + 1))
    if specification == "left":
        return max(0, min(after_start, after_end))
    window(start_frame, end_frame, 1, specification)  # refuses an unknown specification
    # b // 2 frames before the meeting frame, b - b // 2 from it on.
    return max(0, min(2 * min(start_frame, end_frame) + 1, 2 * min(after_start, after_end)))
