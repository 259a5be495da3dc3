"""What power is found for unless something else is asked: effects, and how many studies are simulated."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

USUAL: Mapping[str, Any] = MappingProxyType({
    "target": 0.8,
    "share": 0.65,
    "correlation": 0.1,
    "order_bias": 0.1,
    "motion_sd": 0.0,
    "motions": (),
    "difference": 0.7,
    "shorter": 8.0,
    "longer": 7.0,
    "spread": 0.15,
    "precision": 1.0,
    "missed": 0.005,
    "studies": None,
    "sessions": False,
    "seed": 0,
})  # fmt: skip
"""As `segue power --help` explains them; `studies` is 1,000, for thresholds 200."""
