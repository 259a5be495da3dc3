"""Studies for `segue power` one after another: whole sessions and the whole analysis, to check those drawn at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from study.arrays import BoolArray
from study.experiment.observers import person, respond
from study.experiment.plan import Plan
from study.experiment.session import open_session, walk
from study.experiment.steps import Step
from study.power.curve import Run
from study.power.design import Design, Effect
from study.tasks.registry import answer_columns
from study.tasks.trial import Trial


def whole_sessions(design: Design, effect: Effect) -> Run:
    """Return studies that take hundreds of times as long as those drawn at once, and find the same.

    Each participant goes through a whole session, each study through the analysis in which the effect is to be found.
    """

    def run(rng: np.random.Generator, studies: int, sizes: Sequence[int]) -> BoolArray:
        verdicts = np.zeros((studies, len(sizes)), dtype=bool)
        for number in range(studies):
            seed = int(rng.integers(2**31))
            leanings = _leanings(design, effect.motion_sd, rng)
            parts = [_session(design, plan, seed, leanings) for plan in design.plans[: max(sizes)]]
            for place, size in enumerate(sizes):
                table = pd.concat(parts[:size], ignore_index=True)
                answers, checks = table[table["role"] == "trial"], table[table["role"] == "check"]
                verdicts[number, place] = effect.found(effect.analysed(design, answers, checks))
        return verdicts

    return run


def _leanings(design: Design, motion_sd: float, rng: np.random.Generator) -> dict[tuple[str, str], float]:
    """How well each motion suits each method in one study; nothing where motions don't differ."""
    films = sorted({trial.motion for own in design.trials() for trial in own}) if motion_sd else []
    each = motion_sd / np.sqrt(2.0)
    return {(film, method): each * float(rng.standard_normal()) for film in films for method in design.study.methods}


def _session(design: Design, plan: Plan, seed: int, leanings: Mapping[tuple[str, str], float]) -> pd.DataFrame:
    """A simulated participant's answers to the study, through the session that real front ends run."""
    who = person(design.settings, plan.participant, seed)
    own = _renumbered([trial for trial in plan.trials if trial.study == design.study.name])
    courses = tuple(replace(course, first=len(own) + 1) for course in plan.courses if course.study == design.study.name)
    state = open_session(design.protocol, replace(plan, trials=own, courses=courses), passed=("consent", "form"))

    def answer(trial: Trial, step: Step) -> tuple[str | None, float | None]:
        a, b = (leanings.get((trial.motion, method), 0.0) for method in (trial.methods[0], trial.methods[-1]))
        return respond(replace(who, lean=who.lean + a - b), trial, step)

    rows = [{"participant": plan.participant, **answer_columns(trial, given)} for trial, given in walk(state, answer)]
    return pd.DataFrame(rows)


def _renumbered(trials: Sequence[Trial]) -> tuple[Trial, ...]:
    return tuple(replace(trial, trial=number) for number, trial in enumerate(trials, start=1))
