"""One-hop transitions whose blends are as long as suits them, rather than 30 frames each.

In: a problem. Out: the same problem with the lengths that its blends may take, and a cost that can be compared between
them; `build_table` searches it. Koyama & Goto 2019, section 5, Blending duration.

The distance over the frames of a blend is a mean (2004 Eq. 1), and the least mean over few frames is a cut: wherever
two motions cross, they are alike for a moment, and how differently they move on no longer counts. So two things are
added. However short a blend is, its distance is that over the fixed length from its start on, which compares how the
poses change as well. And a blend not only bends poses by the distance between the motions, it also adds that distance,
over its own length, to the velocities. As in the cost of Lee et al. 2002 both are summed, with velocities weighted so
that poses and velocities of the clips vary alike (`study.transitions.advice`): `D (1 + (tau / (b + 1))^2)`, where `tau`
is the time in which the clips go through their own variation. The sum is scaled so that a blend of the fixed length
costs its distance, as in the paper.

Since longer blends respond later, the responsiveness cost counts the blends as well as the stays:
`R = s_s + s_h + b_1 + b_2 - 2 * shortest`. The weight of Eq. 5 divides by the most that it can be (`default_weight`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from study.arrays import CountArray
from study.motion.clip import Clip
from study.transitions.advice import own_time
from study.transitions.one_hop.problem import FORBIDDEN, Distance, Problem
from study.transitions.point_cloud import LARGEST_COUNT

# Lengths a third of a just noticeable difference apart (2004 section 5.1: 7 frames at 30 fps), up to 1 s.
STEP_S, LONGEST_S = 2.0 / 30.0, 1.0


@dataclass(frozen=True, eq=False)
class StrainDistance:
    """A distance over at least the usual frames, with what the blend adds to the velocities; a `Distance`."""

    distance: Distance
    """How far poses are apart over the frames of a blend: a mean, whatever their number."""
    own_time: float
    """The time in which the clips go through their own variation, frames."""
    usual: int
    """The blend length whose cost stays as it is, frames; over no fewer frames are motions compared."""

    @property
    def unit(self) -> float:
        """That of the distance."""
        return self.distance.unit

    @property
    def words(self) -> str:
        """What the cost is."""
        return (
            f"{self.distance.words}, over at least {self.usual} frames, times (1 + (t / (b + 1))^2) / (1 + (t / "
            f"{self.usual + 1})^2) for a blend of b frames, t = {self.own_time:.3f}"
        )

    @property
    def weights(self) -> Any:
        """Those of the distance, where it has some."""
        return getattr(self.distance, "weights", None)

    def prepare(self, clip: Clip, blend_frames: int) -> tuple[Any, int]:
        """What the distance prepares, and the clip's frames."""
        return self.distance.prepare(clip, max(blend_frames, self.usual)), clip.frames

    def counts(
        self, a: tuple[Any, int], b: tuple[Any, int], blend_frames: int, rows: range, columns: range
    ) -> CountArray:
        """The distance's counts, scaled for the length of the blend; `FORBIDDEN` where the clips end before."""
        window = max(blend_frames, self.usual)
        counts = np.full((len(rows), len(columns)), FORBIDDEN, dtype=np.int32)
        down, across = (
            range(part.start, max(part.start, min(part.stop, frames - window + 1)))
            for part, (_, frames) in ((rows, a), (columns, b))
        )
        if len(down) and len(across):
            found = self.distance.counts(a[0], b[0], window, down, across)
            here, usual = (1.0 + (self.own_time / (frames + 1)) ** 2 for frames in (blend_frames, self.usual))
            counts[: len(down), : len(across)] = np.minimum(np.rint(found * (here / usual)), LARGEST_COUNT)
        return counts


def lengths_at(fps: float, usual: int) -> tuple[int, ...]:
    """The frames that a blend may take: multiples of 0.067 s up to 1 s, and the usual length."""
    steps = {max(1, round(k * STEP_S * fps)) for k in range(1, round(LONGEST_S / STEP_S) + 1)}
    return tuple(sorted({*steps, usual}))


def adaptive(problem: Problem) -> Problem:
    """The problem with blends of their own length.

    A problem with the paper's blends of one length, which is the one whose cost stays as it is. Where its settings have
    no `lengths`, they are those of `lengths_at`, among them the fixed one: then no transition costs more than with it.
    `MotionError` where the rig lacks joints by which the motion's own time is told.
    """
    settings = problem.settings
    usual = settings.blend_frames
    lengths = settings.lengths or lengths_at(problem.clips[0].fps, usual)
    distance = StrainDistance(problem.distance, own_time(*problem.clips), usual)
    return replace(problem, settings=replace(settings, lengths=lengths), distance=distance)
