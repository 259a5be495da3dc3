"""The report as text for a manuscript: a page in, Markdown out, which pandoc turns into a Word file.

Results in words, tables and figures with their numbers, Methods and references; figures are the PNG files beside it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from study.report.page import Page
from study.report.tables import Table


def as_markdown(page: Page) -> str:
    """Return the whole text."""
    return "\n\n".join(_blocks(page)) + "\n"


def _blocks(page: Page) -> Iterator[str]:
    yield f"# {_escaped(page.title)}"
    yield from (f"> {_escaped(warning)}" for warning in page.warnings)
    yield "## Methods"
    for heading, paragraph in page.methods:
        yield f"### {heading}"
        yield _escaped(paragraph)
    yield "## Results"
    for section in page.sections:
        yield f"### {_escaped(section.title)}"
        yield from (_escaped(f"{headline.statement} {headline.detail}".strip()) for headline in section.headlines)
        yield from (
            f"![Figure {page.number(drawing)}. {_escaped(drawing.caption)}](figures/{drawing.name}.png)"
            for drawing in section.drawings
        )
        yield from (_table(table, page.number(table)) for table in section.tables)
        yield from (_escaped(note) for note in section.notes)
    yield "## References"
    yield from (_escaped(work) for work in page.references)


def _table(table: Table, number: int) -> str:
    rows = [[column.heading for column in table.shown], *([text for text, _ in row] for row in table.cells)]
    rule = ["---:" if column.numeric else "---" for column in table.shown]
    lines = [f"| {' | '.join(map(_escaped, row))} |" for row in rows]
    lines.insert(1, f"| {' | '.join(rule)} |")
    return f"**Table {number}.** {_escaped(table.caption)}\n\n" + "\n".join(lines)


def _escaped(text: str) -> str:
    """The text with what Markdown and HTML would read as marks set apart, in one line."""
    return re.sub(r"([\\`*_\[\]<>|#])", r"\\\1", " ".join(text.split()))
