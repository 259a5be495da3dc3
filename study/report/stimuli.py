"""What was shown: a manifest in; tables for the page out."""

from __future__ import annotations

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
