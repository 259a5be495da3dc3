"""`segue blend-length` and `segue transition`: one transition between two clips."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from study.apps.clips import clip_pair
from study.apps.console import emit, json_option, library_option

if TYPE_CHECKING:
    from study.motion.clip import Clip
    from study.transitions.blending import Transition

METHODS = ("fixed", "geodesic", "velocity", "timewarp")


def clip_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Adds the two clips, the frames that a transition joins, and the frame rate to a verb."""
    for decorate in (
        click.option("--fps", type=click.FloatRange(min=1), default=30.0, show_default=True, help="Work at this rate."),
        click.option("--end", type=click.IntRange(min=0), required=True, help="Last blended frame, in DST."),
        click.option("--start", type=click.IntRange(min=0), required=True, help="First blended frame, in SRC."),
        library_option,
        click.argument("destination", metavar="DST"),
        click.argument("source", metavar="SRC"),
    ):
        command = decorate(command)
    return command


@click.command("blend-length")
@clip_options
@click.option("--method", type=click.Choice(METHODS), default="geodesic", show_default=True)
@click.option("--fixed-frames", type=click.IntRange(min=1), default=10, show_default=True, help="For --method fixed.")
@json_option
def blend_length(
    source: str,
    destination: str,
    library: str | None,
    start: int,
    end: int,
    fps: float,
    method: str,
    fixed_frames: int,
    as_json: bool,
) -> None:
    """How long to blend from frame --start of SRC to frame --end of DST (Wang & Bodenheimer 2004).

    SRC and DST are motion files, or names of motions in --library.
    """
    first, second = clip_pair(source, destination, library, fps)
    if method == "timewarp":
        from study.transitions.timewarp import warp_length

        warped = warp_length(first, second, start, end)
        windows = {"source_frames": warped.source_frames, "destination_frames": warped.destination_frames}
        found: tuple[Any, ...] = (warped.blend_frames, warped.blend_s, warped.cost, warped.costs, warped.note)
    else:
        from study.transitions.blend_length import blend_length as choose

        chosen = choose(first, second, start, end, method=method, fixed_frames=fixed_frames)
        windows = {"source_frames": chosen.blend_frames, "destination_frames": chosen.blend_frames}
        found = (chosen.blend_frames, chosen.blend_s, chosen.cost, chosen.costs, chosen.note)
    keys = ("blend_frames", "blend_s", "cost", "costs", "note")
    result = {**dict(zip(keys, found, strict=True)), **windows, "method": method, "fps": fps}
    text = f"{found[0]} frames ({found[1]:.3f} s at {fps:g} fps), cost {found[2]:.5g}"
    if windows["source_frames"] != windows["destination_frames"]:
        text += f", {windows['source_frames']} of SRC over {windows['destination_frames']} of DST"
    emit(result, as_json, f"{text}; {found[4]}" if found[4] else text)


@click.command()
@clip_options
@click.option("--method", type=click.Choice(METHODS), help="Choose the blend length by this method.")
@click.option("--frames", type=click.IntRange(min=1), help="Blend this many frames.")
@click.option("--weight", type=click.Choice(["linear", "sigmoid"]), default="linear", show_default=True)
@click.option("--keep-slide", is_flag=True, help="Leave the feet as blending leaves them, sliding or not.")
@click.option(
    "--out", type=click.Path(dir_okay=False, path_type=Path), required=True, help="X.bvh, X.mp4 or X.png (a strip)."
)
@json_option
def transition(
    source: str,
    destination: str,
    library: str | None,
    start: int,
    end: int,
    fps: float,
    method: str | None,
    frames: int | None,
    weight: str,
    keep_slide: bool,
    out: Path,
    as_json: bool,
) -> None:
    """Blend from frame --start of SRC to frame --end of DST and write the result."""
    from study.experiment.drawing import draw_clip
    from study.motion.bvh import write_bvh
    from study.transitions.footskate import plant_feet

    if (method is None) == (frames is None):
        raise click.UsageError("expected either --method or --frames; give one of them.")
    first, second = clip_pair(source, destination, library, fps)
    joined = join(first, second, start, end, method, frames, weight)
    slide = {}
    if not keep_slide:
        joined, planted = plant_feet(joined, first, second)
        slide = {"slide_before_m": planted.slide_before_m, "slide_after_m": planted.slide_after_m}
    if out.suffix.lower() == ".bvh":
        write_bvh(joined.clip, out)
    else:
        draw_clip(joined.clip, out, blended=(joined.blend_start, joined.blend_stop))
    result = {
        "file": str(out),
        "frames": joined.clip.frames,
        "blend_frames": joined.blend_frames,
        "blend_start": joined.blend_start,
        "blend_stop": joined.blend_stop,
        "note": joined.note,
        **slide,
    }
    emit(result, as_json, f"{out}: {joined.clip.frames} frames; {joined.note}")


def join(
    source: Clip, destination: Clip, start: int, end: int, method: str | None, frames: int | None, weight: str
) -> Transition:
    """The transition of so many frames, or as long as a method says."""
    from study.transitions.blend_length import blend_length as choose
    from study.transitions.blending import blend
    from study.transitions.timewarp import warp_length, warped_blend

    if method == "timewarp":
        chosen = warp_length(source, destination, start, end)
        windows = (chosen.source_frames, chosen.destination_frames)
        return warped_blend(source, destination, start, end, *windows, weight=weight)
    length = frames or choose(source, destination, start, end, method=method or "geodesic").blend_frames
    return blend(source, destination, start, end, length, weight=weight)
