"""No length: for makes that have none, such as a cut, or that bring their own, such as a given file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from study.transitions.methods.method import Length, Room

if TYPE_CHECKING:
    from study.motion.clip import Clip
    from study.transitions.blend_length import BlendLength


class NoLength(Length):
    """No blended frames."""

    name = "none"
    words = ""
    windows = 0
    follows = False

    def at(self, source: Clip, destination: Clip, start_frame: int, end_frame: int, **options: Any) -> BlendLength:
        """No frames, at no known cost."""
        from study.transitions.blend_length import BlendLength

        del source, destination, start_frame, end_frame, options
        return BlendLength(0, 0.0, float("nan"))

    def room(self, fps: float, longest_frames: int | None) -> Room:
        """The points themselves."""
        del fps, longest_frames
        return Room()
