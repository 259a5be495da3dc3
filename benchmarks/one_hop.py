"""Time the one-hop search at the size of Koyama & Goto 2019, and check it against trying everything.

    python benchmarks/one_hop.py                       the paper's size: one pair, 1,000 triggered frames
    python benchmarks/one_hop.py --all                 also all 380 ordered pairs, every frame a trigger
    python benchmarks/one_hop.py --adaptive            blends of their own length beside those of one, on four clips
    python benchmarks/one_hop.py --clips A.amc B.amc   sampled entries on these clips against trying all
    python benchmarks/one_hop.py --json                one JSON object

The paper's size is 20 clips of 1,200 frames at 60 fps, 20 joints, blends of 30 frames, stays of up to 60; their search
took a server of 36 cores about an hour for 1,000 triggered frames. Times include the distances. `music` keeps one
offset for all triggers, `start` begins the destination at the same frame for each. The motions are synthetic dances,
two joints of which weigh nothing, which leaves 20. `cpu_seconds` is the time of all threads together: on a machine
that does something else as well, it says more than `seconds`. Sampled entries are compared with a search that
looks at every combination; `brute_force_s_each` is what it takes for one triggered frame, distances not counted.
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from renderer.workers import cores
from study.motion.clip import Clip, resample, retarget, trim
from study.motion.mending import mend
from study.motion.readers.registry import read_clip
from study.motion.synthetic import synthesize
from study.transitions.one_hop.adaptive import adaptive
from study.transitions.one_hop.build import build_table
from study.transitions.one_hop.problem import (
    FORBIDDEN,
    Alignment,
    PointCloudDistance,
    Problem,
    Settings,
    Switch,
    weight_in_counts,
)
from study.transitions.one_hop.table import OneHopTable

WEIGHT = 2.5e-4
ALIGNMENTS = {"music": Alignment(offset=0), "start": Alignment(destination_frame=100)}


def dances(count: int = 20, frames: int = 1200) -> tuple[Clip, ...]:
    """Synthetic dances at 60 fps, no two alike."""
    kinds = ("dance", "dance_modern", "dance_turns", "tai_chi", "box")
    clips = []
    for number in range(count):
        clip = synthesize(kinds[number % len(kinds)], seconds=frames / 60.0 + 0.1, fps=60.0, seed=number)
        clips.append(replace(trim(clip, 0, frames), name=f"{clip.name}{number}"))
    return tuple(clips)


def distance_of(clips: Sequence[Clip], joints: int) -> PointCloudDistance:
    """Point clouds of so many joints, the first ones."""
    weights = np.zeros(clips[0].skeleton.joints)
    weights[:joints] = 1.0
    return PointCloudDistance(weights)


Legs = dict[tuple[int, int], np.ndarray]


def brute_force(problem: Problem, switch: Switch, trigger: int, legs: Legs) -> tuple[int, ...]:
    """Every combination for one trigger: the cost, stay, hop, frame and stay of the best, by the rule for ties.

    `legs` holds whole distance matrices by (clip, hop), and is filled as they are needed.
    """
    settings, blend = problem.settings, problem.settings.blend_frames
    to, end = switch.alignment.offset_at(trigger), problem.clips[switch.destination].frames
    best = (FORBIDDEN, 0, -1, 0, 0)
    for hop in problem.hop_numbers:
        for clip in (switch.source, switch.destination):
            if (clip, hop) not in legs:
                a, b = (problem.distance.prepare(problem.clips[number], blend) for number in (clip, hop))
                rows, columns = (range(max(problem.clips[n].frames - blend + 1, 0)) for n in (clip, hop))
                legs[clip, hop] = problem.distance.counts(a, b if clip != hop else a, blend, rows, columns)
        first, second = legs[switch.source, hop], legs[switch.destination, hop]
        for stay in range(min(settings.longest_stay_source, len(first) - 1 - trigger) + 1):
            row, arrival = first[trigger + stay] + stay * problem.weight, trigger + stay + blend - to
            if hop == switch.destination and blend <= arrival <= end and arrival - blend < len(row):
                best = min(best, (int(row[arrival - blend]), stay, hop, arrival - blend, 0))
            for stay_hop in range(settings.longest_stay_hop + 1):
                if not 0 <= arrival + stay_hop < len(second) or blend + stay_hop >= len(row):
                    continue
                costs = row[: len(row) - blend - stay_hop] + second[arrival + stay_hop, blend + stay_hop :]
                frame = int(costs.argmin())
                cost = int(costs[frame]) + stay_hop * problem.weight
                best = min(best, (cost, stay, hop, frame, stay_hop))
    return best


def check(problem: Problem, table: OneHopTable, samples: int, rng: np.random.Generator) -> dict[str, Any]:
    """Sampled entries against brute force, which works on the same distances but looks at every combination."""
    able = np.flatnonzero(table.entries[:, 0] >= 0)
    chosen = np.sort(rng.choice(able, min(samples, len(able)), replace=False))
    legs: Legs = {}
    equal, times = 0, []
    for position in chosen:
        number = next(k for k, row in enumerate(table.rows) if 0 <= position - row.first_entry < row.triggers)
        trigger = int(position) - table.rows[number].first_entry + table.rows[number].first_trigger
        start = time.perf_counter()
        cost, stay, hop, frame, stay_hop = brute_force(problem, problem.switches[number], trigger, legs)
        times.append(time.perf_counter() - start)
        # Matrix products in single precision: other blocks, or another processor, round by a count or two.
        same_cost = abs(cost - round(table.costs[position] / problem.distance.unit)) <= 2
        equal += same_cost and [hop, trigger + stay - frame, stay, stay_hop] == table.entries[position].tolist()
    return {"sampled": len(chosen), "equal": equal, "brute_force_s_each": statistics.median(times)}


def paper_size(clips: tuple[Clip, ...], repeats: int) -> dict[str, Any]:
    """1,000 triggered frames of one source and destination."""
    distance = distance_of(clips, 20)
    result: dict[str, Any] = {}
    for name, alignment in ALIGNMENTS.items():
        switches = (Switch(0, 1, alignment, 0, 999),)
        problem = Problem(clips, switches, Settings(), weight_in_counts(WEIGHT, distance), distance)
        times, busy = [], []
        for _ in range(repeats):
            start, before = time.perf_counter(), time.process_time()
            table = build_table(problem)
            times.append(time.perf_counter() - start)
            busy.append(time.process_time() - before)
        found = np.isfinite(table.costs) & np.isfinite(table.direct_costs)
        result[name] = {
            "seconds": statistics.median(times),
            "least_seconds": min(times),
            "cpu_seconds": statistics.median(busy),
            "found": int((table.entries[:, 0] >= 0).sum()),
            "mean_cost": float(table.costs[found].mean()),
            "mean_direct_cost": float(table.direct_costs[found].mean()),
            **check(problem, table, 5, np.random.default_rng(0)),
        }
    return result


def all_pairs(clips: tuple[Clip, ...]) -> dict[str, Any]:
    """Every ordered pair, every frame a trigger."""
    distance = distance_of(clips, 20)
    result: dict[str, Any] = {}
    for name, alignment in ALIGNMENTS.items():
        switches = tuple(Switch(a, b, alignment) for a in range(len(clips)) for b in range(len(clips)) if a != b)
        problem = Problem(clips, switches, Settings(), weight_in_counts(WEIGHT, distance), distance)
        start, before = time.perf_counter(), time.process_time()
        table = build_table(problem)
        taken = {"seconds": time.perf_counter() - start, "cpu_seconds": time.process_time() - before}
        result[name] = {**taken, "pairs": len(switches), "entries": len(table.entries)}
    # Kilobytes on Linux; the most that the whole process ever held.
    result["peak_gb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return result


def adaptive_size(clips: tuple[Clip, ...], repeats: int) -> dict[str, Any]:
    """How much longer the search takes where blends have their own length, by turns; all pairs of the clips."""
    rows: dict[str, Any] = {}
    for name, alignment in ALIGNMENTS.items():
        pairs = [(a, b) for a in range(len(clips)) for b in range(len(clips)) if a != b]
        switches = tuple(Switch(*pair, alignment) for pair in pairs)
        fixed = Problem(clips, switches, Settings(), weight_in_counts(WEIGHT, PointCloudDistance()))
        taken: dict[str, list[float]] = {"fixed": [], "adaptive": []}
        for _ in range(repeats):
            for kind, problem in (("fixed", fixed), ("adaptive", adaptive(fixed))):
                started = time.process_time()
                build_table(problem)
                taken[kind].append(time.process_time() - started)
        seconds = {f"{kind}_cpu_seconds": statistics.median(values) for kind, values in taken.items()}
        ratio = statistics.median(a / b for a, b in zip(taken["adaptive"], taken["fixed"], strict=True))
        rows[name] = {**seconds, "ratio": ratio}
    return rows


def own_clips(files: Sequence[Path], samples: int) -> dict[str, Any]:
    """Sampled entries for all pairs of captured clips, at 60 fps on one body."""
    clips = [replace(resample(mend(read_clip(file)), 60.0), name=file.stem) for file in files]
    clips = [retarget(clip, clips[0].skeleton) for clip in clips]
    distance = PointCloudDistance()
    result: dict[str, Any] = {"clips": [clip.name for clip in clips]}
    for name, alignment in (("music", Alignment(offset=0)), ("start", Alignment(destination_frame=10))):
        switches = tuple(Switch(a, b, alignment) for a in range(len(clips)) for b in range(len(clips)) if a != b)
        problem = Problem(tuple(clips), switches, Settings(), weight_in_counts(WEIGHT, distance), distance)
        start = time.perf_counter()
        table = build_table(problem)
        result[name] = {"seconds": time.perf_counter() - start, "entries": len(table.entries)}
        result[name] |= check(problem, table, samples, np.random.default_rng(1))
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--all", action="store_true", help="all 380 ordered pairs, too")
    parser.add_argument("--adaptive", action="store_true", help="blends of their own length, beside those of one")
    parser.add_argument("--clips", nargs="+", type=Path, default=[], help="motion files of one rig")
    parser.add_argument("--samples", type=int, default=10, help="entries to check on them")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args()
    result: dict[str, Any] = {"cores": cores(), "numpy": np.__version__}
    if chosen.clips:
        result["clips"] = own_clips(chosen.clips, chosen.samples)
    elif chosen.adaptive:
        result["adaptive"] = adaptive_size(dances(4, 600), chosen.repeats)
    else:
        clips = dances()
        result["paper_size"] = paper_size(clips, chosen.repeats)
        if chosen.all:
            result["all_pairs"] = all_pairs(clips)
    if chosen.json:
        print(json.dumps(result, indent=2))
        return
    for part, values in result.items():
        if not isinstance(values, dict):
            print(f"{part}: {values}")
            continue
        for name, row in values.items():
            shown = row.items() if isinstance(row, dict) else [(name, row)]
            words = ", ".join(
                f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}" for key, value in shown
            )
            print(f"{part}, {name}: {words}")


if __name__ == "__main__":
    main()
