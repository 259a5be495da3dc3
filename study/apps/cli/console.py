"""What every verb shares: one JSON object on standard output, everything else on standard error, progress bars."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar, cast

import click

from study.apps.cli.streams import show

Command = TypeVar("Command", bound=Callable[..., Any])

FILE, READABLE = (click.Path(exists=there, dir_okay=False, path_type=Path) for there in (False, True))
FOLDER, RESULTS = (click.Path(exists=there, file_okay=False, path_type=Path) for there in (False, True))
"""Kinds of paths: to be written, and those that have to be there."""

FPS = click.option(
    "--fps",
    type=click.FloatRange(min=1),
    default=30.0,
    show_default=True,
    help="Frames per second to work at; frames are counted at this rate.",
)

WEIGHTS = "Weights of joints: wang2003, fitted to judgements of people; lee2002, one for each major joint."


def kept_flag(name: str, words: str) -> Callable[[Command], Command]:
    """Adds a flag to a verb that is not handed to it: `is_given` looks it up where it counts."""

    def keep(context: click.Context, parameter: click.Parameter, given: bool) -> None:
        context.meta[parameter.opts[0]] = given

    return click.option(name, is_flag=True, expose_value=False, callback=keep, help=words)


def is_given(name: str) -> bool:
    """Whether a flag of `kept_flag` was given to the verb that runs now."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(name))


json_option = kept_flag("--json", "Print one JSON object on standard output.")


library_option = click.option(
    "--library",
    metavar="NAME|FOLDER",
    help="Where motions come from: 'synthetic' (default), or a folder of .bvh, .asf/.amc (CMU's), .glb or .gltf files,"
    " with or without a library.toml.",
)
database_option = click.option(
    "--database",
    metavar="FILE|URL",
    envvar="SEGUE_DATABASE",
    show_envvar=True,
    help="Database of responses: a file, or postgresql+psycopg://USER@HOST/NAME (default: responses.sqlite in the "
    "results folder).",
)


def together(*options: Callable[[Any], Any]) -> Callable[[Command], Command]:
    """Several options as one; help lists them in this order."""

    def add(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return add


def workers_options(verb: Command) -> Command:
    """Adds `--workers` and `--cluster`, of which one may be given; the verb is handed it as `workers`."""

    @click.option(
        "--workers", type=click.IntRange(min=1), help="Number of workers on this machine (default: one a core)."
    )
    @click.option(
        "--cluster",
        metavar="ADDRESS",
        help="Dask scheduler whose workers do it, such as tcp://host:8786 (default: --workers on this machine).",
    )
    @wraps(verb)
    def placed(*arguments: Any, workers: int | None, cluster: str | None, **options: Any) -> Any:
        if workers and cluster:
            raise click.UsageError("expected either --workers or --cluster; give one of them.")
        return verb(*arguments, workers=cluster or workers, **options)

    return cast("Command", placed)


def emit(result: Mapping[str, Any], text: str) -> None:
    """Prints a verb's result: with `--json` the mapping (numbers that are not finite become null), else the text."""
    from study.analysis.to_json import to_json

    show(json.dumps(to_json(result), indent=2, allow_nan=False) if is_given("--json") else text, sys.stdout)


def say(message: str) -> None:
    """One line on standard error."""
    show(message, sys.stderr)


def columns(rows: Sequence[Sequence[str]], left: Collection[int] = (0,)) -> list[str]:
    """Rows of cells as lines of text, the first row the headings; columns in `left` begin at the left."""
    widths = [max(len(row[at]) for row in rows) for at in range(len(rows[0]))]
    return [
        "  ".join(
            cell.ljust(width) if at in left else cell.rjust(width)
            for at, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


@contextmanager
def progress(label: str) -> Iterator[Callable[[float, str], None]]:
    """A progress bar on standard error; gives a function of (the share that is done, a few words such as "3 of 7").

    Where standard error is not a terminal, a line at each quarter takes the bar's place, so that logs stay short.
    """
    if not sys.stderr.isatty():
        shown = -1

        def report(share: float, words: str) -> None:
            nonlocal shown
            if int(4 * share) != shown:
                shown = int(4 * share)
                say(f"{label}: {words}")

        yield report
        return
    words_now = [""]
    steps = 1000
    shown_bar: Any = click.progressbar(
        length=steps, label=label, file=sys.stderr, show_eta=True, item_show_func=lambda _: words_now[0]
    )
    with shown_bar as bar:

        def advance(share: float, words: str) -> None:
            words_now[0] = words
            bar.update(round(steps * share) - bar.pos)

        yield advance
