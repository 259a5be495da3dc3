"""Stimuli as data: what each one is, and the set of them that a protocol needs.

Frozen dataclasses only; `stimuli.prepare` makes them, `rendering.render` draws them, and a manifest is their record.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from study.errors import StimulusError
from study.experiment.stimuli.audit import PairAudit
from study.tasks.trial import Pair
from study.transitions.flaws import Flaws

if TYPE_CHECKING:
    from renderer.camera import Camera
    from renderer.figure import Figure
    from study.experiment.protocol.whole import Protocol

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class MotionUse:
    """One motion within a stimulus: where it came from, and how it was extended.

    `frame` is the transition point in the motion as the library supplies it; `added_before` and `added_after` are the
    frames by which the clip was extended.
    """

    motion: str
    file: str
    frame: int
    frames: int
    added_before: int
    added_after: int
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class StimulusRecord:
    """What a stimulus is; everything but its picture.

    Parameters
    ----------
    id
        Hash of all that is seen (see `stimuli`): identical stimuli share it.
    transition, category
        Name and type of motion of the transition.
    method, optimal_frames, difference_frames
        The method, the length that it gave, and what was added to it for this stimulus.
    blend_frames
        The length that was blended; 0 for a cut.
    frames, blend_start, blend_stop
        Frames in all, and the blended ones as a slice counts them.
    source, destination
        The two motions.
    synthetic
        Whether a program made the motion up.
    notes
        How it was made, in words.
    flaws
        How its feet and its velocities compare with those of its motions; None for a figure without feet.
    holds_feet
        Whether feet that bear weight are to stand.
    """

    id: str
    transition: str
    category: str
    method: str
    optimal_frames: int
    difference_frames: int
    blend_frames: int
    frames: int
    blend_start: int
    blend_stop: int
    source: MotionUse
    destination: MotionUse
    group: str
    synthetic: bool
    notes: tuple[str, ...] = ()
    flaws: Flaws | None = None
    holds_feet: bool = False


@dataclass(frozen=True, eq=False)
class Stimulus:
    """A stimulus ready to be drawn: its record, points `(frames, points, 3)` in metres, figure and camera."""

    record: StimulusRecord
    positions: FloatArray
    figure: Figure
    camera: Camera

    @property
    def id(self) -> str:
        """The content hash."""
        return self.record.id


@dataclass(frozen=True, eq=False)
class StimulusSet:
    """All stimuli of a protocol on one library, each once, and the pairs that are shown.

    `made_from` is a hash of all that they were made from; see `manifest.made_from`. `audits` say how the stimuli of
    each pair differ in what is not judged.
    """

    protocol: Protocol
    library: str
    synthetic: bool
    acknowledgement: str
    stimuli: tuple[Stimulus, ...]
    pairs: tuple[Pair, ...]
    versions: Mapping[str, str] = field(default_factory=dict)
    made_from: str = ""
    audits: tuple[PairAudit, ...] = ()

    @property
    def records(self) -> tuple[StimulusRecord, ...]:
        """The records of all stimuli."""
        return tuple(stimulus.record for stimulus in self.stimuli)

    def stimulus(self, identifier: str) -> Stimulus:
        """A stimulus by its id."""
        for stimulus in self.stimuli:
            if stimulus.id == identifier:
                return stimulus
        raise StimulusError(f"Expected the id of a stimulus of {self.protocol.name!r}, found {identifier!r}.")
