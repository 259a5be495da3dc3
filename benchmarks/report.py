"""How long `segue report` takes: `python benchmarks/report.py [--runs 7] [--participants 35] [--keep FOLDER]`.

The whole session of 2004 is rendered and answered by simulated participants once, into a temporary folder (or one that
is kept, and used again). Then `segue report` runs as a process of its own, several times, in turn with one that only
imports what the report needs: no report can be faster than that. Printed are medians of wall and of processor time,
and the size of the page.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SEGUE = [sys.executable, "-m", "study.apps.cli"]
PROTOCOL = "wang2004_session"
IMPORTS = (
    "import click, numpy, pandas, pydantic, sqlalchemy, jinja2, av, PIL.Image, scipy.special, scipy.optimize, "
    "matplotlib.figure, matplotlib.backends.backend_svg"
)


def timed(command: list[str]) -> tuple[float, float]:
    """Wall and processor time of a command, seconds."""
    began, used = time.perf_counter(), os.times()
    subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    wall, after = time.perf_counter() - began, os.times()
    return wall, (after.children_user + after.children_system) - (used.children_user + used.children_system)


def prepare(folder: Path, participants: int) -> None:
    """Stimuli and answers, once; what is there already is used again."""
    for verb in (["render"], ["simulate", "--participants", str(participants)]):
        command = [*SEGUE, verb[0], PROTOCOL, *verb[1:], "--out", str(folder)]
        subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)


def measure(folder: Path, runs: int) -> None:
    """Run both in turn, so that whatever else the machine does meets both alike."""
    found: dict[str, list[tuple[float, float]]] = {"imports alone": [], "segue report": []}
    timed([*SEGUE, "report", str(folder)])  # the first run fills the disk's cache
    for _ in range(runs):
        found["imports alone"].append(timed([sys.executable, "-c", IMPORTS]))
        found["segue report"].append(timed([*SEGUE, "report", str(folder)]))
    for name, times in found.items():
        wall, processor = (statistics.median(column) for column in zip(*times, strict=True))
        fastest = min(wall for wall, _ in times)
        print(f"{name:<14} {wall:5.2f} s wall (fastest {fastest:.2f}), {processor:5.2f} s of processor, {runs} runs")
    size = (folder / "report.html").stat().st_size
    print(f"report.html    {size / 1e6:.2f} MB; {len(list((folder / 'tables').glob('*.csv')))} tables")


def main() -> None:
    """Prepare, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--participants", type=int, default=35)
    parser.add_argument("--keep", type=Path, help="Folder to keep, and to use again.")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = (options.keep or Path(temporary) / "results").resolve()
        prepare(folder, options.participants)
        measure(folder, options.runs)


if __name__ == "__main__":
    main()
