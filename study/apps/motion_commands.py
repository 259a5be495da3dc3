"""`segue motions` (list, inspect, download) and `segue preview`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from study.apps.console import emit, json_option, library_option, say
from study.counting import counted

if TYPE_CHECKING:
    from study.motion.skeleton import Skeleton

EXISTING = click.Path(exists=True, dir_okay=False, path_type=Path)


@click.group()
def motions() -> None:
    """List motions, inspect a file for what is wrong with it, download CMU trials."""


@motions.command("list")
@library_option
@json_option
def list_motions(library: str | None, as_json: bool) -> None:
    """The motions that a library offers, by name."""
    from study.motion.library import open_library

    opened = open_library(library or "synthetic")
    rows = [opened.entry(name) for name in opened.names()]
    lines = [f"{row.name:20} {row.kind:10} {row.words}" for row in rows]
    result = {
        "library": opened.name,
        "synthetic": opened.synthetic,
        "acknowledgement": opened.acknowledgement,
        "motions": [{"name": row.name, "kind": row.kind, "words": row.words} for row in rows],
    }
    emit(result, as_json, "\n".join(lines))


@motions.command()
@click.argument("file", type=EXISTING)
@click.option(
    "--metres-per-unit", type=click.FloatRange(min=0, min_open=True), help="The file's length unit, in metres."
)
@click.option("--fps", type=click.FloatRange(min=0, min_open=True), help="Frame rate, where the file does not say it.")
@json_option
def inspect(file: Path, metres_per_unit: float | None, fps: float | None, as_json: bool) -> None:
    """What a motion file holds, and what is wrong with it."""
    from study.motion.defects import find_defects
    from study.motion.files import read_clip

    clip = read_clip(file, metres_per_unit=metres_per_unit, fps=fps)
    defects = find_defects(clip)
    roles = {role: clip.skeleton.names[joint] for role, joint in clip.skeleton.roles.items()}
    result = {
        "file": str(file),
        "frames": clip.frames,
        "fps": clip.fps,
        "seconds": clip.seconds,
        "joints": list(clip.skeleton.names),
        "roles": roles,
        "human": clip.skeleton.body.human,
        "missing_roles": dict(clip.skeleton.body.missing),
        "role_notes": list(clip.skeleton.body.notes),
        "history": list(clip.history),
        "defects": [
            {
                "kind": defect.kind,
                "frame_start": defect.frame_start,
                "frame_stop": defect.frame_stop,
                "joint": defect.joint,
                "size": defect.size,
                "unit": defect.unit,
                "message": defect.message,
            }
            for defect in defects
        ],
    }
    lines = [
        f"{file.name}: {counted(clip.frames, 'frame')} at {clip.fps:g} fps, {clip.seconds:.2f} s, "
        f"{counted(clip.skeleton.joints, 'joint')}",
        *clip.history,
        *_role_lines(clip.skeleton),
        *(f"defect: {defect.message}" for defect in defects),
        "" if defects else _nothing_found(clip.skeleton),
    ]
    emit(result, as_json, "\n".join(line for line in lines if line))


def _role_lines(skeleton: Skeleton) -> Iterator[str]:
    """Which joint plays which role, which roles no joint plays, and why."""
    body = skeleton.body
    if not body.human:
        yield f"no human body was found: {next(iter(body.missing.values()))}. It can be previewed; methods need a human"
        return
    yield "roles: " + ", ".join(f"{role} {skeleton.names[joint]}" for role, joint in body.joints.items())
    for why in dict.fromkeys(body.missing.values()):
        yield f"missing: {', '.join(role for role, reason in body.missing.items() if reason == why)} ({why})"
    yield from body.notes


def _nothing_found(skeleton: Skeleton) -> str:
    if {"hip.L", "hip.R", "ankle.L", "ankle.R"} <= skeleton.roles.keys():
        return "no defects found"
    return "no jumps found; flipped legs and the floor were not looked for, as no legs were found"


@motions.command()
@click.argument("trials", nargs=-1, required=True, metavar="TRIAL...")
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), required=True, help="Folder to fill.")
@json_option
def download(trials: tuple[str, ...], out: Path, as_json: bool) -> None:
    """Download trials such as 16_35, or motions such as run, from the CMU Graphics Lab's official site."""
    from study.motion.library import CMU_ACKNOWLEDGEMENT, download_trial

    files = [download_trial(trial, out) for trial in trials]
    say(CMU_ACKNOWLEDGEMENT)
    emit(
        {"files": [str(file) for file in files], "acknowledgement": CMU_ACKNOWLEDGEMENT},
        as_json,
        "\n".join(map(str, files)),
    )


@click.command()
@click.argument("clip", metavar="FILE|NAME")
@library_option
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), required=True, help="X.mp4, or X.png: a strip.")
@click.option("--fps", type=click.FloatRange(min=1), help="Frame rate of the video; the clip's own unless given.")
@click.option(
    "--view", type=click.Choice(["front", "side", "three-quarter"]), default="three-quarter", show_default=True
)
@click.option("--style", type=click.Choice(["stick", "points", "mannequin"]), default="stick", show_default=True)
@click.option("--size", default="640x480", show_default=True, metavar="WxH", help="Of the video, in pixels.")
@click.option("--poses", type=click.IntRange(min=1), default=9, show_default=True, help="Of the strip.")
@click.option("--floor", is_flag=True, help="Draw the ground, with contact shadows.")
@click.option("--track", is_flag=True, help="Let the camera travel with the figure.")
@json_option
def preview(
    clip: str,
    library: str | None,
    out: Path,
    fps: float | None,
    view: str,
    style: str,
    size: str,
    poses: int,
    floor: bool,
    track: bool,
    as_json: bool,
) -> None:
    """One clip as a video, or as a strip of poses in one picture."""
    from study.apps.clips import load_clip
    from study.experiment.drawing import draw_clip

    width, _, height = size.partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise click.UsageError(f"expected --size as WIDTHxHEIGHT such as 640x480, found {size!r}.")
    shown = load_clip(clip, library, fps)
    draw_clip(
        shown,
        out,
        size=(int(width), int(height)),
        view=view,
        style=style,
        poses=poses,
        floor=floor,
        track_seconds=1.0 if track else None,
    )
    result = {"file": str(out), "frames": shown.frames, "fps": shown.fps, "history": list(shown.history)}
    emit(result, as_json, f"{out}: {shown.name or clip}, {counted(shown.frames, 'frame')} at {shown.fps:g} fps")
