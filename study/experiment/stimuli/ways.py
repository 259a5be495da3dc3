"""Ways: how each transition of a study is made by each method, decided once, before anything is made.

A protocol, a library and settled points come in; a `Way` of `transitions/methods` goes out. What takes long to find,
such as the hop of a one-hop transition or the weight of its stays, is kept.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from study.errors import MotionError, MotionFileError, StimulusError, TransitionError
from study.experiment.chance import generator
from study.experiment.protocol.whole import Protocol, StudySpec
from study.motion.clip import Clip, retarget
from study.transitions.methods.method import Method, Motions, Place, Way

if TYPE_CHECKING:
    from study.experiment.stimuli.points import Settled
    from study.motion.library import Library


class Ways:
    """Decides for a protocol on a library; what was found before is kept."""

    def __init__(self, protocol: Protocol, library: Library) -> None:
        self.protocol, self.library = protocol, library
        self._kept: dict[Hashable, Any] = {}
        self._methods: dict[str, Mapping[str, Method]] = {}

    def methods(self, study: StudySpec) -> Mapping[str, Method]:
        """The methods of a study by name."""
        if study.name not in self._methods:
            self._methods[study.name] = self.protocol.methods_of(study)
        return self._methods[study.name]

    def of(self, study: StudySpec, settled: Settled, method: str, difference_frames: int = 0) -> Way:
        """How a method makes one transition of a study, at its own points and so many frames longer than it says.

        Raises
        ------
        StimulusError
            Where it can't be made, or a motion that the method needs is missing or on another rig.
        """
        own, (source, destination) = settled.at(method), settled.lengths[method].windows
        windows = (source + difference_frames, destination + difference_frames)
        try:
            return self.methods(study)[method].make.way(self.place(study, own), windows)
        except (TransitionError, MotionError, MotionFileError) as error:
            raise StimulusError(f"transition {settled.transition.name!r}, {method}: {error}") from error

    def place(self, study: StudySpec, settled: Settled) -> Place:
        """Where a transition of a study is made."""
        protocol, source, destination = self.protocol, settled.source, settled.destination
        shown = (name for one in protocol.transitions_of(study) for name in (one.source, one.destination))
        motions = Motions(
            tuple(dict.fromkeys(shown)),
            partial(self._clip, study),
            protocol.path_of,
            partial(generator, protocol.seed),
            self._kept,
        )
        names, points = (source.name, destination.name), (settled.start_frame, settled.end_frame)
        return Place(settled.transition.name, names, source.clip, destination.clip, *points, motions)

    def _clip(self, study: StudySpec, name: str, like: Clip) -> Clip:
        try:
            return retarget(replace(self.library.clip(name, fps=like.fps), name=name), like.skeleton)
        except MotionError as error:
            raise StimulusError(f"study {study.name!r}, hop {name!r}: {error}") from error
