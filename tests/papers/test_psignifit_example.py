"""The example that psignifit 4 ships (Schuett, Harmeling, Macke & Wichmann 2016): 2AFC, 90 trials at each of 13 levels.

Its authors' tests give the fit of a cumulative normal with the lapse rate held at 1%: threshold 0.0045938671, width
0.0044734345, hardly any overdispersion (eta 5.8e-6). That is the highest point of their posterior, whose priors are
flat here, so it is close to the highest likelihood; our default is the posterior's median.
"""

from __future__ import annotations

import numpy as np
import pytest

from study.analysis.psychometric.likelihood import LikelihoodFit, fit_likelihood
from study.analysis.psychometric.model import make_model
from study.analysis.psychometric.posterior import PsychometricFit, fit_psychometric

LEVELS = np.array([1.0, 1.5, 2, 2.5, 3, 3.5, 4, 4.5, 5, 6, 7, 8, 10]) / 1000
RIGHT = np.array([45, 50, 44, 44, 52, 53, 62, 64, 76, 79, 88, 90, 90])
THRESHOLD, WIDTH = 0.0045938670588426232, 0.0044734344997461074


def test_the_maximum_is_the_published_one() -> None:
    found = fit_likelihood(LEVELS, RIGHT, np.full(13, 90), make_model(lapse=0.01))
    assert isinstance(found, LikelihoodFit)
    assert found.threshold == pytest.approx(THRESHOLD, rel=0.002)
    assert found.width == pytest.approx(WIDTH, rel=0.01)


def test_the_posterior_agrees() -> None:
    found = fit_psychometric(LEVELS, RIGHT, np.full(13, 90), make_model(lapse=0.01))
    assert isinstance(found, PsychometricFit)
    assert found.threshold.value == pytest.approx(THRESHOLD, rel=0.01)
    assert found.width.value == pytest.approx(WIDTH, rel=0.05)
    profile = fit_likelihood(LEVELS, RIGHT, np.full(13, 90), make_model(lapse=0.01))
    assert isinstance(profile, LikelihoodFit)
    assert found.threshold.interval.low == pytest.approx(profile.interval.low, rel=0.01)
    assert found.threshold.interval.high == pytest.approx(profile.interval.high, rel=0.01)
    assert (found.overdispersion.interval.high or 1.0) < 0.1
