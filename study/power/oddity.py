"""The effect of a forced choice: thresholds, halfway from chance to always right, told with a precision."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

from study.analysis.analyse import Analysis
from study.analysis.estimates import Interval
from study.analysis.oddity.analyse import ForcedChoice
from study.analysis.psychometric.analyse import typical_threshold
from study.analysis.psychometric.mixed import TypicalThreshold
from study.analysis.psychometric.model import make_model
from study.arrays import FloatArray
from study.experiment.protocol.studies import AnalysisSettings
from study.experiment.protocol.whole import StudySpec
from study.models.forced import FORCED, Forced
from study.models.population import probability_found
from study.power.curve import Run
from study.power.design import Design, Effect
from study.power.same_different import Conditions, level_study, narrow, threshold_numbers
from study.tasks.observer import ObserverSettings, default_observer


def forced_effect(study: StudySpec, options: Mapping[str, float], decided: AnalysisSettings) -> Effect:
    """Return thresholds shorter and longer, how participants differ, and how precisely both are to be told."""
    precision, confidence, forced = options["precision"], 1 - decided.alpha, FORCED[study.task]
    return Effect(
        **threshold_numbers(partial(forced_observer, forced), options),
        test=f"width of the mixed model's {100 * confidence:g}% intervals of a typical participant's thresholds",
        aim=f"tell both thresholds to ± {precision:g} frames",
        study=lambda design: forced_study(forced, design, precision, confidence),
        found=lambda analysis: forced_found(analysis, study.name, precision),
    )


def forced_observer(forced: Forced, shorter: float, longer: float, spread: float, missed: float) -> ObserverSettings:
    """An observer who, where nothing lapses, is right halfway between chance and always at these differences."""
    settings, reached = default_observer(), forced.at_threshold
    slopes = {"d_prime_shorter": reached / shorter, "d_prime_longer": reached / longer}
    typical = replace(settings.same_different, log_sensitivity_sd=spread, **slopes)
    return replace(settings, same_different=typical, missed=missed)


def forced_found(analysis: Analysis, name: str, precision: float) -> bool:
    """Return whether the intervals of the thresholds of all sides are as narrow as asked."""
    result = analysis.of(ForcedChoice).get(name)
    return result is not None and _told([function.mixed for function in result.functions.values()], precision)


def _told(found: Sequence[TypicalThreshold | str | None], precision: float) -> bool:
    known = [one for one in found if isinstance(one, TypicalThreshold) and one.threshold is not None]
    return len(known) == len(found) and narrow([Interval(one.low, one.high) for one in known], precision)


def forced_study(forced: Forced, design: Design, precision: float, confidence: float) -> Run:
    """Whether the intervals of a typical participant's thresholds are as narrow as asked."""
    model = make_model("2afc", choices=forced.choices)

    def told(conditions: Conditions, right: FloatArray, shown: FloatArray) -> bool:
        table = counts_table(conditions, right, shown)
        table["level"], side = table["difference"].abs(), np.sign(table["difference"])
        parts = [part for sign in (-1, 1) if len(part := table[side == sign])]
        return _told([typical_threshold(part, model, confidence) for part in parts], precision)

    return level_study(design, partial(probability_found, forced), forced.chance, told)


def counts_table(conditions: Conditions, yes: FloatArray, shown: FloatArray) -> pd.DataFrame:
    """Return counts, shape (participants, conditions), as a table of `participant`, `motion`, `difference`, `yes`,
    `shown`; without what was not shown.
    """
    people = len(yes)
    counts = {"yes": yes.ravel(), "shown": shown.ravel(), "motion": np.tile(conditions.motions, people)}
    counts["difference"] = np.tile(conditions.differences, people)
    who = np.repeat(np.arange(people), len(conditions.motions)).astype(str)
    return pd.DataFrame({"participant": who, **counts})[counts["shown"] > 0].copy()
