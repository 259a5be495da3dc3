"""Conditions and groups compared: against scipy's tests, by simulation, and on tables that `segue fit` reads."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from scipy import stats
from scipy.special import ndtr

from study.analysis.conditions import ALONE, BETWEEN, SLOPE, WITHIN, OwnEstimate, compare_conditions
from study.apps.cli import segue


def own(condition: str, values: list[float], first: int = 0, error: float | None = None) -> list[OwnEstimate]:
    return [
        OwnEstimate(f"p{first + place}", condition, "threshold", value, error) for place, value in enumerate(values)
    ]


def test_the_same_participants_are_compared_with_themselves() -> None:
    rng = np.random.default_rng(1)
    one, other = rng.normal(5, 2, 9), rng.normal(6, 2, 9)
    (found,) = compare_conditions([*own("a", list(one)), *own("b", list(other))], 0.9)
    expected = stats.ttest_rel(other, one)
    assert (found.test, found.of, found.participants) == (WITHIN, "b minus a", 9)
    assert (found.t, found.p_value) == (pytest.approx(expected.statistic), pytest.approx(expected.pvalue))
    assert (found.low, found.high) == pytest.approx(tuple(expected.confidence_interval(0.9)))


def test_groups_are_compared_by_welch_and_three_conditions_by_holm() -> None:
    rng = np.random.default_rng(2)
    groups = {name: rng.normal(mean, sd, n) for name, mean, sd, n in (("a", 5, 1, 8), ("b", 6, 3, 12), ("c", 8, 1, 5))}
    rows = [one for place, (name, values) in enumerate(groups.items()) for one in own(name, list(values), 100 * place)]
    found = compare_conditions(rows)
    assert {row.test for row in found} == {BETWEEN}
    for row in found:
        other, one = (groups[name] for name in row.of.split(" minus "))
        expected = stats.ttest_ind(other, one, equal_var=False)
        assert (row.t, row.p_value) == (pytest.approx(expected.statistic), pytest.approx(expected.pvalue))
        assert (row.low, row.high) == pytest.approx(tuple(expected.confidence_interval(0.95)))
    least = min(row.p_value for row in found)
    assert min(row.holm_p_value for row in found) == pytest.approx(3 * least)


def test_what_can_not_be_compared_is_said() -> None:
    (alone,) = compare_conditions([*own("a", [4.0], error=0.3), *own("b", [5.0], error=0.4)])
    assert (alone.test, alone.standard_error) == (ALONE, pytest.approx(0.5))
    assert alone.p_value == pytest.approx(2 * stats.norm.sf(2.0))
    (unknown,) = compare_conditions([*own("a", [4.0]), *own("b", [5.0], error=0.4)])
    assert unknown.in_words() == "threshold: the error of an estimate is not known"
    (few,) = compare_conditions([*own("a", [4.0, 5.0]), *own("b", [5.0], 7)])
    assert few.note == "fewer than two participants in a group"
    assert compare_conditions(own("a", [4.0])) == ()


def fitted(path: Path, rows: list[dict[str, object]], *options: str) -> dict[str, object]:
    pd.DataFrame(rows).to_csv(path, index=False)
    told = CliRunner().invoke(
        segue, ["fit", str(path), *options, "--participant", "who", "--condition", "light", "--json"]
    )
    assert told.exit_code == 0, told.output
    return dict(json.loads(told.stdout))


def test_percepts_in_two_conditions_give_their_difference(tmp_path: Path) -> None:
    """Thresholds 2 apart and slopes of one to two, drawn percept by percept from people who differ."""
    rng, rows = np.random.default_rng(4), []
    for who in range(10):
        lean = rng.normal(0, 0.6)
        for light, threshold, slope in (("dark", 4.0, 1.0), ("bright", 6.0, 0.5)):
            for level in range(-2, 13):
                seen = slope * (level - threshold - lean) + rng.standard_normal(12) > 0
                rows += [{"who": f"p{who}", "light": light, "level": level, "yes": int(one)} for one in seen]
    found = fitted(tmp_path / "a.csv", rows, "--task", "yes-no", "--level", "level", "--answer", "yes", "--guess", "0")
    assert set(found["conditions"]) == {"bright", "dark"}
    apart = {row["quantity"]: row for row in found["differences"]}
    assert {row["of"] for row in apart.values()} == {"dark minus bright"}
    assert apart["threshold"]["low"] < -2 < apart["threshold"]["high"] < -1
    assert apart[SLOPE]["low"] < np.log(2) < apart[SLOPE]["high"]
    assert apart[SLOPE]["low"] > 0.2
    assert [one["p"] is None for one in found["headline"]] == [True, True, False, False]
    assert "dark minus bright: threshold -" in found["answer"]


def test_same_different_conditions_and_each_ones_lapses(tmp_path: Path) -> None:
    rng, rows = np.random.default_rng(5), []
    for who in range(6):
        for light, slope in (("dark", 0.3), ("bright", 0.6)):
            for frames in (-12, -6, -3, 0, 3, 6, 12):
                delta = slope * abs(frames)
                share = ndtr((delta - 1.5) / 2**0.5) + ndtr((-delta - 1.5) / 2**0.5)
                said = np.where(rng.random(16) < share, "different", "same")
                rows += [{"who": f"p{who}", "light": light, "frames": frames, "said": one} for one in said]
    found = fitted(tmp_path / "b.csv", rows, "--task", "same-different", "--level", "frames", "--answer", "said")
    apart = {row["quantity"]: row for row in found["differences"]}
    assert apart[f"{SLOPE}, longer blends"]["low"] < -np.log(2) < apart[f"{SLOPE}, longer blends"]["high"] < 0
    assert apart["threshold of shorter blends"]["low"] > 0
    each = found["conditions"]["dark"]["own"]
    assert len(each) == 6
    assert all(0 <= one["lapse"] <= 0.1 for one in each)
