"""Dead blending: the source is moved on by its last velocity, which decays, and cross-fades into the destination."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

from annotated_types import Gt, Le

from study.settings import SettingsError, setting
from study.transitions.methods.makes.inertialize import Switch, Switching
from study.transitions.methods.method import Way

if TYPE_CHECKING:
    from study.motion.clip import Clip
    from study.transitions.blending import Transition

HOLDEN_2023 = "Holden, D. (2023). Dead blending. theorangeduck.com."


@dataclass(frozen=True)
class DeadBlended(Switch):
    """A cross-fade; the half-lives of the source's velocity lie within bounds, in seconds."""

    shortest_s: float
    longest_s: float

    def joined(self, source: Clip, destination: Clip, start_frame: int, end_frame: int) -> Transition:
        """The transition, its feet as they come."""
        from study.transitions.switching import Extrapolation, dead_blended

        bounds = Extrapolation(shortest_s=self.shortest_s, longest_s=self.longest_s)
        return dead_blended(source, destination, start_frame, end_frame, self.blend, bounds)

    def longer_than(self, other: Way) -> int | None:
        """The difference of two cross-fades that are else alike."""
        if not isinstance(other, DeadBlended):
            return None
        if replace(other, blend=self.blend, placed_frames=self.placed_frames) != self:
            return None
        return self.blend - other.blend


@dataclass(frozen=True)
class DeadBlend(Switching):
    """Half-lives for each axis of each joint, by how velocity and way to the destination agree (Holden 2023)."""

    name = "dead-blend"
    words = "dead-blended transitions {length} {points}"
    how = "move the source on by its decaying velocity and cross-fade it into the destination (Holden 2023)"
    sources = (HOLDEN_2023,)
    levels = True
    moves = True

    shortest_halflife_s: Annotated[float, Gt(0.0), Le(10.0)] = setting(
        0.05, "Make `dead-blend`: shortest half-life of the source's velocity. [seconds]"
    )
    longest_halflife_s: Annotated[float, Gt(0.0), Le(10.0)] = setting(
        1.0, "Make `dead-blend`: longest half-life of the source's velocity. [seconds]"
    )

    def __post_init__(self) -> None:
        if self.shortest_halflife_s > self.longest_halflife_s:
            raise SettingsError(
                "shortest_halflife_s",
                f"expected at most longest_halflife_s = {self.longest_halflife_s:g}, found "
                f"{self.shortest_halflife_s:g}; change one of them",
            )

    def switch(self, blend_frames: int, fps: float) -> Switch:
        """A cross-fade over that many frames."""
        del fps
        bounds = self.shortest_halflife_s, self.longest_halflife_s
        return DeadBlended(blend_frames, blend_frames, self.clean_feet, *bounds)

    def details(self) -> str:
        """The half-lives, and the feet."""
        return f"half-lives {self.shortest_halflife_s:g} to {self.longest_halflife_s:g} s, {super().details()}"
