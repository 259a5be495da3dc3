"""How large figures are in the films of protocols, counted in their pixels, and contact sheets to look at.

    python benchmarks/figure_sizes.py                                  every protocol of protocols/, synthetic motions
    python benchmarks/figure_sizes.py --library path/to/cmu demo       one protocol on a library of files
    python benchmarks/figure_sizes.py --sheets folder                  one picture a protocol: a row for each transition
    python benchmarks/figure_sizes.py transitions_today --sheets folder --transition walk_run       a row for each film

Every frame of every film is drawn at a quarter of its size. Rows and columns that differ from the background are the
figure; the camera's own projection isn't asked. Written for each protocol: the least height in any frame, the least
median height of a film, the furthest that a figure's middle comes from the middle of the frame (shares of the frame's
height and width), and how many frames touch an edge.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from renderer.colour import nv12_to_rgb
from renderer.offscreen import render_frames
from study.experiment.protocol.whole import load_protocol
from study.experiment.stimuli.prepare import prepare
from study.experiment.stimuli.stimulus import Stimulus
from study.motion.library import open_library

ROOT = Path(__file__).parents[1]
POSES = 10


def measured(
    stimulus: Stimulus, fps: float, entry: int | None = None
) -> tuple[dict[str, NDArray[np.float64]], list[NDArray[np.uint8]]]:
    """Height, distance of the middle and touched edges of each frame, and some frames as RGB.

    The frames are spread over the film, or every third from shortly before the end of the `entry`, without their sides.
    """
    width, height = stimulus.camera.size
    camera = replace(
        stimulus.camera, size=(width // 8 * 2, height // 8 * 2), focal_pixels=stimulus.camera.focal_pixels / 4
    )
    frames = list(render_frames(stimulus.positions, stimulus.figure, camera, fps=fps))
    rows: dict[str, list[float]] = {"height": [], "aside": [], "touches": []}
    for frame in frames:
        luma = frame[: camera.size[1]].astype(int)
        seen = np.abs(luma - luma[0, 0]) > 2
        up, across = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
        rows["height"].append((up[-1] - up[0] + 1) / len(luma))
        rows["aside"].append(abs((across[0] + across[-1] + 1) / 2 / seen.shape[1] - 0.5))
        rows["touches"].append(seen[[0, -1]].any() or seen[:, [0, -1]].any())
    figures = {key: np.array(values, dtype=float) for key, values in rows.items()}
    if entry is not None:
        side = camera.size[0] // 4
        return figures, [nv12_to_rgb(frames[entry - 3 + 3 * i])[:, side:-side] for i in range(POSES)]
    shown = np.linspace(0, len(frames) - 1, POSES).round().astype(int)
    return figures, [nv12_to_rgb(frames[i])[::2, ::2] for i in shown]


def protocol_sizes(path: Path, library: str, sheets: Path | None, transition: str | None) -> dict[str, float | str]:
    """One row of the table; the contact sheet is written beside, of all films or of the first of each transition."""
    stimuli = prepare(load_protocol(path), open_library(library))
    found, strips = [], []
    groups: set[str] = set()
    for stimulus in stimuli.stimuli:
        label = stimulus.record.group if transition is None else stimulus.record.method
        if transition not in (None, stimulus.record.transition):
            continue
        entry = None if transition is None else stimuli.protocol.entry_frames
        sizes, frames = measured(stimulus, stimuli.protocol.fps, entry)
        found.append(sizes)
        if label not in groups:
            groups.add(label)
            strip = Image.fromarray(np.concatenate(frames, axis=1))
            ImageDraw.Draw(strip).text((4, 2), label, fill=(0, 0, 0))
            strips.append(np.asarray(strip))
    if sheets is not None:
        sheets.mkdir(parents=True, exist_ok=True)
        shown = "" if transition is None else f"_{transition}"
        Image.fromarray(np.concatenate(strips)).save(sheets / f"{path.stem}{shown}_{Path(library).name}.png")
    return {
        "protocol": path.stem,
        "library": Path(library).name,
        "films": len(found),
        "least_height": min(float(one["height"].min()) for one in found),
        "least_median_height": min(float(np.median(one["height"])) for one in found),
        "median_height": float(np.median(np.concatenate([one["height"] for one in found]))),
        "furthest_aside": max(float(one["aside"].max()) for one in found),
        "frames_at_an_edge": int(sum(one["touches"].sum() for one in found)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("protocols", nargs="*", help="names or files; all of protocols/ by default")
    parser.add_argument("--library", default="synthetic")
    parser.add_argument("--sheets", type=Path, help="folder for contact sheets")
    parser.add_argument("--transition", help="only its films, each in a row of the sheet")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    paths = [Path(p) if p.endswith(".toml") else ROOT / "protocols" / f"{p}.toml" for p in asked.protocols]
    table = []
    for path in paths or sorted((ROOT / "protocols").glob("*.toml")):
        table.append(protocol_sizes(path, asked.library, asked.sheets, asked.transition))
        if not asked.json:
            print(
                "  ".join(f"{k} {v:.2f}" if isinstance(v, float) else str(v) for k, v in table[-1].items()), flush=True
            )
    if asked.json:
        json.dump(table, sys.stdout, indent=1)


if __name__ == "__main__":
    main()
