"""What every verb shares: one JSON object on standard output, everything else on standard error, progress bars."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TypeVar

import click

Command = TypeVar("Command", bound=Callable[..., Any])


def json_option(command: Command) -> Command:
    """Adds `--json` to a verb."""
    return click.option("--json", "as_json", is_flag=True, help="Print one JSON object on standard output.")(command)


def library_option(command: Command) -> Command:
    """Adds `--library` to a verb."""
    return click.option(
        "--library",
        metavar="NAME|FOLDER",
        default=None,
        help="Where motions come from: 'synthetic' (default), or a folder of .bvh or .asf/.amc files such as CMU's.",
    )(command)


def emit(result: Mapping[str, Any], as_json: bool, text: str) -> None:
    """Prints a verb's result: the mapping as JSON, or the text."""
    click.echo(json.dumps(plain(result), indent=2, allow_nan=False) if as_json else text)


def plain(value: Any) -> Any:  # noqa: ANN401 - JSON values are of any type
    """A value as JSON has it: arrays become lists, paths become text, numbers that are not finite become null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | int):
        return value
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    return str(value)


def say(message: str) -> None:
    """One line on standard error."""
    click.echo(message, err=True)


@contextmanager
def progress(label: str, total: int) -> Iterator[Callable[[int, str], None]]:
    """A progress bar on standard error; gives a function of (how many are done, a few words such as "310 frames/s").

    Where standard error is not a terminal, a line at each tenth takes the bar's place, so that logs stay short.
    """
    if not sys.stderr.isatty():
        last = -1

        def report(done: int, words: str) -> None:
            nonlocal last
            tenth = 10 * done // max(total, 1)
            if tenth != last:
                last = tenth
                say(f"{label}: {done} of {total}{f', {words}' if words else ''}")

        yield report
        return
    state = {"words": ""}
    with click.progressbar(
        length=total, label=label, file=sys.stderr, show_eta=True, show_pos=True, item_show_func=lambda _: state["words"]
    ) as bar:

        def advance(done: int, words: str) -> None:
            state["words"] = words
            bar.update(done - bar.pos, None)

        yield advance
