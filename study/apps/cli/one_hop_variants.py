"""`segue one-hop` (between, chain, reach, connect, robustness): variants of Koyama & Goto 2019, section 5."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from study.apps.cli.clips import clips_options
from study.apps.cli.console import FILE, FOLDER, emit, json_option, together
from study.apps.cli.one_hop import (
    load_clips,
    memory_of,
    one_hop,
    pairs_of,
    problem_of,
    search_options,
)
from study.apps.cli.one_hop_play import show_played
from study.counting import counted

if TYPE_CHECKING:
    from study.motion.clip import Clip
    from study.transitions.one_hop.problem import Problem

__all__ = ["one_hop"]

out_option = click.option(
    "--out", type=FILE, help="File to write: X.bvh, X.mp4, or X.png, a strip of poses (default: none)."
)

moment_options = together(
    click.argument("clips", metavar="CLIP...", nargs=-1, required=True),
    search_options,
    click.option(
        "--pair", type=(str, str), metavar="SRC DST", required=True, help="The transition: its source and destination."
    ),
    click.option("--at", "trigger", type=click.IntRange(min=0), required=True, help="Triggered frame of SRC."),
    click.option(
        "--offset", type=int, default=0, show_default=True, help="Frame of SRC with which frame 0 of DST aligns."
    ),
)
"""One transition at one triggered frame."""


def problem_at(loaded: tuple[Clip, ...], pair: tuple[str, str], options: dict[str, Any]) -> Problem:
    """The search for one transition at one triggered frame."""
    from study.transitions.one_hop.problem import Alignment, Switch

    trigger = options["trigger"]
    ((source, destination),) = pairs_of((pair,), loaded)
    switch = Switch(source, destination, Alignment(options["offset"]), trigger, trigger)
    return problem_of(loaded, (switch,), options)


@one_hop.command()
@click.argument("slow")
@click.argument("fast")
@clips_options
@click.option(
    "--fps", type=click.FloatRange(min=1), default=60.0, show_default=True, help="Frames per second to work at."
)
@click.option(
    "--count", type=click.IntRange(1, 50), default=3, show_default=True, help="Number of clips between the two."
)
@click.option("--out", type=FOLDER, required=True, help="Folder for SLOW_FAST_1.bvh and so on.")
@json_option
def between(slow: str, fast: str, library: str | None, fps: float, count: int, out: Path) -> None:
    """Clips of one gait at speeds between those of SLOW and FAST, to be states or hops like any other.

    Whole gait cycles of both, brought into step and mixed; both have to end in steps that repeat.
    """
    import numpy as np

    from study.motion.readers.bvh_writing import write_bvh
    from study.transitions.flaws import find_flaws
    from study.transitions.one_hop.between import in_step, mixed

    clips = load_clips((slow, fast), library, fps)
    pair, names = in_step(*clips), [clip.name for clip in clips]
    rows: list[dict[str, Any]] = []
    for number, share in enumerate(pair.shares(count).tolist(), start=1):
        clip = mixed(pair, share, f"{names[0]}_{names[1]}_{number}")
        file, flaws = out / f"{clip.name}.bvh", find_flaws(clip, (0, clip.frames), clips)
        write_bvh(clip, file)
        way = np.linalg.norm(np.diff(clip.root_positions[:, [0, 2]], axis=0), axis=1).sum()
        seconds = (clip.frames - 1) / clip.fps
        rows.append(
            {
                "file": str(file),
                "share": share,
                "frames": clip.frames,
                "seconds": seconds,
                "speed_m_per_s": float(way) / seconds,
                "unsupported_share": flaws.unsupported_share,
                "own_unsupported_share": flaws.own_unsupported_share,
                "told": list(flaws.told()),
            }
        )
    speeds = [fps * way / frames for way, frames in zip(pair.ways_m, pair.frames, strict=True)]
    lines = [
        f"{row['file']}: {row['speed_m_per_s']:.2f} m/s, {row['seconds']:.2f} s, {100 * row['share']:.0f}% {names[1]}"
        + "".join(f"; {words}" for words in row["told"])
        for row in rows
    ]
    lines.append(
        f"{counted(pair.cycles, 'gait cycle')} of {names[0]} ({speeds[0]:.2f} m/s) and {names[1]} ({speeds[1]:.2f} m/s)"
    )
    result = {"clips": rows, "cycles": pair.cycles, "slow_m_per_s": speeds[0], "fast_m_per_s": speeds[1]}
    emit(result, "\n".join(lines))


@one_hop.command()
@moment_options
@click.option("--hops", type=click.IntRange(1, 8), default=2, show_default=True, help="Most hops on the way.")
@out_option
@json_option
def chain(
    clips: tuple[str, ...],
    library: str | None,
    fps: float,
    pair: tuple[str, str],
    hops: int,
    out: Path | None,
    **options: Any,
) -> None:
    """The best transition through several hops, for one triggered frame.

    Exact, by dynamic programming; each further hop takes as long as the first. Every clip may be a hop.
    """
    from study.transitions.one_hop.chains import find_chains
    from study.transitions.one_hop.play import play_steps

    loaded = load_clips(clips, library, fps)
    problem, trigger = problem_at(loaded, pair, options), options["trigger"]
    (switch,) = problem.switches
    found = [find_chains(problem, switch, most, memory_bytes=memory_of(options))[0] for most in range(1, hops + 1)]
    best = found[-1]
    if best is None:
        raise click.UsageError(
            f"expected a triggered frame from which a transition fits in the clips, found {trigger}; choose an earlier "
            "one, or lower --blend."
        )
    names = [clip.name for clip in loaded]
    steps = [
        {"stay": step.stay, "clip": names[step.clip], "offset": step.offset, "blend_frames": step.blend_frames}
        for step in best.steps
    ]
    costs = [None if one is None else one.cost for one in found]
    said = ", ".join(f"{counted(most, 'hop')} {one.cost:.4g}" for most, one in enumerate(found, start=1) if one)
    result = {"costs": costs, "weight": problem.weight * problem.distance.unit, "steps": steps}
    played = play_steps(loaded, switch.source, trigger, best.steps)
    show_played(played, names, out, result, [f"cost by at most {said}"])


@one_hop.command()
@moment_options
@click.option(
    "--forward", type=float, help="Where to end, metres ahead of the figure at the triggered frame (default: anywhere)."
)
@click.option("--left", type=float, help="Metres to its left, below 0 to its right (default: anywhere).")
@click.option(
    "--within", type=click.FloatRange(min=0), default=0.1, show_default=True, help="Tolerance of the place, metres."
)
@click.option("--turn", type=click.FloatRange(-180, 180), help="Turn to the left, degrees (default: any).")
@click.option("--within-turn", type=click.FloatRange(0, 180), default=10.0, show_default=True,
              help="Tolerance of the turn, degrees.")  # fmt: skip
@out_option
@json_option
def reach(
    clips: tuple[str, ...],
    library: str | None,
    fps: float,
    pair: tuple[str, str],
    forward: float | None,
    left: float | None,
    within: float,
    turn: float | None,
    within_turn: float,
    out: Path | None,
    **options: Any,
) -> None:
    """The best transition that ends at a wanted place and heading, for one triggered frame.

    Exact: every hop, frame and stay is looked at. The end is the last blended frame. Every clip may be a hop.
    """
    from math import degrees, radians

    from study.transitions.one_hop.play import Step, play_steps
    from study.transitions.one_hop.reach import Wanted
    from study.transitions.one_hop.reach import reach as find

    if forward is None and left is None and turn is None:
        raise click.UsageError("expected a place or a heading to reach; give --forward, --left or --turn.")
    loaded = load_clips(clips, library, fps)
    problem, trigger = problem_at(loaded, pair, options), options["trigger"]
    (switch,) = problem.switches
    wanted = Wanted(forward, left, within, None if turn is None else radians(turn), radians(within_turn))
    found, free = find(problem, switch, trigger, wanted), find(problem, switch, trigger, Wanted())
    if found is None:
        where = "" if free is None else (
            f"; the best of all goes {free.forward_m:.2f} m ahead and {free.left_m:.2f} m to the left, and turns by "
            f"{degrees(free.turn_rad):.0f} degrees"
        )  # fmt: skip
        raise click.UsageError(
            f"expected a transition from frame {trigger} that ends there, found none{where}. Allow more, give more "
            "clips, or raise --stay."
        )
    entry, names = found.entry, [clip.name for clip in loaded]
    blend = problem.settings.blend_frames
    result = {
        "hop": names[entry.hop],
        "offset": entry.offset,
        "stay_source": entry.stay_source,
        "stay_hop": entry.stay_hop,
        "cost": found.cost,
        "cost_anywhere": None if free is None else free.cost,
        "forward_m": found.forward_m,
        "left_m": found.left_m,
        "turn_degrees": degrees(found.turn_rad),
    }
    words = (
        f"hop {names[entry.hop]} at offset {entry.offset}, stays of {entry.stay_source} and {entry.stay_hop} frames: "
        f"{found.forward_m:.2f} m ahead, {found.left_m:.2f} m to the left, {degrees(found.turn_rad):.0f} degrees; cost "
        f"{found.cost:.4g}" + ("" if free is None else f", {free.cost:.4g} if it may end anywhere")
    )
    last = Step(entry.stay_hop, switch.destination, options["offset"], blend)
    steps = [Step(entry.stay_source, entry.hop, entry.offset, blend), last]
    show_played(play_steps(loaded, switch.source, trigger, steps), names, out, result, [words])


@one_hop.command()
@click.argument("source", metavar="SRC")
@click.argument("destination", metavar="DST")
@click.argument("hops", metavar="HOP...", nargs=-1, required=True)
@search_options
@out_option
@json_option
def connect(
    source: str,
    destination: str,
    hops: tuple[str, ...],
    library: str | None,
    fps: float,
    out: Path | None,
    **options: Any,
) -> None:
    """Join the last frames of SRC to the first frames of DST by a hop, where the two do not overlap in time."""
    from study.transitions.one_hop.connect import connect as connected
    from study.transitions.one_hop.play import Step, play_steps

    loaded = load_clips((source, destination, *hops), library, fps)
    problem = problem_of(loaded, (), options)
    found, names = connected(problem, 0, 1), [clip.name for clip in loaded]
    entry, blend = found.entry, problem.settings.blend_frames
    last = loaded[0].frames - blend
    result = {"hop": names[entry.hop], "frame": last - entry.offset, "stay_hop": entry.stay_hop, "cost": found.cost}
    steps = [Step(0, entry.hop, entry.offset, blend), Step(entry.stay_hop, 1, found.offset, blend)]
    words = f"hop {result['hop']} from its frame {result['frame']}, stay {entry.stay_hop}; cost {found.cost:.4g}"
    show_played(play_steps(loaded, 0, last, steps), names, out, result, [words])


@one_hop.command()
@click.argument("clips", metavar="CLIP...", nargs=-1, required=True)
@search_options
@click.option("--count", type=click.IntRange(1, 200), default=15, show_default=True, help="Number of transitions.")
@click.option("--out", type=FILE, help="Figure of what each costs: X.png, as Figure 10 (default: none).")
@json_option
def robustness(
    clips: tuple[str, ...], library: str | None, fps: float, count: int, out: Path | None, **options: Any
) -> None:
    """Transitions chosen by rule, direct and by the best hop, and what each part of them costs (section 4.2).

    Triggers lie at equal distances over the usable frames of all clips, each to the next clip.
    """
    from dataclasses import asdict, replace

    from study.apps.cli.one_hop import settings_of
    from study.transitions.one_hop.build import build_table
    from study.transitions.one_hop.robustness import costs_of, draw_costs, robustness_set

    loaded = load_clips(clips, library, fps)
    switches = robustness_set(loaded, settings_of(loaded[0].fps, options), count)
    problem = problem_of(loaded, switches, options)
    table = build_table(replace(problem, switches=switches), memory_bytes=memory_of(options))
    costs = [costs_of(problem, table, number, one.first_trigger) for number, one in enumerate(switches)]
    rows = [
        {"source": loaded[one.source].name, "destination": loaded[one.destination].name, "frame": one.first_trigger}
        | {"destination_frame": one.alignment.destination_frame, **asdict(cost), "cost": cost.total}
        for one, cost in zip(switches, costs, strict=True)
    ]
    if out is not None:
        draw_costs(costs, out)
    lower = sum(cost.total < cost.direct for cost in costs)
    lines = [
        f"{row['source']} {row['frame']} to {row['destination']} {row['destination_frame']}: {row['cost']:.4g}, "
        f"direct {row['direct']:.4g}"
        for row in rows
    ]
    lines.append(f"one-hop costs less in {lower} of {counted(len(rows), 'transition')}" + (f"; {out}" if out else ""))
    result = {"transitions": rows, "weight": problem.weight * problem.distance.unit, "lower": lower}
    emit({**result, "file": None if out is None else str(out)}, "\n".join(lines))
