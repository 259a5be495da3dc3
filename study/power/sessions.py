"""Studies for `segue power` one after another: whole sessions and the whole analysis, to check those drawn at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

from study.analysis.analyse import Analysis, analyse_folder
from study.arrays import BoolArray
from study.experiment.observers import person, respond
from study.experiment.plan import Plan
from study.experiment.session import open_session, walk
from study.power.curve import Run
from study.power.design import Design
from study.tasks.registry import answer_columns
from study.tasks.trial import Trial


def whole_sessions(design: Design, found: Callable[[Analysis], bool]) -> Run:
    """Return studies that take hundreds of times as long as those drawn at once, and find the same.

    Each participant goes through a whole session, each study through the whole analysis; `found` says whether that
    found what there is.
    """

    def run(rng: np.random.Generator, studies: int, sizes: Sequence[int]) -> BoolArray:
        verdicts = np.zeros((studies, len(sizes)), dtype=bool)
        for number in range(studies):
            seed = int(rng.integers(2**31))
            parts = [_session(design, plan, seed) for plan in design.plans[: max(sizes)]]
            for place, size in enumerate(sizes):
                table = pd.concat(parts[:size], ignore_index=True)
                answers, checks = table[table["role"] == "trial"], table[table["role"] == "check"]
                analysis = analyse_folder(design.protocol, answers, checks, rules=design.rules, resamples=10)
                verdicts[number, place] = found(analysis)
        return verdicts

    return run


def _session(design: Design, plan: Plan, seed: int) -> pd.DataFrame:
    """A simulated participant's answers to the study, through the session that real front ends run."""
    who = person(design.settings, plan.participant, seed)
    own = _renumbered([trial for trial in plan.trials if trial.study == design.study.name])
    courses = tuple(replace(course, first=len(own) + 1) for course in plan.courses if course.study == design.study.name)
    state = open_session(design.protocol, replace(plan, trials=own, courses=courses), passed=("consent", "form"))
    rows = [
        {"participant": plan.participant, **answer_columns(trial, answer)}
        for trial, answer in walk(state, partial(respond, who))
    ]
    return pd.DataFrame(rows)


def _renumbered(trials: Sequence[Trial]) -> tuple[Trial, ...]:
    return tuple(replace(trial, trial=number) for number, trial in enumerate(trials, start=1))
