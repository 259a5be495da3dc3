"""The length of a time-warped blend: a window of its own in either motion (2004 section 3.1.4)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from study.transitions.methods.method import WANG_2004, Length, Room

if TYPE_CHECKING:
    from study.motion.clip import Clip
    from study.transitions.timewarp import WarpLength


class Timewarp(Length):
    """The pair of windows that costs least, the shorter one slowed to the longer (2004 Eqs. 5, 6)."""

    name = "timewarp"
    words = "as long as the geodesic distance of warped windows gives (2004)"
    sources = (WANG_2004,)
    windows = 2
    # All pairs of lengths take a hundred times longer to cost than all lengths.
    draws = 150

    def at(self, source: Clip, destination: Clip, start_frame: int, end_frame: int) -> WarpLength:
        """The pair of windows of least cost."""
        from study.transitions.timewarp import warp_length

        return warp_length(source, destination, start_frame, end_frame)

    def room(self, fps: float, longest_frames: int | None) -> Room:
        """One frame more: a warped pose lies between two, of which one may be the frame before the window."""
        room = super().room(fps, longest_frames)
        return Room(room.blend + 1, room.search + 1, entry=1)
