"""Names for the arrays that signatures speak of; their shapes and units stand in the docstrings."""

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
