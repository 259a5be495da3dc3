"""What a study of each task is to find, by the task's name."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from study.errors import AnalysisError
from study.experiment.protocol.studies import AnalysisSettings
from study.experiment.protocol.whole import StudySpec
from study.power.design import Effect
from study.power.oddity import forced_effect
from study.power.preference import preference_effect
from study.power.ratings import rating_effect
from study.power.same_different import same_different_effect
from study.power.staircases import staircase_effect
from study.power.yes_no import yes_no_effect

Make = Callable[["StudySpec", Mapping[str, float], "AnalysisSettings"], Effect]
"""From a study, the numbers of its effect by name, and what was decided about the analysis."""

EFFECTS: Mapping[str, Make] = {
    "same-different": same_different_effect,
    "preference": preference_effect,
    "rating": rating_effect,
    "oddity": forced_effect,
    "2afc": forced_effect,
    "yes-no": yes_no_effect,
    "parallel-rating": rating_effect,
}

OF_PROCEDURES: Mapping[str, Make] = {"staircase": staircase_effect, "quest-plus": staircase_effect}
"""By the procedure, where trials depend on the responses."""


def effect_of(study: StudySpec, options: Mapping[str, float], decided: AnalysisSettings) -> Effect:
    """Return what a study is to find.

    Raises
    ------
    AnalysisError
        When nothing can be planned for its task.
    """
    if study.task not in EFFECTS:
        raise AnalysisError(f"{study.name}: expected one of the tasks {', '.join(EFFECTS)}, found {study.task!r}")
    return OF_PROCEDURES.get(study.procedure.name, EFFECTS[study.task])(study, options, decided)
