"""Simulated answers for the tests of the analysis, by a small generator that shares no code with what it tests."""

from __future__ import annotations

from collections.abc import Callable
from math import erf
from typing import Any

import numpy as np
import pandas as pd
import pytest

LEVELS = (-15, -10, -5, 0, 5, 10, 20)
MOTIONS = ("walking", "standing to walking", "running to turning")


def chance_of_different(size: float, slope: float, criterion: float, lapse: float) -> float:
    """Two impressions of unit variance; "different" where they are further apart than the criterion; some lapses."""
    mean, spread = slope * size, np.sqrt(2.0)
    beyond = 1 - 0.5 * (erf((criterion - mean) / spread / np.sqrt(2)) - erf((-criterion - mean) / spread / np.sqrt(2)))
    return lapse / 2 + (1 - lapse) * beyond


def slope_for(jnd: float, criterion: float, lapse: float) -> float:
    """The slope with which an observer says "different" to 75% of the pairs that are `jnd` frames apart."""
    low, high = 0.0, 20.0
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if chance_of_different(jnd, middle, criterion, lapse) < 0.75 else (low, middle)
    return low


@pytest.fixture
def same_different_study() -> Callable[..., pd.DataFrame]:
    """A function that simulates 2004's study one: 42 pairs a participant, by observers with known thresholds."""

    def simulate(
        rng: np.random.Generator,
        participants: int = 35,
        shorter: float = 8.0,
        longer: float = 7.0,
        criterion: float = 2.2,
        lapse: float = 0.02,
        spread: float = 0.0,
        missed: float = 0.0,
        levels: tuple[int, ...] = LEVELS,
        motions: dict[str, float] | tuple[str, ...] = MOTIONS,
    ) -> pd.DataFrame:
        slopes = {-1: slope_for(shorter, criterion, lapse), 1: slope_for(longer, criterion, lapse)}
        factors = motions if isinstance(motions, dict) else dict.fromkeys(motions, 1.0)
        rows: list[dict[str, Any]] = []
        for person in range(participants):
            better = np.exp(spread * rng.normal())
            for motion, factor in factors.items():
                for level in levels:
                    slope = slopes[-1 if level < 0 else 1] * better * factor
                    chance = chance_of_different(abs(level), slope, criterion, lapse)
                    for first in (True, False):
                        answer = "different" if rng.random() < chance else "same"
                        gone = rng.random() < missed
                        rows.append(
                            {
                                "participant": f"p{person:02}",
                                "simulated": True,
                                "study": "jnd",
                                "task": "same-different",
                                "motion": motion,
                                "difference_frames": level,
                                "reference_first": first,
                                "answer": None if gone else answer,
                                "missed": gone,
                                "response_s": None if gone else float(rng.lognormal(0.0, 0.4)),
                            }
                        )
        return pd.DataFrame(rows)

    return simulate


@pytest.fixture
def preference_study() -> Callable[..., pd.DataFrame]:
    """A function that simulates eight motion pairs a participant, alike within a participant by `correlation`."""

    def simulate(
        rng: np.random.Generator,
        participants: int = 35,
        share: float = 0.5,
        correlation: float = 0.0,
        first_bonus: float = 0.0,
    ) -> pd.DataFrame:
        rows = []
        for person in range(participants):
            own = share
            if correlation > 0:
                weight = 1 / correlation - 1
                own = rng.beta(share * weight, (1 - share) * weight)
            for pair in range(8):
                a_first = bool(rng.integers(2))
                chance = np.clip(own + (first_bonus if a_first else -first_bonus), 0, 1)
                chose_a = bool(rng.random() < chance)
                rows.append(
                    {
                        "participant": f"p{person:02}",
                        "simulated": True,
                        "study": "geodesic",
                        "task": "preference",
                        "motion": f"motion {pair}",
                        "method_a": "geodesic",
                        "method_b": "fixed",
                        "a_first": a_first,
                        "answer": "first" if chose_a == a_first else "second",
                        "chose_a": chose_a,
                        "response_s": 1.0,
                    }
                )
        return pd.DataFrame(rows)

    return simulate
