"""Supply: a motion of the library with room around its transition point for entry, blend and exit.

A motion's name and what is needed come in; a `Supply` goes out. A cyclic motion that is too short is extended by whole
cycles; points are always drawn within the part that the library supplied.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from study.counting import counted
from study.errors import MotionError, StimulusError
from study.motion.clip import Clip, resample

if TYPE_CHECKING:
    from study.motion.library import Library

FREEDOM_S = 1.0
"""Points are drawn within a second or more of motion: a whole cycle of a gait."""


@dataclass(frozen=True)
class Needs:
    """Frames around a point: `before` it, and `after` (the point itself counted), with the least that will do.

    With `whole`, a synthetic motion is made as long as it is by itself, so that the best point can be looked for in it.
    """

    before: int
    after: int
    least_before: int
    least_after: int
    words: str
    whole: bool = False


@dataclass(frozen=True, eq=False)
class Supply:
    """A motion as it is used.

    `first` and `stop` bound the frames that the library supplied, as a slice counts them; those before and after
    were added by extension. `window` are the frames in which a point may lie.
    """

    name: str
    clip: Clip
    first: int
    stop: int
    window: tuple[int, int]
    file: str
    notes: tuple[str, ...] = ()

    @property
    def added_before(self) -> int:
        """Frames added before the captured ones."""
        return self.first

    @property
    def added_after(self) -> int:
        """Frames added after the captured ones."""
        return self.clip.frames - self.stop


def supply(library: Library, fps: float, name: str, needs: Needs, within: tuple[float, float] | None) -> Supply:
    """A motion of the library, extended where it is too short and cyclic."""
    freedom = round(FREEDOM_S * fps)
    # Captured motions come as they are, so that what is added to them is known.
    made = library.synthetic and not needs.whole
    seconds = (needs.before + needs.after + 4 * freedom) / fps if made else None
    try:
        clip = library.clip(name, fps=fps, min_seconds=seconds)
        entry = library.entry(name)
    except MotionError as error:
        raise StimulusError(f"motion {name!r}: {error}") from error
    span = within or (0.0, 1.0)
    low = min(int(np.ceil(span[0] * clip.frames)), clip.frames - 1)
    motion = _Motion(
        clip,
        lambda: library.clip(name, min_seconds=seconds),
        (low, max(int(span[1] * clip.frames), low + 1)),
        (bool(entry.start), bool(entry.end)),
    )
    why = ""
    for before, after in ((needs.before, needs.after), (needs.least_before, needs.least_after)):
        try:
            longer, first, window, notes = _extended(motion, before, after, freedom)
        except MotionError as error:
            why = str(error)
            continue
        return Supply(name, longer, first, first + clip.frames, window, library.where(entry), notes)
    missing = _missing(motion, needs.least_before, needs.least_after)
    raise StimulusError(
        f"motion {name!r}: expected {counted(needs.least_before + needs.least_after, 'frame')} at "
        f"{fps:g} fps around a transition point ({needs.words}), found {clip.frames} in {library.name}: "
        f"{counted(missing, 'frame is', 'frames are')} missing. {why} Or lower entry_s, exit_s or longest_frames by "
        f"{missing / fps:.2f} s together; `segue new` finds what clips can supply."
    )


@dataclass(frozen=True, eq=False)
class _Motion:
    """A motion as the library has it: at the protocol's frame rate, at its own, and what may be done with it.

    `wanted` are the frames in which a point may lie, `cyclic` whether it can be continued before its start and after
    its end.
    """

    clip: Clip
    captured: Callable[[], Clip]
    wanted: tuple[int, int]
    cyclic: tuple[bool, bool]


def _missing(motion: _Motion, before: int, after: int) -> int:
    """Frames that lack around the best point."""
    points = np.arange(*motion.wanted)
    lacking = np.maximum(before - points, 0) + np.maximum(points + after - motion.clip.frames, 0)
    return int(lacking.min())


def _extended(
    motion: _Motion, before: int, after: int, freedom: int
) -> tuple[Clip, int, tuple[int, int], tuple[str, ...]]:
    """The clip with room around its points: the clip, its first captured frame, the points' window, notes.

    `MotionError` where it has no room and can't be given any.
    """
    clip, (low, high) = motion.clip, motion.wanted
    enough = min(freedom, high - low)
    legal = (max(low, before), min(high, clip.frames - after + 1))
    if legal[1] - legal[0] >= enough:
        return clip, 0, legal, ()
    target = _target(clip.frames, motion.wanted, before, after, enough, motion.cyclic)
    if target is None:
        raise MotionError(f"It can't be continued{_where(motion.cyclic)}: use a longer motion.")
    missing_before = max(0, before - target[0])
    missing_after = max(0, target[1] - 1 + after - clip.frames)
    if missing_before == missing_after == 0:
        return clip, 0, target, ()
    return _continued(motion, target, missing_before, missing_after)


def _continued(
    motion: _Motion, target: tuple[int, int], before: int, after: int
) -> tuple[Clip, int, tuple[int, int], tuple[str, ...]]:
    """Extended at the motion's own frame rate, which shows its cycles best, then at the protocol's."""
    from study.motion.cycles import extend

    captured = motion.captured()
    ratio = captured.fps / motion.clip.fps
    # One frame more behind, since the last one may fall between two.
    extension = extend(
        captured,
        frames_before=int(np.ceil(before * ratio)),
        frames_after=int(np.ceil((after + 1) * ratio)) if after else 0,
    )
    clip = resample(extension.clip, motion.clip.fps)
    first = int(np.ceil(extension.added_before / ratio - 1e-6))
    return clip, first, (target[0] + first, target[1] + first), (extension.note,)


def _where(cyclic: tuple[bool, bool]) -> str:
    sides = [side for side, can in zip(("before its start", "after its end"), cyclic, strict=True) if not can]
    return f" {' or '.join(sides)}" if sides else ""


def _target(
    frames: int, wanted: tuple[int, int], before: int, after: int, enough: int, ends: tuple[bool, bool]
) -> tuple[int, int] | None:
    """The stretch of frames to draw points from: about the middle of what is wanted, moved off ends that are fixed."""
    low = wanted[0] if ends[0] else max(wanted[0], before)
    high = wanted[1] if ends[1] else min(wanted[1], frames - after + 1)
    if low >= high:
        return None
    middle = (wanted[0] + wanted[1] - enough) // 2
    first = min(max(middle, low), max(high - enough, low))
    return first, min(first + enough, high)
