"""The default weight between smoothness and responsiveness: Koyama & Goto 2019, section 3.3, Eq. 5.

In: clips and a seeded generator. Out: a weight, and the two mean costs that it rests on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from renderer.workers import Where
from study.counting import counted
from study.errors import TransitionError
from study.motion.clip import Clip
from study.transitions.one_hop.build import MEMORY_BYTES, build_table
from study.transitions.one_hop.problem import Alignment, Distance, PointCloudDistance, Problem, Settings, Switch

CONDITIONS = 100


@dataclass(frozen=True)
class DefaultWeight:
    """A weight and what it rests on."""

    weight: float
    """`w` of Eq. 5, cost a frame of stay."""
    without_stays: float
    with_stays: float
    """The mean smoothness cost of the best transitions with no stays, and with free stays."""
    conditions: tuple[Switch, ...]
    """The transitions drawn: clips, alignment and triggered frame."""


def default_weight(
    clips: Sequence[Clip],
    rng: np.random.Generator,
    *,
    conditions: int = CONDITIONS,
    settings: Settings | None = None,
    distance: Distance | None = None,
    workers: Where = None,
    memory_bytes: int = MEMORY_BYTES,
) -> DefaultWeight:
    """The weight of Eq. 5 for a set of clips.

    Parameters
    ----------
    clips
        The clips that transitions are made between and that may be hops.
    rng, conditions
        Draws the conditions, so many (2019: 100).
    settings
        Blend and longest stays (2019: 30 and 60 frames at 60 fps); the paper's at the clips' frame rate unless given.
        Where blends may have several lengths, what the stays gain is that of the fixed length.

    Raises
    ------
    TransitionError
        Where fewer than two clips are long enough for a blend, or stays make nothing smoother.

    Notes
    -----
    Eq. 5 divides by `2 s_max`, the most that the responsiveness cost can be; here by the longest stays of the source
    and of the hop together, which is the same where they are equal, and by what both blends can take beyond the
    shortest. A condition is drawn such that both stays and blends fit wherever the clips are that long.
    """
    settings = settings or Settings.at(clips[0].fps if clips else 60.0)
    distance = distance or PointCloudDistance()
    if settings.longest_stay_source + settings.longest_stay_hop == 0:
        raise TransitionError("Expected stays of some frames to find a default weight for; there is none without.")
    longest = settings.longest_stay_source + settings.longest_stay_hop + 2 * (settings.blends[-1] - settings.blends[0])
    settings = replace(settings, lengths=())
    drawn = tuple(draw_condition(clips, settings, rng) for _ in range(conditions))
    problem = Problem(tuple(clips), drawn, settings, 0, distance)
    still = Settings(settings.blend_frames, 0, 0)
    tables = [
        build_table(each, workers=workers, memory_bytes=memory_bytes)
        for each in (replace(problem, settings=still), problem)
    ]
    both = np.isfinite(tables[0].costs) & np.isfinite(tables[1].costs)
    if not both.any():
        raise TransitionError("Expected transitions that fit in the clips, found none; use longer clips.")
    without, with_stays = (float(table.costs[both].mean()) for table in tables)
    return DefaultWeight((without - with_stays) / longest, without, with_stays, drawn)


def draw_condition(clips: Sequence[Clip], settings: Settings, rng: np.random.Generator) -> Switch:
    """A source, another clip as destination, a triggered frame, and the destination's frame at that time."""
    blend = settings.blend_frames
    able = [number for number, clip in enumerate(clips) if clip.frames >= blend]
    if len(able) < 2:
        raise TransitionError(
            f"Expected at least two clips of {counted(blend, 'frame')} or more, the blend, found {len(able)} "
            f"of {len(clips)}."
        )
    source, destination = (int(number) for number in rng.choice(able, 2, replace=False))
    stays = settings.longest_stay_source + settings.longest_stay_hop
    latest = clips[source].frames - blend
    trigger = int(rng.integers(max(latest - settings.longest_stay_source, 0) + 1))
    last = clips[destination].frames - blend
    frame = int(rng.integers(max(last - blend - stays, 0) + 1))
    return Switch(source, destination, Alignment(destination_frame=frame), trigger, trigger)
