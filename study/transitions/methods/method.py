"""What a method is: the choice of where a transition is placed, how long its blend takes, and how its frames are made.

Three independent parts make a method: `Points`, `Length` and `Make`. Each member is a frozen dataclass in a module of
its own; its fields are its settings, which are also the keys that a protocol's `[[methods]]` takes. The registry finds
members by name. A make first decides a `Way`, which is cheap to compare, and the way makes the frames when asked.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np

    from study.motion.clip import Clip
    from study.transitions.blend_length import BlendLength
    from study.transitions.timewarp import WarpLength

CANDIDATES = 2000
"""So many pairs of frames are tried before a transition is refused, unless a part takes long to try."""

LONGEST_BLEND_S, USUAL_BLEND_S = 2.0, 1.0
"""Longest blend that is looked for (2004: 0.03 to 2 s), and what a blend is taken to last before it is known."""

WANG_2003 = (
    "Wang, J., & Bodenheimer, B. (2003). An evaluation of a cost metric for selecting transitions between motion "
    "segments. Symposium on Computer Animation, 232–238."
)
WANG_2004 = (
    "Wang, J., & Bodenheimer, B. (2004). Computing the duration of motion transitions: An empirical approach. "
    "Symposium on Computer Animation, 335–344."
)
SHOEMAKE_1985 = "Shoemake, K. (1985). Animating rotation with quaternion curves. SIGGRAPH, 245–254."

Kept = TypeVar("Kept")


@dataclass(frozen=True, eq=False)
class Motions:
    """What a make may ask for beside the two clips that it joins.

    `names` are the motions of the study. `clip` gives a motion of the library at the frame rate and on the skeleton of
    another, `path` the place of a file that the protocol names, `generator` chance that depends on the protocol's seed
    and on a purpose alone. What takes long to find is `kept`.
    """

    names: tuple[str, ...]
    clip: Callable[[str, Clip], Clip]
    path: Callable[[str], Path]
    generator: Callable[[str], np.random.Generator]
    kept: dict[Hashable, Any]

    def once(self, key: Hashable, find: Callable[[], Kept]) -> Kept:
        """What was found before under a key, else what `find` returns, which is kept."""
        if key not in self.kept:
            self.kept[key] = find()
        found: Kept = self.kept[key]
        return found


def _no_study(*_: Any) -> Any:
    raise AssertionError("a make that asks for more than two motions was used outside a study")


NO_STUDY = Motions((), _no_study, _no_study, _no_study, {})
"""For transitions outside a study, by makes that need no other motion."""


@dataclass(frozen=True, eq=False)
class Place:
    """Where a transition is made: its name in the protocol, the two motions by name and as clips of one rig and rate.

    The blend takes the source from `start_frame` on and the destination up to `end_frame`.
    """

    transition: str
    names: tuple[str, str]
    source: Clip
    destination: Clip
    start_frame: int
    end_frame: int
    motions: Motions = NO_STUDY


@dataclass(frozen=True)
class Room:
    """Frames that a method needs around its points, in addition to entry and exit.

    `blend` from the start point on and up to the end point; `search` the same where the motions have as many, so that
    long blends can be found. `entry` before the start point. `stay` beyond the blend in both motions, and `after`
    beyond the exit in the destination.
    """

    blend: int = 1
    search: int = 1
    entry: int = 0
    stay: int = 0
    after: int = 0

    def with_one_before(self) -> Room:
        """The same with one frame of each motion before its window."""
        return replace(self, blend=self.blend + 1, search=self.search + 1, entry=max(self.entry, 1))


@dataclass(frozen=True, eq=False)
class Made:
    """A transition as it is shown.

    `clip` stands on the floor where the source does at the start point; `blend_start` and `blend_stop` bound its blend
    as a slice counts them. `note` says how it was made.
    """

    clip: Clip
    blend_start: int
    blend_stop: int
    note: str


class Way(ABC):
    """How the frames of one transition are made, decided and not yet made. Equal ways make equal frames."""

    @property
    @abstractmethod
    def frames(self) -> int:
        """Frames from the start point until the destination plays alone."""

    @property
    def blend_frames(self) -> int:
        """The blend length, in frames; 0 for a cut."""
        return self.frames

    @property
    def lead(self) -> int:
        """Frames of the source alone between the start point and the blend."""
        return 0

    @property
    def note(self) -> str:
        """What a reader should know of it beside its length."""
        return ""

    @abstractmethod
    def made(self, place: Place) -> Made:
        """Make the frames."""

    @property
    def holds_feet(self) -> bool:
        """Whether feet that bear weight are to stand."""
        return False

    def motions(self, place: Place) -> tuple[Clip, ...]:
        """The motions that it is made from, beside which it is measured."""
        return place.source, place.destination

    def lacking(self, entry: int, after: int) -> str:
        """What is missing for so many frames of entry and after the blend, in words; empty where nothing is."""
        del entry, after
        return ""

    def longer_than(self, other: Way) -> int | None:
        """By how many frames the blend is longer, where that is all that differs; None where the make differs."""
        del other
        return None


@dataclass(frozen=True)
class MethodPart(ABC):
    """What the three kinds of parts share: a name, words for a report, the works that it comes from, and settings."""

    name: ClassVar[str]
    words: ClassVar[str]
    sources: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def setting_names(cls) -> tuple[str, ...]:
        """Names of the settings."""
        return tuple(one.name for one in fields(cls))

    def with_settings(self, settings: Mapping[str, Any]) -> Self:
        """The same part with those of the settings that it takes."""
        return replace(self, **{key: settings[key] for key in self.setting_names() if key in settings})

    def in_words(self, fps: float) -> str:
        """What a Methods section says of the part, at a frame rate."""
        del fps
        return self.words


class Points(MethodPart):
    """Where a transition is placed: at points that all methods of a study share, or at points of the method's own."""


class OwnPoints(Points):
    """Points of the method's own."""

    @abstractmethod
    def best(
        self, source: Clip, destination: Clip, windows: tuple[tuple[int, int], tuple[int, int]], shift: int | None
    ) -> tuple[int, int]:
        """The start and the end frame.

        `windows` are the frames of each clip that may be chosen, as slices count them. Where both clips show one
        motion, `shift` is the destination's frame number of the source's frame 0.
        """


class Length(MethodPart):
    """How long a blend takes.

    `windows` counts the lengths that it gives: none (a cut), one for both motions, or two. `follows` says whether the
    length depends on the points, so that a protocol's conditions on points are about it; `draws` how many points may
    be tried.
    """

    windows: ClassVar[int] = 1
    follows: ClassVar[bool] = True
    draws: ClassVar[int] = CANDIDATES

    @abstractmethod
    def at(
        self, source: Clip, destination: Clip, start_frame: int, end_frame: int, **options: Any
    ) -> BlendLength | WarpLength:
        """The length at two points; `TransitionError` where the clips do not supply it.

        `options` are those of the function that finds it: `weights` of joints, and for one window `specification`.
        """

    def room(self, fps: float, longest_frames: int | None) -> Room:
        """What it needs around its points, where no blend beyond a length is wanted."""
        search = round(LONGEST_BLEND_S * fps)
        return Room(min(longest_frames or search, search), search)


class Make(MethodPart):
    """How the frames of a transition are made.

    `windows` is what it takes of a length (see `Length.windows`). `levels` says whether its blend can be lengthened and
    shortened in a same-different study, `moves` whether it can be made about the same moment as a blend of another
    length (`match` in a protocol), `sets_span` whether both stimuli of a pair with it are equally long, and
    `draws` how many points may be tried where it makes what the other method makes. In `words`, `{length}` and
    `{points}` are replaced by those of the other parts. `how` ends the sentence "Transitions by this method ..." of a
    Methods section, for makes that are neither blends by spherical linear interpolation nor cuts.
    """

    windows: ClassVar[int] = 1
    levels: ClassVar[bool] = False
    moves: ClassVar[bool] = False
    sets_span: ClassVar[bool] = False
    draws: ClassVar[int] = CANDIDATES
    how: ClassVar[str] = ""

    @abstractmethod
    def way(self, place: Place, windows: tuple[int, int]) -> Way:
        """Decide how a transition is made over so many frames of the source and of the destination.

        `TransitionError` or `MotionError` where it can't be made.
        """

    def room(self, length: Length, fps: float, longest_frames: int | None) -> Room:
        """What the make needs around the points; by default what the length needs."""
        return length.room(fps, longest_frames)

    @property
    def centred(self) -> bool:
        """Whether the transition points meet in the middle of the blend rather than begin and end it."""
        return False

    def placed(self, start_frame: int, end_frame: int, frames: int) -> tuple[int, int]:
        """The first blended frame of the source and the last of the destination, for transition points and a length."""
        if not self.centred:
            return start_frame, end_frame
        from study.transitions.windows import window

        blend = window(start_frame, end_frame, frames, "centre")
        return blend.source_start, blend.destination_stop - 1

    def usual_s(self, length: Length, fps: float) -> float:
        """Seconds that it takes, as far as can be told before points are known."""
        del length, fps
        return USUAL_BLEND_S

    def details(self) -> str:
        """The settings in words, for methods of a protocol's own."""
        return ""

    def files_read(self) -> tuple[str, ...]:
        """The files that it reads, as the protocol names them."""
        return ()

    def transitions(self) -> tuple[str, ...]:
        """The transitions of the protocol that its settings name."""
        return ()

    def lacks(self, transition: str) -> str:
        """What its settings lack to make a transition of the protocol, in words; empty where they lack nothing."""
        del transition
        return ""


@dataclass(frozen=True)
class Method:
    """A method: a name, its three parts, and how natural simulated observers find its transitions.

    `utility` are log-odds of being chosen over a blend of fixed length. `words` and `source` stand in a Methods section
    for the words of the parts, and beside their sources.
    """

    name: str
    points: Points
    length: Length
    make: Make
    utility: float
    words: str = ""
    source: str = ""

    def with_settings(self, settings: Mapping[str, Any]) -> Method:
        """The same method with those of the settings that its parts take."""
        return replace(
            self,
            points=self.points.with_settings(settings),
            length=self.length.with_settings(settings),
            make=self.make.with_settings(settings),
        )

    def length_at(self, source: Clip, destination: Clip, start_frame: int, end_frame: int) -> BlendLength | WarpLength:
        """The length at two points, which begin and end the blend or meet in its middle, as the make has them."""
        options = {"specification": "centre"} if self.make.centred else {}
        return self.length.at(source, destination, start_frame, end_frame, **options)

    def in_words(self, fps: float) -> str:
        """What a Methods section calls its transitions, at a frame rate."""
        if self.words:
            return self.words
        length, points = self.length.in_words(fps), self.points.in_words(fps)
        said = self.make.in_words(fps).format(length=length, points=points)
        return " ".join(said.split())

    @property
    def sources(self) -> tuple[str, ...]:
        """The works that it rests on, as references."""
        own = (self.source,) if self.source else ()
        return tuple(dict.fromkeys((*self.points.sources, *self.length.sources, *self.make.sources, *own)))

    def room(self, fps: float, longest_frames: int | None) -> Room:
        """What it needs around its points."""
        return self.make.room(self.length, fps, longest_frames)
