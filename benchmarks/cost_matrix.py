"""Time the cost of Lee et al. between all frames of two long clips, beside the matrix products that it rests on.

    python benchmarks/cost_matrix.py [--frames N] [--weights wang2003|lee2002] [--repeats N]

The products alone (dot products of each joint's rotations, and of positions and velocities) take turns with the whole
cost, in tiles of the same size, on as many threads. What comes out is thrown away block by block, as when only the
least cost is wanted, so memory does not grow with the number of pairs.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from renderer.workers import cores
from study.motion import quaternions as quat
from study.motion.clip import Clip
from study.motion.synthetic import synthesize
from study.transitions.cost_matrix import extremes, joint_blocks
from study.transitions.threads import one_blas_thread
from study.transitions.weights import joint_weights

ROWS, COLUMNS = 256, 512


def made_up_clip(frames: int, seed: int) -> Clip:
    """Random poses on the rig of the synthetic library, whose joints turn about as far as captured ones do."""
    rig = synthesize("walk", seconds=1.0).skeleton
    rng = np.random.default_rng(seed)
    positions = np.cumsum(rng.normal(scale=0.01, size=(frames, 3)), axis=0)
    rotations = np.concatenate(
        [np.ones((frames, rig.joints, 1)), 0.2 * rng.normal(size=(frames, rig.joints, 3))], axis=2
    )
    return Clip(rig, positions, quat.normalise(rotations), 30.0)


def products(frames: int, joints: int) -> None:
    """The matrix products alone, in single precision."""
    rng = np.random.default_rng(0)
    shapes = [4] * joints + [3 * joints + 7]
    left = [rng.normal(size=(frames, size)).astype(np.float32) for size in shapes]
    right = [np.ascontiguousarray(factor.T) for factor in left]

    def rows(at: int) -> None:
        for across in range(0, frames, COLUMNS):
            for a, b in zip(left, right, strict=True):
                a[at : at + ROWS] @ b[:, across : across + COLUMNS]

    with one_blas_thread(), ThreadPoolExecutor(cores()) as pool:
        list(pool.map(rows, range(0, frames, ROWS)))


def seconds(work: Callable[[], object]) -> float:
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=10_000)
    parser.add_argument("--weights", default="wang2003")
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    clips = made_up_clip(options.frames, 0), made_up_clip(options.frames, 1)
    joints = int(np.count_nonzero(joint_weights(clips[0].skeleton, options.weights, with_root=True)))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    ours, theirs = [], []
    for _ in range(options.repeats):
        ours.append(seconds(lambda: extremes(joint_blocks(*clips, weights=options.weights))))
        theirs.append(seconds(lambda: products(options.frames, joints)))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    whole, alone = statistics.median(ours), statistics.median(theirs)
    print(f"{options.frames} x {options.frames} frames, {joints} weighted joints, {cores()} cores, single precision")
    print(f"  cost, its least and greatest   median {whole:7.2f} s, best {min(ours):7.2f}")
    print(f"  the matrix products alone      median {alone:7.2f} s, best {min(theirs):7.2f}")
    print(f"  ratio {whole / alone:.1f}; memory grew by {(peak - before) / 1024:.0f} MB")


if __name__ == "__main__":
    main()
