"""Lesnoff et al. 2004: cattle with pleuropneumonia in 15 herds over four periods (`cbpp` in the R package lme4).

A logistic mixed model with a random intercept a herd. lme4's own tests hold its fixed effects by adaptive quadrature
with 25 points; its documentation prints standard errors and the spread between herds by Laplace's approximation.
"""

from __future__ import annotations

import numpy as np
import pytest

from study.analysis.regression.mixed import MixedFit, fit_mixed

# Cases of animals in each of a herd's periods; herd 8 was seen in the first alone.
HERDS = (
    "2/14 3/12 4/9 0/5", "3/22 1/18 1/21", "8/22 2/16 0/16 2/20", "2/10 0/10 2/9 0/6", "5/18 0/25 0/24 1/4",
    "3/17 0/17 0/18 1/20", "8/16 1/10 3/9 0/5", "12/34", "2/9 0/6 0/8 0/6", "1/22 1/22 0/18 2/22",
    "0/25 5/27 3/22 1/22", "2/10 1/8 0/6 0/5", "1/21 2/24 0/19 0/23", "11/19 0/2 0/3 0/2", "1/19 1/15 1/15 0/15",
)  # fmt: skip


def fitted(nodes: int) -> MixedFit:
    cells = [(h, p, *map(int, cell.split("/"))) for h, row in enumerate(HERDS) for p, cell in enumerate(row.split())]
    herd, period, cases, animals = (np.array(column) for column in zip(*cells, strict=True))
    assert (len(cells), cases.sum(), animals.sum()) == (56, 99, 842)
    design = np.column_stack([np.ones(len(cells)), *(period == place for place in (1, 2, 3))]).astype(float)
    fit = fit_mixed(design, np.ones((len(cells), 1)), cases, animals, herd, nodes=nodes)
    assert isinstance(fit, MixedFit)
    return fit


@pytest.mark.parametrize("nodes", [9, 25])
def test_fixed_effects_by_quadrature(nodes: int) -> None:
    values = [effect.value for effect in fitted(nodes).effects]
    assert values == pytest.approx([-1.39922533, -0.99140729, -1.12782185, -1.57946627], abs=2e-4)


def test_standard_errors_and_spread() -> None:
    """Laplace's, so only near: errors 0.232, 0.307, 0.327 and 0.427; standard deviation of the herds 0.642."""
    fit = fitted(25)
    assert [effect.standard_error for effect in fit.effects] == pytest.approx([0.232, 0.307, 0.327, 0.427], abs=0.01)
    assert fit.spread[0] == pytest.approx(0.642, abs=0.01)
