"""What the page shows of one study: a headline, figures and tables."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Generic, TypeVar

from study.analysis.analyse import Analysis, Data
from study.report import tables, words
from study.report.drawing import Picture
from study.report.tables import Table

if TYPE_CHECKING:
    pass


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

    @property
    def interval(self) -> str:
        """What an interval is called: "95% interval"."""
        return f"{100 * self.confidence:g}% interval"

    def place(self, motion: str) -> int:
        """Where a motion stands in the protocol; the first participant's plan has another order."""
        return self.transitions.index(motion) if motion in self.transitions else len(self.transitions)


Result = TypeVar("Result")


@dataclass(frozen=True)
class SectionKind(Generic[Result]):
    """How a kind of result is shown."""

    section: Callable[[Result, About], Section | None]
    """From a result and what is known of its study; None where there is nothing to show."""
    methods: Callable[[Collection[Result], Analysis], str]
    """How studies of this kind were analysed, for a Methods section: from the results and the whole analysis."""
    references: Callable[[Collection[Result]], set[str]]
    """Keys of the works that this rests on."""


def headline_table(analysis: Analysis) -> Table:
    """Return every headline in numbers."""
    rows = [
        vars(one) | {"study": words.readable(one.study), "result": words.readable(one.unit), "value": one.estimate}
        | {"low": one.interval.low, "high": one.interval.high, "p_value": one.p, "holm_p_value": one.p_adjusted}
        for one in analysis.headline
    ]  # fmt: skip
    return tables.make(
        "results",
        "Results in numbers. Confidence intervals and tests hold for what the last column names; p is also adjusted "
        "for the other tests of its family (Holm). What the papers’ own statistics give is in the section of each "
        "study.",
        "study result value low high p_value holm_p_value generalises_to",
        rows,
        headings={"value": "estimate"},
    )
