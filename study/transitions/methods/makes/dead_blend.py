"""Dead blending: the source is moved on by its last velocity, which decays, and cross-fades into the destination."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from annotated_types import Gt, Le

from study.settings import setting
from study.transitions.methods.makes.blends import finished
from study.transitions.methods.makes.inertialize import Switching
from study.transitions.methods.method import Made, Place, Way

HOLDEN_2023 = "Holden, D. (2023). Dead blending. theorangeduck.com."


@dataclass(frozen=True)
class DeadBlended(Way):
    """A cross-fade of so many frames; the half-lives of the source's velocity lie within bounds, in seconds."""

    blend: int
    shortest_s: float
    longest_s: float
    clean_feet: bool

    @property
    def frames(self) -> int:
        """Frames of the cross-fade."""
        return self.blend

    def made(self, place: Place) -> Made:
        """Blend, then plant the feet."""
        from study.transitions.switching import Extrapolation, dead_blended

        clips, points = (place.source, place.destination), (place.start_frame, place.end_frame)
        way = Extrapolation(shortest_s=self.shortest_s, longest_s=self.longest_s)
        return finished(dead_blended(*clips, *points, self.blend, way), place, self.clean_feet)

    def longer_than(self, other: Way) -> int | None:
        """The difference of two cross-fades that are else alike."""
        if not isinstance(other, DeadBlended) or replace(other, blend=self.blend) != self:
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

    shortest_halflife_s: Annotated[float, Gt(0.0), Le(10.0)] = setting(
        0.05, "Make `dead-blend`: shortest half-life of the source's velocity. [seconds]"
    )
    longest_halflife_s: Annotated[float, Gt(0.0), Le(10.0)] = setting(
        1.0, "Make `dead-blend`: longest half-life of the source's velocity. [seconds]"
    )

    def way(self, place: Place, windows: tuple[int, int]) -> Way:
        """A cross-fade over that many frames."""
        del place
        bounds = sorted((self.shortest_halflife_s, self.longest_halflife_s))
        return DeadBlended(windows[1], bounds[0], bounds[1], self.clean_feet)

    def details(self) -> str:
        """The half-lives, and the feet."""
        return f"half-lives {self.shortest_halflife_s:g} to {self.longest_halflife_s:g} s, {super().details()}"
