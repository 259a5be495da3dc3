"""What a procedure is: the choice of a study's next trial, as a pure fold over the answers so far.

`Settings` are what a protocol says of one (`[studies.procedure]`), a frozen dataclass whose fields are its keys. A plan
draws with them: trials that are known beforehand, or a `Course`, which is all that has to be stored to find the trials
again from the answers. A `Procedure` says which trial comes next; it keeps no state, so that resuming a session is the
same as running it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar
from typing import Protocol as Shape

import numpy as np

from study.models.tracks import Rule
from study.tasks.answer import Answer
from study.tasks.task import Asked
from study.tasks.trial import Pair, Trial

Members = tuple[int, ...]
"""Which of a pair's stimuli each slot of a trial shows."""


class Procedure(Shape):
    """Which trial of a study comes next.

    All methods take one answer for each trial that is finished (of a trial that was shown again, the last one), in the
    order in which they were finished.
    """

    def next(self, answers: Sequence[Answer]) -> tuple[Trial, ...]:
        """The trials that come next whatever is answered to them; none where the study is over."""

    def candidates(self, answers: Sequence[Answer]) -> tuple[Trial | None, ...]:
        """The trials of which one may follow the next, for films to be loaded ahead; None where the study may end."""

    def progress(self, answers: Sequence[Answer]) -> tuple[int, int]:
        """How far the study is, and how far it goes: in trials, of the most that there may be."""


@dataclass(frozen=True)
class Draw:
    """What a plan gives to a procedure."""

    study: str
    """Its name."""
    pairs: tuple[Pair, ...]
    """All that its trials may show, in the protocol's order, which matters: a draw counts on it."""
    arrangements: tuple[Members, ...]
    """Which member of a pair each slot shows: all that the task has."""
    order: str
    """How they are drawn: `both`, `random`, `balanced`, `by-group`; of stimuli that are shown one by one: `random`,
    `by-group`."""
    repeats: int
    """How often the whole set is shown."""
    group: int
    """The participant's, for `by-group`."""
    blocks: bool = False
    """Whether trials with one transition follow each other."""


@dataclass(frozen=True)
class Course:
    """What a plan keeps of a study whose trials depend on the answers."""

    study: str
    """Its name."""
    first: int
    most: int
    """Number of its first trial, and how many numbers are kept for it."""
    settings: Adaptive
    """Of the procedure."""
    pairs: tuple[Pair, ...]
    """All that may be shown."""
    arrangements: tuple[Members, ...]
    """Which member of a pair each slot shows: a trial draws one of these."""
    repeats: int
    """How often the whole set is shown."""


@dataclass(frozen=True)
class Settings(ABC):
    """What the settings of every procedure answer; subclasses are frozen dataclasses that refuse bad values.

    `name` is what a protocol calls the procedure, `title` what a Methods section does, `sources` are its references.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    sources: ClassVar[tuple[str, ...]] = ()

    def rule_of(self, task: str) -> Rule | None:
        """The rule of its tracks in a study with this task, so that the analysis can follow it; None without tracks."""
        del task
        return None

    def problems(self, asked: Asked) -> Iterator[tuple[str, str]]:
        """What does not fit between the procedure and other keys of its study: the key, and what
        was expected, found, and to do.
        """
        del asked
        yield from ()

    def differences(self) -> tuple[int, ...] | None:
        """The differences in frames that may come, where the procedure finds them; None where the protocol does."""
        return None

    def trials(self, transitions: int, repeats: int) -> tuple[int, int] | None:
        """The fewest and the most trials of a study; None where they are known beforehand."""
        del transitions, repeats
        return None

    def in_words(self) -> str:
        """What there is to say of it beside its title; empty for nothing."""
        return ""

    def drawn(self, draw: Draw, rng: np.random.Generator) -> list[Trial]:
        """The trials that are known beforehand, drawn with the plan's own generator; the plan numbers them."""
        del draw, rng
        return []


class Adaptive(Settings):
    """The settings of a procedure whose trials depend on the answers."""

    @abstractmethod
    def course(self, draw: Draw, first: int) -> Course:
        """What a plan keeps of it, numbered from `first` on."""

    @abstractmethod
    def begun(self, course: Course, rng: np.random.Generator) -> Procedure:
        """The procedure of a stored course; `rng` is the same whenever it is begun."""
