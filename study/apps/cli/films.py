"""Options of verbs that make a film to look at: the figure, from where, by which camera, how large."""

from __future__ import annotations

import click

from study.apps.cli.console import together

film_options = together(
    click.option(
        "--style",
        type=click.Choice(["mannequin", "stick", "points"]),
        default="mannequin",
        show_default=True,
        help="How the figure is drawn: mannequin, a body; stick, its bones; points, a dot at each joint.",
    ),
    click.option(
        "--view",
        type=click.Choice(["front", "side", "three-quarter"]),
        default="three-quarter",
        show_default=True,
        help="Seen from the front, from the side, or from between them (three-quarter), as the figure goes.",
    ),
    click.option(
        "--camera",
        type=click.Choice(["track", "pan", "fixed"]),
        default="track",
        show_default=True,
        help="track follows the figure; pan stands still and turns after it; fixed does not move.",
    ),
    click.option(
        "--size",
        default="1280x720",
        show_default=True,
        metavar="WxH",
        callback=lambda _context, _parameter, text: film_size(text),
        help="Width and height of the film, pixels.",
    ),
)
"""What `drawing.draw_clip` takes: style, view, camera and size."""


def film_size(text: str) -> tuple[int, int]:
    """`1280x720` as width and height."""
    width, _, height = text.partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise click.UsageError(f"expected --size as WIDTHxHEIGHT such as 1280x720, found {text!r}.")
    return int(width), int(height)
