"""Stimuli by one-hop transitions: a hop for each pair of transition points, and the blends that go through it.

A protocol, a library and settled points come in; a `Transition` goes out, made with the same blends and the same
cleaning of feet as the direct one beside it. Koyama & Goto 2019; the transition points are theirs in this way: the
source's point is the triggered frame, and the destination stands in time as the direct blend of `fixed_frames` has it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from study.errors import MotionError, StimulusError, TransitionError
from study.experiment.chance import generator
from study.experiment.protocol.whole import Protocol, StudySpec
from study.motion.clip import Clip, retarget
from study.transitions.blending import Transition, blend
from study.transitions.footskate import plant_feet

if TYPE_CHECKING:
    from study.experiment.stimuli.points import Settled
    from study.motion.library import Library
    from study.transitions.one_hop.problem import Settings

METHOD = "one-hop"


@dataclass(frozen=True)
class Hop:
    """A one-hop transition between settled points.

    Parameters
    ----------
    name
        The hop's motion.
    frame
        Its frame at the start of the first blend.
    stay_source, stay_hop
        Frames to wait before each blend.
    direct
        Whether it is the direct transition itself.
    blend_frames
        Frames of each blend.
    cost, direct_cost
        Eq. 2 and the distance of the direct transition, square metres.
    weight
        Cost a frame of stay, square metres.
    """

    name: str
    frame: int
    stay_source: int
    stay_hop: int
    direct: bool
    blend_frames: int
    cost: float
    direct_cost: float
    weight: float

    @property
    def frames(self) -> int:
        """From the triggered frame until the destination plays alone."""
        return self.stay_source + (1 if self.direct else 2) * self.blend_frames + self.stay_hop

    @property
    def at_once(self) -> bool:
        """Whether it is the direct blend at the transition's own points, which needs no hop."""
        return self.direct and self.stay_source == 0

    @property
    def words(self) -> str:
        """For manifests."""
        return (
            f"hop {self.name} from its frame {self.frame}, stays of {self.stay_source} and {self.stay_hop} frames, "
            f"blends of {self.blend_frames}; cost {self.cost:.4f}, direct {self.direct_cost:.4f}, weight "
            f"{self.weight:.3g} a frame"
        )


class Hops:
    """Finds hops for a protocol on a library; motions and weights are prepared once, when they are first needed."""

    def __init__(self, protocol: Protocol, library: Library) -> None:
        self.protocol, self.library = protocol, library
        self._clips: dict[str, Clip] = {}
        self._weights: dict[tuple[tuple[str, ...], int, int], float] = {}
        self._found: dict[tuple[str, str, int, int], Hop] = {}

    def find(self, study: StudySpec, settled: Settled) -> Hop:
        """The optimal hop for one transition of a study.

        Raises
        ------
        StimulusError
            Where no transition fits, or the library lacks a hop, or has it on another rig.
        """
        key = (study.name, settled.transition.name, settled.start_frame, settled.end_frame)
        if key not in self._found:
            self._check(study, settled)
            try:
                self._found[key] = self._search(study, settled)
            except (TransitionError, MotionError) as error:
                raise StimulusError(f"transition {settled.transition.name!r}, one-hop: {error}") from error
        return self._found[key]

    def _check(self, study: StudySpec, settled: Settled) -> None:
        for name in self._names(study):
            try:
                self._clip(name, settled.source.clip)
            except MotionError as error:
                raise StimulusError(f"study {study.name!r}, hop {name!r}: {error}") from error

    def _names(self, study: StudySpec) -> tuple[str, ...]:
        shown = [name for part in self.protocol.transitions_of(study) for name in (part.source, part.destination)]
        return tuple(dict.fromkeys(study.one_hop.hops or shown))

    def _clip(self, name: str, like: Clip) -> Clip:
        if name not in self._clips:
            self._clips[name] = replace(self.library.clip(name, fps=self.protocol.fps), name=name)
        return retarget(self._clips[name], like.skeleton)

    def _search(self, study: StudySpec, settled: Settled) -> Hop:
        from study.transitions.one_hop.build import build_table
        from study.transitions.one_hop.problem import (
            Alignment,
            PointCloudDistance,
            Problem,
            Settings,
            Switch,
            weight_in_counts,
        )

        source, distance = settled.source.clip, PointCloudDistance()
        blend_frames, stay = self.protocol.fixed_frames_of(study), round(study.one_hop.stay_s * self.protocol.fps)
        settings = Settings(blend_frames, stay, stay)
        names = self._names(study)
        motions = tuple(self._clip(name, source) for name in names)
        weight = self._weight(study, names, motions, settings)
        destination = retarget(settled.destination.clip, source.skeleton)
        beside = Alignment(destination_frame=settled.end_frame - blend_frames + 1)
        problem = Problem(
            (source, destination, *motions),
            (Switch(0, 1, beside, settled.start_frame, settled.start_frame),),
            settings,
            weight_in_counts(weight, distance),
            distance,
        )
        table = build_table(problem)
        entry = table.look_up(0, 1, settled.start_frame)
        if entry is None:
            raise TransitionError("Expected clips with frames for a transition, found none that fits.")
        offset = beside.offset_at(settled.start_frame)
        name = (settled.source.name, settled.destination.name, *names)[entry.hop]
        return Hop(
            name if entry.hop > 1 else f"{name} ({'source' if entry.hop == 0 else 'destination'})",
            settled.start_frame + entry.stay_source - entry.offset,
            entry.stay_source,
            entry.stay_hop,
            entry.hop == 1 and entry.offset == offset and entry.stay_hop == 0,
            blend_frames,
            float(table.costs[0]),
            float(table.direct_costs[0]),
            problem.weight * distance.unit,
        )

    def _weight(self, study: StudySpec, names: tuple[str, ...], motions: tuple[Clip, ...], settings: Settings) -> float:
        """The weight that the study gives, or that of Eq. 5 for its hops, drawn from the protocol's seed."""
        from study.transitions.one_hop.default_weight import default_weight

        if study.one_hop.weight is not None:
            return study.one_hop.weight * study.one_hop.weight_times
        if settings.longest_stay_source == 0:
            return 0.0
        key = (names, settings.blend_frames, settings.longest_stay_source)
        if key not in self._weights:
            rng = generator(self.protocol.seed, "one-hop weight")
            found = default_weight(motions, rng, conditions=study.one_hop.conditions, settings=settings)
            self._weights[key] = max(found.weight, 0.0)
        return self._weights[key] * study.one_hop.weight_times

    def transition(self, study: StudySpec, settled: Settled) -> Transition:
        """The transition by way of the hop: two blends, the second into the destination at its place in time.

        The result's blend runs from the first blended frame of the first blend to the last one of the second.
        """
        hop = self.find(study, settled)
        source, destination = settled.source.clip, settled.destination.clip
        start = settled.start_frame + hop.stay_source
        weight, cleaned = self.protocol.stimuli.weight, self.protocol.stimuli.clean_feet
        into = settled.end_frame - hop.blend_frames + 1
        if hop.direct:
            made = blend(
                source,
                destination,
                start,
                into + hop.stay_source,
                hop.blend_frames,
                weight=weight,
                specification="left",
            )
            return plant_feet(made, source, destination)[0] if cleaned else made
        between = self._hop_clip(hop, source, destination)
        first = blend(source, between, start, hop.frame, hop.blend_frames, weight=weight, specification="left")
        if cleaned:
            first, _ = plant_feet(first, source, between)
        leave = start + hop.blend_frames + hop.stay_hop
        arrive = into + leave - settled.start_frame
        second = blend(first.clip, destination, leave, arrive, hop.blend_frames, weight=weight, specification="left")
        if cleaned:
            second, _ = plant_feet(second, first.clip, destination)
        return replace(second, blend_start=start, note=f"{first.note}; {second.note}; {hop.words}")

    def _hop_clip(self, hop: Hop, source: Clip, destination: Clip) -> Clip:
        if hop.name.endswith(" (source)"):
            return source
        return destination if hop.name.endswith(" (destination)") else self._clip(hop.name, source)
