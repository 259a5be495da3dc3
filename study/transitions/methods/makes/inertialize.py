"""Inertialization: the destination plays at once, and what it lacks of the source's pose and velocity decays."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

from annotated_types import Ge, Le

from study.settings import setting
from study.transitions.methods.makes.blends import CleaningFeet, finished
from study.transitions.methods.method import Length, Made, Place, Room, Way

if TYPE_CHECKING:
    from study.motion.clip import Clip
    from study.transitions.blending import Transition

BOLLO_2018 = (
    "Bollo, D. (2018). Inertialization: High-performance animation transitions in Gears of War. Game Developers "
    "Conference."
)
HOLDEN_2021 = "Holden, D. (2021). Spring-It-On: The game developer's spring-roll-call. theorangeduck.com."


@dataclass(frozen=True)
class Switch(Way):
    """A switch after which `blend` frames hold what is left of the source.

    The destination is placed as by a blend of `placed_frames`.
    """

    blend: int
    placed_frames: int
    clean_feet: bool

    @property
    def frames(self) -> int:
        """Frames that hold something of the source."""
        return self.blend

    @property
    def holds_feet(self) -> bool:
        """As `clean_feet` says."""
        return self.clean_feet

    @abstractmethod
    def joined(self, source: Clip, destination: Clip, start_frame: int, end_frame: int) -> Transition:
        """The transition, its feet as they come."""

    def made(self, place: Place) -> Made:
        """Join the motions, then plant the feet."""
        joined = self.joined(place.source, place.destination, place.start_frame, place.end_frame)
        return finished(joined, place, self.clean_feet)


@dataclass(frozen=True)
class Inertialized(Switch):
    """An offset that decays by a spring of a half-life in seconds, or by Bollo's polynomial if it has none."""

    halflife_s: float | None = None

    def joined(self, source: Clip, destination: Clip, start_frame: int, end_frame: int) -> Transition:
        """The transition, its feet as they come."""
        from study.transitions.switching import inertialized, quintic, spring

        seconds = (self.blend + 1) / source.fps
        decay = quintic(seconds) if self.halflife_s is None else spring(self.halflife_s, seconds)
        placed = self.placed_frames
        return inertialized(source, destination, start_frame, end_frame, self.blend, decay, placed_frames=placed)

    def longer_than(self, other: Way) -> int | None:
        """The difference of two decays by the polynomial, which has no other setting."""
        if not isinstance(other, Inertialized) or self.halflife_s is not None or other.halflife_s is not None:
            return None
        return self.blend - other.blend if self.clean_feet == other.clean_feet else None


class Switching(CleaningFeet):
    """What makes that switch at once have in common: they need the frame before the switch in both clips."""

    @abstractmethod
    def switch(self, blend_frames: int, fps: float) -> Switch:
        """How a transition is made in place of a blend of so many frames."""

    def way(self, place: Place, windows: tuple[int, int]) -> Way:
        """In place of a blend of that many frames."""
        return self.switch(windows[1], place.source.fps)

    def room(self, length: Length, fps: float, longest_frames: int | None) -> Room:
        """One frame of each clip before the switch, which says how fast it moves."""
        return super().room(length, fps, longest_frames).with_one_before()


class InertializeQuintic(Switching):
    """Decay over the blend length by a polynomial that never overshoots (Bollo 2018)."""

    name = "inertialize-quintic"
    words = "inertialized transitions {length} {points}"
    how = (
        "let the difference of pose and velocity decay after a switch to the destination, by a polynomial (Bollo 2018)"
    )
    sources = (BOLLO_2018,)
    levels = True
    moves = True

    def switch(self, blend_frames: int, fps: float) -> Switch:
        """A decay over that many frames."""
        del fps
        return Inertialized(blend_frames, blend_frames, self.clean_feet)


@dataclass(frozen=True)
class Inertialize(Switching):
    """Decay by a critically damped spring."""

    name = "inertialize"
    words = "inertialized transitions (critically damped spring) {points}"
    how = (
        "let the difference of pose and velocity decay after a switch to the destination, by a critically damped spring"
    )
    sources = (BOLLO_2018, HOLDEN_2021)

    halflife_s: Annotated[float | None, Ge(0.01), Le(2.0)] = setting(
        None,
        "Make `inertialize`: half-life of the spring; by default the one that leaves as much of the source, on average "
        "over time, as a blend of the method's length. [seconds]",
    )

    def switch(self, blend_frames: int, fps: float) -> Switch:
        """A spring of the half-life that is set, or that matches so many frames; until one hundredth is left."""
        from study.transitions.switching import matched_blend_s, matching_halflife_s, spring_s

        halflife_s = self.halflife_s or matching_halflife_s((blend_frames + 1) / fps)
        placed = max(1, round(matched_blend_s(halflife_s) * fps) - 1)
        return Inertialized(max(placed, round(spring_s(halflife_s) * fps)), placed, self.clean_feet, halflife_s)

    def room(self, length: Length, fps: float, longest_frames: int | None) -> Room:
        """The blend that it matches, and after it the frames that a spring lasts longer."""
        room = super().room(length, fps, longest_frames)
        way = self.switch(room.search, fps)
        blend = max(room.blend, way.placed_frames + 1) if self.halflife_s else room.blend
        after = room.after + way.frames - way.placed_frames
        return replace(room, blend=blend, search=max(blend, room.search), after=after)

    def details(self) -> str:
        """The half-life, and the feet."""
        spring = f"half-life {self.halflife_s:g} s" if self.halflife_s else "half-life matched to the blend length"
        return f"{spring}, {super().details()}"
