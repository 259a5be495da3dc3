"""The lengths of Wang & Bodenheimer 2004, section 3.1: fixed, by geodesic distance, by joint velocity, time-warped."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any

from annotated_types import Ge, Le

from study.counting import counted
from study.settings import setting
from study.transitions.methods.method import WANG_2004, Length, Room

if TYPE_CHECKING:
    from study.motion.clip import Clip
    from study.transitions.blend_length import BlendLength
    from study.transitions.timewarp import WarpLength


class Geodesic(Length):
    """The length whose window costs least by geodesic distance (Eqs. 1, 2)."""

    name = "geodesic"
    words = "as long as the geodesic distance gives (2004)"
    sources = (WANG_2004,)

    def at(self, source: Clip, destination: Clip, start_frame: int, end_frame: int, **options: Any) -> BlendLength:
        """The length at two points."""
        from study.transitions.blend_length import geodesic_length

        return geodesic_length(source, destination, start_frame, end_frame, **options)


class Velocity(Length):
    """The largest joint difference over that joint's speed (Eqs. 3, 4)."""

    name = "velocity"
    words = "as long as joint velocities give (2004)"
    sources = (WANG_2004,)

    def at(self, source: Clip, destination: Clip, start_frame: int, end_frame: int, **options: Any) -> BlendLength:
        """The length at two points."""
        from study.transitions.blend_length import velocity_length

        return velocity_length(source, destination, start_frame, end_frame, **options)


@dataclass(frozen=True)
class Fixed(Length):
    """The same length at all points: 0.33 s unless set."""

    name = "fixed"
    words = "of a fixed length"
    sources = (WANG_2004,)
    follows = False

    fixed_frames: Annotated[int | None, Ge(1), Le(600)] = setting(
        None, "Length `fixed`: the blend length; by default that of the study, or 0.33 s. [frames]"
    )

    def frames(self, fps: float) -> int:
        """The length in frames."""
        from study.transitions.blend_length import FIXED_S, default_frames

        return self.fixed_frames or default_frames(fps, FIXED_S)

    def at(self, source: Clip, destination: Clip, start_frame: int, end_frame: int, **options: Any) -> BlendLength:
        """The length, held to what the clips supply."""
        from study.transitions.blend_length import fixed_length

        return fixed_length(source, destination, start_frame, end_frame, self.frames(source.fps), **options)

    def room(self, fps: float, longest_frames: int | None) -> Room:
        """At least the length itself."""
        room = super().room(fps, longest_frames)
        return replace(room, blend=max(room.blend, self.frames(fps)))

    def in_words(self, fps: float) -> str:
        """In frames."""
        return f"of {counted(self.frames(fps), 'frame')}"


@dataclass(frozen=True)
class Timewarp(Length):
    """The pair of windows that costs least, the shorter one slowed to the longer (Eqs. 5, 6)."""

    name = "timewarp"
    words = "as long as the geodesic distance of warped windows gives (2004)"
    sources = (WANG_2004,)
    windows = 2
    # All pairs of lengths take a hundred times longer to cost than all lengths.
    draws = 150

    steepest: Annotated[float, Ge(1), Le(10)] = setting(
        2.0, "Length `timewarp`: the longer window has at most so many times the frames of the shorter one."
    )

    def at(self, source: Clip, destination: Clip, start_frame: int, end_frame: int, **options: Any) -> WarpLength:
        """The pair of windows of least cost."""
        from study.transitions.timewarp import warp_length

        return warp_length(source, destination, start_frame, end_frame, steepest=self.steepest, **options)

    def room(self, fps: float, longest_frames: int | None) -> Room:
        """One frame more, since a warped pose may lie before the window's first; and the exit beside a longer blend."""
        room = super().room(fps, longest_frames)
        return Room(room.blend + 1, room.search + 1, entry=1, after=room.blend - 1)
