"""Leave-one-out cross-validation of fitted joint weights on captured motions, with labels made from known weights.

    python benchmarks/fit_weights.py FOLDER SOURCE DESTINATION [SOURCE DESTINATION]... --transfer SOURCE DESTINATION

Nobody's judgement is in this: a cut is called good or bad by the weights of Wang & Bodenheimer 2003, Table 1 (good:
among the cheapest of its two clips; bad: near one cost for all clips, with some spread), 16 good and 26 bad ones as in
the paper. What is measured is how well the least squares finds the weights again, and how far the best transitions move
when one label is left out; the paper has under one frame on average, median zero, and 41 of 42 on another motion.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from study.motion.clip import Clip, retarget
from study.motion.library import open_library
from study.transitions.cost_matrix import cost_matrix
from study.transitions.fit_weights import LabelledCut, cross_validate, fit_weights
from study.transitions.weights import WANG2003

GOOD, BAD = 16, 26


def labelled(pairs: list[tuple[Clip, Clip]], spread: float, seed: int) -> list[LabelledCut]:
    """Cuts with labels by the published weights: bad ones within `spread` of one level, as a share of it."""
    rng = np.random.default_rng(seed)
    costs = [cost_matrix(*pair, weights=WANG2003)[5:-5, 5:-5] for pair in pairs]
    level = float(np.median([np.quantile(cost, 0.7) for cost in costs]))
    cuts = []
    for number in range(GOOD + BAD):
        bad = number >= GOOD
        pair, cost = pairs[number % len(pairs)], costs[number % len(pairs)]
        pool = np.abs(cost - level) <= spread * level if bad else cost <= np.quantile(cost, 0.001)
        found = np.argwhere(pool) + 5
        if not len(found):
            continue
        i, j = found[rng.integers(len(found))]
        cuts.append(LabelledCut(*pair, int(i), int(j), float(bad)))
    return cuts


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("motions", nargs="+")
    parser.add_argument("--transfer", nargs=2, required=True)
    parser.add_argument("--spread", type=float, default=0.1)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    library = open_library(options.folder)
    clips = [library.clip(name, fps=30.0) for name in (*options.motions, *options.transfer)]
    clips = [clips[0], *(retarget(clip, clips[0].skeleton) for clip in clips[1:])]
    pairs = list(zip(clips[:-2:2], clips[1:-2:2], strict=True))
    cuts = labelled(pairs, options.spread, options.seed)
    found = fit_weights(cuts)
    print(f"{found.good} good and {found.bad} bad labels on {len(pairs)} pairs of clips; fitted weights:")
    print(
        "  " + ", ".join(f"{role} {value:.3f}" for role, value in found.weights.items() if value and role[-2:] != ".R")
    )
    started = time.perf_counter()
    checked = cross_validate(cuts, transfer=(clips[-2], clips[-1]))
    print(
        f"leave one out: mean {checked.mean_frames:.2f} frames, median {checked.median_frames:g}, "
        f"{checked.deviations.count(0)} of {len(cuts)} unmoved, most {max(checked.deviations)}"
    )
    print(
        f"transfer to {' and '.join(options.transfer)}: {checked.transfer_same} of {len(cuts)} the same, "
        f"most {max(checked.transfer)} frames; {time.perf_counter() - started:.1f} s in all"
    )


if __name__ == "__main__":
    main()
