"""Power: against the normal theory of a known test; participants' spread as stated."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.special import expit
from scipy.stats import nct, t

from study.analysis.power import logit_normal, power_curve
from study.apps.cli import run
from study.errors import AnalysisError


def test_a_t_test_has_the_power_that_theory_gives() -> None:
    def simulate(rng: np.random.Generator, participants: int) -> np.ndarray:
        return rng.normal(0.5, 1.0, participants)

    def finds(data: np.ndarray, participants: int) -> bool:
        own = data[:participants]
        return bool(own.mean() / own.std(ddof=1) * participants**0.5 > t.ppf(0.975, participants - 1))

    found = power_curve(simulate, finds, [40, 10, 20], studies=1500, target=0.8, seed=1)
    for point in found.points:
        size = point.participants
        theory = nct.sf(t.ppf(0.975, size - 1), size - 1, 0.5 * size**0.5)
        assert point.power == pytest.approx(theory, abs=0.04)
    assert found.needed is not None
    assert 29 <= found.needed <= 38
    assert power_curve(simulate, finds, [5], studies=50).needed is None


@pytest.mark.parametrize(("share", "correlation"), [(0.5, 0.2), (0.65, 0.1), (0.9, 0.3), (0.65, 0.0)])
def test_people_differ_as_stated(share: float, correlation: float) -> None:
    mean, spread = logit_normal(share, correlation)
    own = expit(mean + spread * np.random.default_rng(0).normal(size=400_000))
    assert own.mean() == pytest.approx(share, abs=0.003)
    assert own.var() / (share * (1 - share)) == pytest.approx(correlation, abs=0.005)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: power_curve(lambda _, n: n, lambda *_: True, []), "participants from 2 on"),
        (lambda: power_curve(lambda _, n: n, lambda *_: True, [5], target=1.5), "a power between 0 and 1"),
        (lambda: logit_normal(1.0, 0.1), "a share between 0 and 1"),
    ],
)
def test_refusals(call: object, message: str) -> None:
    with pytest.raises(AnalysisError, match=message):
        call()  # type: ignore[operator]


@pytest.mark.slow
@pytest.mark.parametrize("study", ["jnd", "preference"])
def test_the_verb_goes_through_a_real_protocol(study: str, capsys: pytest.CaptureFixture[str]) -> None:
    sizes = ["--participants", "4,30", "--studies", "20", "--share", "0.8", "--precision", "3"]
    names = {"jnd": "blend_length_jnd", "preference": "geodesic_vs_fixed"}
    assert run(["power", names[study], *sizes, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    powers = [point["power"] for point in found["points"]]
    assert powers[0] < powers[1]
    assert powers[1] > 0.8
    assert 4 < found["needed"] <= 30
