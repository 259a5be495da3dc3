"""Hecht, Shlaer & Pirenne 1942, "Energy, quanta, and vision", J. Gen. Physiol. 25: frequency of seeing.

Table V: percent of flashes seen at each number of quanta at the cornea, by three observers, two of them twice. The
values and the numbers of flashes agree with the data set `HSP` of the R package MPDiR (Knoblauch & Maloney 2012), which
gives Table V as its source. Their Figure 7 lays Poisson distributions through the first runs: observers see where at
least 6 (SH), 7 (SS) and 5 (MHP) quanta are absorbed. Their abstract puts the threshold, 60% seen, at 54 to 148 quanta.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.stats import gamma

from study.analysis.psychometric.model import make_model
from study.analysis.psychometric.posterior import PsychometricFit, fit_psychometric, threshold_at

# Quanta, percent seen, number of flashes at each, quanta of the Poisson curve.
SEEN = {
    "SH": ([46.9, 73.1, 113.8, 177.4, 276.1, 421.7], [0.0, 9.4, 33.3, 73.5, 100.0, 100.0], 35, 6),
    "SS": ([24.1, 37.6, 58.6, 91.0, 141.9, 221.3], [0.0, 4.0, 18.0, 54.0, 94.0, 100.0], 50, 7),
    "MHP": ([37.6, 58.6, 91.0, 141.9, 221.3, 342.8], [6.0, 6.0, 24.0, 66.0, 88.0, 100.0], 50, 5),
    "SH again": ([37.1, 58.5, 92.9, 148.6, 239.3, 386.4], [0.0, 7.5, 40.0, 80.0, 97.5, 100.0], 40, 6),
    "SS again": ([23.5, 37.1, 58.5, 92.9, 148.6, 239.3], [0.0, 0.0, 12.0, 44.0, 94.0, 100.0], 50, 7),
}


def fitted(observer: str) -> PsychometricFit:
    quanta, percent, flashes, _ = SEEN[observer]
    seen = np.round(np.array(percent) * flashes / 100)
    model = make_model("yes-no", guess=0.0, lapse=0.0)
    fit = fit_psychometric(np.log10(quanta), seen, np.full(len(seen), flashes), model)
    assert isinstance(fit, PsychometricFit)
    return fit


@pytest.mark.parametrize("observer", list(SEEN))
def test_thresholds_lie_between_54_and_148_quanta(observer: str) -> None:
    found = threshold_at(fitted(observer), 0.6)
    assert found.value is not None
    assert 54 <= 10**found.value <= 148.5


@pytest.mark.parametrize("observer", list(SEEN))
def test_the_published_number_of_quanta_has_a_width_inside_the_interval(observer: str) -> None:
    """Seeing n absorbed quanta or more: over log quanta a curve whose width depends on n alone."""
    quanta = SEEN[observer][3]
    width = np.log10(gamma.ppf(0.95, quanta)) - np.log10(gamma.ppf(0.05, quanta))
    interval = fitted(observer).width.interval
    assert interval.low is not None
    assert interval.low < width < (interval.high or np.inf)
    assert interval.low > 0.6 * width


@pytest.mark.parametrize("observer", list(SEEN))
def test_the_published_poisson_curve_gives_the_same_threshold(observer: str) -> None:
    quanta, percent, flashes, number = SEEN[observer]
    seen = np.array(percent) / 100

    def loss(log_efficiency: float) -> float:
        p = np.clip(gamma.cdf(np.array(quanta) * 10**log_efficiency, number), 1e-9, 1 - 1e-9)
        return -float((flashes * (seen * np.log(p) + (1 - seen) * np.log1p(-p))).sum())

    best = minimize_scalar(loss, bounds=(-2.5, 0), method="bounded").x
    published = np.log10(gamma.ppf(0.6, number)) - best
    found = threshold_at(fitted(observer), 0.6)
    assert found.value == pytest.approx(published, abs=0.03)
