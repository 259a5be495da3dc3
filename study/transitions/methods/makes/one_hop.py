"""Optimal one-hop transitions: through a third motion, with the stays of least cost (Koyama & Goto 2019).

The transition points are theirs in this way: the source's point is the triggered frame, and the destination stands in
time as the direct blend of the same length has it. Both blends are made and cleaned as the direct one beside them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from annotated_types import Ge, Le

from study.errors import TransitionError
from study.settings import setting
from study.transitions.methods.lengths.wang2004 import Fixed
from study.transitions.methods.makes.blends import Blended, Blending
from study.transitions.methods.method import SHOEMAKE_1985, Length, Made, Place, Room, Way

if TYPE_CHECKING:
    from study.motion.clip import Clip
    from study.transitions.blending import Transition
    from study.transitions.one_hop.problem import Settings

KOYAMA_2019 = (
    "Koyama, Y., & Goto, M. (2019). Precomputed optimal one-hop motion transition for responsive character animation. "
    "The Visual Computer. doi:10.1007/s00371-019-01693-8"
)

_SOURCE, _DESTINATION = " (source)", " (destination)"


@dataclass(frozen=True)
class Hop(Way):
    """A one-hop transition between two points.

    `frame` is that of the motion `name` at the start of the first blend; `stay_source` and `stay_hop` are the frames
    to wait before each blend of `hop_blend_frames`. `direct` says whether it is the direct transition itself. Costs
    are Eq. 2 and the distance of the direct transition, `weight` the cost of a frame of stay, all in square metres.
    `curve` and `clean_feet` say how the blends are made.
    """

    name: str
    frame: int
    stay_source: int
    stay_hop: int
    direct: bool
    hop_blend_frames: int
    cost: float
    direct_cost: float
    weight: float
    curve: str = "linear"
    clean_feet: bool = True

    @property
    def frames(self) -> int:
        """From the triggered frame until the destination plays alone."""
        return self.stay_source + (1 if self.direct else 2) * self.hop_blend_frames + self.stay_hop

    @property
    def blend_frames(self) -> int:
        """Frames of each blend."""
        return self.hop_blend_frames

    @property
    def lead(self) -> int:
        """The stay in the source."""
        return self.stay_source

    @property
    def note(self) -> str:
        """Which hop, with its stays and its cost."""
        return (
            f"hop {self.name} from its frame {self.frame}, stays of {self.stay_source} and {self.stay_hop} frames, "
            f"blends of {self.hop_blend_frames}; cost {self.cost:.4f}, direct {self.direct_cost:.4f}, weight "
            f"{self.weight:.3g} a frame"
        )

    def made(self, place: Place) -> Made:
        """Two blends, the second into the destination at its place in time.

        The result's blend runs from the first blended frame of the first blend to the last one of the second.
        """
        source, destination = place.source, place.destination
        start = place.start_frame + self.stay_source
        into = place.end_frame - self.hop_blend_frames + 1
        if self.direct:
            only = self._blend(source, destination, start, into + self.stay_source)
            return Made(only.clip, only.blend_start, only.blend_stop, only.note)
        between = self._clip(place)
        first = self._blend(source, between, start, self.frame)
        leave = start + self.hop_blend_frames + self.stay_hop
        second = self._blend(first.clip, destination, leave, into + leave - place.start_frame)
        return Made(second.clip, start, second.blend_stop, f"{first.note}; {second.note}; {self.note}")

    def _blend(self, source: Clip, destination: Clip, start: int, into: int) -> Transition:
        from study.transitions.blending import blend
        from study.transitions.footskate import plant_feet

        made = blend(source, destination, start, into, self.hop_blend_frames, weight=self.curve, specification="left")
        return plant_feet(made, source, destination) if self.clean_feet else made

    @property
    def holds_feet(self) -> bool:
        """As `clean_feet` says."""
        return self.clean_feet

    def motions(self, place: Place) -> tuple[Clip, ...]:
        """The two motions, and the hop between them."""
        return (
            (place.source, place.destination) if self.direct else (place.source, self._clip(place), place.destination)
        )

    def _clip(self, place: Place) -> Clip:
        if self.name.endswith(_SOURCE):
            return place.source
        return place.destination if self.name.endswith(_DESTINATION) else place.motions.clip(self.name, place.source)


@dataclass(frozen=True)
class OneHop(Blending):
    """The optimal hop between two points."""

    name = "one-hop"
    words = "optimal one-hop transitions (2019)"
    sources = (SHOEMAKE_1985, KOYAMA_2019)
    sets_span = True
    # Each with a search for the hop.
    draws = 20

    hops: tuple[str, ...] = setting(
        (), "Make `one-hop`: motions that may be hops; by default those of the study's transitions."
    )
    stay_s: Annotated[float, Ge(0), Le(10)] = setting(
        1.0, "Make `one-hop`: longest stay in the source and in the hop; 0 for none. [seconds]"
    )
    hop_weight: Annotated[float | None, Ge(0), Le(0.01)] = setting(
        None, "Make `one-hop`: cost of a frame of stay, square metres; by default that of Eq. 5."
    )
    weight_times: Annotated[float, Ge(0), Le(100)] = setting(
        1.0, "Make `one-hop`: what that cost is multiplied by (Figure 11)."
    )
    conditions: Annotated[int, Ge(1), Le(10000)] = setting(
        100, "Make `one-hop`: transitions drawn for the weight of Eq. 5."
    )

    def room(self, length: Length, fps: float, longest_frames: int | None) -> Room:
        """The source plays on for a stay, the destination for both stays and a second blend."""
        room, blend, stay = length.room(fps, longest_frames), self._frames(length, fps), round(self.stay_s * fps)
        return Room(blend, room.search, stay=stay, after=2 * stay + blend)

    def usual_s(self, length: Length, fps: float) -> float:
        """Two blends and a stay."""
        return 2 * self._frames(length, fps) / fps + self.stay_s

    def way(self, place: Place, windows: tuple[int, int]) -> Way:
        """The optimal hop, or the direct blend where that costs least and starts at once."""
        names, frames = tuple(dict.fromkeys(self.hops or place.motions.names)), windows[0]
        key = (self, frames, names, place.source, place.destination, place.start_frame, place.end_frame)
        hop = place.motions.once(key, lambda: self._search(place, names, frames))
        return Blended(windows, self.weight, self.clean_feet) if hop.direct and hop.stay_source == 0 else hop

    @staticmethod
    def _frames(length: Length, fps: float) -> int:
        """The length of both blends: one that does not follow from the points."""
        if not isinstance(length, Fixed):
            raise AssertionError("the registry lets a hop have a fixed length alone")
        return length.frames(fps)

    def _search(self, place: Place, names: tuple[str, ...], frames: int) -> Hop:
        from study.motion.clip import retarget
        from study.transitions.one_hop.build import build_table
        from study.transitions.one_hop.problem import (
            Alignment,
            PointCloudDistance,
            Problem,
            Settings,
            Switch,
            weight_in_counts,
        )

        source, distance = place.source, PointCloudDistance()
        stay = round(self.stay_s * source.fps)
        settings = Settings(frames, stay, stay)
        motions = tuple(place.motions.clip(name, source) for name in names)
        weight = self._weight(place, names, motions, settings)
        destination = retarget(place.destination, source.skeleton)
        beside = Alignment(destination_frame=place.end_frame - frames + 1)
        problem = Problem(
            (source, destination, *motions),
            (Switch(0, 1, beside, place.start_frame, place.start_frame),),
            settings,
            weight_in_counts(weight, distance),
            distance,
        )
        table = build_table(problem)
        entry = table.look_up(0, 1, place.start_frame)
        if entry is None:
            raise TransitionError("Expected clips with frames for a transition, found none that fits.")
        return Hop(
            (place.names[0] + _SOURCE, place.names[1] + _DESTINATION, *names)[entry.hop],
            place.start_frame + entry.stay_source - entry.offset,
            entry.stay_source,
            entry.stay_hop,
            entry.hop == 1 and entry.offset == beside.offset_at(place.start_frame) and entry.stay_hop == 0,
            frames,
            float(table.costs[0]),
            float(table.direct_costs[0]),
            problem.weight * distance.unit,
            self.weight,
            self.clean_feet,
        )

    def _weight(self, place: Place, names: tuple[str, ...], motions: tuple[Clip, ...], settings: Settings) -> float:
        """The weight that is set, or that of Eq. 5 for the hops, drawn from the protocol's seed."""
        from study.transitions.one_hop.default_weight import default_weight

        if self.hop_weight is not None:
            return self.hop_weight * self.weight_times
        if settings.longest_stay_source == 0:
            return 0.0

        def find() -> float:
            rng = place.motions.generator("one-hop weight")
            return max(default_weight(motions, rng, conditions=self.conditions, settings=settings).weight, 0.0)

        key = ("one-hop weight", names, self.conditions, settings.blend_frames, settings.longest_stay_source)
        return place.motions.once(key, find) * self.weight_times
