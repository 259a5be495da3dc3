"""Davidson 1970: six brands of chocolate pudding in pairs, with answers of no preference.

Strengths that add up to 1 and nu are those that the paper gives to four digits; the likelihood is held against one
written out in full and climbed by another method.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from study.analysis.preference.bradley_terry import BradleyTerry, fit_bradley_terry

# The two brands; how often they were compared, how often each was preferred, how often neither.
COMPARED = np.array([
    (1, 2, 57, 19, 22, 16), (1, 3, 47, 16, 19, 12), (2, 3, 48, 19, 19, 10), (1, 4, 54, 18, 23, 13),
    (2, 4, 51, 23, 19, 9), (3, 4, 54, 19, 20, 15), (1, 5, 50, 13, 19, 18), (2, 5, 48, 16, 20, 12),
    (3, 5, 48, 16, 15, 17), (4, 5, 47, 17, 14, 16), (1, 6, 51, 18, 21, 12), (2, 6, 54, 22, 20, 12),
    (3, 6, 41, 13, 18, 10), (4, 6, 51, 14, 19, 18), (5, 6, 44, 11, 21, 12),
])  # fmt: skip


def fitted(counts: np.ndarray, **options: object) -> BradleyTerry:
    first, second, shown, won, _, tied = counts.T
    found = fit_bradley_terry(first.astype(str), second.astype(str), won + tied / 2, shown, tied=tied, **options)
    assert isinstance(found, BradleyTerry)
    return found


def minus_log_likelihood(point: np.ndarray, counts: np.ndarray, with_order: bool) -> float:
    """Of strengths beside the last brand's, nu's logarithm and the effect of coming first, answer by answer."""
    strengths, nu, order = np.append(point[:5], 0.0), np.exp(point[5]), point[6] if with_order else 0.0
    total = 0.0
    for first, second, _, won, lost, tied in counts:
        a, b = np.exp(strengths[first - 1] + order), np.exp(strengths[second - 1])
        whole = a + b + nu * np.sqrt(a * b)
        total += won * np.log(a / whole) + lost * np.log(b / whole) + tied * np.log(nu * np.sqrt(a * b) / whole)
    return -total


def test_the_published_strengths_and_nu() -> None:
    assert (COMPARED[:, 3:].sum(axis=1) == COMPARED[:, 2]).all()
    found = fitted(COMPARED, with_order=False)
    shares = np.exp([row.value for row in sorted(found.strengths, key=lambda row: row.method)])
    assert shares / shares.sum() == pytest.approx([0.1388, 0.1730, 0.1617, 0.1654, 0.1587, 0.2024], abs=5e-5)
    assert found.ties is not None
    assert np.exp(found.ties.value) == pytest.approx(0.7468, abs=5e-5)
    assert found.degrees_of_freedom == 2 * 15 - 6


@pytest.mark.parametrize("with_order", [False, True])
def test_the_likelihood_written_out_has_the_same_maximum(with_order: bool) -> None:
    rng = np.random.default_rng(70)
    turned = COMPARED[:, [1, 0, 2, 4, 3, 5]]
    counts = np.concatenate([COMPARED, turned])
    counts[:, 3] += rng.integers(0, 8, len(counts))  # the first is favoured
    counts[:, 2] = counts[:, 3:].sum(axis=1)
    found = fitted(counts, with_order=with_order, reference="6")
    best = minimize(minus_log_likelihood, np.zeros(6 + with_order), (counts, with_order), tol=1e-10)
    values = [row.value for row in sorted(found.strengths, key=lambda row: row.method)][:5]
    besides = [found.ties, *([found.order] if with_order else [])]
    assert [*values, *(row.value for row in besides if row)] == pytest.approx(best.x, abs=1e-4)
    assert found.log_likelihood == pytest.approx(-best.fun, abs=1e-6)
    errors = np.sqrt(np.diag(np.linalg.inv(hessian(best.x, counts, with_order))))
    own = [row.standard_error for row in sorted(found.strengths, key=lambda row: row.method)][:5]
    assert [*own, *(row.standard_error for row in besides if row)] == pytest.approx(errors, rel=1e-3)


def hessian(at: np.ndarray, counts: np.ndarray, with_order: bool, step: float = 1e-3) -> np.ndarray:
    size = len(at)
    moves = step * np.eye(size)
    found = np.zeros((size, size))
    for i in range(size):
        for j in range(size):
            corners = [(a, b, minus_log_likelihood(at + a * moves[i] + b * moves[j], counts, with_order))
                       for a in (-1, 1) for b in (-1, 1)]  # fmt: skip
            found[i, j] = sum(a * b * value for a, b, value in corners) / (4 * step**2)
    return found


def test_what_ties_alone_and_a_method_that_never_loses_leave_open() -> None:
    same = np.array([(1, 2, 9, 0, 0, 9), (2, 3, 9, 0, 0, 9)])
    first, second, shown, won, _, tied = same.T
    found = fit_bradley_terry(first.astype(str), second.astype(str), won + tied / 2, shown, tied=tied)
    assert found == "every answer was a tie: strengths cannot be estimated"
    # What wins always lies endlessly far above; one tie brings it down, since nu is that of the others too.
    counts = np.array([(1, 2, 9, 9, 0, 0), (1, 3, 9, 9, 0, 0), (2, 3, 9, 4, 3, 2)])
    rows = {row.method: row.value for row in fitted(counts, with_order=False, reference="2").strengths}
    assert rows["1"] is None
    assert rows["3"] == pytest.approx(-np.log(4 / 3), abs=2e-3)
    counts[0] = (1, 2, 9, 8, 0, 1)
    rows = {row.method: row.value for row in fitted(counts, with_order=False, reference="2").strengths}
    assert rows["1"] is not None
    assert 2 < rows["1"] < 8
