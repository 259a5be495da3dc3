"""The joint cost of 2003 in place of the point cloud distance: Koyama & Goto 2019, section 3.2, Choice of distance.

The cost of a blend is the mean of the costs of its frame pairs (Lee et al. 2002, as studied in Wang & Bodenheimer
2003), so it compares joint rotations and velocities instead of places.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from study.arrays import CountArray
from study.motion.clip import Clip
from study.transitions.cost_matrix import cost_matrix
from study.transitions.point_cloud import LARGEST_COUNT


@dataclass(frozen=True)
class JointDistance:
    """The mean joint cost over the frames of a blend; a `Distance`."""

    weights: str | Mapping[str, float] = "wang2003"
    """As `joint_weights` takes them."""
    nu: float = 1.0
    """How much velocities weigh beside poses (2003: one)."""
    unit: float = 2.0**-20
    words: str = "mean joint cost, squared half angles and metres (Wang & Bodenheimer 2003)"

    def prepare(self, clip: Clip, blend_frames: int) -> Clip:
        """The clip itself."""
        del blend_frames
        return clip

    def counts(self, a: Clip, b: Clip, blend_frames: int, rows: range, columns: range) -> CountArray:
        """Means of the frames' costs along diagonals; all frames of both clips are compared, then cut to size."""
        frames = cost_matrix(a, b, weights=self.weights, nu=self.nu, precision="single") / np.float32(self.unit)
        sums = np.zeros((len(rows), len(columns)))
        for step in range(blend_frames):
            sums += frames[rows.start + step : rows.stop + step, columns.start + step : columns.stop + step]
        counts = np.minimum(np.rint(sums / blend_frames), LARGEST_COUNT).astype(np.int32)
        if a is b:
            same = np.arange(max(rows.start, columns.start), min(rows.stop, columns.stop))
            counts[same - rows.start, same - columns.start] = 0
        return counts
