"""Clips as figures, pictures and videos: what a skeleton looks like, and one clip drawn for a person to look at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from study.errors import StimulusError
from study.motion.clip import Clip, joint_positions, trim
from study.motion.skeleton import Skeleton

if TYPE_CHECKING:
    from renderer.figure import Figure

AROUND_S = 2.0
"""What is shown of a transition before and after its blend, as the stimuli of 2004 do (section 4.2)."""

# Hip to ankle over stature (Winter, Biomechanics and Motor Control of Human Movement, anthropometric table).
LEG_SHARE = 0.491


def figure_for(
    skeleton: Skeleton,
    style: str = "stick",
    colours: Mapping[str, Sequence[int]] | None = None,
    background: Sequence[int] | None = None,
    floor_m: float | None = None,
) -> Figure:
    """The renderer's figure for a skeleton, over `joint_positions(clip, ends=True)`.

    Parameters
    ----------
    skeleton
        Any rig; limbs are told apart by its joint roles.
    style
        As `renderer.figure.make_figure` takes it.
    colours, background
        8-bit RGB by side (`left`, `right`, `centre`), and of the background, instead of the style's own.
    floor_m
        Height of a ground plane with contact shadows, metres; none where None.
    """
    from renderer.figure import make_figure

    height_m = skeleton.leg_length / LEG_SHARE if skeleton.has("ankle") else None
    return make_figure(
        skeleton.bones,
        skeleton.sides,
        dict(skeleton.roles),
        style=style,
        height_m=height_m,
        colours=colours,
        background=background,
        floor_m=floor_m,
    )


def draw_clip(
    clip: Clip,
    out: Path,
    *,
    size: tuple[int, int] = (1280, 720),
    view: str = "three-quarter",
    style: str = "mannequin",
    poses: int = 9,
    camera: str = "track",
    floor: bool = False,
    blended: tuple[int, int] | None = None,
) -> None:
    """A clip as a video (`.mp4`) or as a strip of poses (`.png`).

    Parameters
    ----------
    clip, out
        What to draw, and where to.
    size
        Width and height of a video in pixels; a strip is as wide as its poses need.
    view, style, camera
        As the renderer takes them; the camera is that of a video.
    poses
        How many poses a strip shows.
    floor
        Draw the ground, at height 0, with contact shadows.
    blended
        Frames of a transition's blend, as a slice counts them: source, blend and destination are coloured apart, and
        no more is shown than `AROUND_S` before and after the blend.
    """
    from renderer.segments import Segment

    if out.suffix.lower() not in (".mp4", ".png"):
        raise StimulusError(f"{out}: expected a name that ends in .mp4 or .png, found {out.suffix or 'no ending'!r}.")
    if blended is not None:
        around = round(AROUND_S * clip.fps)
        first, stop = max(blended[0] - around, 0), min(blended[1] + around, clip.frames)
        clip, blended = trim(clip, first, stop), (blended[0] - first, blended[1] - first)
    positions = joint_positions(clip, ends=True)
    figure = figure_for(clip.skeleton, style, floor_m=0.0 if floor else None)
    edges = [0, *blended, clip.frames] if blended is not None else []
    parts = zip(("source", "blend", "destination"), edges, edges[1:], strict=False)
    segments = [Segment(name, start, stop) for name, start, stop in parts if stop > start]
    if out.suffix.lower() == ".mp4":
        from renderer.framing import frame_group
        from renderer.video import render_video

        seen = frame_group([positions], figures=[figure], camera=camera, size=size, view=view, fps=clip.fps)
        render_video(out, positions, figure, seen, fps=clip.fps, segments=segments)
    else:
        from renderer.strip import render_strip

        render_strip(out, positions, figure, count=poses, segments=segments, view=view)
