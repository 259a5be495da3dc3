"""Predicted and measured cost of one-hop tables as the library grows: the curve behind `segue one-hop build --plan`.

    python benchmarks/one_hop_scaling.py                        10, 20 and 40 clips of 20 s, all pairs; 1,000 predicted
    python benchmarks/one_hop_scaling.py --clips 10 20 40 80    others
    python benchmarks/one_hop_scaling.py --memory-gb 0.25       less memory: more blocks, their tables on the disk
    python benchmarks/one_hop_scaling.py --start                the destination starts at one frame, as a jump does
    python benchmarks/one_hop_scaling.py --json                 one JSON object

Each size is a process of its own, which first plans and then builds: `core_s` is processor time of all threads,
`peak_gb` the most that the process held (on Linux) less what it held after a table of two short clips. Synthetic dances
at 60 fps, blends of 30 frames, stays of up to 60, one worker unless `--workers` says otherwise.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.one_hop import ALIGNMENTS, WEIGHT, dances
from study.transitions.one_hop.build import build_table
from study.transitions.one_hop.plan import plan
from study.transitions.one_hop.problem import PointCloudDistance, Problem, Settings, Switch, weight_in_counts

FRAMES = 1200


def held_bytes() -> int:
    """The most that this process ever held; Linux counts in kilobytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def problem_of(count: int, alignment: str, drawn: int = 80, frames: int = FRAMES) -> Problem:
    """All pairs of so many dances; more than `drawn` are the same ones again: enough for the trial of a plan."""
    made = dances(min(count, drawn), frames)
    clips = tuple(replace(made[n % drawn], name=f"clip{n}") for n in range(count))
    pairs = (Switch(a, b, ALIGNMENTS[alignment]) for a in range(count) for b in range(count) if a != b)
    distance = PointCloudDistance()
    return Problem(clips, tuple(pairs), Settings(), weight_in_counts(WEIGHT, distance), distance)


def one_size(count: int, alignment: str, memory_bytes: int, workers: int, build: bool) -> dict[str, Any]:
    """Plan, then build, in this process."""
    build_table(problem_of(2, alignment, frames=200), workers=1)
    before = held_bytes()
    problem = problem_of(count, alignment)
    started = time.process_time()
    expected = plan(problem, memory_bytes, workers)
    row = {"predicted": {**asdict(expected), "peak_gb": expected.peak_bytes / 2**30}}
    row["plan_s"] = time.process_time() - started
    if build:
        started = time.process_time()
        with tempfile.TemporaryDirectory() as folder:
            table = build_table(
                problem, workers=workers, memory_bytes=memory_bytes, checkpoint=Path(folder) / "unfinished.npz"
            )
        core_s, peak_gb = time.process_time() - started, (held_bytes() - before) / 2**30
        row["measured"] = {"core_s": core_s, "peak_gb": peak_gb, "entries": len(table.entries)}
        row["ratio"] = {"core_s": core_s / expected.core_s, "peak_gb": peak_gb / row["predicted"]["peak_gb"]}
    return row


def apart(count: int, chosen: argparse.Namespace, build: bool) -> dict[str, Any]:
    """`one_size` in a process of its own."""
    words = ["--one", str(count), "--memory-gb", str(chosen.memory_gb), "--workers", str(chosen.workers)]
    words += ["--start"] * chosen.start + ["--only-plan"] * (not build)
    told = subprocess.run([sys.executable, __file__, *words], check=True, capture_output=True, text=True).stdout
    return json.loads(told)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--clips", nargs="+", type=int, default=[10, 20, 40])
    parser.add_argument("--predict", nargs="*", type=int, default=[1000], help="sizes to plan only")
    parser.add_argument("--memory-gb", type=float, default=2.0)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--start", action="store_true", help="the destination starts at one frame")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--only-plan", action="store_true", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.one:
        alignment = "start" if chosen.start else "music"
        row = one_size(chosen.one, alignment, int(chosen.memory_gb * 2**30), chosen.workers, not chosen.only_plan)
        print(json.dumps(row))
        return
    result = {}
    for count, build in [*((n, True) for n in chosen.clips), *((n, False) for n in chosen.predict)]:
        row = result[count] = apart(count, chosen, build)
        if not chosen.json:
            told, found = row["predicted"], row.get("measured", {})
            print(
                f"{count} clips, {told['transitions']} transitions, {told['blocks']} blocks: processor predicted "
                f"{told['core_s']:.4g} s, measured {found.get('core_s', float('nan')):.4g} s; memory predicted "
                f"{told['peak_gb']:.3f} GB, measured {found.get('peak_gb', float('nan')):.3f} GB; table "
                f"{told['table_bytes'] / 2**30:.3f} GB; planned in {row['plan_s']:.3g} s",
                flush=True,
            )
    if chosen.json:
        print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
