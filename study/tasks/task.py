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

Layout = Literal["one after another"]
"""How the slots of a trial are shown."""

Kind = Literal["word", "point"]
"""What is answered: a word, each with a button and a key, or a point of a scale."""


Order = Literal["both", "random", "balanced", "by-group"]
Show = Literal["single", "pair"]


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
    differences_frames: tuple[int, ...]
    order: Order
    repeats: int
    attention_checks: int
    scale_points: int

    @property
    def items(self) -> Sequence[Item]:
        """Questions of a rating."""


Problem = tuple[str, str]
"""A key of the study (empty for the study itself), and what is wrong with it: expected, found, what to do."""


@dataclass(frozen=True)
class Condition:
    """The stimuli of one pair, before any is made.

    Parameters
    ----------
    name
        What tells the pair from the others of its transition, such as `+5`; empty where there is one alone.
    methods
        How the blend length of each stimulus is found.
    added_frames
        What is added to each of these lengths.
    difference_frames
        Comparison minus reference; None where methods are compared.
    """

    name: str
    methods: tuple[str, ...]
    added_frames: tuple[int, ...]
    difference_frames: int | None = None


@dataclass(frozen=True)
class Shortcut:
    """How somebody would answer who sees one property of a pair's stimuli alone, such as their duration.

    Parameters
    ----------
    counts
        What is counted: `right` answers, or answers for the `comparison`.
    share
        Their share, 0 to 1, given how much more of the property the comparison has than the reference, in standard
        deviations of one percept: in each of the pairs that differ in what is judged, and in those that do not.
    chance
        That share where the property tells nothing.
    needed
        What people need at threshold; None where the protocol's threshold says it, or there is none.
    """

    counts: Literal["right", "comparison"]
    share: Callable[[NDArray[np.float64], NDArray[np.float64]], float]
    chance: float
    needed: float | None = None


@dataclass(frozen=True)
class Task:
    """One task: every question that the house asks.

    Parameters
    ----------
    name
        Unique. Analyses, report sections and power know it by this.
    asked_as
        What the protocol and the table of answers call it; `rating` is two tasks, by how many stimuli are shown.
    decides
        What is decided, as a clause: "whether two transitions are the same".
    layout, kind
        How its slots are shown, and what is answered.
    orders
        The orders in which a pair can be shown: for each slot, which of the pair's stimuli it shows.
    timed
        Whether the answer has a time limit.
    tested
        Whether its studies have a test that can be confirmatory.
    keys
        Keys of a study that only some tasks take, this one among them.
    instructions, question, welcome
        Names of its built-in words: what is read before a study, what is asked after each trial (empty where items
        ask), and the welcome of a session that has no other kind of trial.
    legal
        The answers that count.
    right
        The right answer to a trial; None where none is right.
    columns
        Columns of the table of answers that it gives a meaning; without empty ones.
    problems
        What does not fit between the task and the other keys of a study.
    conditions
        The pairs of one transition, in order; those of practice where asked for.
    practice
        Pairs for so many practice trials, out of shuffled ones; fewer are repeated.
    judge
        How a simulated person answers: the answer, and how easy it was from 0 to 1.
    truth
        What an analysis of a simulated study should find, at a threshold; None where nothing is known.
    in_words
        What participants did, as a clause for a Methods section, given words for the methods.
    shortcut
        How somebody would answer who sees one property of the stimuli alone; None where single stimuli are shown.
    """

    name: str
    asked_as: str
    decides: str
    layout: Layout
    kind: Kind
    orders: tuple[tuple[int, ...], ...]
    timed: bool
    tested: bool
    keys: frozenset[str]
    instructions: str
    question: str
    welcome: str
    legal: Callable[[Asked], tuple[str, ...]]
    right: Callable[[Trial], str | None]
    columns: Callable[[Trial, Answer], Mapping[str, Any]]
    problems: Callable[[Asked], Iterator[Problem]]
    conditions: Callable[[Asked, bool], tuple[Condition, ...]]
    practice: Callable[[Sequence[Pair], int], list[Pair]]
    judge: Callable[[Person, Trial, Sequence[str], np.random.Generator], tuple[str, float]]
    truth: Callable[[ObserverSettings, Asked, float], dict[str, Any] | None]
    in_words: Callable[[Asked, Callable[[str], str]], str]
    shortcut: Shortcut | None

    @property
    def slots(self) -> int:
        """How many stimuli a trial shows."""
        return len(self.orders[0])
