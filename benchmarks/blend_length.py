"""Time geodesic blend lengths: of one transition, beside plainer implementations; warped; and by the hundred thousand.

    python benchmarks/blend_length.py [--clips SOURCE DESTINATION] [--repeats N]

The first two take turns, and medians are printed. Without motion files the clips are random turns of the joints on a
small rig, which cost the same to compare as captured ones. The plain implementation is also what the tests compare
with.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from study.motion import quaternions as quat
from study.motion.clip import Clip, resample
from study.motion.skeleton import Skeleton
from study.transitions.batch import geodesic_lengths
from study.transitions.blend_length import geodesic_length
from study.transitions.timewarp import warp_costs
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


def made_up_clips() -> tuple[Clip, Clip]:
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
    rng = np.random.default_rng(0)
    rotations = [quat.normalise(rng.normal(size=(200, len(names), 4))) for _ in range(2)]
    return tuple(Clip(rig, np.zeros((200, 3)), q, 30.0) for q in rotations)  # type: ignore[return-value]


def captured_clips(paths: list[Path]) -> tuple[Clip, Clip]:
    from study.motion.readers.registry import read_clip

    source, destination = (resample(read_clip(path), 30.0) for path in paths)
    return source, destination


def milliseconds(work: Callable[[], object]) -> float:
    started = time.perf_counter()
    work()
    return 1000 * (time.perf_counter() - started)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clips", type=Path, nargs=2, help="motion files of one rig")
    parser.add_argument("--repeats", type=int, default=200)
    options = parser.parse_args()
    source, destination = captured_clips(options.clips) if options.clips else made_up_clips()
    longest = min(60, source.frames - 10, destination.frames - 10)
    i, j = 5, destination.frames - 6
    weights = joint_weights(source.skeleton)
    times: dict[str, list[float]] = {"blend_length": [], "one length at a time": [], "plain loops": []}
    for repeat in range(options.repeats + 1):
        ours = milliseconds(lambda: geodesic_length(source, destination, i, j, longest=longest))
        first_try = milliseconds(lambda: vectorised_costs(source, destination, i, j, longest, weights))
        if repeat:  # the first round warms up
            times["blend_length"].append(ours)
            times["one length at a time"].append(first_try)
    times["plain loops"].append(milliseconds(lambda: plain_costs(source, destination, i, j, longest, weights)))
    print(f"all {longest} geodesic blend lengths of one transition, {source.skeleton.joints} joints")
    show(times)
    warped = [milliseconds(lambda: warp_costs(source, destination, i, j, longest, weights)) for _ in range(20)][1:]
    print(f"all {longest} x {longest} time-warped costs of one transition")
    show({"warp_costs": warped})
    rng = np.random.default_rng(0)
    starts = rng.integers(0, source.frames - longest + 1, 100_000)
    ends = rng.integers(longest - 1, destination.frames, 100_000)
    batch = [milliseconds(lambda: geodesic_lengths(source, destination, starts, ends)) for _ in range(5)]
    print(f"100,000 geodesic blend lengths between two clips, {source.frames} and {destination.frames} frames")
    show({"geodesic_lengths": batch})


def show(times: dict[str, list[float]]) -> None:
    for label, values in times.items():
        print(
            f"  {label:22s} median {statistics.median(values):9.3f} ms, best {min(values):9.3f}  ({len(values)} runs)"
        )


if __name__ == "__main__":
    main()
