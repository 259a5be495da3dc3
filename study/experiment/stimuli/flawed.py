"""Which stimuli move as their motions don't: records of stimuli in, the worst first, and a sentence about them, out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from study.counting import counted

if TYPE_CHECKING:
    from study.experiment.stimuli.stimulus import StimulusRecord

_NAMED = 3


def flawed(records: Sequence[StimulusRecord]) -> list[StimulusRecord]:
    """Those whose feet are to stand and that have something to be told of, the worst first (see `Flaws.told`)."""
    found = [one for one in records if one.holds_feet and one.flaws and any(one.flaws.told())]
    return sorted(found, key=lambda one: -(one.flaws.severity if one.flaws else 0.0))


def flaw_notes(records: Sequence[StimulusRecord]) -> Iterator[str]:
    """One sentence about the worst of them; none where there are none."""
    if found := flawed(records):
        named = [
            f"{one.transition}, {one.method}, {counted(one.blend_frames, 'frame')}: {', '.join(one.flaws.told())}"
            for one in found[:_NAMED]
            if one.flaws
        ]
        rest = f"; and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
        all_held = sum(one.holds_feet for one in records)
        yield (
            f"{len(found)} of {counted(all_held, 'stimulus', 'stimuli')} move as their motions don't, "
            f"and people may see it: {'; '.join(named)}{rest}."
        )
