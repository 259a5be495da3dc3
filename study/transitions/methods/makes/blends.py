"""Blends by spherical linear interpolation, plain or time-warped, and the cut, which is a blend of no frames."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Literal

from study.settings import setting
from study.transitions.methods.method import SHOEMAKE_1985, WANG_2003, Length, Made, Make, Place, Room, Way

if TYPE_CHECKING:
    from study.transitions.blending import Transition

KOVAR_2003 = (
    "Kovar, L., & Gleicher, M. (2003). Flexible automatic motion blending with registration curves. Proceedings of the "
    "2003 ACM SIGGRAPH/Eurographics Symposium on Computer Animation, 214–224."
)


def finished(made: Transition, place: Place, clean_feet: bool) -> Made:
    """A transition as it is shown, with its feet planted or not."""
    from study.transitions.footskate import plant_feet

    if clean_feet:
        # The clips themselves know when a foot is planted; a sliding one may be too fast to be found in the blend.
        made = plant_feet(made, place.source, place.destination)
    return Made(made.clip, made.blend_start, made.blend_stop, made.note)


@dataclass(frozen=True)
class Blended(Way):
    """A blend of so many source and destination frames, under a weight, with feet planted or not; a cut of none.

    Motions of equal windows are blended frame by frame unless they are brought `in_step`.
    """

    windows: tuple[int, int]
    weight: str = "linear"
    clean_feet: bool = False

    in_step: ClassVar[bool] = False

    @property
    def frames(self) -> int:
        """The longer of the two windows."""
        return max(self.windows)

    @property
    def holds_feet(self) -> bool:
        """As `clean_feet` says; a cut has no feet to hold."""
        return self.clean_feet and self.blend_frames > 0

    def made(self, place: Place) -> Made:
        """Cut, blend, or warp and blend; then plant the feet."""
        from study.transitions.blending import blend, cut
        from study.transitions.timewarp import warped_blend

        clips, points = (place.source, place.destination), (place.start_frame, place.end_frame)
        if self.blend_frames == 0:
            made = cut(*clips, *points)
        elif self.in_step or self.windows[0] != self.windows[1]:
            made = warped_blend(*clips, *points, *self.windows, weight=self.weight, in_step=self.in_step)
        else:
            made = blend(*clips, *points, self.blend_frames, weight=self.weight)
        return finished(made, place, self.holds_feet)

    def longer_than(self, other: Way) -> int | None:
        """The larger difference of the two windows; a cut differs from a blend in its length alone."""
        if not isinstance(other, Blended):
            return None
        if self.blend_frames and other.blend_frames and replace(self, windows=other.windows) != other:
            return None
        return max((b - a for a, b in zip(other.windows, self.windows, strict=True)), key=abs)


@dataclass(frozen=True)
class CleaningFeet(Make):
    """What all makes that change the clips' own frames can be told."""

    clean_feet: bool = setting(
        True, "Whether sliding of planted feet is removed after blending; by default as in `[stimuli]`."
    )

    def details(self) -> str:
        """The feet."""
        return f"sliding of planted feet {'removed' if self.clean_feet else 'left in'}"


@dataclass(frozen=True)
class Blending(CleaningFeet):
    """What all makes that blend can be told."""

    weight: Literal["linear", "sigmoid"] = setting(
        "linear", "How the blend weight runs from 0 to 1; by default as in `[stimuli]`."
    )

    def details(self) -> str:
        """The weight and the feet."""
        return f"{self.weight} weight, {super().details()}"


class Interpolating(Blending):
    """What makes by spherical linear interpolation have in common."""

    words = "blends {length} {points}"
    sources: ClassVar[tuple[str, ...]] = (SHOEMAKE_1985,)

    def way(self, place: Place, windows: tuple[int, int]) -> Way:
        """A blend of that many frames."""
        del place
        return Blended(windows, self.weight, self.clean_feet)


@dataclass(frozen=True)
class Slerp(Interpolating):
    """A blend by spherical linear interpolation (2004 section 3)."""

    name = "slerp"
    levels = True
    moves = True

    specification: Literal["start-end", "centre"] = setting(
        "start-end",
        "Make `slerp`: `start-end` if the transition points are the blend's first and last frame, so that a longer "
        "blend begins earlier in the destination; `centre` if they meet in its middle.",
    )

    @property
    def centred(self) -> bool:
        """As the specification says."""
        return self.specification == "centre"

    def details(self) -> str:
        """The specification, where points meet in the middle; the weight and the feet."""
        return ("centre-aligned, " if self.centred else "") + super().details()


class InStep(Blended):
    """A blend along a registration curve."""

    in_step = True


class Registered(Interpolating):
    """A blend of two windows of one length, brought into step (Kovar & Gleicher 2003)."""

    name = "registration-curve"
    words = "blends along registration curves {length} {points}"
    sources = (SHOEMAKE_1985, KOVAR_2003)

    def way(self, place: Place, windows: tuple[int, int]) -> Way:
        """A blend of that many frames of each clip."""
        del place
        return InStep(windows, self.weight, self.clean_feet)

    def room(self, length: Length, fps: float, longest_frames: int | None) -> Room:
        """One frame of each clip before its window."""
        return super().room(length, fps, longest_frames).with_one_before()


class Warped(Interpolating):
    """A blend of two windows of different length, the shorter one slowed (2004 section 3.1.4)."""

    name = "timewarp"
    words = "time-warped blends (2004) {points}"
    windows = 2
    moves = True
    sets_span = True


class Cut(Make):
    """From one frame to the next, without a blend (2003 section 4.2)."""

    name = "cut"
    words = "cuts {points}"
    sources = (WANG_2003,)
    windows = 0
    moves = True

    def way(self, place: Place, windows: tuple[int, int]) -> Way:
        """No blended frames."""
        del place
        return Blended(windows)
