"""A transition at another frame rate: made again from its clips at that rate, from the same moment to the same moment.

Blend lengths are chosen at the rate of a study; a file is best written at the rate that its motion was captured at.
Resampling the transition instead would leave only the poses of the lower rate.
"""

from __future__ import annotations

from collections.abc import Mapping

from study.motion.clip import Clip
from study.transitions.blending import Transition, blend
from study.transitions.timewarp import warped_blend


def remade(
    made: Transition,
    source: Clip,
    destination: Clip,
    *,
    weight: str = "linear",
    joint_frames: Mapping[str, int] | None = None,
    in_step: bool = False,
) -> Transition:
    """The transition with its clips at another rate.

    The poses next to the blend, source alone and destination alone, stay at their moments: the nearest frames to these.

    Parameters
    ----------
    made
        A blend of the same two clips, time-warped or not.
    source, destination
        The clips at the new rate, on one skeleton.
    weight, joint_frames
        As it was made with; see `study.transitions.blending.blend`.
    in_step
        Whether it goes along a registration curve, of which the new rate has one of its own.
    """
    ratio = source.fps / made.clip.fps

    def between(frames: tuple[int, int], clip: Clip) -> tuple[int, int]:
        """The frames strictly between the two that are next to a stretch of the blend."""
        return max(0, round((frames[0] - 1) * ratio) + 1), min(clip.frames, round(frames[1] * ratio))

    start, stop = between(made.source_frames, source)
    first, end = between(made.destination_frames, destination)
    uneven = made.source_frames[1] - made.source_frames[0] != made.destination_frames[1] - made.destination_frames[0]
    if in_step or uneven:
        windows = stop - start, end - first
        return warped_blend(source, destination, start, end - 1, *windows, weight=weight, in_step=in_step)
    frames = min(stop - start, end)
    own = {role: min(frames, round((count + 1) * ratio) - 1) for role, count in (joint_frames or {}).items()}
    return blend(source, destination, start, end - 1, frames, weight=weight, joint_frames=own)
