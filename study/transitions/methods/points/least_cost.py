"""Points of a method's own: where a metric is least over all frames that leave room (2003 section 4.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from study.settings import setting
from study.transitions.methods.method import WANG_2003, OwnPoints

if TYPE_CHECKING:
    from study.motion.clip import Clip

_METRICS = {
    "lee2002": "under the weights of Lee et al. (2002)",
    "wang2003": "under the optimised weights of 2003",
    "pointcloud": "between point clouds",
}


@dataclass(frozen=True)
class LeastCost(OwnPoints):
    """The pair of frames that a metric says are nearest."""

    name = "least-cost"
    words = "of least cost"
    sources = (WANG_2003,)

    metric: Literal["lee2002", "wang2003", "pointcloud"] = setting(
        "wang2003", "Points `least-cost`: what says how far two frames are apart (2003 section 4.2)."
    )

    def best(
        self, source: Clip, destination: Clip, windows: tuple[tuple[int, int], tuple[int, int]], shift: int | None
    ) -> tuple[int, int]:
        """The start and the end frame of least cost; from a frame to itself or its neighbours is no transition."""
        import numpy as np

        from study.transitions.candidates import APART_S, frame_costs

        rows, columns = (slice(*window) for window in windows)
        costs = frame_costs(source, destination, self.metric)[rows, columns].copy()
        if shift is not None:
            apart = np.arange(*windows[0])[:, None] + shift - np.arange(*windows[1])
            costs[np.abs(apart) < APART_S * source.fps] = np.inf
        row, column = np.unravel_index(int(np.argmin(costs)), costs.shape)
        return rows.start + int(row), columns.start + int(column)

    def in_words(self, fps: float) -> str:
        """With the metric."""
        return f"{super().in_words(fps)} {_METRICS[self.metric]}"
