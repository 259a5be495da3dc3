"""Names for the arrays that signatures speak of (their shapes and units stand in the docstrings), and runs in one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
CountArray = NDArray[np.int32]
"""Costs counted in whole numbers; see `study.transitions.point_cloud`."""
AnyFloat = NDArray[np.floating]
"""In single or double precision."""


def runs(flags: BoolArray) -> list[tuple[int, int]]:
    """Stretches of true in a row of flags, as slices count them."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]
