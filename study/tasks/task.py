"""What the house asks of a task. A task is one `Task`, in a module of its own; `registry` finds it by name.

A task knows no protocol, session or database. What it reads of a study is `Asked`: plain keys of the protocol.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from study.tasks.answer import Answer
from study.tasks.observer import ObserverSettings, Person
from study.tasks.trial import Pair, Trial

Layout = Literal["one after another", "side by side"]
"""How the slots of a trial are shown."""

Kind = Literal["word", "point", "slider"]
"""What is answered: a word, each with a button and a key, a point of a scale, or a place on a slider."""

SLIDER_POINTS = 101
"""A slider goes from 0 to 100."""


def scale(points: int) -> tuple[str, ...]:
    """The points of a scale, from 0."""
    return tuple(map(str, range(points)))


Order = Literal["both", "random", "balanced", "by-group"]
Show = Literal["single", "pair"]
Slider = Literal["plain", "ticks"]


class Item(Protocol):
    """One question of a rating: its name in the answers, and words at the middle of the scale."""

    name: str
    middle: str


class Asked(Protocol):
    """What tasks and procedures read of a study: its keys in the protocol, by their names there."""

    name: str
    task: str
    show: Show | None
    reference: str
    comparison: str | None
    others: tuple[str, ...]
    sets: int | None
    differences_frames: tuple[int, ...]
    order: Order
    repeats: int
    attention_checks: int
    ties: bool
    confidence_points: int | None
    slider: Slider | None
    scale_points: int
    side_by_side: bool
    replays: int
    hidden_reference: str | None

    @property
    def items(self) -> Sequence[Item]:
        """Questions of a rating."""

    @property
    def methods(self) -> tuple[str, ...]:
        """All methods that are shown."""


Problem = tuple[str, str]
"""A key of the study (empty for the study itself), and what is wrong with it: expected, found, what to do."""


@dataclass(frozen=True)
class Condition:
    """The stimuli of one pair, before any is made."""

    name: str
    """What tells the pair from the others of its transition, such as `+5`; empty where there is one alone."""
    methods: tuple[str, ...]
    """How the blend length of each stimulus is found."""
    added_frames: tuple[int, ...]
    """What is added to each of these lengths."""
    difference_frames: int | None = None
    """Comparison minus reference; None where methods are compared."""


@dataclass(frozen=True)
class Shortcut:
    """How somebody would answer who sees one property of a pair's stimuli alone, such as their duration."""

    counts: Literal["right", "comparison"]
    """What is counted: `right` answers, or answers for the `comparison`."""
    share: Callable[[NDArray[np.float64], NDArray[np.float64]], float]
    """Their share, 0 to 1, given how much more of the property the comparison has than the reference, in standard
    deviations of one percept: in each of the pairs that differ in what is judged, and in those that do not."""
    chance: float
    """That share where the property tells nothing."""
    needed: float | None = None
    """What people need at threshold; None where the protocol's threshold says it, or there is none."""


@dataclass(frozen=True)
class Task:
    """One task: every question that the house asks."""

    name: str
    """Unique. Analyses, report sections and power know it by this."""
    asked_as: str
    """What the protocol and the table of answers call it; `rating` is two tasks, by how many stimuli are shown."""
    decides: str
    """What is decided, as a clause: "whether two transitions are the same"."""
    layout: Layout
    kind: Kind
    """How its slots are shown, and what is answered; `layout_of` and `kind_of` know what a study changes."""
    orders: tuple[tuple[int, ...], ...]
    """The orders in which a pair can be shown: for each slot, which of the pair's stimuli it shows; empty where they
    follow from how many methods a study has (`orders_of`)."""
    timed: bool
    """Whether the answer has a time limit."""
    tested: bool
    """Whether its studies have a test that can be confirmatory."""
    keys: frozenset[str]
    """Keys of a study that only some tasks take, this one among them."""
    instructions: str
    question: str
    welcome: str
    """Names of its built-in words: what is read before a study, what is asked after each trial (empty where items ask),
    and the welcome of a session that has no other kind of trial."""
    legal: Callable[[Asked], tuple[str, ...]]
    """The answers that count."""
    right: Callable[[Trial], str | None]
    """The right answer to a trial; None where none is right."""
    columns: Callable[[Trial, Answer], Mapping[str, Any]]
    """Columns of the table of answers that it gives a meaning; without empty ones."""
    problems: Callable[[Asked], Iterator[Problem]]
    """What does not fit between the task and the other keys of a study."""
    conditions: Callable[[Asked, bool], tuple[Condition, ...]]
    """The pairs of one transition, in order; those of practice where asked for."""
    practice: Callable[[Sequence[Pair], int], list[Pair]]
    """Pairs for so many practice trials, out of shuffled ones; fewer are repeated."""
    judge: Callable[[Person, Trial, Sequence[str], np.random.Generator], tuple[str, float]]
    """How a simulated person answers: the answer, and how easy it was from 0 to 1."""
    truth: Callable[[ObserverSettings, Asked, float, Sequence[float]], dict[str, Any] | None]
    """What an analysis of a simulated study should find, at a threshold, given how visible the difference of each pair
    is (0 to 1); None where nothing is known."""
    in_words: Callable[[Asked, Callable[[str], str]], str]
    """What participants did, as a clause for a Methods section, given words for the methods."""
    shortcut: Shortcut | None
    """How somebody would answer who sees one property of the stimuli alone; None where single stimuli are shown."""

    @property
    def slots(self) -> int:
        """How many stimuli a trial shows; 0 where the study decides."""
        return len(self.orders[0]) if self.orders else 0
