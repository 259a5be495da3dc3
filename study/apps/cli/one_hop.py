"""`segue one-hop build`, and what all its verbs share: optimal one-hop transitions, Koyama & Goto 2019."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from study.apps.cli.clips import clips_options, find_entry, load_clip
from study.apps.cli.console import FILE, READABLE, emit, json_option, progress, say, together, workers_options
from study.counting import counted

if TYPE_CHECKING:
    from study.arrays import IntArray
    from study.motion.clip import Clip
    from study.transitions.one_hop.problem import Problem, Settings, Switch
    from study.transitions.one_hop.table import OneHopTable


@click.group("one-hop")
def one_hop() -> None:
    """The best transitions through an intermediate clip, for every triggered frame (Koyama & Goto 2019)."""


def load_clips(specs: tuple[str, ...], library: str | None, fps: float | None) -> tuple[Clip, ...]:
    """Clips as `load_clip` takes them, on the body of the first, named by file or motion."""
    from dataclasses import replace

    from study.apps.cli.clips import on_body_of

    names = [Path(spec).stem if Path(spec).is_file() else spec for spec in specs]
    if len(set(names)) < len(names):
        twice = sorted({name for name in names if names.count(name) > 1})
        raise click.UsageError(f"expected clips with names of their own, found {', '.join(twice)} more than once.")
    clips = [replace(load_clip(spec, library, fps), name=name) for spec, name in zip(specs, names, strict=True)]
    return tuple(on_body_of(clips[0], clip) for clip in clips)


def pairs_of(pairs: tuple[tuple[str, str], ...], clips: tuple[Clip, ...]) -> list[tuple[int, int]]:
    """Source and destination numbers; all ordered pairs where none is named."""
    names = [clip.name for clip in clips]
    for name in {name for pair in pairs for name in pair}:
        if name not in names:
            raise click.UsageError(f"expected --pair with names of the clips ({', '.join(names)}), found {name!r}.")
    if pairs:
        return [(names.index(source), names.index(destination)) for source, destination in pairs]
    return [(a, b) for a in range(len(clips)) for b in range(len(clips)) if a != b]


search_options = together(
    clips_options,
    click.option(
        "--fps",
        type=click.FloatRange(min=1),
        default=60.0,
        show_default=True,
        help="Frames per second to work at; frames are counted at this rate.",
    ),
    click.option("--blend", type=click.IntRange(min=1), help="Length of each blend, frames (default: 0.5 s)."),
    click.option(
        "--stay", type=click.IntRange(min=0), help="Longest stay in source and in hop, frames (default: 1 s)."
    ),
    click.option(
        "--weight",
        type=click.FloatRange(min=0),
        help="Cost of a frame of stay, in units of the distance (default: that of Eq. 5).",
    ),
    click.option(
        "--times", type=click.FloatRange(min=0), default=1.0, show_default=True, help="Factor of that weight."
    ),
    click.option(
        "--seed", type=int, default=0, show_default=True, help="Seed of the pairs that Eq. 5 draws, a whole number."
    ),
    click.option(
        "--distance",
        type=click.Choice(["pointcloud", "joint"]),
        default="pointcloud",
        show_default=True,
        help="pointcloud: distances of points on the body; joint: rotations and velocities of joints.",
    ),
    click.option(
        "--part",
        type=click.Choice(["lower", "upper"]),
        help="The distance of one part of the body: lower, or upper, the spine and above (default: all).",
    ),
    click.option(
        "--memory-gb",
        type=click.FloatRange(min=0.05),
        default=2.0,
        show_default=True,
        help="Memory to work in, gigabytes.",
    ),
)
"""Clips, frame rate and what all searches share."""


@one_hop.command()
@click.argument("clips", metavar="CLIP...", nargs=-1, required=True)
@search_options
@click.option(
    "--out", type=FILE, help="File to write: X.npz, or X.bin with X.json, for engines (default: none, with --plan)."
)
@click.option("--plan", is_flag=True, help="Only say what the build will take: operations, memory, processor time.")
@click.option(
    "--pair", "pairs", type=(str, str), multiple=True, metavar="SRC DST", help="A transition to build (default: all)."
)
@click.option(
    "--offset",
    type=int,
    help="Frame of SRC with which frame 0 of DST always aligns, as in dancing to music (default: 0).",
)
@click.option(
    "--start",
    type=click.IntRange(min=0),
    help="Instead of --offset: the frame at which DST is entered whenever triggered, as in a jump (default: none).",
)
@click.option(
    "--longest",
    type=click.IntRange(min=1),
    help="Longest transition, frames, both blends included (default: as the stays allow).",
)
@click.option(
    "--genre",
    type=(str, click.FloatRange(min=0)),
    metavar="GENRE COST",
    help="Prefer hops of a genre, a category of the library: any other costs so much more (Eq. 6; default: none).",
)
@click.option("--adaptive", is_flag=True, help="Each blend has a length of its own, up to 1 s.")
@click.option("--on-beat", is_flag=True, help="Align beats with beats, estimated from the motions or given by --beats.")
@click.option(
    "--beats",
    type=(str, READABLE),
    multiple=True,
    metavar="CLIP FILE",
    help="File of the times of a clip's beats, seconds; may be repeated.",
)
@click.option(
    "--near-direct",
    type=click.IntRange(min=0),
    help="The hop is DST itself, shifted by at most this many frames (default: any hop).",
)
@click.option("--runs", is_flag=True, help="X.bin holds neighbouring entries together, without loss.")
@workers_options
@json_option
def build(clips: tuple[str, ...], library: str | None, out: Path | None, fps: float, **options: Any) -> None:
    """Find the best transition between clips for every triggered frame, and write a table of them.

    Every clip may be a hop. The same command resumes an interrupted build.
    """
    import numpy as np

    from study.files import check_place
    from study.transitions.one_hop.runs import to_runs
    from study.transitions.one_hop.table import write_table

    if out is None and not options["plan"]:
        raise click.UsageError("expected --out, the file to write, or --plan, found neither; give one.")
    if out is not None and out.suffix not in (".npz", ".bin", ".json"):
        raise click.UsageError(f"expected --out as a name that ends in .npz, .bin or .json, found {str(out)!r}.")
    if options["runs"] and out is not None and out.suffix == ".npz":
        raise click.UsageError("expected --out X.bin with --runs; .npz holds every entry, with its costs.")
    loaded = load_clips(clips, library, fps)
    options["known_beats"] = known_beats(clips, library, loaded)
    options["genres"] = [find_entry(spec, library)[1].kind for spec in clips]
    if out is None or options["plan"]:
        _tell_plan(asked(loaded, {**options, "weight": options["weight"] or 0.0}), options)
        return
    check_place(out)
    table = built(asked(loaded, options), out, options)
    files = write_table(table, out, as_runs=options["runs"])
    size = to_runs(table.entries).nbytes if options["runs"] else table.entries.nbytes
    both = np.isfinite(table.costs) & np.isfinite(table.direct_costs)
    result = {
        "files": [str(file) for file in files],
        "transitions": len(table.rows),
        "entries": len(table.entries),
        "found": int((table.entries[:, 0] >= 0).sum()),
        "bytes": int(size),
        "weight": table.weight,
        "mean_cost": float(table.costs[both].mean()) if both.any() else None,
        "mean_direct_cost": float(table.direct_costs[both].mean()) if both.any() else None,
    }
    text = (
        f"{', '.join(map(str, files))}: {counted(len(table.rows), 'transition')}, {result['found']} of "
        f"{counted(len(table.entries), 'triggered frame')}, {counted(size, 'byte')}, weight "
        f"{table.weight:.4g} a frame"
    )
    if both.any():
        text += f"; mean cost {result['mean_cost']:.4g}, direct {result['mean_direct_cost']:.4g}"
    emit(result, text)


def switches_of(clips: tuple[Clip, ...], options: dict[str, Any]) -> tuple[Switch, ...]:
    """The transitions that the options ask for."""
    from study.transitions.one_hop.problem import Alignment, Switch

    if options["offset"] is not None and options["start"] is not None:
        raise click.UsageError("expected either --offset or --start; give one of them.")
    offset = (options["offset"] or 0) if options["start"] is None else None
    alignment = Alignment(offset, options["start"])
    return tuple(Switch(a, b, alignment) for a, b in pairs_of(options["pairs"], clips))


def settings_of(fps: float, options: dict[str, Any]) -> Settings:
    """Blend and stays from the options."""
    from study.transitions.one_hop.adaptive import lengths_at
    from study.transitions.one_hop.problem import Settings

    usual = Settings.at(fps)
    blend = options["blend"] or usual.blend_frames
    stay = usual.longest_stay_source if options["stay"] is None else options["stay"]
    longest = options.get("longest")
    if longest is not None and longest < 2 * blend:
        raise click.UsageError(f"expected --longest of at least two blends, {2 * blend} frames, found {longest}.")
    lengths = lengths_at(fps, blend) if options.get("adaptive") else ()
    return Settings(blend, stay, stay, None if longest is None else longest - 2 * blend, lengths)


def asked(clips: tuple[Clip, ...], options: dict[str, Any]) -> Problem:
    """The search of the paper, with the variants that leave its structure as it is."""
    from dataclasses import replace

    from study.transitions.one_hop.adaptive import adaptive
    from study.transitions.one_hop.beats import genre_costs

    if options["adaptive"] and options["longest"]:
        raise click.UsageError("expected no --longest with --adaptive; it bounds both stays, whatever the blends take.")
    switches = switches_of(clips, options)
    offsets = beat_offsets(clips, switches, options)
    problem = problem_of(clips, switches, options)
    genre = options["genre"]
    costs = {} if genre is None else genre_costs(options["genres"], genre[0], genre[1], problem.distance)
    problem = replace(problem, offsets=offsets, hop_costs=costs, nearest_to_direct=options["near_direct"])
    return adaptive(problem) if options["adaptive"] else problem


def built(problem: Problem, out: Path, options: dict[str, Any]) -> OneHopTable:
    """The table, with progress on standard error."""
    from study.transitions.one_hop.build import build_table

    with progress("hops") as report:
        return build_table(
            problem,
            workers=options["workers"],
            memory_bytes=memory_of(options),
            checkpoint=out.with_name(f"{out.stem}.unfinished.npz"),
            progress=lambda done, total: report(done / total, f"{done} of {total}"),
        )


def _tell_plan(problem: Problem, options: dict[str, Any]) -> None:
    from dataclasses import asdict

    from renderer.workers import cores
    from study.transitions.one_hop.plan import plan

    workers = options["workers"] if isinstance(options["workers"], int) else cores()
    found = plan(problem, memory_of(options), workers)
    held, clips, block, table = (
        f"{size / 2**30:.2f} GB" for size in (found.peak_bytes, found.clips_bytes, found.block_bytes, found.table_bytes)
    )
    place = "in memory too" if found.blocks == 1 else "on the disk"
    emit(
        {**asdict(found), "peak_bytes": found.peak_bytes, "workers": workers},
        f"{counted(found.clips, 'clip')}, {counted(found.transitions, 'transition')}, "
        f"{counted(found.triggered_frames, 'triggered frame')}\n"
        f"work: {found.window_pairs:.3g} distances, {found.sums:.3g} sums, in {counted(found.jobs, 'job')} of "
        f"{counted(found.blocks, 'block')}\n"
        f"memory: {held} at most, without the program itself: clips {clips}, a block with {counted(workers, 'worker')} "
        f"{block}; the table is {table}, {place}\n"
        f"time: {found.core_s:.3g} s of processor, by a trial on this machine; the weight of Eq. 5 is not counted",
    )


def memory_of(options: dict[str, Any]) -> int:
    """The memory limit in bytes."""
    return int(options["memory_gb"] * 2**30)


def problem_of(clips: tuple[Clip, ...], switches: tuple[Switch, ...], options: dict[str, Any]) -> Problem:
    """What is searched for, with the weight that is given or that of Eq. 5."""
    from numpy.random import default_rng

    from study.transitions.one_hop.default_weight import default_weight
    from study.transitions.one_hop.joint_distance import JointDistance
    from study.transitions.one_hop.parts import part_weights
    from study.transitions.one_hop.problem import Distance, PointCloudDistance, Problem, weight_in_counts

    settings, part = settings_of(clips[0].fps, options), options["part"]
    if part and options["distance"] == "joint":
        raise click.UsageError("expected --distance pointcloud with --part; the joint distance is of the whole body.")
    weights = part_weights(clips[0].skeleton, part) if part else None
    distance: Distance = JointDistance() if options["distance"] == "joint" else PointCloudDistance(weights)
    weight = options["weight"]
    if weight is None:
        found = default_weight(
            clips,
            default_rng(options["seed"]),
            settings=settings,
            distance=distance,
            workers=options.get("workers"),
            memory_bytes=memory_of(options),
        )
        weight = found.weight
        means = f"{found.without_stays:.4g} without stays, {found.with_stays:.4g} with"
        say(f"weight of Eq. 5: {weight:.4g} a frame ({means})")
    return Problem(clips, switches, settings, weight_in_counts(weight * options["times"], distance), distance)


def known_beats(specs: tuple[str, ...], library: str | None, clips: tuple[Clip, ...]) -> list[IntArray]:
    """The frames of each clip's beats as `library.toml` says them; empty where it says none."""
    from study.transitions.one_hop.beats import beats_at

    times = [find_entry(spec, library)[1].beats for spec in specs]
    return [beats_at([t - clip.start_s for t in said], clip) for said, clip in zip(times, clips, strict=True)]


def beat_offsets(
    clips: tuple[Clip, ...], switches: tuple[Switch, ...], options: dict[str, Any]
) -> dict[tuple[int, int], IntArray]:
    """The offsets of a beat-aware search; none where it is not asked for."""
    from study.transitions.one_hop.beats import all_beat_offsets, find_beats, read_beats

    given = dict(options["beats"])
    names = [clip.name for clip in clips]
    if unknown := sorted(set(given) - set(names)):
        raise click.UsageError(f"expected --beats for clips that are given ({', '.join(names)}), found {unknown[0]!r}.")
    if not given and not options["on_beat"]:
        return {}
    known = options["known_beats"]
    beats = {
        number: read_beats(given[clip.name], clip)
        if clip.name in given
        else (known[number] if len(known[number]) else find_beats(clip))
        for number, clip in enumerate(clips)
    }
    return all_beat_offsets(beats, [switch.source for switch in switches], range(len(clips)))
