"""How many participants a study needs, by simulation through the real plan and the real analysis.

In: a protocol, its pairs of stimuli, and effects. Out: power by number of participants.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from renderer.workers import Where
from study.analysis.exclusions import rules_of
from study.arrays import BoolArray
from study.errors import AnalysisError
from study.experiment.plan import draw_plan
from study.power.curve import Run, power_curve
from study.power.design import Design, Effect, MotionsPoint, PlannedStudy
from study.power.registry import effect_of
from study.power.sessions import whole_sessions
from study.power.usual import USUAL

if TYPE_CHECKING:
    from study.experiment.plan import Plan
    from study.experiment.protocol.whole import Protocol, StudySpec
    from study.tasks.trial import Pair

AT_ONCE = 250
"""Studies drawn and analysed together: enough to be fast, few enough for little memory."""


def plans_of(protocol: Protocol, pairs: Sequence[Pair], participants: int) -> tuple[Plan, ...]:
    """The real plans of this many participants."""
    return tuple(draw_plan(protocol, pairs, f"power-{place:03}", group=place) for place in range(participants))


def chosen_study(protocol: Protocol, name: str | None) -> StudySpec:
    """The study asked for, or the only one.

    Raises
    ------
    AnalysisError
        When there is more than one to choose from, or none of that name.
    """
    names = ", ".join(study.name for study in protocol.studies)
    if name is None and len(protocol.studies) > 1:
        raise AnalysisError(f"{protocol.name}: expected --study with one of {names}")
    for study in protocol.studies:
        if name in (None, study.name):
            return study
    raise AnalysisError(f"{protocol.name}: expected one of the studies {names}, found {name!r}")


@dataclass(frozen=True, eq=False)
class _Studies:
    """Simulated studies of a protocol, as plain data that other processes can be sent; a `Run`."""

    protocol: Protocol
    study: StudySpec
    pairs: Sequence[Pair]
    participants: int
    options: Mapping[str, Any]
    motions: int | None = None

    def __call__(self, rng: np.random.Generator, studies: int, sizes: Sequence[int]) -> BoolArray:
        """What each study found."""
        return _run_of(self)(rng, studies, sizes)


@lru_cache(maxsize=4)
def _planned(asked: _Studies) -> tuple[Design, Effect]:
    effect = effect_of(asked.study, asked.options, asked.protocol.analysis)
    plans = plans_of(asked.protocol, asked.pairs, asked.participants)
    rules = rules_of(asked.protocol.analysis.exclusions)
    return Design(asked.protocol, asked.study, plans, effect.observer, rules), effect


@lru_cache(maxsize=4)
def _run_of(asked: _Studies) -> Run:
    design, effect = _planned(asked)
    if asked.motions is not None:
        assert effect.with_motions is not None, "refused before"
        return effect.with_motions(design, asked.motions)
    return whole_sessions(design, effect) if asked.options["sessions"] else effect.study(design)


def plan_power(
    protocol: Protocol,
    study: StudySpec,
    pairs: Sequence[Pair],
    sizes: Sequence[int],
    options: Mapping[str, Any],
    progress: Callable[[int, int], None] | None = None,
    workers: Where = 1,
) -> PlannedStudy:
    """Power for numbers of participants; `options` replace those of `USUAL`, `workers` are as for `power_curve`.

    Raises
    ------
    AnalysisError
        Where other numbers of motions are asked for, and the study is planned with its own alone.
    """
    options = {**USUAL, **options}
    asked = _Studies(protocol, study, pairs, max(sizes), options)
    design, effect = _planned(asked)
    slow = options["sessions"] or effect.slow
    studies = options["studies"] or (200 if slow else 1000)
    if options["motions"] and effect.with_motions is None:
        raise AnalysisError(f"{study.name}: expected no --motions for this study, which is planned with its own alone")
    settings: dict[str, Any] = {"studies": studies, "target": options["target"], "seed": options["seed"]}
    settings["at_once"] = 10 if slow else AT_ONCE
    settings["workers"] = workers
    found = power_curve(asked, sizes, **settings, progress=progress)
    surface = []
    for count in options["motions"]:
        own = power_curve(replace(asked, motions=count), sizes, **settings)
        surface.append(MotionsPoint(count, own.points, own.needed))
    return PlannedStudy(
        protocol=protocol.name,
        study=study.name,
        task=study.task,
        effect={**effect.stated, "missed": options["missed"]},
        icc=effect.icc,
        test=effect.test,
        aim=effect.aim,
        points=found.points,
        target=found.target,
        needed=found.needed,
        note="; ".join(filter(None, (found.note, effect.beside(design)))),
        simulations=studies,
        through="whole sessions" if options["sessions"] else "plan, observers, exclusions and default test",
        seed=options["seed"],
        by_motions=tuple(surface),
        answers_per_participant=effect.answers(design),
    )
