"""Data that say little: whatever comes in, the answer is a statement, never a crash, a silent NaN or a false certainty.

Tables are drawn at random from kinds of trouble: one level, one participant, all answers alike, perfect performance,
missing cells, no answers, weights far apart, levels far apart, shares that fall. Seeds stand in the test's name.
"""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pandas as pd
import pytest

from study.analysis.psychometric.analyse import analyse_psychometric
from study.analysis.psychometric.likelihood import fit_likelihood
from study.analysis.psychometric.model import make_model
from study.analysis.psychometric.posterior import PsychometricFit, curve_of, fit_psychometric, threshold_at
from study.analysis.same_different.analyse import analyse_jnd
from study.analysis.same_different.d_prime import d_prime
from study.analysis.to_json import to_json
from study.errors import AnalysisError

SIGMOIDS = ("normal", "logistic", "gumbel", "weibull")


def without_nan(value: Any, path: str = "") -> None:
    """Every number is finite, and where there is none a sentence stands near by."""
    json.dumps(value, allow_nan=False)
    if isinstance(value, dict):
        for key, item in value.items():
            without_nan(item, f"{path}.{key}")
    elif isinstance(value, list):
        for place, item in enumerate(value):
            without_nan(item, f"{path}[{place}]")
    elif isinstance(value, float):
        assert math.isfinite(value), path


def counts_of(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Levels, answers "yes" and answers, with some trouble."""
    count = int(rng.integers(1, 9))
    levels = np.sort(rng.choice([1, 0.001, 1e4, 7.5], 1) * np.arange(1, count + 1.0))
    if rng.random() < 0.2:
        levels = np.cumsum(rng.exponential(1, count) ** 4) + 1e-6
    shown = rng.choice([0, 1, 2, 5, 30, 400], count).astype(float)
    kind = rng.integers(6)
    share = [np.zeros(count), np.ones(count), np.full(count, 0.5), np.linspace(1, 0, count), rng.random(count),
             (np.arange(count) > count / 2).astype(float)][kind]  # fmt: skip
    return levels, rng.binomial(shown.astype(int), share).astype(float), shown


@pytest.mark.parametrize("seed", range(60))
def test_psychometric_functions(seed: int) -> None:
    rng = np.random.default_rng(seed)
    levels, yes, shown = counts_of(rng)
    model = make_model(str(rng.choice(["2afc", "yes-no"])), sigmoid=str(rng.choice(SIGMOIDS)))
    fit, best = fit_psychometric(levels, yes, shown, model), fit_likelihood(levels, yes, shown, model)
    answered = levels[shown > 0]
    if isinstance(fit, str):
        assert fit == best
        assert len(answered) < 2
        return
    for estimate in (fit.threshold, fit.width, fit.lapse, fit.guess, fit.overdispersion, threshold_at(fit, 0.8)):
        if estimate.value is None:
            assert estimate.note
        else:
            assert math.isfinite(estimate.value)
        for end in (estimate.interval.low, estimate.interval.high):
            assert end is None or math.isfinite(end)
    if fit.threshold.value is not None:
        assert answered.min() <= fit.threshold.value <= answered.max()
        low, high = fit.threshold.interval.low, fit.threshold.interval.high
        assert low is None or low <= fit.threshold.value
        assert high is None or high >= fit.threshold.value
    assert np.isfinite(curve_of(fit)).all()
    assert not isinstance(best, str)
    if best.threshold is None:
        assert best.note
    assert math.isfinite(best.log_likelihood)


@pytest.mark.parametrize(
    ("yes", "shown"),
    [([0] * 6, [20] * 6), ([20] * 6, [20] * 6), ([10] * 6, [20] * 6), ([20, 17, 12, 9, 4, 0], [20] * 6)],
    ids=["all no", "all yes", "chance", "falls"],
)
@pytest.mark.parametrize("task", ["2afc", "yes-no"])
def test_no_threshold_is_sure_where_there_is_none(yes: list[int], shown: list[int], task: str) -> None:
    fit = fit_psychometric(np.arange(6.0), yes, shown, make_model(task))
    assert isinstance(fit, PsychometricFit)
    certain = fit.threshold.interval.low is not None and fit.threshold.interval.high is not None
    assert fit.threshold.value is None or not certain


def study_of(rng: np.random.Generator) -> pd.DataFrame:
    """Trials of several people, with some trouble."""
    rows = []
    for person in range(int(rng.integers(1, 6))):
        levels, yes, shown = counts_of(rng)
        rows += [
            {"participant": person, "level": a, "yes": b, "shown": c}
            for a, b, c in zip(levels, yes, shown, strict=True)
        ]
    return pd.DataFrame(rows)


@pytest.mark.parametrize("seed", range(12))
def test_psychometric_studies(seed: int) -> None:
    result = to_json(analyse_psychometric(study_of(np.random.default_rng(seed))))
    without_nan(result)
    assert result["answer"]
    if result["group"]["mean_threshold"] is None:
        assert result["group"]["note"]


def answers_of(rng: np.random.Generator) -> pd.DataFrame:
    """Same-different answers, with some trouble."""
    levels = rng.choice([-20.0, -15, -10, -5, 0, 5, 10, 20], int(rng.integers(1, 8)), replace=False)
    chance = float(rng.choice([0.0, 1.0, 0.5, -1.0]))
    rows: list[dict[str, Any]] = []
    for person in range(int(rng.choice([1, 2, 3, 9]))):
        for level in levels:
            for trial in range(int(rng.choice([0, 1, 6]))):
                p = min(abs(level) / 15, 1.0) if chance < 0 else chance
                answer = "different" if rng.random() < p else "same"
                rows.append({"participant": f"p{person}", "motion": f"m{trial % 2}", "difference_frames": level,
                             "reference_first": bool(trial % 2), "task": "same-different",
                             "answer": None if rng.random() < 0.1 else answer})  # fmt: skip
    names = ["participant", "motion", "difference_frames", "reference_first", "task", "answer"]
    return pd.DataFrame(rows, columns=names)


@pytest.mark.parametrize("seed", range(40))
def test_same_different_studies(seed: int) -> None:
    result = to_json(analyse_jnd(answers_of(np.random.default_rng(seed)), resamples=40))
    without_nan(result)
    assert result["answer"]
    for kind in ("model", "mixed"):
        if result[kind] is None:
            assert result[f"{kind}_note"]
    fits = [result["published"], *((result["model"] or {}).get(name, {}) for name in ("jnd", "corrected"))]
    for thresholds in [*fits, (result["mixed"] or {}).get("typical", {})]:
        for side, found in thresholds.items():
            if found["frames"] is None:
                assert found["note"], side
                assert found["status"] != "reached"
            elif found["interval"]["low"] is None and found["interval"]["high"] is None:
                assert found["note"] or found["standard_error"] is None, side


@pytest.mark.parametrize("shown", [6, 1])
@pytest.mark.parametrize("answer", ["same", "different"])
def test_everybody_answers_alike(answer: str, shown: int) -> None:
    rows = [
        {"participant": f"p{person}", "difference_frames": float(level), "answer": answer}
        for person in range(5)
        for level in (-10, -5, 0, 5, 10)
        for _ in range(shown)
    ]
    result = analyse_jnd(pd.DataFrame(rows), resamples=20)
    assert result.model is None
    assert result.mixed is None
    assert f'every answer was "{answer}"' in result.model_note
    assert "No model was fitted" in result.answer


def test_perfect_performance_leaves_the_threshold_open_below() -> None:
    """Between no difference and the smallest one shown: there is no telling where."""
    rows = [
        {
            "participant": f"p{person}",
            "difference_frames": float(level),
            "answer": "same" if level == 0 else "different",
        }
        for person in range(8)
        for level in (-10, -5, 0, 5, 10)
        for _ in range(6)
    ]
    result = analyse_jnd(pd.DataFrame(rows), resamples=20)
    assert result.model is not None
    assert set(result.model.jnd) == {"shorter", "longer"}
    for found in result.model.jnd.values():
        assert found.frames is None or found.interval.low is None or found.note
    assert result.mixed is None


@pytest.mark.parametrize(
    "counts",
    [(0, 0, 3, 10), (3, 10, 0, 0), (0, 10, 0, 10), (10, 10, 10, 10), (10, 10, 0, 10), (0, 10, 10, 10), (1, 1, 0, 1)],
    ids=["no different pairs", "no same pairs", "never", "always", "perfect", "turned round", "one pair of each"],
)
def test_tables_of_hits_and_false_alarms(counts: tuple[float, float, float, float]) -> None:
    found = d_prime(*counts)
    if 0 in (counts[1], counts[3]):
        assert set(vars(found).values()) == {None}
        return
    value, low, high = found.d_prime, found.low, found.high
    assert value is not None
    assert low is not None
    assert 0 <= low <= value
    assert high is None or high >= value
    if counts[0] == counts[1] and counts[2] in (0, counts[3]):
        assert high is None


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: d_prime(11, 10, 0, 10), "found 11 of 10 pairs"),
        (lambda: d_prime(math.nan, 10, 0, 10), "found nan of 10 pairs"),
        (lambda: fit_psychometric([1, 2], ["a", "b"], [3, 3]), "numbers"),
        (lambda: fit_psychometric([1, 2], [1, 2], [3, math.inf]), "finite"),
        (lambda: fit_psychometric([1, 1e308], [1, 2], [3, 3]), "expected at most 1e.12 in levels, found 1e.308"),
        (lambda: fit_psychometric([[1, 2]], [[1, 2]], [[3, 3]]), "one shape"),
        (lambda: fit_psychometric([1, 2], [1, 2], [3, 3], confidence=95), "between 0 and 1"),
        (lambda: analyse_psychometric(pd.DataFrame({"level": [1.0]})), "none named participant"),
        (
            lambda: analyse_jnd(pd.DataFrame({"participant": ["a"], "difference_frames": ["far"], "answer": ["same"]})),
            "numbers",
        ),
        (
            lambda: analyse_jnd(pd.DataFrame({"participant": [None], "difference_frames": [1], "answer": ["same"]})),
            "found 1 row without",
        ),
        (
            lambda: analyse_jnd(
                pd.DataFrame({"participant": ["a"], "difference_frames": [math.inf], "answer": ["same"]})
            ),
            "infinite",
        ),
        (
            lambda: analyse_jnd(
                pd.DataFrame({"participant": ["a"], "difference_frames": [-1e300], "answer": ["same"]})
            ),
            "expected at most 1e.12 in difference_frames",
        ),
        (
            lambda: analyse_psychometric(
                pd.DataFrame({"participant": [None], "level": [1.0], "yes": [1], "shown": [2]})
            ),
            "found 1 row without",
        ),
        (
            lambda: analyse_jnd(pd.DataFrame({"participant": ["a"], "difference_frames": [1], "answer": ["Same"]})),
            "'Same'",
        ),
        (
            lambda: analyse_jnd(
                pd.DataFrame({"participant": ["a"], "difference_frames": [1], "answer": ["same"]}), level=75
            ),
            "between 0 and 1",
        ),
    ],
)
def test_what_cannot_be_read_is_refused(call: Any, message: str) -> None:
    with pytest.raises(AnalysisError, match=message):
        call()
