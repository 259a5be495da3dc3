"""Ways: how each transition of a study is made by each method, decided once, before anything is made.

A protocol, a library and settled points come in; a `Way` of `transitions/methods` goes out. What takes long to find,
such as the hop of a one-hop transition or the weight of its stays, is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from study.errors import MotionError, MotionFileError, StimulusError, TransitionError
from study.experiment.chance import generator
from study.experiment.protocol.whole import Protocol, StudySpec
from study.motion.clip import Clip, retarget
from study.transitions.methods.method import Method, Place, Way

if TYPE_CHECKING:
    import numpy as np

    from study.experiment.stimuli.points import Settled
    from study.motion.library import Library

Kept = TypeVar("Kept")


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
        source, destination = settled.source, settled.destination
        return Place(
            settled.transition.name,
            (source.name, destination.name),
            source.clip,
            destination.clip,
            settled.start_frame,
            settled.end_frame,
            _Motions(self.protocol, study, self.library, self._kept),
        )


@dataclass(frozen=True, eq=False)
class _Motions:
    """What a make may ask for: other motions, files, chance, and what it found before."""

    protocol: Protocol
    study: StudySpec
    library: Library
    kept: dict[Hashable, Any]

    @property
    def names(self) -> tuple[str, ...]:
        """The motions of the study's transitions."""
        shown = self.protocol.transitions_of(self.study)
        return tuple(dict.fromkeys(name for one in shown for name in (one.source, one.destination)))

    def clip(self, name: str, like: Clip) -> Clip:
        """A motion of the library."""
        try:
            clip = self.once(("clip", name), lambda: replace(self.library.clip(name, fps=like.fps), name=name))
            return retarget(clip, like.skeleton)
        except MotionError as error:
            raise StimulusError(f"study {self.study.name!r}, hop {name!r}: {error}") from error

    def path(self, file: str) -> Path:
        """A file as the protocol names it: from the folder of the protocol's file."""
        return self.protocol.path_of(file)

    def generator(self, purpose: str) -> np.random.Generator:
        """A generator of the protocol's seed."""
        return generator(self.protocol.seed, purpose)

    def once(self, key: Hashable, find: Callable[[], Kept]) -> Kept:
        """What was found before, or is found now."""
        if key not in self.kept:
            self.kept[key] = find()
        found: Kept = self.kept[key]
        return found
