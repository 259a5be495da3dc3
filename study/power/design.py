"""What a study for `segue power` is made of: a protocol's real plans and a stated effect.

Answers come from the observer models of `segue simulate`, answer window, inattention and the protocol's exclusions
included. Hundreds of studies are drawn and analysed at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from study.analysis.analyse import Analysis, analyse_folder
from study.analysis.exclusions import Rules, exclude
from study.arrays import BoolArray, FloatArray
from study.experiment.plan import Plan
from study.experiment.protocol.whole import Protocol, StudySpec
from study.power.curve import PowerPoint, Run
from study.tasks.observer import ObserverSettings
from study.tasks.registry import task_of
from study.tasks.trial import Trial


@dataclass(frozen=True, eq=False)
class Design:
    """What is simulated."""

    protocol: Protocol
    study: StudySpec
    """`protocol`, `study`: of the session, and which of its studies."""
    plans: tuple[Plan, ...]
    """Real plans, one a participant, at least as many as the largest study has."""
    settings: ObserverSettings
    """The observer that the stated effects amount to."""
    rules: Rules
    """The protocol's exclusions."""

    def trials(self, role: str = "trial") -> list[list[Trial]]:
        """The study's own trials of each plan."""
        return [
            [trial for trial in plan.trials if trial.study == self.study.name and trial.role == role]
            for plan in self.plans
        ]

    @property
    def window_s(self) -> float | None:
        """How long an answer may take; ratings have no limit."""
        return self.protocol.timing.answer_s if task_of(self.study).timed else None


@dataclass(frozen=True)
class MotionsPoint:
    """How many participants a study needs with this many motions; `points` and `needed` as in `Power`."""

    motions: int
    points: tuple[PowerPoint, ...]
    needed: int | None


@dataclass(frozen=True)
class PlannedStudy:
    """How many participants a study needs, with all that this rests on."""

    protocol: str
    study: str
    task: str
    """`protocol`, `study`, `task`: what is planned."""
    effect: Mapping[str, float]
    """Its numbers, by name, the share of trials without a response among them."""
    icc: float | None
    test: str
    aim: str
    """`icc`, `test`, `aim`: as in `Effect`."""
    points: tuple[PowerPoint, ...]
    target: float
    needed: int | None
    note: str
    """`points`, `target`, `needed`, `note`: as in `Power`."""
    simulations: int
    """Simulated studies."""
    through: str
    """What each of them went through."""
    seed: int
    """Of the simulation."""
    by_motions: tuple[MotionsPoint, ...]
    """The same with other numbers of motions, where these were asked for."""
    answers_per_participant: int
    """On average, where trials depend on the responses."""


def _whole(design: Design, answers: pd.DataFrame, checks: pd.DataFrame) -> Analysis:
    """The whole analysis."""
    return analyse_folder(design.protocol, answers, checks, rules=design.rules, resamples=10)


@dataclass(frozen=True, eq=False)
class Effect:
    """What a study is to find."""

    observer: ObserverSettings
    """Who answers as the effect has it."""
    stated: Mapping[str, float]
    """Its numbers, by name."""
    icc: float | None
    """Intraclass correlation of a participant's answers; None where the effect is not stated by one."""
    test: str
    aim: str
    """`test`, `aim`: what finds it, and what that is, in words: "to {aim} in 80% of studies"."""
    study: Callable[[Design], Run]
    """Simulates and analyses many studies at once."""
    found: Callable[[Any], bool]
    """Whether the analysis of one study found it."""
    with_motions: Callable[[Design, int], Run] | None = None
    """The same with so many motions instead of the protocol's; None where that can't be planned."""
    analysed: Callable[[Design, pd.DataFrame, pd.DataFrame], Any] = _whole
    """The analysis that `found` looks at, of a study's answers and of those to its attention checks."""
    motion_sd: float = 0.0
    """By how much a leaning between two methods varies over motions, standard deviation in logits."""
    slow: bool = False
    """Whether a study takes so long that fewer are simulated."""
    answers: Callable[[Design], int] = lambda design: len(design.trials()[0])
    """How many trials of the study a participant answers, on average."""
    beside: Callable[[Design], str] = lambda _: ""
    """What another procedure would take, in words."""


def motions_of(trials: Sequence[Sequence[Trial]]) -> FloatArray:
    """Return which motion each trial shows, shape (participants, trials, motions), 0 or 1."""
    names = sorted({trial.motion for own in trials for trial in own})
    return np.array([[[float(trial.motion == name) for name in names] for trial in own] for own in trials])


def times(design: Design, rng: np.random.Generator, ease: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return response times in seconds, and which answers were given in time (as `observers.respond` draws them)."""
    settings = design.settings
    median = settings.response_median_s * (1.5 - 0.5 * ease)
    response_s = median * np.exp(settings.response_log_sd * rng.standard_normal(ease.shape))
    inattentive = rng.random(ease.shape) < settings.missed
    late = inattentive | (response_s > design.window_s) if design.window_s is not None else np.zeros(ease.shape, bool)
    return response_s, np.asarray(~late)


def kept_of(design: Design, rng: np.random.Generator, response_s: FloatArray, given: BoolArray) -> BoolArray:
    """Return which answers the analysis counts: those given, and not excluded by the protocol's rules."""
    if design.rules == Rules():
        return given

    studies, people, trials = given.shape
    who = np.repeat(np.arange(studies * people), trials)
    table = pd.DataFrame(
        {
            "participant": who,
            "answer": _words(given, "given"),
            "response_s": np.where(given.ravel(), response_s.ravel(), np.nan),
        }
    )
    kept, _ = exclude(table, design.rules, _checks(design, rng, studies, people))
    left = np.zeros(len(table), dtype=bool)
    left[kept.index.to_numpy()] = True
    return np.asarray(given & left.reshape(given.shape))


def _checks(design: Design, rng: np.random.Generator, studies: int, people: int) -> pd.DataFrame:
    """Answers to attention checks: right wherever they were given in time."""
    count = len(design.trials("check")[0])
    _, given = times(design, rng, np.ones((studies, people, count)))
    who = np.repeat(np.arange(studies * people), count)
    return pd.DataFrame({"participant": who, "answer": _words(given, "right"), "expected": "right"})


def _words(given: BoolArray, word: str) -> NDArray[np.object_]:
    """The word where an answer was given, None where not."""
    words: NDArray[np.object_] = np.array([None, word], dtype=object)
    return np.asarray(words[given.ravel().astype(int)], dtype=object)
