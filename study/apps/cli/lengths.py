"""What every blend length would cost, as a picture or as CSV: the file that `segue blend-length --out` writes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from study.motion.clip import Clip
    from study.transitions.blend_length import BlendLength
    from study.transitions.timewarp import WarpLength


def show_lengths(
    source: Clip,
    destination: Clip,
    points: tuple[int, int],
    chosen: BlendLength,
    out: Path,
    options: tuple[str, str],
    words: str,
) -> None:
    """The geodesic cost of each length, of all joints and of each (2004 Figures 2, 3, 5), as a picture or as CSV."""
    import numpy as np

    from study.transitions.blend_length import geodesic_length, joint_costs
    from study.transitions.distances import frame_distance
    from study.transitions.weights import MAJOR_ROLES, joint_weights
    from study.transitions.windows import window

    weights, specification = options
    longest = None if chosen.blend_frames <= 2 * source.fps else chosen.blend_frames
    curve = geodesic_length(source, destination, *points, longest=longest, weights=weights, specification=specification)
    if curve.lengths is None or curve.costs is None:
        raise AssertionError("the geodesic method gives the cost of every length")
    joints = np.array([source.skeleton.role(role) for role in MAJOR_ROLES])
    by_joint = joint_costs(source, destination, *points, int(curve.lengths[-1]), joints, specification)
    named = {role: row[curve.lengths - 1] for role, row in zip(MAJOR_ROLES, by_joint, strict=True)}
    if out.suffix.lower() == ".csv":
        columns = {"blend_frames": curve.lengths, "blend_s": curve.lengths / source.fps, "cost": curve.costs, **named}
        _write_csv(out, columns)
        return
    from study.report.costs import curve_picture

    span = window(*points, chosen.blend_frames, specification)
    differences = frame_distance(
        source.rotations[span.source_start : span.source_stop],
        destination.rotations[span.destination_start : span.destination_stop],
        joint_weights(source.skeleton, weights),
    )
    curve_picture(
        curve.lengths,
        curve.costs,
        out,
        chosen=chosen.blend_frames,
        fps=source.fps,
        joints=named,
        frames=(differences, span.source_start),
        words=words,
    )


def show_warped(found: WarpLength, fps: float, out: Path, words: str) -> None:
    """The cost of each pair of lengths (2004 Eqs. 5, 6), as a picture or as CSV."""
    import numpy as np

    lengths = np.arange(found.shortest, found.shortest + len(found.costs))
    if out.suffix.lower() == ".csv":
        source, destination = np.meshgrid(lengths, lengths, indexing="ij")
        frames = {"source_frames": source, "destination_frames": destination}
        seconds = {"source_s": source / fps, "destination_s": destination / fps}
        columns = {**frames, **seconds, "cost": found.costs}
        _write_csv(out, {name: column[np.isfinite(found.costs)] for name, column in columns.items()})
        return
    from study.report.costs import cost_picture

    cost_picture(
        found.costs,
        out,
        least=(found.source_frames, found.destination_frames),
        span=(len(lengths), len(lengths)),
        names=("source frames in the blend", "destination frames in the blend"),
        label=f"cost; {words}",
        first=found.shortest,
    )


def _write_csv(out: Path, columns: dict[str, Any]) -> None:
    import pandas as pd

    from study.files import write_whole

    write_whole(out, pd.DataFrame(columns).to_csv(index=False))
