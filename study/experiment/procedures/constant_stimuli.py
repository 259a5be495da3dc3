"""Constant stimuli: all trials are known before the first answer, every pair in its order or orders, shuffled.

2004 section 4.2: each pair in both orders, the order of pairs and the order within a pair both at random.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from study.experiment.procedures.procedure import Draw, Settings
from study.tasks.answer import Answer
from study.tasks.trial import Trial, trial_of


@dataclass(frozen=True)
class Constant(Settings):
    """The keys of `[studies.procedure]` with `name = "constant"`: none."""

    name: ClassVar[str] = "constant"
    title: ClassVar[str] = "constant stimuli"

    def drawn(self, draw: Draw, rng: np.random.Generator) -> list[Trial]:
        """The trials of a study, repeat after repeat."""
        return [trial for repeat in range(1, draw.repeats + 1) for trial in _drawn_set(draw, repeat, rng)]


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
    pairs, order, group = draw.pairs, draw.order, draw.group
    count = len(pairs)
    if len(pairs[0].stimuli) == 1:
        if order == "by-group":
            turn = group % count
            return [trial_of(pair, (0,), repeat) for pair in [*pairs[turn:], *pairs[:turn]]]
        return [trial_of(pairs[i], (0,), repeat) for i in rng.permutation(count)]
    if order == "both":
        shown = [(pair, a_first) for pair in pairs for a_first in (True, False)]
    elif order == "random":
        shown = [(pair, bool(a)) for pair, a in zip(pairs, rng.integers(0, 2, count), strict=True)]
    elif order == "balanced":
        # An odd count leaves one pair over; which way it goes is drawn too.
        halves = (np.arange(count) + int(rng.integers(0, 2))) % 2 == 0
        shown = [(pair, bool(a)) for pair, a in zip(pairs, rng.permutation(halves), strict=True)]
    else:
        shown = [(pair, group % 2 == 0) for pair in pairs]
    return [
        trial_of(pair, (0, 1) if a_first else (1, 0), repeat)
        for pair, a_first in (shown[i] for i in rng.permutation(len(shown)))
    ]
