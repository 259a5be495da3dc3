"""Which make suits a transition: each is made at the same points, and what it does to the motions is measured.

In: a place and a blend length. Out: a `Measured` for each make, by what can be seen of a stimulus: frames in which no
foot stands, how hard a toe is pulled, and how far poses are from those of the clips. No study has compared the makes of
game engines with blends, so what the measures prefer here is a rule of ours and no finding.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from study.errors import TransitionError
from study.motion.clip import Clip, retarget, trim
from study.transitions.flaws import ACCELERATION_TIMES, SHARE_OVER, find_flaws
from study.transitions.methods.makes.blends import Slerp
from study.transitions.methods.method import Made, Place
from study.transitions.methods.registry import DIRECT
from study.transitions.point_cloud import PointCloud, point_cloud, window_distances

_LEAST_POSE_M = 0.005
"""A distance of poses that nobody sees: a blend this near is taken to be so far, so that a ratio says something."""
_CLEARLY = 0.1
"""By so much another make must have the lower score to be taken in place of the plain blend, which studies were about.
"""


@dataclass(frozen=True)
class Measured:
    """What a make does at one place, feet planted, in the frames that the longest of all makes takes."""

    make: str
    unsupported_share: float
    own_unsupported_share: float
    """Share of these frames in which no foot stands though one is at floor height; of the motions' own frames."""
    toe_acceleration_times: float
    """Largest acceleration of a toe over the motions' own."""
    own_pose_m: float
    """Distance of the poses from the nearest pose of either motion, on average over these frames, metres."""

    def score(self, plain: Measured) -> float:
        """The three measures in units of what is told (`flaws.told`) and of the plain blend's poses; less is better."""
        skating = max(self.unsupported_share - self.own_unsupported_share, 0.0) / SHARE_OVER
        poses = max(self.own_pose_m, _LEAST_POSE_M) / max(plain.own_pose_m, _LEAST_POSE_M)
        return skating + self.toe_acceleration_times / ACCELERATION_TIMES + poses


def compare(place: Place, blend_frames: int) -> tuple[Measured, ...]:
    """Every direct make over one blend length, the best first; none for a rig without feet.

    Makes that the clips leave no room for are omitted.
    """
    if not place.source.skeleton.has("ankle"):
        return ()
    made: dict[str, Made] = {}
    for name, make in DIRECT.items():
        with suppress(TransitionError):
            made[name] = make().way(place, (blend_frames, blend_frames)).made(place)
    stop = max(one.blend_stop for one in made.values())
    motions = (place.source, place.destination)
    found = []
    for name, one in made.items():
        blend = (one.blend_start, min(stop, one.clip.frames))
        flaws, distance = find_flaws(one.clip, blend, motions), own_pose_m(one.clip, blend, motions)
        shares = flaws.unsupported_share, flaws.own_unsupported_share
        found.append(Measured(name, *shares, flaws.toe_acceleration_times, distance))
    plain = _plain(found)
    return tuple(sorted(found, key=lambda one: one.score(plain) - _CLEARLY * (one is plain)))


def own_pose_m(clip: Clip, blend: tuple[int, int], motions: Sequence[Clip]) -> float:
    """Root mean square distance of joints from the nearest pose of any motion, on average over blended frames, metres.

    Poses are turned and shifted on the floor to fit best, as point clouds are (`point_cloud`); 0 without a blend.
    """
    if blend[0] == blend[1]:
        return 0.0
    ours = point_cloud(trim(clip, *blend))
    apart = [
        window_distances(ours, _cloud(retarget(motion, clip.skeleton)), 1, precision="double").min(axis=1)
        for motion in motions
    ]
    return float(np.sqrt(np.min(apart, axis=0)).mean())


@lru_cache(maxsize=8)
def _cloud(motion: Clip) -> PointCloud:
    """The point cloud of a motion, kept for the last few: many transitions are made of the same two."""
    return point_cloud(motion)


def why(measured: Sequence[Measured]) -> str:
    """What the first has over the plain blend, in words; empty where nothing was measured."""
    if not measured:
        return ""
    plain, best = _plain(measured), measured[0]
    if best is plain:
        return "no make is clearly better in feet, toes and poses together"
    figures = (
        ("no foot stands in {:.0%} of the frames (blend: {:.0%})", best.unsupported_share, plain.unsupported_share),
        (
            "a toe accelerates {:.2f} times as much as in the clips ({:.2f})",
            best.toe_acceleration_times,
            plain.toe_acceleration_times,
        ),
        ("poses are {:.1f} cm from the clips' own ({:.1f})", 100 * best.own_pose_m, 100 * plain.own_pose_m),
    )
    return ", ".join(words.format(new, old) for words, new, old in figures)


def _plain(measured: Sequence[Measured]) -> Measured:
    return next(one for one in measured if one.make == Slerp.name)
