"""How many participants a study needs, by simulation through the real plan and the real analysis.

In: a protocol, its pairs of stimuli, and effects. Out: power by number of participants.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from study.analysis.exclusions import rules_of
from study.errors import AnalysisError
from study.experiment.plan import draw_plan
from study.power.curve import power_curve
from study.power.design import Design, MotionsPoint, PlannedStudy
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


def plan_power(
    protocol: Protocol,
    study: StudySpec,
    pairs: Sequence[Pair],
    sizes: Sequence[int],
    options: Mapping[str, Any],
    progress: Callable[[int, int], None] | None = None,
) -> PlannedStudy:
    """Power for numbers of participants; `options` replace those of `USUAL`.

    Raises
    ------
    AnalysisError
        Where other numbers of motions are asked for, and the study is planned with its own alone.
    """
    options = {**USUAL, **options}
    effect = effect_of(study, options, protocol.analysis)
    rules = rules_of(protocol.analysis.exclusions)
    design = Design(protocol, study, plans_of(protocol, pairs, max(sizes)), effect.observer, rules)
    slow = options["sessions"] or effect.slow
    studies = options["studies"] or (200 if slow else 1000)
    with_motions = effect.with_motions
    if options["motions"] and with_motions is None:
        raise AnalysisError(f"{study.name}: expected no --motions for this study, which is planned with its own alone")
    settings: dict[str, Any] = {"studies": studies, "target": options["target"], "seed": options["seed"]}
    settings["at_once"] = 10 if slow else AT_ONCE
    run = whole_sessions(design, effect) if options["sessions"] else effect.study(design)
    found = power_curve(run, sizes, **settings, progress=progress)
    surface = []
    for count in options["motions"]:
        assert with_motions is not None, "refused above"
        own = power_curve(with_motions(design, count), sizes, **settings)
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
