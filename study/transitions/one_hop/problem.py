"""The one-hop search problem: what is asked, in whole numbers of frames and of cost.

Koyama & Goto 2019, sections 3.1 and 3.2. A transition plays the source for a stay, blends into a hop, plays the hop
for a stay, and blends into the destination. Frames of the three clips share one timeline, the source's: a clip with
*temporal alignment offset* `o` has its frame 0 at source frame `o`, so at source frame `t` it shows frame `t - o`.

Costs are whole numbers (*counts*) of a distance's unit. Sums of counts are exact in any order, so that a fast search
and a plain one give the same table entry by entry, ties included.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from study.arrays import CountArray, FloatArray, IntArray
from study.errors import TransitionError
from study.motion.clip import Clip
from study.transitions import point_cloud as clouds

# The count of what can't be. Two distances, the penalties of two stays and of two blends, and a hop's cost, each at
# most `LARGEST_COUNT` = 2^26, stay below it; twice FORBIDDEN and three of them still fit an int32.
FORBIDDEN = 2**29
_LARGEST_PENALTY = clouds.LARGEST_COUNT

# 2019, section 3.1: blends of 0.5 s; section 3.3: stays of at most 60 frames at 60 fps.
BLEND_S, LONGEST_STAY_S = 0.5, 1.0


class Distance(Protocol):
    """A distance between windows of two clips, symmetric, 0 between a window and itself (2019, Choice of distance)."""

    @property
    def unit(self) -> float:
        """The cost of one count."""

    @property
    def words(self) -> str:
        """What the cost is, with its unit, for headers and pictures."""

    def prepare(self, clip: Clip, blend_frames: int) -> Any:
        """What `counts` needs of a clip, computed once."""

    def counts(self, a: Any, b: Any, blend_frames: int, rows: range, columns: range) -> CountArray:
        """Costs of blends that start at the frames `rows` of one clip and `columns` of another, in counts."""


@dataclass(frozen=True, eq=False)
class PointCloudDistance:
    """The distance of Kovar et al. 2002 over the frames of the blend: mean squared metres; see `point_cloud`."""

    weights: FloatArray | None = None
    """`(joints,)`: how much each joint counts; all the same unless given."""
    unit: float = 1.0 / clouds.COUNTS_PER_SQUARE_METRE
    words: str = "mean squared distance after alignment on the floor, square metres (Kovar et al. 2002)"

    def prepare(self, clip: Clip, blend_frames: int) -> clouds.PointCloud:
        """The clip as a point cloud."""
        del blend_frames
        return clouds.point_cloud(clip, self.weights)

    def counts(
        self, a: clouds.PointCloud, b: clouds.PointCloud, blend_frames: int, rows: range, columns: range
    ) -> CountArray:
        """`window_counts`."""
        return clouds.window_counts(a, b, blend_frames, rows=rows, columns=columns)


@dataclass(frozen=True)
class Settings:
    """What a search may choose from."""

    blend_frames: int = 30
    """Frames in each of the two blends (2019: 30, half a second at 60 fps)."""
    longest_stay_source: int = 60
    longest_stay_hop: int = 60
    """The most frames to wait in the source after the trigger, and in the hop after the first blend (2019: 60)."""
    longest_stay_both: int | None = None
    """The most frames for both stays together, where that is less: a bound on the duration of the transition, which is
    both stays and both blends (2019, section 5, Higher responsiveness)."""
    lengths: tuple[int, ...] = ()
    """The frames that each blend may take, ascending, where its length is searched for as well (2019, section 5,
    Blending duration). Every frame beyond the shortest then costs as much as one of a stay. `build_table` alone takes
    them."""

    def __post_init__(self) -> None:
        stays = (self.longest_stay_source, self.longest_stay_hop, self.longest_stay_both or 0)
        if self.blend_frames < 1 or min(stays) < 0:
            raise TransitionError(
                f"Expected a blend of at least 1 frame and longest stays of at least 0, got {self.blend_frames} and "
                f"{', '.join(map(str, stays))}."
            )
        if list(self.lengths) != sorted({frames for frames in self.lengths if frames > 0}):
            raise TransitionError(f"Expected lengths of blends of 1 frame or more, ascending, got {self.lengths}.")

    @staticmethod
    def at(fps: float) -> Settings:
        """The paper's settings at a frame rate: blends of 0.5 s and stays of at most 1 s."""
        blend, stay = max(1, round(BLEND_S * fps)), round(LONGEST_STAY_S * fps)
        return Settings(blend, stay, stay)

    @property
    def blends(self) -> tuple[int, ...]:
        """The frames that a blend may take, ascending."""
        return self.lengths or (self.blend_frames,)

    @property
    def stay_both(self) -> int:
        """The most frames for both stays together."""
        most = self.longest_stay_source + self.longest_stay_hop
        return most if self.longest_stay_both is None else min(self.longest_stay_both, most)


@dataclass(frozen=True)
class Alignment:
    """Where the destination stands on the source's timeline (`o_sd` of 2019, given, never searched).

    Exactly one is given: `offset`, the same for every trigger, as when both are danced to one piece of music; or
    `destination_frame`, the frame of the destination at the triggered frame, as when a jump starts at the press of
    a button.
    """

    offset: int | None = None
    destination_frame: int | None = None

    def __post_init__(self) -> None:
        if (self.offset is None) == (self.destination_frame is None):
            raise TransitionError(
                "Expected a temporal alignment by either an offset (music) or the destination's frame at the trigger, "
                f"got {self.offset} and {self.destination_frame}."
            )

    def offset_at(self, trigger: int) -> int:
        """The destination's offset for a triggered frame."""
        if self.offset is not None:
            return self.offset
        assert self.destination_frame is not None  # __post_init__ saw to it
        return trigger - self.destination_frame


@dataclass(frozen=True)
class Switch:
    """One transition of a state machine, for a stretch of triggered frames."""

    source: int
    destination: int
    """Which clips, by number."""
    alignment: Alignment = Alignment(offset=0)
    """Where the destination stands."""
    first_trigger: int = 0
    last_trigger: int | None = None
    """The triggered frames, both included; all frames of the source unless given."""


@dataclass(frozen=True, eq=False)
class Problem:
    """Clips, the transitions between them, the hops to choose from, and what counts as good."""

    clips: tuple[Clip, ...]
    """All clips that are in memory at runtime, of one rig at one frame rate."""
    switches: tuple[Switch, ...]
    """The transitions to find."""
    settings: Settings = Settings()
    """Blend length and stays."""
    weight: int = 0
    """`w` of Eq. 2, in counts a frame; see `weight_in_counts`."""
    distance: Distance = field(default_factory=PointCloudDistance)
    """`D` of Eq. 3."""
    hops: tuple[int, ...] | None = None
    """Which clips may be hops; all of them unless given. One-hop costs no more than direct only where the destination
    is among them."""
    hop_costs: Mapping[int, int] = field(default_factory=dict)
    """A cost in counts to add wherever a clip is the hop, by clip (Eq. 6); nothing unless given."""
    offsets: Mapping[tuple[int, int], IntArray] = field(default_factory=dict)
    """By (source, hop), the only offsets that the hop may have, ascending (section 4.4); any unless given."""
    nearest_to_direct: int | None = None
    """Where given, the hop must be the destination itself, and its offset lie within this many frames of the
    destination's (section 5, Higher responsiveness)."""

    def __post_init__(self) -> None:
        check_clips(self.clips)
        blends = self.settings.blends
        most = max(self.settings.longest_stay_source, self.settings.longest_stay_hop, blends[-1] - blends[0], 1)
        if not 0 <= self.weight * most <= _LARGEST_PENALTY:
            raise TransitionError(
                f"Expected a weight from 0 to {_LARGEST_PENALTY // most * self.distance.unit:g} a frame for stays of "
                f"up to {most} frames, got {self.weight * self.distance.unit:g}."
            )
        for clip in {number for switch in self.switches for number in (switch.source, switch.destination)}:
            self._check_number(clip)
        for hop in self.hop_numbers:
            self._check_number(hop)
        for hop, cost in self.hop_costs.items():
            if not 0 <= cost <= clouds.LARGEST_COUNT:
                raise TransitionError(f"Expected a cost for hop {hop} of 0 to {clouds.LARGEST_COUNT}, got {cost}.")

    def _check_number(self, number: int) -> None:
        if not 0 <= number < len(self.clips):
            raise TransitionError(f"Expected clip numbers from 0 to {len(self.clips) - 1}, got {number}.")

    @property
    def hop_numbers(self) -> tuple[int, ...]:
        """The clips that may be hops, ascending."""
        return tuple(range(len(self.clips))) if self.hops is None else tuple(sorted(set(self.hops)))

    def triggers(self, switch: Switch) -> range:
        """The triggered frames of a switch."""
        frames = self.clips[switch.source].frames
        last = frames - 1 if switch.last_trigger is None else switch.last_trigger
        if not 0 <= switch.first_trigger <= last < frames:
            raise TransitionError(
                f"Expected triggered frames from 0 to {frames - 1} of {self.clips[switch.source].name or 'the source'}"
                f", got {switch.first_trigger} to {last}."
            )
        return range(switch.first_trigger, last + 1)


def weight_in_counts(weight: float, distance: Distance) -> int:
    """A weight in the distance's own cost a frame as the nearest whole number of counts a frame."""
    if not (np.isfinite(weight) and weight >= 0):
        raise TransitionError(f"Expected a weight of at least 0 a frame, got {weight}.")
    return round(weight / distance.unit)


def check_clips(clips: Sequence[Clip]) -> None:
    """`TransitionError` unless there are clips, all of one joint tree and one frame rate; bodies may differ."""
    if not clips:
        raise TransitionError("Expected at least one clip, got none.")
    first = clips[0]
    for number, clip in enumerate(clips[1:], start=1):
        who = f"clip {number} ({clip.name or 'no name'})"
        if not clip.skeleton.matches(first.skeleton):
            odd = sorted(set(clip.skeleton.names) ^ set(first.skeleton.names))
            raise TransitionError(
                f"Expected all clips to share one joint tree; {who} differs from clip 0 ({first.name or 'no name'}) in "
                f"{', '.join(odd[:3]) or 'the order of its joints'}. Retarget it, or use clips of one rig."
            )
        if not np.isclose(clip.fps, first.fps, rtol=1e-9):
            raise TransitionError(
                f"Expected all clips at one frame rate; {who} has {clip.fps:g} fps and clip 0 has {first.fps:g}. "
                "Resample them (segue one-hop build --fps)."
            )
