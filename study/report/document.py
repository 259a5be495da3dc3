"""The report: a results folder in; one self-contained page, and every table and figure as files, out.

The page needs no network: styles, figures, strips and videos are embedded. It is the same, byte for byte, for the same
folder and version of Segue. What participants or protocols wrote is escaped by the template.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from study.files import check_place, write_whole
from study.report import tables, words
from study.report.material import gather

if TYPE_CHECKING:
    from study.analysis.analyse import Analysis
    from study.report.page import Page

TEMPLATES = Path(__file__).parent / "templates"


def write_report(
    results_folder: str | Path,
    *,
    out: str | Path | None = None,
    database: str | None = None,
    resamples: int = 1000,
    analysis: Analysis | None = None,
) -> Path:
    """Write `report.html`, `manuscript.md`, `tables/` and `figures/` of a results folder.

    Parameters
    ----------
    results_folder
        With `protocol.toml`, `manifest.json` and `responses.sqlite`; what `segue power --json` printed, as
        `power*.json`, is shown too.
    out
        The folder to write into; the results folder unless given, which is then only read.
    database
        Where the answers are, if not in the folder: a file, or a URL.
    resamples
        Bootstrap samples behind standard errors.
    analysis
        Of the folder, where it was made already.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    AnalysisError
        When there are no answers yet.
    SegueError
        When a part of the folder is missing or can't be read.
    """
    from study.analysis.analyse import analyse_folder
    from study.report.manuscript import as_markdown
    from study.report.media import embedding
    from study.report.page import compose

    folder = Path(results_folder)
    target = folder if out is None else Path(out)
    path = target / "report.html"
    material = gather(folder, database)
    check_place(path)
    with embedding(material.manifest) as pictures:
        analysis = analysis or analyse_folder(material.protocol, material.answers, material.checks, resamples=resamples)
        page = replace(compose(material, analysis), pictures=pictures())
    _write_files(target, page, analysis)
    write_whole(target / "manuscript.md", as_markdown(page))
    write_whole(path, to_html(page))
    return path


def _write_files(folder: Path, page: Page, analysis: Analysis) -> None:
    """Write every table as CSV and JSON, every figure as SVG, PNG and PDF, and the whole analysis as JSON."""
    from study.analysis.analyse import analysis_json
    from study.report.drawing import as_file

    for table in page.tables:
        write_whole(folder / "tables" / f"{table.name}.csv", tables.as_csv(table))
        write_whole(folder / "tables" / f"{table.name}.json", tables.as_json(table))
    for drawing in page.drawings:
        stem, picture = folder / "figures" / drawing.name, drawing.picture
        write_whole(stem.with_suffix(".svg"), as_file(picture.svg))
        write_whole(stem.with_suffix(".png"), picture.png)
        write_whole(stem.with_suffix(".pdf"), picture.pdf)
    whole = json.dumps(analysis_json(analysis), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    write_whole(folder / "tables" / "analysis.json", whole)


def to_html(page: Page) -> str:
    """Return the page as one HTML text; everything but our own SVG and CSS is escaped."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["unbroken"] = words.unbroken
    markup: Callable[[str], Markup] = Markup
    styles = (TEMPLATES / "report.css").read_text(encoding="utf-8")
    return environment.get_template("report.html.jinja").render(page=page, styles=markup(styles), markup=markup)
