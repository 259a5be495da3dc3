"""Constant stimuli: all trials are known before the first answer, every pair in its order or orders, shuffled.

2004 section 4.2: each pair in both orders, the order of pairs and the order within a pair both at random.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from study.experiment.procedures.procedure import Draw, Settings
from study.tasks.answer import Answer
from study.tasks.trial import Trial, trial_of

IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class Constant(Settings):
    """The keys of `[studies.procedure]` with `name = "constant"`: none."""

    name: ClassVar[str] = "constant"
    title: ClassVar[str] = "constant stimuli"

    def drawn(self, draw: Draw, rng: np.random.Generator) -> list[Trial]:
        """The trials of a study, repeat after repeat."""
        trials = [trial for repeat in range(1, draw.repeats + 1) for trial in _drawn_set(draw, repeat, rng)]
        if not draw.blocks:
            return trials
        motions = list(dict.fromkeys(pair.motion for pair in draw.pairs))
        order = {motions[i]: place for place, i in enumerate(rng.permutation(len(motions)))}
        return sorted(trials, key=lambda trial: order[trial.motion])  # as they were drawn within a block


@dataclass(frozen=True)
class ConstantStimuli:
    """The trials of one study, in their order (`Procedure`)."""

    trials: tuple[Trial, ...]

    def next(self, answers: Sequence[Answer]) -> tuple[Trial, ...]:
        """All trials that are left."""
        done = {answer.trial for answer in answers}
        return tuple(trial for trial in self.trials if trial.trial not in done)

    def candidates(self, answers: Sequence[Answer]) -> tuple[Trial | None, ...]:
        """The one trial that follows the next; None where that is the last."""
        return self.next(answers)[1:2] or (None,)

    def progress(self, answers: Sequence[Answer]) -> tuple[int, int]:
        """Trials finished and trials in all."""
        return len(answers), len(self.trials)


def _drawn_set(draw: Draw, repeat: int, rng: np.random.Generator) -> list[Trial]:
    """One repeat: each pair in its order or orders, shuffled."""
    pairs, arrangements, count = draw.pairs, draw.arrangements, len(draw.pairs)
    if len(arrangements) == 1:
        turn, by_group = draw.group % count, draw.order == "by-group"
        turned = [*pairs[turn:], *pairs[:turn]] if by_group else [pairs[i] for i in rng.permutation(count)]
        return [trial_of(pair, arrangements[0], repeat) for pair in turned]
    if draw.order == "both":
        shown = [(pair, members) for pair in pairs for members in arrangements]
    else:
        drawn = drawn_orders(len(arrangements), count, draw.order, rng, draw.group)
        shown = [(pair, arrangements[place]) for pair, place in zip(pairs, drawn, strict=True)]
    mixed = (shown[i] for i in rng.permutation(len(shown)))
    return [trial_of(pair, members, repeat) for pair, members in mixed]


def drawn_orders(orders: int, count: int, how: str, rng: np.random.Generator, group: int = 0) -> IntArray:
    """Which of so many orders each of `count` pairs is shown in, from 0."""
    if how == "random":
        return np.asarray(orders - 1 - rng.integers(0, orders, count))
    if how == "balanced":
        # A count that does not divide leaves pairs over; which way they go is drawn too.
        return np.asarray(rng.permutation((np.arange(count) + int(rng.integers(0, orders))) % orders))
    return np.full(count, group % orders)
