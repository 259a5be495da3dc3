"""`segue blend-length` and `segue transition`: one transition between two clips."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from study.apps.clips import clip_pair
from study.apps.console import emit, json_option, library_option

METHODS = ("fixed", "geodesic", "velocity")


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
    from study.transitions.blend_length import blend_length as choose

    first, second = clip_pair(source, destination, library, fps)
    chosen = choose(first, second, start, end, method=method, fixed_frames=fixed_frames)
    result = {
        "blend_frames": chosen.blend_frames,
        "blend_s": chosen.blend_s,
        "cost": chosen.cost,
        "costs": chosen.costs,
        "method": method,
        "fps": fps,
    }
    emit(
        result, as_json, f"{chosen.blend_frames} frames ({chosen.blend_s:.3f} s at {fps:g} fps), cost {chosen.cost:.5g}"
    )


@click.command()
@clip_options
@click.option("--method", type=click.Choice(METHODS), help="Choose the blend length by this method.")
@click.option("--frames", type=click.IntRange(min=1), help="Blend this many frames.")
@click.option("--weight", type=click.Choice(["linear", "sigmoid"]), default="linear", show_default=True)
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
    out: Path,
    as_json: bool,
) -> None:
    """Blend from frame --start of SRC to frame --end of DST and write the result."""
    from study.experiment.drawing import draw_clip
    from study.motion.bvh import write_bvh
    from study.transitions.blend_length import blend_length as choose
    from study.transitions.blending import blend

    if (method is None) == (frames is None):
        raise click.UsageError("expected either --method or --frames; give one of them.")
    first, second = clip_pair(source, destination, library, fps)
    blend_frames = frames or choose(first, second, start, end, method=method or "geodesic").blend_frames
    joined = blend(first, second, start, end, blend_frames, weight=weight)
    if out.suffix.lower() == ".bvh":
        write_bvh(joined.clip, out)
    else:
        draw_clip(joined.clip, out, blended=(joined.blend_start, joined.blend_stop))
    result = {
        "file": str(out),
        "frames": joined.clip.frames,
        "blend_frames": blend_frames,
        "blend_start": joined.blend_start,
        "blend_stop": joined.blend_stop,
    }
    text = f"{out}: {joined.clip.frames} frames, blended from frame {joined.blend_start} to {joined.blend_stop - 1}"
    emit(result, as_json, text)
