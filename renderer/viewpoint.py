"""From where to look: the side from which a group's motion is largest and clearest.

A fixed camera that sees all of a travelling figure either looks along its way, where the limbs swing towards the
camera and hardly move in the picture, or from the side, where the way fills the frame and the figure is small. Between
the two there is a best view, and where it is depends on the motion: a run into a turn wants another than a walk.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.camera import Camera, check_positions, project_film
from renderer.framing import frame_group

FloatArray = NDArray[np.float64]

CANDIDATES_DEGREES = tuple(range(-90, 91, 5))
"""Views tried, from one side by the front to the other."""

LOOKS_HZ = 15.0
"""Frames per second that are looked at: to choose a view, not to frame it."""


def best_view(
    positions_list: Sequence[ArrayLike],
    *,
    heading: float,
    fps: float = 30.0,
    score: Callable[[Camera], float] | None = None,
    **framing: Any,
) -> float:
    """The view, radians from the front, in which a group's figures are large and their limbs move most.

    Parameters
    ----------
    positions_list
        Each `(frames, points, 3)`, metres; point 0 is what the others' motion is seen against (the pelvis).
    heading
        The direction that counts as forwards, radians about Y from +Z.
    fps, framing
        As for `frame_group`.
    score
        What makes a camera good, the higher the better; by default `clarity`.

    Returns
    -------
    float
        What `frame_group` takes as `view`: of the candidates, every five degrees, the one with the best score, by
        default the largest geometric mean of the figure's height in the picture and the speed at which its points move
        there. Of equals, the one nearest to the front, then the one to the left.
    """
    group = [check_positions(positions, f"positions of clip {i}") for i, positions in enumerate(positions_list)]
    step = max(1, round(fps / LOOKS_HZ))
    group, fps = [positions[::step] for positions in group], fps / step
    candidates = sorted((np.radians(degrees) for degrees in CANDIDATES_DEGREES), key=lambda view: (abs(view), view))
    judged = score or (lambda camera: clarity(group, camera, fps))
    scores = [judged(frame_group(group, view=view, heading=heading, fps=fps, **framing)) for view in candidates]
    return float(candidates[int(np.argmax(np.round(scores, 6)))])


def clarity(group: Sequence[FloatArray], camera: Camera, fps: float) -> float:
    """Geometric mean of the figures' median height, pixels, and their points' mean speed against point 0, pixels/s."""
    heights, speeds = [], []
    for positions in group:
        seen, _ = project_film(camera, positions, fps)
        heights.append(np.ptp(seen[..., 1], axis=1))
        moved = np.diff(seen - seen[:, :1], axis=0)
        speeds.append(fps * np.linalg.norm(moved, axis=-1).mean(axis=1) if len(moved) else np.zeros(1))
    # A group that stands still is judged by its size alone.
    return float(np.sqrt(np.median(np.concatenate(heights)) * max(float(np.mean(np.concatenate(speeds))), 1e-3)))
