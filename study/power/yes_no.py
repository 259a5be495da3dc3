"""The effect of a yes-no study: thresholds, to be told with a stated precision."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from scipy.special import ndtri

from study.analysis.analyse import Analysis
from study.analysis.estimates import Interval
from study.analysis.psychometric.analyse import BelievedThreshold
from study.analysis.yes_no.analyse import YesNo, sensitivities
from study.arrays import FloatArray
from study.experiment.protocol.studies import AnalysisSettings
from study.experiment.protocol.whole import StudySpec
from study.models.population import probability_yes
from study.power.curve import Run
from study.power.design import Design, Effect
from study.power.oddity import counts_table
from study.power.same_different import Conditions, level_study, narrow, threshold_numbers
from study.tasks.observer import ObserverSettings, default_observer

USUAL_SHARE = 0.75


def yes_no_effect(study: StudySpec, options: Mapping[str, float], decided: AnalysisSettings) -> Effect:
    """Return thresholds shorter and longer, how participants differ, and how precisely both are to be told."""
    precision, confidence = options["precision"], 1 - decided.alpha
    return Effect(
        **threshold_numbers(yes_no_observer, options),
        test=f"width of the mixed probit model's {100 * confidence:g}% intervals of a typical participant's thresholds",
        aim=f"tell both thresholds to ± {precision:g} frames",
        study=lambda design: yes_no_study(design, precision, decided.threshold, confidence),
        found=lambda analysis: yes_no_found(analysis, study.name, precision),
    )


def yes_no_observer(shorter: float, longer: float, spread: float, missed: float) -> ObserverSettings:
    """An observer who says "yes" in 75% of the trials at these differences."""
    settings = default_observer()
    own = settings.same_different
    reached = float(ndtri((USUAL_SHARE - own.lapse / 2) / (1 - own.lapse))) + own.criterion / 2
    slopes = {"d_prime_shorter": reached / shorter, "d_prime_longer": reached / longer}
    typical = replace(own, log_sensitivity_sd=spread, criterion_sd=spread, **slopes)
    return replace(settings, same_different=typical, missed=missed)


def yes_no_found(analysis: Analysis, name: str, precision: float) -> bool:
    """Return whether the intervals of the thresholds of all sides are as narrow as asked."""
    result = analysis.of(YesNo).get(name)
    return result is not None and _told(list(result.thresholds.values()), precision)


def _told(found: Sequence[BelievedThreshold], precision: float) -> bool:
    return narrow([Interval(one.low, one.high) for one in found], precision)


def yes_no_study(design: Design, precision: float, share: float, confidence: float) -> Run:
    """Whether the intervals of a typical participant's thresholds are as narrow as asked."""

    def told(conditions: Conditions, yes: FloatArray, shown: FloatArray) -> bool:
        found = sensitivities(counts_table(conditions, yes, shown), share, confidence)
        return _told([one.threshold for one in found.values()], precision)

    return level_study(design, probability_yes, 0.5, told)
