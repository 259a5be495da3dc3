"""`segue fit` on little and on odd data: what can't be told, or looks wrong, is said in a sentence."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

Fitted = Callable[..., dict[str, Any]]
Refused = Callable[..., str]

COUNTED = ("--level", "x", "--answer", "a", "--shown", "n", "--participant", "who")
AFC = ("--task", "2afc", "--level", "x", "--answer", "a", "--participant", "who")


@pytest.mark.parametrize(
    ("times", "log_likelihood", "criterion_error", "delta_error"),
    [(1, -16.6857627579, 0.34900448096, 0.70351563805), (10, -166.8576275789, 0.11036490734, 0.22247117858)],
)
def test_sensr_rows(
    fitted: Fitted, times: int, log_likelihood: float, criterion_error: float, delta_error: float
) -> None:
    """`samediff(8, 5, 4, 9)`: two levels and one person have no lapse rate, and that is said."""
    found = fitted(
        f"who,x,n,a\np,0,{13 * times},{5 * times}\np,1,{13 * times},{9 * times}\n", "--task", "same-different", *COUNTED
    )
    model = found["model"]
    assert (model["criterion"], model["slopes"]["longer"]) == pytest.approx((1.2295508916, 1.8849964801), abs=1e-6)
    assert (model["criterion_error"], model["slope_errors"]["longer"]) == pytest.approx(
        (criterion_error, delta_error), abs=1e-5
    )
    assert model["log_likelihood"] == pytest.approx(log_likelihood, abs=1e-6)
    assert "2 levels can't tell a lapse rate" in model["note"]
    assert "2 levels can't tell a lapse rate" in found["headline"][0]["note"]


def same_different(chance: Callable[[int], float]) -> str:
    rng = np.random.default_rng(1)
    rows = [f"p{person},{x},40,{rng.binomial(40, chance(x))}" for person in range(6) for x in (-10, -5, 0, 5, 10)]
    return "\n".join(["who,x,n,a", *rows]) + "\n"


def test_a_lapse_rate_is_held_and_its_bound_is_said(fitted: Fitted) -> None:
    text = same_different(lambda x: 0.2 + 0.6 * min(1, abs(x) / 7))
    free = fitted(text, "--task", "same-different", *COUNTED)
    assert free["mixed"]["lapse"] == pytest.approx(0.1)
    assert "the lapse rate is at the bound of its range, 10%" in free["headline"][0]["note"]
    held = fitted(text, "--task", "same-different", *COUNTED, "--lapse", "0.03")
    assert held["model"]["lapse"] == held["mixed"]["lapse"] == 0.03
    assert "bound of its range" not in held["headline"][0]["note"]


def test_levels_keep_their_digits(fitted: Fitted) -> None:
    rng = np.random.default_rng(2)
    rows = [
        f"p{person},{20250 + x},{int(rng.random() < 0.5 + 0.5 / (1 + np.exp(-2 * (x - 2))))}"
        for person in range(4) for x in range(5) for _ in range(30)
    ]  # fmt: skip
    found = fitted("\n".join(["who,x,a", *rows]), *AFC)
    assert "e+04" not in found["answer"]
    assert f"{found['mixed']['threshold']:.1f}" in found["answer"]


def test_parts_of_answers_are_refused(refused: Refused) -> None:
    text = "who,x,n,a\n" + "".join(f"p{p},{x},20,{10 + 2 * x + 0.5 * (x == 3)}\n" for p in range(3) for x in range(5))
    assert "row 5: expected whole numbers of answers, found 16.5 of 20; give counts" in refused(
        text, "--task", "2afc", *COUNTED
    )


def test_two_people_who_can_not_tell_have_no_threshold(fitted: Fitted) -> None:
    rows = [f"p{person},{x},{trial % 2}" for person in range(2) for x in range(5) for trial in range(20)]
    found = fitted("\n".join(["who,x,a", *rows]), *AFC)
    assert found["answer"] == (
        "No threshold of the group can be given: 2 of 2 participants have no threshold within the levels."
    )


@pytest.mark.parametrize("numbered", [True, False])
def test_a_file_joined_twice_is_noticed(fitted: Fitted, numbered: bool) -> None:
    """Copies are no wonder where nothing but level and answer is in the file."""
    rows = [f"{trial if numbered else 0},p,{trial % 5},{int(trial % 5 > trial % 3)}" for trial in range(60)]
    found = fitted("\n".join(["trial,who,x,a", *rows, *rows]), *AFC)
    assert found["copies"] == (60 if numbered else 0)


def test_three_methods_have_an_omnibus_test_first(fitted: Fitted) -> None:
    rng = np.random.default_rng(3)
    rows = [f"p{p},{m},{rng.integers(1, 5) + 'ABC'.index(m)}" for p in range(12) for m in "ABC" for _ in range(2)]
    rated = ("--task", "rating", "--method", "m", "--answer", "a", "--participant", "who")
    found = fitted("\n".join(["who,m,a", *rows]), *rated)
    first, *pairs = found["headline"]
    assert first["unit"] == "F of all methods"
    effects = {row["source"]: row for row in found["rating_anova"]["rating"][0]["mixed_design"]["effects"]}
    assert first["p"] == effects["method"]["corrected_p_value"]
    assert "F(2, 22)" in first["statement"]
    assert len(pairs) == 3
    apart = [row.replace(",A,", ",C,") for row in rows if ",A," in row or ",B," in row]
    parted = [row.rsplit(",", 1)[0] + (",1" if ",B," in row else ",9") for row in apart]
    assert "8.00, the same for all 12, exact sign test" in fitted("\n".join(["who,m,a", *parted]), *rated)["answer"]
