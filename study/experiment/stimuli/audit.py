"""What gives a pair away besides what is judged: how its two stimuli differ in length, place, size and path.

Pairs come in, and the positions, figures and cameras of their stimuli; for each pair a `PairAudit` goes out, which the
manifest keeps. `shortcuts` says what could be achieved by seeing nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from study.tasks.trial import Pair

if TYPE_CHECKING:
    from renderer.camera import Camera
    from renderer.capsules import Figure
    from renderer.shapes import Poses

FloatArray = NDArray[np.float64]

Moving = tuple[FloatArray, "Figure", "Camera"]
"""Points `(frames, points, 3)` in metres, the figure on them, and the camera that sees them."""


@dataclass(frozen=True)
class FrameAudit:
    """How the comparison's figure stands in the picture of one frame, against the reference's.

    `right` and `down` are the shift of the middle of its outline, in heights of the figure (mean of both); `size` is
    its height divided by the reference's; `pose` the mean distance of its joints from the reference's once place and
    size are taken away, in heights of the figure.
    """

    right: float
    down: float
    size: float
    pose: float


@dataclass(frozen=True)
class PairAudit:
    """How the stimuli of a pair differ in what is not judged: the reference's value, then the comparison's.

    Parameters
    ----------
    pair
        Its name.
    seconds
        How long each takes.
    first, last
        The figure in the first and in the last frame that shows it.
    speeds_m_s, paths_m
        Mean speed of the figure over the floor, and the length of its path.
    """

    pair: str
    seconds: tuple[float, float]
    first: FrameAudit
    last: FrameAudit
    speeds_m_s: tuple[float, float]
    paths_m: tuple[float, float]


def audit(pairs: Sequence[Pair], moving: Mapping[str, Moving], fps: float) -> tuple[PairAudit, ...]:
    """Measure every pair of two stimuli; single ones that are rated have nothing to be compared with.

    `moving` is what is seen of each stimulus, by its id.
    """
    seen = {}
    for one in dict.fromkeys(one for pair in pairs for one in pair.stimuli):
        positions, figure, camera = moving[one]
        seen[one] = view(first_and_last(positions, figure), camera, fps)
    return tuple(compared(pair.name, *(seen[one] for one in pair.stimuli)) for pair in pairs if len(pair.stimuli) == 2)


@dataclass(frozen=True, eq=False)
class Seen:
    """What is seen of one stimulus: seconds, metres, and for its first and last frame the outline and the joints."""

    seconds: float
    path_m: float
    outlines: FloatArray
    joints: FloatArray


def first_and_last(positions: FloatArray, figure: Figure) -> Poses:
    """The first and the last frame of a stimulus that show its figure."""
    from renderer.shapes import pose

    # Half way through a fade, and before a cover: what is seen last.
    last = len(positions) - 1 - figure.ending[1] - figure.ending[0] // 2
    return pose(positions, figure, (0, last))


def view(ends: Poses, camera: Camera, fps: float) -> Seen:
    """What a camera sees of one stimulus, by its first and last frame."""
    from renderer.shapes import on_picture

    steps = np.diff(ends.positions[:, 0][:, [0, 2]], axis=0)
    joints, edges = on_picture(ends, camera, fps)
    return Seen(len(ends.positions) / fps, float(np.linalg.norm(steps, axis=1).sum()), edges, joints)


def compared(name: str, one: Seen, other: Seen) -> PairAudit:
    """How the comparison differs from the reference."""
    first, last = (_frame_audit(*((each.outlines[at], each.joints[at]) for each in (one, other))) for at in (0, 1))
    seconds, paths = (one.seconds, other.seconds), (one.path_m, other.path_m)
    speeds = tuple(path / max(s, 1e-9) for path, s in zip(paths, seconds, strict=True))
    return PairAudit(name, _rounded(seconds), first, last, _rounded(speeds), _rounded(paths))


def _rounded(values: Sequence[float]) -> tuple[float, float]:
    return round(values[0], 6), round(values[1], 6)


def _frame_audit(one: tuple[FloatArray, FloatArray], other: tuple[FloatArray, FloatArray]) -> FrameAudit:
    heights = [outline[3] - outline[1] for outline, _ in (one, other)]
    middles = [(outline[:2] + outline[2:]) / 2 for outline, _ in (one, other)]
    shift = (middles[1] - middles[0]) / np.mean(heights)
    poses = [(joints - middle) / high for (_, joints), middle, high in zip((one, other), middles, heights, strict=True)]
    apart = float(np.linalg.norm(poses[1] - poses[0], axis=1).mean())
    return FrameAudit(*(round(float(x), 6) for x in (*shift, heights[1] / heights[0], apart)))
