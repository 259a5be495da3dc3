"""Answers to the form as others may see them: true, and shared by enough people, against a count of combinations."""

from __future__ import annotations

from collections import Counter
from statistics import mean

import numpy as np
import pytest

from study.experiment.form import FEWEST, coarsened
from study.experiment.protocol.texts import FormField

FIELDS = {
    "gender": FormField(name="gender", label="Gender", kind="choice", choices=("female", "male", "other", "none")),
    "age": FormField(name="age", label="Age", kind="number"),
    "plays": FormField(name="plays", label="Plays", kind="choice", choices=("yes", "no")),
    "remarks": FormField(name="remarks", label="Remarks"),
}


def people(number: int, seed: int) -> dict[int, dict[str, str]]:
    rng = np.random.default_rng(seed)
    chances = {"gender": [0.5, 0.35, 0.05, 0.0, 0.1], "plays": [0.6, 0.3, 0.1]}
    drawn = {name: rng.choice([*FIELDS[name].choices, ""], number, p=odds) for name, odds in chances.items()}
    ages = np.where(rng.random(number) < 0.1, "", rng.integers(18, 70, number).astype(str))
    return {
        one: {
            "gender": str(drawn["gender"][one]),
            "age": str(ages[one]),
            "plays": str(drawn["plays"][one]),
            "remarks": "I",
        }
        for one in range(number)
    }


@pytest.mark.parametrize("number", [1, 4, 5, 9, 24, 60, 300])
def test_every_combination_is_shared_by_enough_people_or_by_all(number: int) -> None:
    for seed in range(20):
        given = people(number, seed)
        told = coarsened(FIELDS, given)
        assert set(told) == set(given)
        shared = Counter(tuple(sorted(said.items())) for said in told.values())
        assert min(shared.values()) >= min(FEWEST, number)
        for one, said in told.items():
            assert said["remarks"] == ""
            assert said["gender"] in ("", given[one]["gender"])
            assert said["plays"] in ("", given[one]["plays"])
        groups: dict[tuple[str, str], list[int]] = {}
        for one, said in told.items():
            if said["age"]:
                groups.setdefault((said["gender"], said["age"]), []).append(int(given[one]["age"]))
        for (_, age), own in groups.items():
            assert float(age) == pytest.approx(mean(own), abs=1e-3)
        if number < FEWEST:
            assert {"".join(said.values()) for said in told.values()} == {""}


def test_what_many_share_is_told_as_it_is() -> None:
    said = [{"gender": gender, "age": age, "plays": plays} for gender in ("female", "male") for age in ("20", "30")
            for plays in ("yes", "no")]  # fmt: skip
    given = {one: {**said[one % 8], "remarks": ""} for one in range(8 * FEWEST)}
    assert coarsened(FIELDS, given) == given


def test_one_who_stands_alone_takes_the_next_rarer_along() -> None:
    given = {one: {"gender": "other" if one == 0 else "male" if one < 7 else "female"} for one in range(40)}
    told = coarsened({"gender": FIELDS["gender"]}, given)
    assert Counter(said["gender"] for said in told.values()) == {"female": 33, "": 7}
