"""Time all 60 geodesic blend lengths of one transition, beside the plain implementation of 2004 Eqs. 1 and 2.

    python benchmarks/blend_length.py [--folder FOLDER_OF_CMU_BVH] [--repeats N]

The two take turns, and medians are printed. Without a folder the clips are random turns of the joints on a small rig,
which cost the same to compare as captured ones. The plain implementation is also what the tests compare with.
"""

from __future__ import annotations

import argparse
import statistics
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from study.motion import quaternions as quat
from study.motion.clip import Clip, resample, trim
from study.motion.skeleton import Skeleton
from study.transitions.blend_length import blend_length
from study.transitions.weights import joint_weights


def plain_costs(
    source: Clip, destination: Clip, i: int, j: int, longest: int, weights: NDArray[np.float64]
) -> list[float]:
    """2004 Eqs. 1 and 2 as they are printed, but for the source index: frame by frame, joint by joint."""
    costs = []
    for b in range(1, longest + 1):
        total = 0.0
        for t in range(1, b + 1):
            for k in np.flatnonzero(weights):
                q_source, q_destination = source.rotations[i + t - 1, k], destination.rotations[j - b + t, k]
                turn = quat.log(quat.multiply(quat.conjugate(q_destination), q_source))
                total += float(weights[k]) * float(turn @ turn)
        costs.append(total / b)
    return costs


def vectorised_costs(
    source: Clip, destination: Clip, i: int, j: int, longest: int, weights: NDArray[np.float64]
) -> list[float]:
    """The same, one blend length at a time with whole windows as arrays: what one would write first with NumPy."""
    used = np.flatnonzero(weights)
    costs = []
    for b in range(1, longest + 1):
        a, c = source.rotations[i : i + b, used], destination.rotations[j - b + 1 : j + 1, used]
        costs.append(float(np.mean((quat.half_angle_between(a, c) ** 2) @ weights[used])))
    return costs


def made_up_clips(seed: int = 0) -> tuple[Clip, Clip]:
    names = ["Hips", "Spine", "Head"]
    parents = [-1, 0, 1]
    for side in ("Left", "Right"):
        for chain, top in ((("UpLeg", "Leg", "Foot"), 0), (("Arm", "ForeArm", "Hand"), 1)):
            above = top
            for part in chain:
                names.append(side + part)
                parents.append(above)
                above = len(names) - 1
    offsets = np.full((len(names), 3), 0.2)
    rig = Skeleton(tuple(names), np.array(parents), offsets, np.zeros(0, dtype=np.int64), np.zeros((0, 3)))
    rng = np.random.default_rng(seed)
    rotations = [quat.normalise(rng.normal(size=(200, len(names), 4))) for _ in range(2)]
    return tuple(Clip(rig, np.zeros((200, 3)), q, 30.0) for q in rotations)  # type: ignore[return-value]


def captured_clips(folder: Path) -> tuple[Clip, Clip]:
    from study.motion.files import read_clip

    walks = [read_clip(folder / name) for name in ("16_15.bvh", "16_21.bvh")]
    walks = [resample(trim(clip, 1, clip.frames), 30.0) for clip in walks]
    return walks[0], walks[1]


def milliseconds(work: object) -> float:
    started = time.perf_counter()
    work()  # type: ignore[operator]
    return 1000 * (time.perf_counter() - started)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, help="CMU trials as BVH; 16_15 and 16_21 are used")
    parser.add_argument("--repeats", type=int, default=200)
    options = parser.parse_args()
    source, destination = captured_clips(options.folder) if options.folder else made_up_clips()
    longest = min(60, source.frames - 10, destination.frames - 10)
    i, j = 5, destination.frames - 6
    weights = joint_weights(source.skeleton)

    def ours() -> None:
        blend_length(source, destination, i, j, longest=longest)

    def first_try() -> None:
        vectorised_costs(source, destination, i, j, longest, weights)

    ours()
    times: dict[str, list[float]] = {"blend_length": [], "one length at a time": []}
    for _ in range(options.repeats):
        times["blend_length"].append(milliseconds(ours))
        times["one length at a time"].append(milliseconds(first_try))
    times["plain loops"] = [milliseconds(lambda: plain_costs(source, destination, i, j, longest, weights))]
    print(f"all {longest} geodesic blend lengths of one transition, {source.skeleton.joints} joints, median of runs")
    for label, values in times.items():
        print(f"  {label:22s} {statistics.median(values):9.3f} ms  ({len(values)} runs)")


if __name__ == "__main__":
    main()
