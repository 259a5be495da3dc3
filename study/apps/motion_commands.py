"""`segue motions` (list, inspect, download) and `segue preview`."""

from __future__ import annotations

from pathlib import Path

import click

from study.apps.console import emit, json_option, library_option, say

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
@click.option("--metres-per-unit", type=click.FloatRange(min=0, min_open=True), help="The file's length unit, in metres.")
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
        f"{file.name}: {clip.frames} frames at {clip.fps:g} fps, {clip.seconds:.2f} s, {clip.skeleton.joints} joints",
        *clip.history,
        "roles: " + ", ".join(f"{role} {name}" for role, name in roles.items()),
        *(f"defect: {defect.message}" for defect in defects),
        "" if defects else "no defects found",
    ]
    emit(result, as_json, "\n".join(line for line in lines if line))


@motions.command()
@click.argument("trials", nargs=-1, required=True, metavar="TRIAL...")
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), required=True, help="Folder to fill.")
@json_option
def download(trials: tuple[str, ...], out: Path, as_json: bool) -> None:
    """Download trials such as 16_35, or motions such as run, from the CMU Graphics Lab's official site."""
    from study.motion.library import CMU_ACKNOWLEDGEMENT, download_trial

    files = [download_trial(trial, out) for trial in trials]
    say(CMU_ACKNOWLEDGEMENT)
    emit({"files": [str(file) for file in files], "acknowledgement": CMU_ACKNOWLEDGEMENT}, as_json, "\n".join(map(str, files)))
