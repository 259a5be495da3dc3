"""What was shown: a manifest in; tables for the page out."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from study.experiment.stimuli.manifest import Manifest
from study.experiment.stimuli.stimulus import MotionUse
from study.report import tables, words
from study.report.tables import Table


def stimulus_table(manifest: Manifest) -> Table:
    """Return every stimulus: method, lengths, motions, hash."""
    rows = [
        {
            "id": record.id,
            "transition": words.readable(record.transition),
            "category": record.category,
            "method": record.method,
            "optimal_frames": record.optimal_frames,
            "difference_frames": record.difference_frames,
            "blend_frames": record.blend_frames,
            "frames": record.frames,
            "source": _motion_in_words(record.source),
            "destination": _motion_in_words(record.destination),
            "notes": "; ".join(record.notes),
        }
        for record in manifest.records
    ]
    return tables.make(
        "stimuli",
        "Every stimulus, in frames. k is the length that the method gives; the blend is k and the difference.",
        "transition category method optimal_frames difference_frames blend_frames frames:count source destination "
        "notes id",
        rows,
        headings={"difference_frames": "difference", "frames": "in all", "source": "from"},
        files_only="category notes id",
    )


def flaw_tables(manifest: Manifest) -> Iterator[Table]:
    """Every stimulus beside its motions, the worst first, where it was measured."""
    measured = [record for record in manifest.records if record.flaws]
    if not measured:
        return
    rows = []
    for record in sorted(measured, key=lambda one: -(one.flaws.severity if one.flaws else 0.0)):
        if (flaws := record.flaws) is None:
            raise AssertionError("only measured stimuli are listed")
        rows.append(
            {
                "transition": words.readable(record.transition),
                "method": record.method,
                "blend_frames": record.blend_frames,
                "unsupported_percent": 100 * flaws.unsupported_share,
                "own_unsupported_percent": 100 * flaws.own_unsupported_share,
                "left_skating_percent": 100 * flaws.left.skating_share,
                "right_skating_percent": 100 * flaws.right.skating_share,
                "own_skating_percent": 50 * (flaws.left.own_skating_share + flaws.right.own_skating_share),
                "sink_cm": 100 * flaws.sink_m,
                "toe_times": flaws.toe_acceleration_times,
                "joint_times": flaws.joint_velocity_change_times,
                "root_times": flaws.root_velocity_change_times,
                "id": record.id,
            }
        )
    yield tables.make(
        "stimulus_flaws",
        "How the stimuli move beside their motions, the worst first. Percent of the blended frames in which no foot "
        "stands though one is at floor height, and in all frames of the motions; the same for each foot by itself, "
        "where swinging low counts too; how far a foot sinks under its lowest in the motions; and the largest "
        "acceleration of a toe and the largest changes of velocity of a joint and of the root from one frame to the "
        "next, over the motions' own.",
        "transition method blend_frames unsupported_percent own_unsupported_percent left_skating_percent "
        "right_skating_percent own_skating_percent sink_cm toe_times joint_times root_times id",
        rows,
        files_only="id",
    )


def _motion_in_words(use: MotionUse) -> str:
    """The motion and its trial; no folder of the machine that rendered it."""
    return words.readable(use.motion) + (f" ({Path(use.file).stem})" if use.file else "")


def motion_table(manifest: Manifest) -> Table:
    """Return every motion that was used: its file, where it was blended, and by how much it was extended."""
    rows: dict[tuple[Any, ...], dict[str, Any]] = {}
    for record in manifest.records:
        for role, use in (("from", record.source), ("to", record.destination)):
            key = (record.transition, role, use.motion, use.file, use.frame, use.added_before, use.added_after)
            rows[key] = {
                "transition": words.readable(record.transition),
                "role": role,
                "motion": words.readable(use.motion),
                "file": Path(use.file).name,
                "frame": use.frame,
                "frames": use.frames,
                "added_before": use.added_before,
                "added_after": use.added_after,
                "changes": "; ".join(note for note in use.notes if note.startswith(("extended", "mirrored"))),
                "notes": "; ".join(use.notes),
            }
    return tables.make(
        "motions",
        "Every motion, in frames of the study: its file, the frame at which the blend starts or ends, its length, and "
        "the frames that were added before and after it.",
        "transition role motion file frame frames:count added_before added_after changes notes",
        list(rows.values()),
        headings={"frames": "of", "notes": "all notes"},
        files_only="notes" if any(row["changes"] for row in rows.values()) else "notes changes",
    )
