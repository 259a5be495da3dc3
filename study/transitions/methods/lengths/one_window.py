"""Lengths that source and destination share (2004 section 3.1): fixed, by geodesic distance, by joint velocity."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

from annotated_types import Ge, Le

from study.counting import counted
from study.transitions.methods.method import WANG_2004, Length, Room, setting

if TYPE_CHECKING:
    from study.motion.clip import Clip
    from study.transitions.blend_length import BlendLength


@dataclass(frozen=True)
class Fixed(Length):
    """The same length at all points."""

    name = "fixed"
    words = "of a fixed length"
    sources = (WANG_2004,)
    follows = False

    fixed_frames: Annotated[int | None, Ge(1), Le(600)] = setting(
        None, "Length `fixed`: the blend length; that of the study, or 0.33 s, where it is left out. [frames]"
    )

    def frames(self, fps: float) -> int:
        """The length in frames; 0.33 s (2004) unless set."""
        from study.transitions.blend_length import FIXED_S, default_frames

        return self.fixed_frames or default_frames(fps, FIXED_S)

    def at(self, source: Clip, destination: Clip, start_frame: int, end_frame: int) -> BlendLength:
        """The length, held to what the clips supply."""
        from study.transitions.blend_length import blend_length

        frames = self.frames(source.fps)
        return blend_length(source, destination, start_frame, end_frame, method="fixed", fixed_frames=frames)

    def room(self, fps: float, longest_frames: int | None) -> Room:
        """At least the length itself."""
        room = super().room(fps, longest_frames)
        return replace(room, blend=max(room.blend, self.frames(fps)))

    def in_words(self, fps: float) -> str:
        """In frames."""
        return f"of {counted(self.frames(fps), 'frame')}"


class Geodesic(Length):
    """The length whose window costs least by geodesic distance (2004 Eqs. 1, 2)."""

    name = "geodesic"
    words = "as long as the geodesic distance gives (2004)"
    sources = (WANG_2004,)

    def at(self, source: Clip, destination: Clip, start_frame: int, end_frame: int) -> BlendLength:
        """The length of least cost."""
        from study.transitions.blend_length import blend_length

        return blend_length(source, destination, start_frame, end_frame, method="geodesic")


class Velocity(Length):
    """The largest joint difference over that joint's speed (2004 Eqs. 3, 4)."""

    name = "velocity"
    words = "as long as joint velocities give (2004)"
    sources = (WANG_2004,)

    def at(self, source: Clip, destination: Clip, start_frame: int, end_frame: int) -> BlendLength:
        """The length that the joint needs."""
        from study.transitions.blend_length import blend_length

        return blend_length(source, destination, start_frame, end_frame, method="velocity")
