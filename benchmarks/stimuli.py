"""Flaws of stimuli that their methods did not intend: skating, sunken and jumping feet, sudden changes of velocity.

    python benchmarks/stimuli.py [--protocol NAME]... [--library FOLDER]... [--folder FOLDER]... [--pairs N] [--json X]
    python benchmarks/stimuli.py --methods [--library FOLDER]... [--pairs N]

Every protocol is made on the synthetic library and on each `--library` that has its motions; of each `--folder`, random
pairs of its motions are blended at random points over the geodesic length, a fixed one and a long one. Each stimulus is
measured by `study.transitions.flaws` and, to check that, by the arithmetic below, which shares no code with it: forward
kinematics with rotation matrices on the arrays of a clip.

With `--methods`, every built-in method that takes given points joins the same random pairs of each library at the same
random points, and all are measured over the same frames: those of the longest.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.apps.cli.shared import load
from study.errors import SegueError
from study.experiment.stimuli.drafts import Draft, add_drafts
from study.experiment.stimuli.films import Film, plan_all
from study.experiment.stimuli.ways import Ways
from study.motion.clip import Clip, retarget, trim
from study.motion.library import open_library
from study.motion.synthetic import synthesize
from study.transitions.blend_length import geodesic_length
from study.transitions.comparison import own_pose_m
from study.transitions.flaws import Flaws, find_flaws
from study.transitions.methods.makes.blends import Blended
from study.transitions.methods.method import Motions, Place
from study.transitions.methods.points.shared import Shared
from study.transitions.methods.registry import DIRECT, METHODS

PROTOCOLS = sorted(path.stem for path in (Path(__file__).parents[1] / "protocols").glob("*.toml"))

Array = NDArray[np.float64]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--library", action="append", default=[])
    parser.add_argument("--folder", action="append", default=[])
    parser.add_argument("--protocol", action="append", default=[])
    parser.add_argument("--pairs", type=int, default=40)
    parser.add_argument("--fps", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--methods", action="store_true")
    options = parser.parse_args()
    if options.methods:
        for library in ["synthetic", *options.library]:
            method_table(library, options.pairs, options.fps, np.random.default_rng(options.seed))
        pose_costs()
        return
    rows: list[dict[str, Any]] = []
    for library in ["synthetic", *options.library]:
        for protocol in options.protocol or PROTOCOLS:
            rows += _shown(f"{protocol} on {Path(library).name}", protocol_stimuli(protocol, library))
    for folder in options.folder:
        found = folder_stimuli(folder, options.pairs, options.fps, np.random.default_rng(options.seed))
        rows += _shown(f"pairs of {Path(folder).name}", found)
    if rows:
        _print("all", rows)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))


Measurable = tuple[str, Clip, tuple[int, int], Sequence[Clip], float]


def protocol_stimuli(name: str, library: str) -> Iterator[Measurable]:
    """Every stimulus of a protocol: its name, frames, blend, motions, and the seconds that it took to make."""
    protocol, opened = load(name), open_library(library)
    ways = Ways(protocol, opened)
    planned, _ = plan_all(protocol, opened, ways)
    seen: dict[Film, Draft] = {}
    for each in planned:
        before = set(seen)
        began = time.perf_counter()
        add_drafts(protocol, each, seen, ways)
        seconds = (time.perf_counter() - began) / max(len(seen) - len(before), 1)
        for film, draft in seen.items():
            if film not in before:
                what = f"{each.study.name} {draft.settled.transition.name} {draft.method} {draft.blend_frames}"
                motions = film.way.motions(ways.place(each.study, draft.settled))
                yield what, draft.clip, draft.blend, motions, seconds


def folder_stimuli(folder: str, pairs: int, fps: float, rng: np.random.Generator) -> Iterator[Measurable]:
    """Blends between random motions of a folder that share a rig."""
    for place in random_places(folder, fps, rng):
        geodesic = geodesic_length(place.source, place.destination, place.start_frame, place.end_frame).blend_frames
        lengths = {"geodesic": geodesic, "fixed": round(fps / 3), "long": round(0.8 * fps)}
        found = []
        try:
            for kind, frames in lengths.items():
                began = time.perf_counter()
                done = Blended((frames, frames), "linear", clean_feet=True).made(place)
                found.append((f"{kind} {frames}", done, time.perf_counter() - began))
        except SegueError:
            continue
        for kind, done, seconds in found:
            first = max(0, done.blend_start - round(fps))
            clip = trim(done.clip, first, min(done.clip.frames, done.blend_stop + round(fps)))
            blend = done.blend_start - first, done.blend_stop - first
            yield f"{place.transition} {kind}", clip, blend, (place.source, place.destination), seconds
        if not (pairs := pairs - 1):
            return


def random_places(folder: str, fps: float, rng: np.random.Generator) -> Iterator[Place]:
    """Random points of random pairs of a folder's motions that share a rig, 1,200 of them."""
    library = open_library(folder)
    clips: dict[str, Clip] = {}
    for name in library.names():
        with suppress(SegueError):
            clips[name] = library.clip(name, fps=fps)
    usable = [name for name, clip in clips.items() if clip.seconds > 1.5]
    hops = tuple(str(name) for name in rng.choice(usable, min(6, len(usable)), replace=False))

    def fitted(name: str, like: Clip) -> Clip:
        return retarget(clips[name], like.skeleton)

    motions = Motions(hops, fitted, Path, lambda _: np.random.default_rng(0), {})
    for _ in range(1200):
        a, b = (str(name) for name in rng.choice(usable, 2, replace=False))
        with suppress(SegueError, ValueError):
            source, destination = clips[a], fitted(b, clips[a])
            start = int(rng.integers(round(0.3 * fps), source.frames - 5))
            end = int(rng.integers(5, destination.frames - round(0.5 * fps)))
            yield Place(f"{a}:{start} to {b}:{end}", (a, b), source, destination, start, end, motions)


def method_table(folder: str, pairs: int, fps: float, rng: np.random.Generator) -> None:
    """Every method at the same places, as rows of a table."""
    methods = {name: one for name, one in METHODS.items() if isinstance(one.points, Shared)}
    rows: dict[str, list[list[float]]] = {name: [] for name in methods}
    done = 0
    for place in random_places(folder, fps, rng):
        clips, points = (place.source, place.destination), (place.start_frame, place.end_frame)
        made = {}
        try:
            for name, method in methods.items():
                length = method.length.at(*clips, *points) if method.length.windows else None
                way = method.make.way(place, length.windows if length else (0, 0))
                made[name] = way.made(place), way.motions(place)
        except SegueError:
            continue
        longest = max(one.blend_stop - one.blend_start for one, _ in made.values())
        for name, (one, motions) in made.items():
            blend = one.blend_start, min(one.blend_start + longest, one.clip.frames)
            flaws = find_flaws(one.clip, blend, motions)
            skating = 0.5 * (flaws.left.skating_share + flaws.right.skating_share)
            limited = [float(getattr(flaws, f"{key}_times") > limit) for key, limit in _LIMITS]
            shares = [flaws.unsupported_share, skating, flaws.toe_acceleration_times, *limited]
            rows[name].append([*shares, 100 * own_pose_m(one.clip, blend, motions)])
        if (done := done + 1) == pairs:
            break
    print(f"{Path(folder).name}: {done} transitions, each by every method")
    print(
        "| method | no foot stands | a foot skates | toe, median times | toe > 1.5 times, % | joint > 1, % "
        "| root > 1, % | from own poses, cm |"
    )
    for name, found in rows.items():
        values = np.array(found)
        mean, toe = values.mean(axis=0), np.median(values[:, 2])
        percent = " | ".join(f"{100 * share:.0f}" for share in mean[3:6])
        print(f"| `{name}` | {mean[0]:.3f} | {mean[1]:.3f} | {toe:.2f} | {percent} | {mean[6]:.1f} |", flush=True)


def pose_costs() -> None:
    """What each make takes for a further pose, feet as they come: 60 blended frames less 1, the least of 100 times."""
    walk, run = synthesize("walk", seconds=8.0), synthesize("run", seconds=8.0)
    for name, make in DIRECT.items():
        bare = make().with_settings({"clean_feet": False})
        places = [Place("", ("", ""), walk, run, 60, 70 + frames) for frames in (1, 60)]
        ways = [bare.way(place, (frames, frames)) for place, frames in zip(places, (1, 60), strict=True)]
        least = [np.inf, np.inf]
        for _ in range(100):
            for k, (way, place) in enumerate(zip(ways, places, strict=True)):
                began = time.perf_counter()
                way.made(place)
                least[k] = min(least[k], time.perf_counter() - began)
        further = (least[1] - least[0]) / (ways[1].frames - ways[0].frames)
        print(f"{name}: {1e3 * least[0]:.1f} ms for the first pose, {1e6 * further:.0f} us for a further one")


def _shown(title: str, stimuli: Iterator[Measurable]) -> list[dict[str, Any]]:
    """Measure, print a table, and return its rows."""
    rows = []
    try:
        for name, clip, blend, motions, seconds in stimuli:
            flaws = find_flaws(clip, blend, motions)
            other = plain_figures(clip, blend, [retarget(motion, clip.skeleton) for motion in motions])
            _compare(name, flaws, other)
            if blend[1] > blend[0]:
                row = {"set": title, "name": name, "frames": blend[1] - blend[0], "seconds": seconds, **asdict(flaws)}
                for key in ("sink_m", *(f"{key}_times" for key, _ in _LIMITS)):
                    row[key] = getattr(flaws, key)
                for key in ("skating_share", "own_skating_share"):
                    row[key] = 0.5 * (getattr(flaws.left, key) + getattr(flaws.right, key))
                rows.append(row)
    except SegueError as error:
        print(f"{title}: {error}"[:200])
    if rows:
        _print(title, rows)
    return rows


def _print(title: str, rows: Sequence[dict[str, Any]]) -> None:
    frames = np.array([row["frames"] for row in rows], dtype=float)

    def pooled(key: str) -> float:
        return float(np.sum(frames * [row[key] for row in rows]) / frames.sum())

    def over(key: str, limit: float) -> str:
        values = np.array([row[key] for row in rows])
        return (
            f"median {np.median(values):.2f}, most {values.max():.2f}, over {limit:g} in {np.mean(values > limit):.1%}"
        )

    print(f"{title}: {len(rows)} stimuli, {1000 * np.median([row['seconds'] for row in rows]):.0f} ms each")
    for what, key in (("no foot stands", "unsupported"), ("a foot skates", "skating"), ("airborne", "airborne")):
        shares = pooled(f"{key}_share"), pooled(f"own_{key}_share")
        print(f"  {what:28} {shares[0]:.3f} of the blended frames, {shares[1]:.3f} of the motions' own")
    for key, limit in (("sink_m", 0.02), *((f"{name}_times", limit) for name, limit in _LIMITS)):
        print(f"  {key:28} {over(key, limit)}", flush=True)


_LIMITS = (("toe_acceleration", 1.5), ("joint_velocity_change", 1.0), ("root_velocity_change", 1.0))


def _compare(name: str, flaws: Flaws, other: dict[str, float]) -> None:
    """Stop where the two measures differ."""
    for key, value in other.items():
        found: Any = flaws
        for part in key.split("."):
            found = getattr(found, part)
        if abs(found - value) > 2e-6 * max(1.0, abs(value)):
            raise AssertionError(f"{name}: {key} is {found} by study and {value} by plain arithmetic")


def matrices(q: Array) -> Array:
    """Rotation matrices `(..., 3, 3)` of unit quaternions `(..., 4)`, scalar first."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def plain_figures(clip: Clip, blend: tuple[int, int], motions: Sequence[Clip]) -> dict[str, float]:
    """The figures of `Flaws` again, frame by frame and point by point."""
    own = [plain_feet(motion) for motion in motions]
    made = plain_feet(clip)
    own_lows = [plain_lows(feet) for feet, _, _ in own]
    lows = [[max(heights) for heights in zip(*(each[foot] for each in own_lows), strict=True)] for foot in (0, 1)]
    standing = max(plain_standing(feet, low, clip.fps) for (feet, _, _), low in zip(own, own_lows, strict=True))
    inside = range(*blend)
    last = min(len(clip.root_positions) - 1, blend[1] + round(0.25 * clip.fps))
    around = [f for f in range(max(blend[0] - 1, 1), last) if f >= 1]
    toe = [(made[1][f + 1] - 2 * made[1][f] + made[1][f - 1]) * clip.fps**2 for f in around]
    toe_own = max(float(np.linalg.norm(np.diff(toes, n=2, axis=0), axis=-1).max()) for _, toes, _ in own) * clip.fps**2
    root = max(float(np.linalg.norm(made[2][f + 1] - 2 * made[2][f] + made[2][f - 1])) for f in around) * clip.fps
    root_own = max(float(np.linalg.norm(np.diff(path, n=2, axis=0), axis=-1).max()) for _, _, path in own) * clip.fps
    unsupported = sum(plain_state(made[0], lows, standing, f, clip.fps) == "slides" for f in inside)
    count = max(len(inside), 1)
    own_states = [
        plain_state(feet, low, standing, f, clip.fps)
        for (feet, _, _), low in zip(own, own_lows, strict=True)
        for f in range(len(feet[0]))
    ]
    after = range(max(blend[0] - 1, 0), min(len(clip.root_positions), blend[1] + round(0.25 * clip.fps)))
    sink = [
        min(float(feet[foot][..., 1].min()) for feet, _, _ in own)
        - min(float(made[0][foot][f, :, 1].min()) for f in after)
        for foot in (0, 1)
    ]
    return {
        "unsupported_share": unsupported / count,
        "own_unsupported_share": own_states.count("slides") / len(own_states),
        "left.sink_m": sink[0],
        "right.sink_m": sink[1],
        "left.toe_acceleration_m_per_s2": max(float(np.linalg.norm(a[0])) for a in toe),
        "right.toe_acceleration_m_per_s2": max(float(np.linalg.norm(a[1])) for a in toe),
        "left.own_toe_acceleration_m_per_s2": toe_own,
        "root_velocity_change_m_per_s": root,
        "own_root_velocity_change_m_per_s": root_own,
    }


def plain_feet(clip: Clip) -> tuple[list[Array], Array, Array]:
    """Points of both feet `(frames, points, 3)`, toes `(frames, 2, 3)` and the root's path, from a clip's arrays."""
    rig = clip.skeleton
    turned, at = [matrices(clip.rotations[:, 0])], [np.array(clip.root_positions)]
    for joint in range(1, len(rig.parents)):
        above = int(rig.parents[joint])
        at.append(at[above] + np.einsum("fab,b->fa", turned[above], rig.offsets[joint]))
        turned.append(turned[above] @ matrices(clip.rotations[:, joint]))
    feet, toes = [], []
    for side in "LR":
        ankle = rig.roles[f"ankle.{side}"]
        joints = [ankle, *(j for j in range(len(rig.parents)) if int(rig.parents[j]) == ankle)]
        grand = [j for j in range(len(rig.parents)) if int(rig.parents[j]) in joints[1:] and j not in joints]
        joints += grand
        while more := [j for j in range(len(rig.parents)) if int(rig.parents[j]) in joints and j not in joints]:
            joints += more
        points = [at[j] for j in sorted(joints)]
        for parent, offset in zip(rig.end_parents, rig.end_offsets, strict=True):
            if int(parent) in joints:
                points.append(at[int(parent)] + np.einsum("fab,b->fa", turned[int(parent)], offset))
        feet.append(np.stack(points, axis=1))
        toes.append(at[rig.roles.get(f"toe.{side}", ankle)])
    return feet, np.stack(toes, axis=1), at[0]


def plain_speed(points: Array, k: int, f: int, fps: float) -> float:
    """The slower of the steps before and after a frame, m/s."""
    steps = [points[b, k] - points[a, k] for a, b in ((f - 1, f), (f, f + 1)) if a >= 0 and b < len(points)]
    return min(float(np.hypot(step[0], step[2])) for step in steps) * fps


def plain_lows(feet: list[Array]) -> list[list[float]]:
    """The lowest height of each point of both feet: the one that 2% of the frames are under."""
    return [[float(np.quantile(points[:, k, 1], 0.02)) for k in range(points.shape[1])] for points in feet]


def plain_standing(feet: list[Array], lows: Sequence[Sequence[float]], fps: float) -> float:
    """Speed up to which a foot of a motion stands."""
    slowest = []
    for f in range(len(feet[0])):
        speeds = [
            plain_speed(points, k, f, fps)
            for points, low in zip(feet, lows, strict=True)
            for k in range(points.shape[1])
            if points[f, k, 1] < low[k] + 0.03
        ]
        if speeds:
            slowest.append(min(speeds))
    return min(max(float(np.quantile(slowest, 0.9)) if slowest else 0.0, 0.2), 0.6)


def plain_state(feet: list[Array], lows: Sequence[Sequence[float]], standing: float, f: int, fps: float) -> str:
    """Whether a figure stands, slides or is in the air in a frame."""
    down = [(p, k) for p, low in zip(feet, lows, strict=True) for k in range(p.shape[1]) if p[f, k, 1] < low[k] + 0.03]
    if not down:
        return "airborne"
    return "stands" if any(plain_speed(p, k, f, fps) < standing for p, k in down) else "slides"


if __name__ == "__main__":
    main()
