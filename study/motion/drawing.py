"""Clips as figures, pictures and videos: what a skeleton looks like, and one clip drawn for a person to look at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from study.errors import StimulusError
from study.motion.clip import Clip, joint_positions
from study.motion.skeleton import Skeleton

if TYPE_CHECKING:
    from renderer.figure import Figure

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

    height_m = skeleton.leg_length / LEG_SHARE if {"ankle.L", "ankle.R"} <= skeleton.roles.keys() else None
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
    size: tuple[int, int] = (640, 480),
    view: str = "three-quarter",
    style: str = "stick",
    poses: int = 9,
    track_seconds: float | None = None,
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
    view, style
        As the renderer takes them.
    poses
        How many poses a strip shows.
    track_seconds
        Let the camera follow the figure; smoothing window in seconds.
    floor
        Draw the ground, at height 0, with contact shadows.
    blended
        Frames of a transition's blend, as a slice counts them: a strip shows source, blend and destination apart.
    """
    positions = joint_positions(clip, ends=True)
    figure = figure_for(clip.skeleton, style, floor_m=0.0 if floor else None)
    if out.suffix.lower() == ".mp4":
        from renderer.camera import frame_group
        from renderer.video import render_video

        camera = frame_group([positions], size=size, view=view, track_seconds=track_seconds, fps=clip.fps)
        render_video(out, positions, figure, camera, fps=clip.fps)
    elif out.suffix.lower() == ".png":
        from renderer.strip import Segment, render_strip

        segments: list[Segment] = []
        if blended is not None:
            edges = [0, *blended, clip.frames]
            names = ("source", "blend", "destination")
            segments = [
                Segment(name, start, stop)
                for name, start, stop in zip(names, edges, edges[1:], strict=False)
                if stop > start
            ]
        render_strip(out, positions, figure, count=poses, segments=segments, view=view)
    else:
        raise StimulusError(f"{out}: expected a name that ends in .mp4 or .png, found {out.suffix or 'no ending'!r}.")
