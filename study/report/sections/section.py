"""What the page shows of one study: a headline, figures, tables, and one line of the table that compares readings."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from study.analysis.analyse import Analysis, Data
from study.report import tables
from study.report.drawing import Picture
from study.report.tables import Table

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Drawing:
    """A figure with its caption; `name` is that of its files."""

    name: str
    picture: Picture
    caption: str


@dataclass(frozen=True)
class Headline:
    """An answer in words: the statement itself, and what it rests on."""

    statement: str
    detail: str


@dataclass(frozen=True)
class Reading:
    """A line of the table that sets published and corrected results side by side."""

    result: str
    published: str
    corrected: str


@dataclass(frozen=True)
class Section:
    """One study on the page."""

    anchor: str
    title: str
    """`anchor`, `title`: where links lead, and the heading."""
    headlines: tuple[Headline, ...]
    """Shown at the top of the page."""
    drawings: tuple[Drawing, ...] = ()
    tables: tuple[Table, ...] = ()
    notes: tuple[str, ...] = ()
    """`drawings`, `tables`, `notes`: in this order; the tables follow the first drawing."""
    folded: tuple[Table, ...] = ()
    """Tables to open."""
    readings: tuple[Reading, ...] = ()
    """Its lines of the table that compares readings."""


@dataclass(frozen=True)
class About:
    """What a section knows of its study beside the result."""

    name: str
    title: str
    """`name`, `title`: of the study."""
    fps: float = 30.0
    """Frames per second, for seconds beside frames."""
    data: Data = "collected"
    mark: str = ""
    """`data`, `mark`: whose answers they are, and what every figure says about its data."""
    alpha: float = 0.05
    confidence: float = 0.95
    """`alpha`, `confidence`: level of significance, and confidence of intervals."""
    points: int = 5
    ends: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    """`points`, `ends`: of a rating scale, counted from 0, and the words at its lowest and highest point, by
    question."""
    transitions: tuple[str, ...] = ()
    """Names of the transitions in the protocol's order."""
    lengths: Mapping[str, int] = field(default_factory=dict)
    """Blend length in frames of the first stimulus of each transition's pairs: k in a same-different study."""
    known: Mapping[str, Any] = field(default_factory=dict)
    """What is known of simulated observers; empty where people took part."""

    @property
    def interval(self) -> str:
        """What an interval is called: "95% interval"."""
        return f"{100 * self.confidence:g}% interval"

    def place(self, motion: str) -> int:
        """Where a motion stands in the protocol; the first participant's plan has another order."""
        return self.transitions.index(motion) if motion in self.transitions else len(self.transitions)


Result = TypeVar("Result")


Course = tuple[str, Callable[["pd.DataFrame"], "pd.Series[bool]"]]
"""What the course of a study is told by: a percentage in words, and which answers count towards it."""


@dataclass(frozen=True)
class SectionKind(Generic[Result]):
    """How a kind of result is shown."""

    section: Callable[[Result, About], Section | None]
    """From a result and what is known of its study; None where there is nothing to show."""
    methods: Callable[[Collection[Result], Analysis], str]
    """How studies of this kind were analysed, for a Methods section: from the results and the whole analysis."""
    references: Callable[[Collection[Result]], set[str]]
    """Keys of the works that this rests on."""
    course: Course | None = None
    """None where answers do not change over a study in any way that is told."""


def readings_table(sections: Sequence[Section]) -> Table | None:
    """Return every result as published and corrected, side by side; None where there is no result."""
    rows = [vars(row) for section in sections for row in section.readings]
    if not rows:
        return None
    if len({row["result"] for row in rows}) < len(rows):
        rows = [
            vars(row) | {"result": f"{section.title}: {row.result}"} for section in sections for row in section.readings
        ]
    return tables.make(
        "results",
        "Every result as published and corrected, with confidence intervals in brackets. Published: the statistics of "
        "the papers, which treat all responses as independent or interpolate thresholds linearly. Corrected: the "
        "participant is the unit, and thresholds come from a model of the task.",
        "result published corrected",
        rows,
    )
