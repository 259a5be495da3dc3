"""`segue blend-length` and `segue transition`: one transition between two clips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from study.apps.cli.clips import clip_pair, clips_options
from study.apps.cli.console import FILE, FPS, WEIGHTS, emit, json_option, together
from study.apps.cli.films import film_options
from study.apps.cli.moments import in_words, moment
from study.counting import counted
from study.transitions.methods.makes.blends import Registered, Slerp, Warped
from study.transitions.methods.makes.inertialize import Switching
from study.transitions.methods.registry import DIRECT, METHODS

if TYPE_CHECKING:
    from study.motion.clip import Clip
    from study.transitions.blend_length import BlendLength
    from study.transitions.blending import Transition
    from study.transitions.timewarp import WarpLength

LENGTHS = {
    name: one.length for name, one in METHODS.items() if one.length.windows and type(one.make) in (Slerp, Warped)
}
"""Methods whose blend lies between two given frames, and the length of each."""

SWITCHES = {name: make for name, make in DIRECT.items() if issubclass(make, Switching)}
"""Makes that switch to the destination at the start frame."""

METHOD = (
    "How the length is chosen: fixed, the same for all; velocity, by the speed of the joint that differs most; "
    "geodesic, of least cost; timewarp, a length for each clip, of least cost."
)

clip_options = together(
    click.argument("source", metavar="SRC"),
    click.argument("destination", metavar="DST"),
    clips_options,
    click.option("--start", type=click.IntRange(min=0), required=True, help="First blended frame, a frame of SRC."),
    click.option("--end", type=click.IntRange(min=0), required=True, help="Last blended frame, a frame of DST."),
    FPS,
)
"""The two clips, the frames that a transition joins, and the frame rate."""

specification_option = click.option(
    "--specification",
    type=click.Choice(["start-end", "centre", "left"]),
    default="start-end",
    show_default=True,
    help="What --start and --end are: start-end, the blend's first and last frame; centre, both its middle; left, both "
    "its first.",
)


@click.command("blend-length")
@clip_options
@click.option("--method", type=click.Choice(list(LENGTHS)), default="geodesic", show_default=True, help=METHOD)
@click.option(
    "--fixed-frames", type=click.IntRange(min=1), help="Blend length for --method fixed, frames (default: 0.33 s)."
)
@click.option(
    "--weights", type=click.Choice(["wang2003", "lee2002"]), default="wang2003", show_default=True, help=WEIGHTS
)
@specification_option
@click.option("--printed-sum", is_flag=True, help="With timewarp: the undivided sum as printed in Eqs. 5 and 6.")
@click.option(
    "--out", type=FILE, help="File for the costs of all lengths: X.png, a figure; X.csv, numbers (default: none)."
)
@json_option
def blend_length(
    source: str,
    destination: str,
    library: str | None,
    start: int,
    end: int,
    fps: float,
    method: str,
    fixed_frames: int | None,
    weights: str,
    specification: str,
    printed_sum: bool,
    out: Path | None,
) -> None:
    """How long to blend from frame --start of SRC to frame --end of DST (Wang & Bodenheimer 2004)."""
    from study.apps.cli.lengths import show_lengths, show_warped
    from study.transitions.blend_length import BlendLength, major_joint_differences
    from study.transitions.timewarp import warp_length

    if out is not None and out.suffix.lower() not in (".png", ".csv"):
        raise click.UsageError(f"expected --out as a name that ends in .png or .csv, found {str(out)!r}.")
    first, second = clip_pair(source, destination, library, fps)
    words = f"{source} frame {start} to {destination} frame {end}, {method}"
    found: BlendLength | WarpLength
    if LENGTHS[method].windows == 2:
        _check_two_windows(method, specification)
        found = warp_length(first, second, start, end, weights=weights, average=not printed_sum)
        result: dict[str, Any] = {"costs": found.costs, "shortest": found.shortest}
        if out is not None:
            show_warped(found, fps, out, words)
    else:
        length = LENGTHS[method].with_settings({"fixed_frames": fixed_frames})
        found = length.at(first, second, start, end, weights=weights, specification=specification)
        assert isinstance(found, BlendLength), "a length of one window"
        result = {"costs": found.costs, "joint": found.joint, "unclipped_s": found.unclipped_s}
        if out is not None:
            show_lengths(first, second, (start, end), found, out, (weights, specification), words)
    windows = found.windows
    differences = major_joint_differences(first, second, start, end)
    keys = {"blend_frames": found.blend_frames, "blend_s": found.blend_s, "cost": found.cost, "note": found.note}
    keys |= {"source_frames": windows[0], "destination_frames": windows[1], "method": method, "fps": fps}
    keys |= {**moment(first, start, "start"), **moment(second, end, "end")}
    text = f"{counted(found.blend_frames, 'frame')} ({found.blend_s:.3f} s at {fps:g} fps), cost {found.cost:.5g}"
    if windows[0] != windows[1]:
        text += f", {windows[0]} of SRC over {windows[1]} of DST"
    where = f"from {in_words(first, start, source)} to {in_words(second, end, destination)}"
    lines = [f"{text}; {found.note}" if found.note else text, where]
    lines += ["", "differences between the two frames, half angles:"]
    lines += [f"  {role:12} {value:.4f}" for role, value in differences.items()]
    result |= {**keys, "differences": differences, "file": None if out is None else str(out)}
    emit(result, "\n".join(lines))


def _check_two_windows(method: str, specification: str) -> None:
    if specification != "start-end":
        raise click.UsageError(f"expected --specification start-end with {method}: its two windows differ in length.")


@click.command()
@clip_options
@click.option("--method", type=click.Choice(list(LENGTHS)), help=METHOD + " (default: --frames)")
@click.option("--frames", type=click.IntRange(min=1), help="Blend length, frames (default: --method's).")
@click.option("--make", type=click.Choice(list(DIRECT)), default=Slerp.name,
              show_default=True,
              help="How the frames are made: slerp, a blend by interpolation; registration-curve, a blend in step; "
              "inertialize, inertialize-quintic, dead-blend: a switch, as game engines make it.")  # fmt: skip
@click.option("--halflife", type=click.FloatRange(0.01, 2.0),
              help="Half-life for --make inertialize, seconds (default: it matches the blend length).")  # fmt: skip
@click.option("--weight", type=click.Choice(["linear", "sigmoid"]), default="linear", show_default=True,
              help="How the weight grows over the blend: linear, evenly; sigmoid, slowly at both ends.")  # fmt: skip
@specification_option
@click.option(
    "--joint",
    "joints",
    multiple=True,
    metavar="ROLE=FRAMES",
    help="Blend one joint over fewer frames, such as shoulder.L=6; may be repeated.",
)
@click.option("--keep-slide", is_flag=True, help="Do not remove the sliding of feet.")
@click.option(
    "--unit",
    type=click.Choice(["m", "cm", "mm", "in"]),
    help="Length unit of X.bvh: m, cm, mm or in(ches) (default: that of SRC). Its frame rate is that of SRC unless "
    "--fps is given.",
)
@click.option("--out", type=FILE, required=True, help="File to write: X.bvh, X.mp4, or X.png, a strip of poses.")
@film_options
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
    make: str,
    halflife: float | None,
    weight: str,
    specification: str,
    joints: tuple[str, ...],
    keep_slide: bool,
    unit: str | None,
    out: Path,
    **look: Any,
) -> None:
    """Blend from frame --start of SRC to frame --end of DST and write the result.

    --start, --end and --frames are frames at --fps. A film or strip shows two seconds before and after the blend;
    source, blend and destination have colours of their own.
    """
    from study.motion.drawing import draw_clip
    from study.motion.library_file import UNITS
    from study.motion.readers.bvh_writing import write_bvh
    from study.transitions.flaws import find_flaws
    from study.transitions.footskate import plant_feet
    from study.transitions.rates import remade

    if (method is None) == (frames is None):
        raise click.UsageError("expected either --method or --frames; give one of them.")
    first, second = clip_pair(source, destination, library, fps)
    switch, in_step = switch_of(make, halflife, method, specification, joints), make == Registered.name
    joined, found = join(
        first,
        second,
        (start, end),
        method,
        frames,
        weight,
        specification,
        joint_frames(joints),
        switch=switch,
        in_step=in_step,
    )
    points = {**moment(first, start, "start"), **moment(second, end, "end")}
    where = f"from {in_words(first, start, source)} to {in_words(second, end, destination)}"
    told = click.get_current_context().get_parameter_source("fps") is not ParameterSource.DEFAULT
    if out.suffix.lower() == ".bvh" and not told and first.file_fps:
        first, second = clip_pair(source, destination, library, first.file_fps, tell=False)
        if switch is None:
            own = joint_frames(joints)
            joined = remade(joined, first, second, weight=weight, joint_frames=own, in_step=in_step)
        else:
            count = frames if found is None else found.blend_frames
            joined = switched(switch, first, second, (start, end), count or 1, fps)
    if not keep_slide:
        joined = plant_feet(joined, first, second)
    blended = joined.blend_start, joined.blend_stop
    flaws = find_flaws(joined.clip, blended, (first, second)) if joined.clip.skeleton.has("ankle") else None
    if out.suffix.lower() == ".bvh":
        write_bvh(joined.clip, out, metres_per_unit=UNITS[unit] if unit else None)
    else:
        draw_clip(joined.clip, out, blended=blended, **look)
    rate = joined.clip.fps
    result = {
        "file": str(out),
        "frames": joined.clip.frames,
        "blend_frames": joined.blend_frames,
        "blend_start": joined.blend_start,
        "blend_stop": joined.blend_stop,
        "blend_s": joined.blend_frames / rate,
        "seconds": joined.clip.seconds,
        "fps": rate,
        **points,
        "method": method,
        "make": make,
        "cost": None if found is None else found.cost,
        "unclipped_s": getattr(found, "unclipped_s", None),
        "note": "; ".join(filter(None, (joined.note, "" if found is None else found.note))),
        "history": list(joined.clip.history),
        "flaws": asdict(flaws) if flaws else None,
    }
    text = (
        f"{out}: {counted(joined.clip.frames, 'frame')} ({joined.clip.seconds:.3f} s at {rate:g} fps), "
        f"{joined.blend_frames} of them blended ({joined.blend_frames / rate:.3f} s), {where}; {result['note']}"
    ) + "".join(f"; {what}" for what in (flaws.told() if flaws else ()))
    emit(result, text)


def join(
    source: Clip,
    destination: Clip,
    points: tuple[int, int],
    method: str | None,
    frames: int | None,
    weight: str,
    specification: str = "start-end",
    shorter: dict[str, int] | None = None,
    *,
    switch: Switching | None = None,
    in_step: bool = False,
) -> tuple[Transition, BlendLength | WarpLength | None]:
    """The transition of a given or a method's length, and the method's result.

    `shorter` has blends of joints' own, by role; `switch` takes the place of the blend, or the motions are brought
    `in_step` by a registration curve.
    """
    from study.transitions.blending import blend
    from study.transitions.timewarp import warp_length, warped_blend

    chosen: BlendLength | WarpLength | None = None
    if method is not None and LENGTHS[method].windows == 2:
        _check_two_windows(method, specification)
        if shorter:
            raise click.UsageError(f"expected no --joint with {method}: its joints share one warp.")
        chosen = warp_length(source, destination, *points)
    elif method is not None:
        chosen = LENGTHS[method].at(source, destination, *points, specification=specification)
    count = frames if chosen is None else chosen.blend_frames
    assert count is not None, "either a method or a length is given"
    windows = (count, count) if chosen is None else chosen.windows
    if switch is not None:
        return switched(switch, source, destination, points, count, source.fps), chosen
    if in_step or windows[0] != windows[1]:
        return warped_blend(source, destination, *points, *windows, weight=weight, in_step=in_step), chosen
    made = blend(source, destination, *points, count, weight=weight, specification=specification, joint_frames=shorter)
    return made, chosen


def switch_of(
    make: str, halflife: float | None, method: str | None, specification: str, joints: Sequence[str]
) -> Switching | None:
    """The make that switches, if `--make` names one; with options that it does not know, a usage error."""
    if halflife is not None and make != "inertialize":
        raise click.UsageError(f"expected no --halflife with --make {make}; it belongs to --make inertialize.")
    if make == Slerp.name:
        return None
    if joints or specification != "start-end":
        raise click.UsageError(f"expected neither --joint nor --specification with --make {make}, which has its own.")
    if make not in SWITCHES:
        return None
    if method is not None and LENGTHS[method].windows == 2:
        raise click.UsageError(f"expected another --method than {method} with --make {make}: it has one length.")
    return SWITCHES[make]().with_settings({} if halflife is None else {"halflife_s": halflife})


def switched(
    switch: Switching, source: Clip, destination: Clip, points: tuple[int, int], frames: int, fps: float
) -> Transition:
    """The transition in place of a blend of so many frames; points and frames count at `fps`, the clips at theirs."""
    ratio = source.fps / fps
    counted_at, made_at = (switch.switch(count, rate) for count, rate in (
        (frames, fps), (max(1, round((frames + 1) * ratio) - 1), source.fps)
    ))  # fmt: skip
    start = round((points[0] - 1) * ratio) + 1
    end = round((points[1] - counted_at.placed_frames) * ratio) + made_at.placed_frames
    return made_at.joined(source, destination, start, end)


def joint_frames(given: Sequence[str]) -> dict[str, int]:
    """`hip.L=5` and the like, as a mapping."""
    from study.motion.joint_names import ROLES

    found = {}
    for text in given:
        role, _, frames = text.partition("=")
        if role not in ROLES or not frames.isdigit() or int(frames) < 1:
            raise click.UsageError(
                f"expected --joint as ROLE=FRAMES such as shoulder.L=6, found {text!r}; roles: {', '.join(ROLES)}."
            )
        found[role] = int(frames)
    return found
