"""Matplotlib figures to inline SVG, PNG and PDF: the same bytes every time, names for screen readers.

`new_figure` gives an empty figure in the report's quiet style, `picture_of` what page and files need of it.
"""

from __future__ import annotations

import html
import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, SOFT, FAINT, RULE = "#1d2328", "#5b666e", "#9aa5ac", "#dfe4e7"
BLUE, ORANGE, TEAL = "#0b5fa5", "#b8520a", "#1b7f79"
PRINTED_DPI = 300

_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "segue",
    "text.parse_math": False,
    "axes.unicode_minus": True,
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.titlecolor": INK,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelsize": 9,
    "ytick.labelsize": 9,
    "xtick.major.size": 3,
    "ytick.major.size": 0,
    "text.color": INK,
    "legend.frameon": False,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
}


@contextmanager
def new_figure(
    width: float, height: float, rows: int = 1, columns: int = 1, **options: Any
) -> Iterator[tuple[Figure, Any]]:
    """Within it, a figure of this size in inches with its axes is drawn in the report's style."""
    import matplotlib as mpl
    from matplotlib.figure import Figure as NewFigure

    with mpl.rc_context(_STYLE):
        figure = NewFigure(figsize=(width, height), layout="constrained")  # nothing is registered with pyplot
        yield figure, figure.subplots(rows, columns, **options)


def quiet_grid(axes: Axes, axis: str = "y") -> None:
    """Draw hairlines behind the data."""
    axes.grid(visible=True, axis=axis, color=RULE, linewidth=0.7)  # type: ignore[arg-type]
    axes.set_axisbelow(True)


def percent_axis(axes: Axes) -> None:
    """Percentages upwards, with hairlines."""
    axes.set_ylim(-3, 103)
    axes.set_yticks([0, 25, 50, 75, 100], ["0", "25", "50", "75", "100%"])
    quiet_grid(axes)


def named_rows(axes: Axes, places: Sequence[float], labels: Sequence[str]) -> None:
    """Labels in place of an axis at the left, for values that are drawn in rows."""
    axes.set_yticks(places, labels)
    axes.tick_params(axis="y", labelcolor=INK)
    axes.spines["left"].set_visible(False)
    quiet_grid(axes, "x")


@dataclass(frozen=True)
class Picture:
    """A figure as markup for the page, and for print: 300 dots an inch, and as vectors."""

    svg: str
    png: bytes
    pdf: bytes


def picture_of(figure: Figure, name: str, title: str, description: str, mark: str) -> Picture:
    """Return a finished figure.

    Parameters
    ----------
    name
        Unique in the page; every id in the figure begins with it.
    title, description
        What a screen reader says.
    mark
        What its data are (simulated, synthetic), written at its foot; nothing where they need no mark.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_pdf import FigureCanvasPdf
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    if mark:
        figure.supxlabel(mark, x=0.995, ha="right", fontsize=8.5, color=ORANGE, fontstyle="italic")
    text, png, pdf = io.StringIO(), io.BytesIO(), io.BytesIO()
    # `savefig` would draw everything twice, once without leaving a mark, to place the axes.
    nothing = {"Date": None, "Creator": None, "Format": None, "Type": None}
    FigureCanvasSVG(figure).print_svg(text, metadata=nothing)  # type: ignore[no-untyped-call]
    figure.set_layout_engine("none")  # axes stay where they are
    figure.set_facecolor("white")
    FigureCanvasPdf(figure).print_pdf(pdf, metadata={"CreationDate": None})  # type: ignore[no-untyped-call]
    figure.set_dpi(PRINTED_DPI)
    FigureCanvasAgg(figure).print_png(png, metadata={"Software": None})  # type: ignore[no-untyped-call]
    return Picture(_inline(text.getvalue(), name, title, description), png.getvalue(), pdf.getvalue())


def _inline(text: str, name: str, title: str, description: str) -> str:
    """An SVG file as an element of the page, named for screen readers."""
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r'\bid="([^"]+)"', rf'id="{name}-\1"', text)
    text = re.sub(r"url\(#([^)]+)\)", rf"url(#{name}-\1)", text)
    text = re.sub(r'href="#([^"]+)"', rf'href="#{name}-\1"', text)
    # The page's typeface instead of matplotlib's: the reader's machine need not have that one.
    text = re.sub(r"font: ([^;'\"]*?)'DejaVu Sans'", r"font: \1var(--sans, sans-serif)", text)
    opening, rest = text.split(">", 1)
    opening = re.sub(r'\s(?:width|height)="[^"]*"', "", opening)
    names = (
        f'<title id="{name}-title">{html.escape(title)}</title><desc id="{name}-desc">{html.escape(description)}</desc>'
    )
    return (
        f'{opening} role="img" aria-labelledby="{name}-title {name}-desc" style="width:100%;height:auto">{names}{rest}'
    ).strip()


def as_file(svg: str) -> str:
    """Return an SVG element of the page as a file of its own: with a size and a typeface that any program knows."""
    width, height = re.search(r'viewBox="0 0 ([0-9.]+) ([0-9.]+)"', svg).groups()  # type: ignore[union-attr]
    opening, rest = svg.split(">", 1)
    opening = re.sub(r' style="[^"]*"', f' width="{width}pt" height="{height}pt"', opening)
    rest = rest.replace("var(--sans, sans-serif)", "Helvetica, Arial, sans-serif")
    return f'<?xml version="1.0" encoding="utf-8"?>\n{opening}>{rest}\n'
