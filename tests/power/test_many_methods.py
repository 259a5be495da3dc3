"""Power of strengths of many methods, beside what the information of the design allows."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import expit, logit
from scipy.stats import nct, t

from study.analysis.exclusions import Rules
from study.experiment.plan import draw_plan
from study.experiment.protocol.whole import parse_protocol
from study.power.design import Design
from study.power.registry import effect_of
from study.power.sessions import whole_sessions
from study.tasks.registry import task_of
from study.tasks.trial import Pair

MOTIONS = ("m0", "m1", "m2", "m3")
PROTOCOL = (
    "name = 'many'\ntitle = 'Many'\nseed = 5\n"
    + "".join(
        f"[[transitions]]\nname = '{name}'\ncategory = 'c'\nsource = 'a'\ndestination = 'b'\n" for name in MOTIONS
    )
    + "[[studies]]\nname = 'natural'\ntask = 'preference'\nreference = 'geodesic'\ncomparison = 'fixed'\n"
    "others = ['cut', 'velocity', 'one-hop']\nsets = 2\norder = 'balanced'\n"
)
OPTIONS = {"correlation": 0.0, "order_bias": 0.0, "missed": 0.0}


def design_of(people: int) -> Design:
    protocol = parse_protocol(PROTOCOL)
    study = protocol.studies[0]
    pairs = tuple(
        Pair(f"natural/{motion}/{one.name}", "natural", study.task, motion, "c", one.methods, one.methods)
        for motion in MOTIONS
        for one in task_of(study).conditions(study, False)
    )
    plans = tuple(draw_plan(protocol, pairs, f"p{place}", group=place) for place in range(people))
    effect = effect_of(study, {**OPTIONS, "share": 0.7}, protocol.analysis)
    return Design(protocol, study, plans, effect.observer, Rules())


def found_in(share: float, people: int, studies: int) -> float:
    design = design_of(people)
    effect = effect_of(design.study, {**OPTIONS, "share": share}, design.protocol.analysis)
    typical = Design(design.protocol, design.study, design.plans, effect.observer, Rules())
    return float(effect.study(typical)(np.random.default_rng(3), studies, [people]).mean())


def test_the_power_is_near_what_the_information_of_the_design_allows() -> None:
    """Fisher information of all pairs, at Student's t with one degree fewer than motions; errors that let participants
    and motions vary are never smaller, and by chance up to half as large again where neither does."""
    people, share = 24, 0.85
    names = ("geodesic", "cut", "velocity", "one-hop")  # beside fixed
    information, design = np.zeros((5, 5)), design_of(people)
    for own in design.trials():
        for trial in own:
            first, second = trial.methods if trial.a_first else trial.methods[::-1]
            row = np.array([*((first == n) - (second == n) for n in names), 1.0], dtype=float)
            chance = expit(logit(share) * row[0])
            information += chance * (1 - chance) * np.outer(row, row)
    quantile, freedom = t.ppf(1 - design.protocol.analysis.alpha / 2, len(MOTIONS) - 1), len(MOTIONS) - 1
    error = float(np.sqrt(np.linalg.inv(information)[0, 0]))
    low, high = (float(nct.sf(quantile, freedom, logit(share) / (error * factor))) for factor in (1.5, 1.0))
    assert low - 0.1 < found_in(share, people, 60) < high + 0.1


def test_where_nothing_is_to_be_found_hardly_anything_is() -> None:
    assert found_in(0.5, 12, 40) <= 0.1


def power_of(options: dict[str, float], people: int, studies: int, *, whole: bool = False) -> float:
    design = design_of(people)
    effect = effect_of(design.study, {**OPTIONS, **options}, design.protocol.analysis)
    typical = Design(design.protocol, design.study, design.plans, effect.observer, Rules())
    run = whole_sessions(typical, effect) if whole else effect.study(typical)
    return float(run(np.random.default_rng(3), studies, [people]).mean())


def test_motions_that_differ_cost_power_and_make_no_false_findings() -> None:
    alike, apart = (power_of({"share": 0.85, "motion_sd": spread}, 24, 60) for spread in (0.0, 1.5))
    assert apart < alike - 0.2
    assert power_of({"share": 0.5, "motion_sd": 1.5}, 12, 60) <= 0.1


@pytest.mark.parametrize("motion_sd", [0.0, 0.5])
def test_strengths_at_once_are_those_of_whole_sessions(motion_sd: float) -> None:
    options = {"share": 0.8, "correlation": 0.1, "motion_sd": motion_sd}
    at_once, whole = power_of(options, 24, 100), power_of(options, 24, 30, whole=True)
    assert 0.15 < at_once < 0.95
    assert at_once == pytest.approx(whole, abs=3.5 * 0.5 * np.sqrt(1 / 30 + 1 / 100))
