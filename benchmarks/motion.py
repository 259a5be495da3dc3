"""How long a BVH file takes from disk to joint positions, beside pybvh on the same file in the same process.

    python benchmarks/motion.py [FILE] [--runs 15] [--json]

The two take turns, so that what else the machine does falls on both; medians are reported. Without FILE, the longest
trial of the motion capture folder is taken (`../shared/motions`, or the one that SEGUE_MOCAP names).
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import os
import platform
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from study.motion.clip import joint_positions, resample
from study.motion.readers.bvh import read_bvh

MOCAP = Path(os.environ.get("SEGUE_MOCAP", Path(__file__).resolve().parents[2] / "shared" / "motions"))


def seconds(job: Callable[[], object]) -> float:
    start = time.perf_counter()
    job()
    return time.perf_counter() - start


def peer(path: Path) -> Callable[[], object] | None:
    try:
        import pybvh
    except ImportError:
        print("pybvh is missing: python -m pip install pybvh (it comes with segue[test])", file=sys.stderr)
        return None

    def parse_and_place() -> object:
        return pybvh.read_bvh_file(path).node_positions()

    try:
        parse_and_place()
    except ValueError as problem:
        print(f"pybvh can't read {path.name}: {problem}", file=sys.stderr)
        return None
    return parse_and_place


def measure(path: Path, runs: int) -> dict[str, object]:
    clip = read_bvh(path)
    jobs: dict[str, Callable[[], object]] = {
        "parse_and_kinematics": lambda: joint_positions(read_bvh(path), ends=True),
        "parse": lambda: read_bvh(path),
        "kinematics": lambda: joint_positions(clip, ends=True),
        "resample_to_30_fps": lambda: resample(clip, 30.0),
    }
    other = peer(path)
    if other is not None:
        jobs["pybvh_parse_and_kinematics"] = other
    for job in jobs.values():
        job()
    times: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(runs):
        for name, job in jobs.items():
            times[name].append(seconds(job))
    medians = {f"{name}_ms": round(1000 * statistics.median(taken), 2) for name, taken in times.items()}
    best = {f"{name}_best_ms": round(1000 * min(taken), 2) for name, taken in times.items()}
    result: dict[str, object] = {"file": path.name, "frames": clip.frames, "joints": clip.skeleton.joints, "runs": runs}
    result |= medians | best
    if other is not None:
        pairs = zip(times["pybvh_parse_and_kinematics"], times["parse_and_kinematics"], strict=True)
        result["pybvh_over_ours"] = round(statistics.median(theirs / ours for theirs, ours in pairs), 2)
        result["pybvh"] = importlib.metadata.version("pybvh")
    return result | {"python": platform.python_version(), "numpy": np.__version__, "processors": os.cpu_count()}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", nargs="?", type=Path, default=MOCAP / "cmu_bvh" / "06_13.bvh", help="a BVH file")
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    if not options.file.is_file():
        print(f"Expected a BVH file, found none at {options.file}. Name one, or set SEGUE_MOCAP.", file=sys.stderr)
        return 2
    result = measure(options.file, options.runs)
    if options.json:
        print(json.dumps(result))
    else:
        for name, value in result.items():
            print(f"{name:36} {value}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
