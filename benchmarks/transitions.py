"""Transitions between captured locomotion clips: their lengths, and how smoothly they join.

    python benchmarks/transitions.py FOLDER [--transitions N] [--seed N]

FOLDER is a library of motions, such as CMU trials. Geodesic lengths are counted over 200 random points of every pair of
motions; blends (of five frames or more, feet planted) are judged at random points, and the time-warped blends at the
same points beside them. A change of velocity is that from one frame to the next, in and around the blend, as a share of
the largest that the two clips show anywhere themselves: 1 and less is no more abrupt than the motions are.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from study.errors import SegueError
from study.motion import quaternions as quat
from study.motion.clip import Clip, retarget
from study.motion.library import Library, open_library
from study.transitions.batch import geodesic_lengths
from study.transitions.blend_length import geodesic_length
from study.transitions.blending import blend, facing
from study.transitions.footskate import plant_feet
from study.transitions.timewarp import warp_length, warped_blend

MOTIONS = ("walk_slow", "walk", "walk_fast", "jog", "run", "run_fast", "stand_to_walk", "stand_to_run", "walk_to_stop")
MOTIONS += ("run_to_stop", "walk_turn_left", "walk_turn_right", "run_turn_left")
LONGEST, EDGE = 60, 8


def joint_jerks(clip: Clip) -> NDArray[np.float64]:
    """The largest change of any joint's velocity at each frame."""
    velocity = quat.log(quat.multiply(quat.conjugate(clip.rotations[:-1, 1:]), clip.rotations[1:, 1:]))
    return np.asarray(np.linalg.norm(np.diff(velocity, axis=0), axis=-1).max(axis=1))


def root_jerks(clip: Clip) -> NDArray[np.float64]:
    """The change of the root's velocity, in the figure's facing, at each frame."""
    heading = facing(clip)
    steps = quat.rotate(quat.yaw(-0.5 * (heading[1:] + heading[:-1])), np.diff(clip.root_positions, axis=0))
    return np.asarray(np.linalg.norm(np.diff(steps, axis=0), axis=1))


def room(source: Clip, destination: Clip) -> int:
    return min(LONGEST, source.frames - EDGE, destination.frames - EDGE)


def captured(library: Library) -> dict[str, Clip]:
    clips = {name: library.clip(name, fps=30.0) for name in MOTIONS if name in library.names()}
    skeleton = next(iter(clips.values())).skeleton
    return {name: retarget(clip, skeleton) for name, clip in clips.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--transitions", type=int, default=120)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    clips = captured(open_library(options.folder))
    lengths = []
    for a, source in clips.items():
        for b, destination in clips.items():
            if a != b:
                longest = room(source, destination)
                starts = rng.integers(0, source.frames - longest + 1, 200)
                ends = rng.integers(longest - 1, destination.frames, 200)
                lengths.append(geodesic_lengths(source, destination, starts, ends)[0])
    found = np.concatenate(lengths)
    quartiles = ", ".join(f"{value:g}" for value in np.quantile(found, [0.05, 0.25, 0.5, 0.75, 0.95]))
    usual = np.mean((found >= 5) & (found <= 35))
    print(f"{len(found)} geodesic lengths between {len(clips)} motions: {usual:.0%} from 5 to 35 frames")
    print(f"  5, 25, 50, 75, 95%: {quartiles} frames")
    rows = np.array([judged(clips, rng) for _ in range(options.transitions)])
    joints, roots, warped = rows.T
    print(f"{len(rows)} blends of 5 frames or more; changes of velocity as a share of the clips' own largest:")
    for label, values in (("joints", joints), ("root", roots), ("joints, time-warped", warped)):
        over = np.mean(values > 1)
        print(f"  {label:20} median {np.median(values):.2f}, largest {values.max():.2f}, above 1 in {over:.1%}")


def judged(clips: dict[str, Clip], rng: np.random.Generator) -> list[float]:
    """One random transition, drawn again until its blend has five frames or more."""
    while True:
        a, b = rng.choice(list(clips), 2, replace=False)
        source, destination = clips[a], clips[b]
        longest = room(source, destination)
        start = int(rng.integers(2, source.frames - longest + 1))
        end = int(rng.integers(longest, destination.frames))
        try:
            length = geodesic_length(source, destination, start, end, longest=longest).blend_frames
            warp = warp_length(source, destination, start, end, longest=longest)
            if length < 5 or end > destination.frames - 4:
                continue
            made = blend(source, destination, start, end, length)
            bent = warped_blend(source, destination, start, end, warp.source_frames, warp.destination_frames)
        except SegueError:
            continue
        planted = plant_feet(made, source, destination)
        around = slice(made.blend_start - 2, made.blend_stop + 1)
        around_warp = slice(bent.blend_start - 2, bent.blend_stop + 1)
        own = max(joint_jerks(clip).max() for clip in (source, destination))
        own_root = max(root_jerks(clip).max() for clip in (source, destination))
        return [
            float(joint_jerks(planted.clip)[around].max() / own),
            float(root_jerks(planted.clip)[around].max() / own_root),
            float(joint_jerks(bent.clip)[around_warp].max() / own),
        ]


if __name__ == "__main__":
    main()
