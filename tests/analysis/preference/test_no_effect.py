"""Equivalence, Bayes factors, and Bradley-Terry where it can't be fitted."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.stats import ttest_1samp

from study.analysis.preference.bradley_terry import BradleyTerry, fit_bradley_terry
from study.analysis.preference.no_effect import no_preference
from study.errors import AnalysisError


def test_equivalence_is_two_one_sided_tests() -> None:
    shares = np.random.default_rng(1).normal(0.52, 0.1, size=35)
    found = no_preference(shares, margin=0.1)
    above = ttest_1samp(shares, 0.4, alternative="greater").pvalue
    below = ttest_1samp(shares, 0.6, alternative="less").pvalue
    assert found.equivalence_p_value == pytest.approx(max(above, below))
    assert found.interval.low is not None
    assert found.interval.high is not None
    assert (found.equivalence_p_value < 0.05) == (found.interval.low > 0.4 and found.interval.high < 0.6)


@pytest.mark.parametrize("shares", [[], [0.5], [0.5] * 10, [1.0] * 10])
def test_no_certainty_without_spread(shares: list[float]) -> None:
    found = no_preference(shares)
    assert found.equivalence_p_value is None
    assert found.note


def test_methods_that_never_lose_have_no_finite_strength() -> None:
    found = fit_bradley_terry(list("abac"), list("bacb"), [10, 0, 5, 5], [10, 10, 10, 10], with_order=False)
    assert isinstance(found, BradleyTerry)
    always = fit_bradley_terry(list("aab"), list("bcc"), [10, 10, 5], [10] * 3, with_order=False, reference="b")
    assert isinstance(always, BradleyTerry)
    assert always.strengths[0].method == "a"
    assert always.strengths[0].value is None
    assert "a" in always.note


def separated(rng: np.random.Generator) -> tuple[list[str], list[str], np.ndarray]:
    """Few answers to pairs of four methods, mostly one-sided."""
    names, count = "abcd", int(rng.integers(6, 14))
    pairs = [rng.choice(4, 2, replace=False) for _ in range(count)]
    favoured = np.array([float((one < other) if rng.random() < 0.8 else rng.integers(2)) for one, other in pairs])
    return [names[one] for one, _ in pairs], [names[other] for _, other in pairs], favoured


@pytest.mark.parametrize("seed", range(25))
def test_strengths_are_finite_where_chains_of_answers_lead_both_ways(seed: int) -> None:
    """Ford 1957: two strengths are finitely apart exactly where each method was favoured along a chain to the other."""
    first, second, favoured = separated(np.random.default_rng([seed, 7]))
    reach = {(name, name) for name in {*first, *second}}
    reach |= {(a, b) if won else (b, a) for a, b, won in zip(first, second, favoured, strict=True)}
    for middle in "abcd":
        reach |= {(a, c) for a, b in reach for other, c in reach if b == other == middle}
    for reference in {*first, *second}:
        found = fit_bradley_terry(first, second, favoured, np.ones(len(first)), with_order=False, reference=reference)
        if isinstance(found, str):
            assert "not linked" in found
            continue
        for row in found.strengths:
            both = (row.method, reference) in reach and (reference, row.method) in reach
            assert (row.value is not None) == both, (reference, row.method)


def test_the_finite_strengths_are_those_of_the_others_alone() -> None:
    """Beside a method that never loses the others have the strengths that they have without it, by statsmodels too."""
    import statsmodels.api as sm

    rng = np.random.default_rng(8)
    rows = [(a, b, float(rng.random() < chance)) for a, b, chance in (("b", "c", 0.6), ("c", "d", 0.6), ("d", "b", 0.4))
            for _ in range(30)]  # fmt: skip
    alone = [list(part) for part in zip(*rows, strict=True)]
    every = [list(part) for part in zip(*rows, *(("a", other, 1.0) for other in "bcd" for _ in range(9)), strict=True)]
    found, expected = (
        fit_bradley_terry(first, second, favoured, np.ones(len(first)), with_order=False)
        for first, second, favoured in (every, alone)
    )
    assert isinstance(found, BradleyTerry)
    assert isinstance(expected, BradleyTerry)
    assert found.reference == expected.reference == "b"
    design = np.array([[(a == name) - (b == name) for name in "cd"] for a, b, _ in rows], dtype=float)
    theirs = sm.Logit(np.array(alone[2]), design).fit(disp=0)
    for name, value, error in zip("cd", theirs.params, theirs.bse, strict=True):
        for fit in (found, expected):
            one = next(row for row in fit.strengths if row.method == name)
            assert one.value == pytest.approx(value, abs=1e-4)
            assert one.standard_error == pytest.approx(error, rel=1e-3)
    assert found.strengths[0].method == "a"
    assert found.strengths[0].value is None
    assert (
        found.note == "a: the answers for or against it all go one way, so its distance from b has no finite estimate"
    )


def test_an_order_that_can_not_be_told_is_left_out() -> None:
    never = fit_bradley_terry(list("ab"), list("bc"), [6, 7], [10] * 2)
    assert isinstance(never, BradleyTerry)
    assert never.order is None
    assert "the orders shown cannot separate" in never.note
    decided = fit_bradley_terry(list("abacbc"), list("bacacb"), [10] * 6, [10] * 6)
    assert "every answer went to the same position" in str(decided)


def test_unlinked_methods_are_said() -> None:
    assert "not linked" in str(fit_bradley_terry(list("ac"), list("bd"), [5, 5], [10, 10], with_order=False))
    assert "fewer than two" in str(fit_bradley_terry([], [], [], []))


def test_a_method_may_be_called_order() -> None:
    """The term for the order of presentation is told from a method of that name."""
    rows = [
        ("order", "chaos", 14),
        ("chaos", "order", 9),
        ("order", "void", 16),
        ("void", "chaos", 7),
        ("void", "order", 5),
    ]
    first, second, favoured = zip(*rows, strict=True)
    renamed = [[{"order": "x"}.get(name, name) for name in names] for names in (first, second)]
    shown = [20] * len(rows)
    found = fit_bradley_terry(first, second, favoured, shown, reference="chaos")
    expected = fit_bradley_terry(*renamed, favoured, shown, reference="chaos")
    assert isinstance(found, BradleyTerry)
    assert isinstance(expected, BradleyTerry)
    assert [row.method for row in found.strengths] == ["order", "chaos", "void"]
    for one, other in zip(found.strengths, expected.strengths, strict=True):
        assert one.value == pytest.approx(other.value)
    assert found.order is not None
    assert expected.order is not None
    assert found.order.value == pytest.approx(expected.order.value)
    with pytest.raises(AnalysisError, match="one of the methods chaos, order, void as reference, found 'walk'"):
        fit_bradley_terry(first, second, favoured, shown, reference="walk")


def three_methods(rng: np.random.Generator, people: int, spread: float) -> dict[str, list[str] | np.ndarray]:
    """Answers to all pairs of three methods by people who differ; true strengths 1, 0, -0.5, first place 0.3."""
    strength = {"a": 1.0, "b": 0.0, "c": -0.5}
    first, second, who, chance = [], [], [], []
    for person in range(people):
        own = {name: value + spread * rng.normal() for name, value in strength.items()}
        for one, other in (("a", "b"), ("b", "a"), ("a", "c"), ("c", "a"), ("b", "c"), ("c", "b")) * 4:
            first.append(one)
            second.append(other)
            who.append(f"p{person}")
            chance.append(1 / (1 + np.exp(-(own[one] - own[other] + 0.3))))
    return {"first": first, "second": second, "who": who, "favoured": (rng.random(len(who)) < chance).astype(float)}


def test_strengths_rest_on_participants_where_these_differ() -> None:
    """The scatter of strengths over studies is that of the participants' standard errors, not of the answers'."""
    rng = np.random.default_rng(12)
    values, robust, naive = [], [], []
    for _ in range(120):
        data = three_methods(rng, 20, 0.8)
        common = (data["first"], data["second"], data["favoured"], np.ones(len(data["who"])))
        found = fit_bradley_terry(*common, reference="b", participants=data["who"])
        plain = fit_bradley_terry(*common, reference="b")
        assert isinstance(found, BradleyTerry)
        assert isinstance(plain, BradleyTerry)
        assert found.participants == 20
        one = next(row for row in found.strengths if row.method == "a")
        values.append(one.value)
        robust.append(one.standard_error)
        naive.append(next(row for row in plain.strengths if row.method == "a").standard_error)
    assert np.mean(robust) == pytest.approx(np.std(values), rel=0.2)
    assert np.mean(naive) < 0.75 * np.std(values)


def test_goodness_of_fit_is_the_same_from_answers_and_from_counts() -> None:
    data = three_methods(np.random.default_rng(3), 15, 0.0)
    single = fit_bradley_terry(data["first"], data["second"], data["favoured"], np.ones(len(data["who"])))
    table = pd.DataFrame(data).groupby(["first", "second"])["favoured"].agg(["sum", "count"]).reset_index()
    counted = fit_bradley_terry(list(table["first"]), list(table["second"]), table["sum"], table["count"])
    assert isinstance(single, BradleyTerry)
    assert isinstance(counted, BradleyTerry)
    assert single.degrees_of_freedom == counted.degrees_of_freedom == 3
    assert single.deviance == pytest.approx(counted.deviance, abs=1e-6)
    assert single.deviance < 15


def test_one_participant_has_strengths_without_errors() -> None:
    found = fit_bradley_terry(list("aaabbb"), list("bbbaaa"), [1, 1, 0, 1, 0, 0], [1] * 6, participants=["p"] * 6)
    assert isinstance(found, BradleyTerry)
    assert all(row.standard_error is None for row in found.strengths)
    assert found.strengths[0].value is not None
    assert "1 participant: too few" in found.note


def test_errors_over_participants_and_motions_are_those_of_two_way_clusters() -> None:
    """By statsmodels' sandwiches of single clusters, combined as Cameron, Gelbach and Miller 2011 do (section 2.2)."""
    import statsmodels.api as sm

    rng = np.random.default_rng(21)
    strength = dict(zip("abcd", (0.0, 0.5, 0.8, -0.4), strict=True))
    rows = []
    for motion in range(6):
        apart = {name: strength[name] + rng.normal(0, 0.8) for name in "abcd"}
        for person in range(15):
            for a, b in (("a", "b"), ("c", "d"), ("a", "c"), ("b", "d")):
                first, second = (a, b) if rng.random() < 0.5 else (b, a)
                chance = 1 / (1 + np.exp(apart[second] - apart[first] - 0.3))
                rows.append((first, second, float(rng.random() < chance), f"p{person}", f"m{motion}"))
    first, second, favoured, people, motions = (list(part) for part in zip(*rows, strict=True))
    found = fit_bradley_terry(
        first, second, favoured, np.ones(len(rows)), reference="a", participants=people, motions=motions
    )
    assert isinstance(found, BradleyTerry)
    assert (found.participants, found.motions) == (15, 6)
    design = np.array([[*((a == n) - (b == n) for n in "bcd"), 1.0] for a, b, *_ in rows], dtype=float)

    def spread(labels: list[str]) -> np.ndarray:
        groups = np.unique(labels, return_inverse=True)[1]
        cluster = {"groups": groups, "use_correction": False}
        model = sm.GLM(np.array(favoured), design, family=sm.families.Binomial())
        fit = model.fit(cov_type="cluster", cov_kwds=cluster, tol=1e-12)
        count = groups.max() + 1
        return np.asarray(np.diag(fit.cov_params())) * count / (count - 1)

    both = [f"{a} {b}" for a, b in zip(people, motions, strict=True)]
    expected = np.maximum(spread(people) + spread(motions) - spread(both), np.maximum(spread(people), spread(motions)))
    own = {row.method: row.standard_error for row in found.strengths}
    assert [own[name] for name in "bcd"] == pytest.approx(np.sqrt(expected[:3]), rel=1e-5)
    assert found.order is not None
    assert found.order.standard_error == pytest.approx(np.sqrt(expected[3]), rel=1e-5)
    alone = fit_bradley_terry(first, second, favoured, np.ones(len(rows)), reference="a", participants=people)
    assert isinstance(alone, BradleyTerry)
    widths = [row.interval.high - row.interval.low for row in alone.strengths if row.method != "a"]
    assert max(widths) < min(row.interval.high - row.interval.low for row in found.strengths if row.method != "a")
