"""`segue cost-matrix`: what a cut from any frame of one clip to any frame of another costs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from study.apps.cli.clips import clip_pair, clips_options
from study.apps.cli.console import FILE, FPS, WEIGHTS, emit, json_option
from study.apps.cli.moments import in_words, moment
from study.counting import counted

if TYPE_CHECKING:
    from study.transitions.cost_matrix import Block, Extremes

LABELS = {"joint": "cost, squared half angles and metres", "pointcloud": "mean squared distance, square metres"}


@click.command("cost-matrix")
@click.argument("source", metavar="SRC")
@click.argument("destination", metavar="DST")
@clips_options
@FPS
@click.option("--metric", type=click.Choice(list(LABELS)), default="joint", show_default=True,
              help="joint: rotations and velocities of joints; pointcloud: distances of body points.")  # fmt: skip
@click.option(
    "--weights", type=click.Choice(["wang2003", "lee2002"]), default="wang2003", show_default=True, help=WEIGHTS
)
@click.option(
    "--nu",
    type=click.FloatRange(min=0),
    default=1.0,
    show_default=True,
    help="Weight of velocities beside rotations, a factor.",
)
@click.option(
    "--root",
    type=click.Choice(["matched", "world", "none"]),
    default="matched",
    show_default=True,
    help="What counts of the root: matched, its height, since a transition aligns position and facing; world, all of "
    "it; none, nothing.",
)
@click.option("--window", type=click.IntRange(min=1), help="Length of a point cloud, frames (default: 0.33 s).")
@click.option(
    "--out", type=FILE, help="File for the matrix: X.npy, or X.png, darker where it costs less (default: none)."
)
@json_option
def cost_matrix(
    source: str,
    destination: str,
    library: str | None,
    fps: float,
    metric: str,
    window: int | None,
    out: Path | None,
    **of_joints: Any,
) -> None:
    """The cost of a transition between all frames of SRC and DST (Wang & Bodenheimer 2003), and its minimum."""
    from study.transitions.cost_matrix import extremes, joint_blocks, pointcloud_blocks

    if out is not None and out.suffix.lower() not in (".npy", ".png"):
        raise click.UsageError(f"expected --out as a name that ends in .npy or .png, found {str(out)!r}.")
    if metric == "joint" and window is not None:
        raise click.UsageError("expected --window with --metric pointcloud; the joint cost compares single frames.")
    first, second = clip_pair(source, destination, library, fps)
    if metric == "joint":
        blocks, shape = joint_blocks(first, second, **of_joints), (first.frames, second.frames)
    else:
        window = window or max(1, round(fps / 3))
        blocks = pointcloud_blocks(first, second, window=window)
        shape = (first.frames - window + 1, second.frames - window + 1)
        if min(shape) < 1:
            most = min(first.frames, second.frames)
            raise click.UsageError(
                f"expected --window of 1 to {counted(most, 'frame')}, which both clips have, found {window}."
            )
    if out is None:
        found = extremes(blocks)
    elif out.suffix.lower() == ".npy":
        found = _write_matrix(blocks, shape, out)
    else:
        found = _draw(blocks, shape, out, (f"{source}, frame", f"{destination}, frame"), LABELS[metric])
    result: dict[str, object] = {"min": found.min, "argmin": found.argmin, "max": found.max, "shape": found.shape}
    result |= {"metric": metric, "fps": fps, **(of_joints if metric == "joint" else {"window": window})}
    result |= {**moment(first, found.argmin[0], "source"), **moment(second, found.argmin[1], "destination")}
    result["file"] = None if out is None else str(out)
    least = f"{in_words(first, found.argmin[0], source)} to {in_words(second, found.argmin[1], destination)}"
    text = (
        f"{found.shape[0]} x {found.shape[1]} costs at {fps:g} fps, from {found.min:.5g} to {found.max:.5g}; "
        f"least from {least}"
    )
    emit(result, text if out is None else f"{out}: {text}")


def _write_matrix(blocks: Iterable[Block], shape: tuple[int, int], out: Path) -> Extremes:
    """Write the matrix as float32, block by block: mapped into memory, a full disk would end the process."""
    import numpy as np

    from study.files import whole_file

    with whole_file(out) as unfinished, unfinished.open("wb") as file:
        header = {"descr": np.lib.format.dtype_to_descr(np.dtype("<f4")), "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_1_0(file, header)
        return _extremes(blocks, lambda _, block: file.write(block.astype("<f4").tobytes()))


def _draw(blocks: Iterable[Block], shape: tuple[int, int], out: Path, names: tuple[str, str], label: str) -> Extremes:
    from study.report.costs import Reducer, cost_picture

    reducer = Reducer(shape)
    found = _extremes(blocks, reducer.add)
    cost_picture(reducer.small, out, least=found.argmin, span=shape, names=names, label=label)
    return found


def _extremes(blocks: Iterable[Block], keep: Callable[..., object]) -> Extremes:
    """The extremes of blocks that are kept as they pass."""
    from study.transitions.cost_matrix import extremes

    def kept() -> Iterator[Block]:
        for rows, block in blocks:
            keep(rows, block)
            yield rows, block

    return extremes(kept())
