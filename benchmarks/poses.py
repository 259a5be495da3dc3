"""What a further pose of a transition costs by each make, beside one of a plain blend.

    python benchmarks/poses.py [--repeats N]

A walk into a run, 22 joints, blends of 30 and of 90 frames, feet as they come: the difference of their times, over 60
poses. Makes take turns, and the least times are compared. A registration curve is found once a transition; its own time
is taken off, and printed for 30 and 90 frames.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

from study.motion.clip import trim
from study.motion.synthetic import synthesize
from study.transitions.blending import blend
from study.transitions.registration import registration
from study.transitions.switching import Extrapolation, dead_blended, inertialized, quintic, spring
from study.transitions.timewarp import warped_blend

SHORT, LONG, START, END = 30, 90, 60, 200


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=40)
    repeats = parser.parse_args().repeats
    walk, run = synthesize("walk", seconds=12.0), synthesize("run", seconds=12.0)
    clips = (walk, run, START, END)

    def curve(frames: int) -> object:
        return registration(trim(walk, START - 1, START + frames), trim(run, END - frames, END + 1))

    makes: dict[str, Callable[[int], object]] = {
        "slerp": lambda frames: blend(*clips, frames),
        "timewarp": lambda frames: warped_blend(*clips, frames, frames),
        "registration-curve": lambda frames: warped_blend(*clips, frames, frames, in_step=True),
        "inertialize": lambda frames: inertialized(*clips, frames, spring(0.2, (frames + 1) / 30.0)),
        "inertialize-quintic": lambda frames: inertialized(*clips, frames, quintic((frames + 1) / 30.0)),
        "dead-blend": lambda frames: dead_blended(*clips, frames, Extrapolation()),
        "the curve": curve,
    }
    least: dict[tuple[str, int], float] = {}
    for _ in range(repeats):
        for name, make in makes.items():
            for frames in (SHORT, LONG):
                began = time.perf_counter()
                make(frames)
                took = 1e6 * (time.perf_counter() - began)
                least[name, frames] = min(took, least.get((name, frames), took))
    for frames in (SHORT, LONG):
        least["registration-curve", frames] -= least["the curve", frames]
    further = {name: (least[name, LONG] - least[name, SHORT]) / (LONG - SHORT) for name in makes}
    for name in makes:
        if name == "the curve":
            print(f"the curve itself, once: {least[name, SHORT]:.0f} and {least[name, LONG]:.0f} microseconds")
        else:
            print(f"{name:20} {further[name]:5.1f} microseconds a pose, {further[name] / further['slerp']:.1f} slerp")


if __name__ == "__main__":
    main()
