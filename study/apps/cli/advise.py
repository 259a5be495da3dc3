"""`segue advise`: for each pair of clips, where to blend, for how long, and how the frames are made."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import permutations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from study.apps.cli.clips import clips_options, find_entry, load_clip
from study.apps.cli.console import FOLDER, FPS, columns, emit, json_option, progress, say
from study.apps.cli.moments import moment

if TYPE_CHECKING:
    from study.motion.clip import Clip
    from study.transitions.advice import Advice

HEADINGS = (
    *("from", "to", "method", "make", "start", "s", "in file", "end", "s", "in file"),
    *("frames", "s", "than default", "JND", "cost", "cost at default"),
)
POINT = (("_frame", "d"), ("_s", ".2f"), ("_file_frame", ".5g"))


@click.command()
@click.argument("motions", nargs=-1, metavar="[CLIP]...")
@clips_options
@FPS
@click.option(
    "--out",
    type=FOLDER,
    help="Folder for advice.csv, advice.json, and a strip of each transition (default: none is written).",
)
@click.option("--no-strips", is_flag=True, help="Write only the tables.")
@json_option
def advise(motions: tuple[str, ...], library: str | None, fps: float, out: Path | None, no_strips: bool) -> None:
    """Where, how long and how to blend, for each ordered pair of clips, and the difference from ten frames.

    The whole library if no clip is named. The method suits
    the motion (Wang & Bodenheimer 2004): geodesic if one of the two is cyclic, else velocity. The make is the one with
    the steadiest feet, the smoothest toes and poses nearest to the clips' own.
    """
    from study.errors import SegueError
    from study.files import check_place
    from study.motion.library import open_library
    from study.transitions.advice import is_cyclic

    opened = open_library(library) if library else None
    names = motions or (opened.distinct() if opened else ())
    if len(set(names)) < 2:
        raise click.UsageError(f"expected at least two clips, or --library with two or more, found {len(set(names))}.")
    if out is not None:
        check_place(out / "advice.csv")
    clips, cyclic = {}, {}
    problems: list[str] = []
    for name in dict.fromkeys(names):
        try:
            # As `transition` has it: synthetic motions are made at this rate. Cycles show best at the clip's own.
            made, own = load_clip(name, opened, fps), load_clip(name, opened, None, tell=False)
            said = find_entry(name, opened)[1].cyclic
        except SegueError as error:
            if motions:
                raise
            # A file of a whole folder that can't be read is named, and the others are advised on.
            problems.append(f"{name}: {error}")
        else:
            clips[name], cyclic[name] = made, is_cyclic(own) if said is None else said
    if len(clips) < 2:
        raise click.UsageError(
            f"expected at least two clips that can be read, found {len(clips)}. {'; '.join(problems)}"
        )
    rows: list[dict[str, Any]] = []
    pairs = list(permutations(clips, 2))
    with progress("advise") as advance:
        for done, (source, destination) in enumerate(pairs, start=1):
            try:
                row = _one(
                    clips[source], clips[destination], (cyclic[source], cyclic[destination]), None if no_strips else out
                )
            except SegueError as error:
                problems.append(f"{source} to {destination}: {error}")
            else:
                rows.append({**row, "source": source, "destination": destination, "fps": fps})
            advance(done / len(pairs), f"{done} of {len(pairs)}")
    for problem in problems[:3]:
        say(problem)
    if len(problems) > 3:
        say(f"{len(problems) - 3} more pairs have no advice either; --json lists them under problems")
    result = {"fps": fps, "advice": rows, "problems": problems, "cyclic": cyclic}
    if out is not None:
        _write(out, result)
    emit(result, "\n".join(_table(rows, fps, library)))


def _one(source: Clip, destination: Clip, cyclic: tuple[bool, bool], out: Path | None) -> dict[str, Any]:
    """The advice as a row, and the strip drawn where there is a folder for it."""
    from dataclasses import asdict

    from study.motion.clip import retarget
    from study.transitions.advice import advise as find

    destination = retarget(destination, source.skeleton)
    found = find(source, destination, cyclic=cyclic)
    strip = None if out is None else str(_strip(source, destination, found, out / "strips"))
    points = {**moment(source, found.start_frame, "start"), **moment(destination, found.end_frame, "end")}
    return {**asdict(found), **points, "strip": strip}


def _strip(source: Clip, destination: Clip, found: Advice, folder: Path) -> Path:
    """A strip of the advised transition with a second and a half on either side, feet planted."""
    from study.motion.clip import trim
    from study.motion.drawing import draw_clip
    from study.transitions.methods.method import Place
    from study.transitions.methods.registry import MAKES

    names, points = (found.source, found.destination), (found.start_frame, found.end_frame)
    place = Place("", names, source, destination, *points)
    made = MAKES[found.make]().way(place, (found.blend_frames, found.blend_frames)).made(place)
    around = round(1.5 * source.fps)
    start = max(0, made.blend_start - around)
    clip = trim(made.clip, start, min(made.clip.frames, made.blend_stop + around))
    picture = folder / f"{found.source}-to-{found.destination}.png".replace("/", "_")
    draw_clip(clip, picture, poses=13, blended=(made.blend_start - start, made.blend_stop - start))
    return picture


def _write(out: Path, result: dict[str, Any]) -> None:
    import json

    import pandas as pd

    from study.analysis.to_json import to_json
    from study.files import write_whole
    from study.spreadsheets import safe_table

    table = pd.DataFrame(result["advice"]).drop(columns="makes", errors="ignore")
    write_whole(out / "advice.csv", safe_table(table).to_csv(index=False))
    write_whole(out / "advice.json", json.dumps(to_json(result), indent=2, allow_nan=False) + "\n")


def _table(rows: Sequence[dict[str, Any]], fps: float, library: str | None) -> Iterator[str]:
    """The advice as columns of text, those furthest from the default first, and how a row is typed back."""
    cells = [
        (
            row["source"],
            row["destination"],
            row["method"],
            row["make"],
            *(f"{row[end + kind]:{form}}" for end in ("start", "end") for kind, form in POINT),
            str(row["blend_frames"]),
            f"{row['blend_s']:.2f}",
            f"{row['difference_frames']:+d}",
            f"{row['jnd']:.1f}",
            f"{row['cost']:.4f}",
            f"{row['default_cost']:.4f}",
        )
        for row in sorted(rows, key=lambda row: -row["jnd"])
    ]
    yield f"Frames at {fps:g} fps; 'in file' is the frame of the motion's own file, at the file's rate."
    yield from columns([HEADINGS, *cells], left=(0, 1, 2, 3))
    yield "JND: just noticeable differences of the blend length from the default; from 1 on, people see it."
    if cells:
        yield f"A row as a transition: segue transition {_arguments(cells[0], fps, library)} --out X.mp4"


def _arguments(row: Sequence[str], fps: float, library: str | None) -> str:
    """What `segue transition` takes to make a row of the table."""
    from shlex import join

    given = [row[0], row[1], *(("--library", library) if library else ()), "--fps", f"{fps:g}"]
    return join([*given, "--start", row[4], "--end", row[7], "--method", row[2], "--make", row[3]])
