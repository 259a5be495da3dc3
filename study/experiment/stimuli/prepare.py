"""Stimuli: from a protocol and a library to all that participants see.

A protocol and a library come in; a `StimulusSet` goes out: each stimulus is a blended transition, cut to entry, blend
and exit, as joint positions with a figure and a camera. What is seen is hashed, and the hash is the stimulus's name,
so a stimulus is rendered once and reused after. Nothing is drawn here; see `rendering`.

One fixed camera serves a group (2004 section 4.1: groups of motions were shown from the same position). Transitions
start over the same point with the same heading, so that it sees all of them from the same side, as near as may be.
"""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from study.errors import StimulusError
from study.experiment.plan import Pair
from study.experiment.protocol.whole import Protocol, StudySpec
from study.experiment.stimuli.films import Film, Planned, Showing, plan_all
from study.experiment.stimuli.hops import Hops
from study.experiment.stimuli.points import Settled, Supply
from study.experiment.stimuli.rendering import Manifest, RenderSummary, made_from, read_manifest, record, render
from study.experiment.stimuli.stimulus import MotionUse, Stimulus, StimulusRecord, StimulusSet
from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions, trim
from study.motion.drawing import figure_for
from study.transitions.blending import Transition, blend, cut, facing
from study.transitions.footskate import plant_feet
from study.transitions.timewarp import warped_blend

if TYPE_CHECKING:
    from renderer.camera import Camera
    from renderer.figure import Figure
    from study.motion.library import Library

__all__ = [
    "Manifest",
    "RenderSummary",
    "Stimulus",
    "StimulusRecord",
    "StimulusSet",
    "check",
    "prepare",
    "read_manifest",
    "record",
    "render",
]

FloatArray = NDArray[np.float64]

LOOK_VERSION = 1
"""Part of every stimulus's name: raised when the renderer comes to draw the same figure otherwise."""

_TRAVELS_M = 0.5


@dataclass(frozen=True, eq=False)
class _Draft:
    """A stimulus before it has a camera."""

    settled: Settled
    method: str
    difference_frames: int
    blend_frames: int
    clip: Clip
    blend: tuple[int, int]
    positions: FloatArray
    notes: tuple[str, ...]


def prepare(protocol: Protocol, library: Library, progress: Callable[[int, int], None] | None = None) -> StimulusSet:
    """Build all stimuli of a protocol.

    Parameters
    ----------
    protocol, library
        What to show, and the motions to show it with.
    progress
        Called with transitions that are done and the number of them, after each.

    Raises
    ------
    StimulusError
        With everything that can't be shown, one problem a line.
    """
    hops = Hops(protocol, library)
    planned, problems = plan_all(protocol, library, hops, progress)
    if problems:
        raise StimulusError("\n".join(problems))
    drafts: dict[Film, _Draft] = {}
    for each in planned:
        _add_drafts(protocol, each, drafts, hops)
    stimuli = _with_cameras(protocol, library, drafts)
    return StimulusSet(
        protocol,
        library.name,
        library.synthetic,
        library.acknowledgement,
        tuple({stimulus.id: stimulus for stimulus in stimuli.values()}.values()),
        tuple(_pair(each.study, showing, stimuli) for each in planned for showing in each.showings),
        versions(),
        made_from(protocol, library),
    )


def check(protocol: Protocol, library: Library) -> list[str]:
    """Everything that can't be shown, one sentence each; empty where all can."""
    return plan_all(protocol, library, Hops(protocol, library))[1]


def versions() -> dict[str, str]:
    """What made the stimuli, for manifests."""
    import scipy

    import study

    return {
        "segue": study.__version__,
        "look": str(LOOK_VERSION),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
    }


def _add_drafts(protocol: Protocol, planned: Planned, drafts: dict[Film, _Draft], hops: Hops) -> None:
    """Make what is seen in one study of one transition, but for what was made before."""
    study, settled = planned.study, planned.settled
    for showing in planned.showings:
        seen = ((showing.a, showing.method_a, 0), (showing.b, showing.method_b, showing.difference_frames or 0))
        for film, method, difference in seen:
            if film is not None and film not in drafts:
                made = None if film.hop is None else hops.transition(study, settled)
                drafts[film] = _draft(protocol, settled.at(method), method, difference, film, made)


def _draft(
    protocol: Protocol,
    settled: Settled,
    method: str,
    difference: int,
    film: Film,
    by_hop: Transition | None,
) -> _Draft:
    """Blend, cut to entry and exit, clean the feet, and place at the origin with the common heading."""
    made = by_hop or _transition(protocol, settled, film.blend_frames, film.windows)
    if protocol.stimuli.clean_feet and film.blend_frames and by_hop is None:
        # The clips themselves know when a foot is planted; a sliding one may be too fast to be found in the blend.
        made, _ = plant_feet(made, settled.source.clip, settled.destination.clip)
    entry, after = (round(s * protocol.fps) for s in (protocol.stimuli.entry_s, protocol.stimuli.exit_s))
    first = settled.start_frame - entry
    clip = trim(made.clip, first, made.blend_stop + film.frames_on + after)
    notes = [note for note in (made.note, settled.lengths[method].note) if note]
    positions = _placed(joint_positions(clip, ends=True), protocol, settled)
    return _Draft(
        settled,
        method,
        difference,
        film.blend_frames,
        clip,
        (made.blend_start - first, made.blend_stop - first),
        positions,
        tuple(notes),
    )


def _transition(
    protocol: Protocol, settled: Settled, blend_frames: int, windows: tuple[int, int] | None = None
) -> Transition:
    source, destination = settled.source.clip, settled.destination.clip
    if blend_frames == 0:
        return cut(source, destination, settled.start_frame, settled.end_frame)
    if windows is not None:
        points = settled.start_frame, settled.end_frame
        return warped_blend(source, destination, *points, *windows, weight=protocol.stimuli.weight)
    return blend(
        source,
        destination,
        settled.start_frame,
        settled.end_frame,
        blend_frames,
        weight=protocol.stimuli.weight,
        specification=protocol.stimuli.specification,
    )


def _placed(positions: FloatArray, protocol: Protocol, settled: Settled) -> FloatArray:
    """Points with the pelvis over the origin where the blend starts, and the way of the transition along +Z.

    The way is that of a blend of one frame whatever the length: entries are the same for all lengths and shall stay
    so. Rounded to a tenth of a millimetre, so that the hash doesn't hang on the last bits of a machine's arithmetic.
    """
    made = _transition(protocol, settled, 1)
    entry, after = (round(s * protocol.fps) for s in (protocol.stimuli.entry_s, protocol.stimuli.exit_s))
    path = made.clip.root_positions
    way = path[made.blend_stop + after - 1] - path[made.blend_start - entry]
    if np.hypot(way[0], way[2]) > _TRAVELS_M:
        heading = float(np.arctan2(way[0], way[2]))
    else:
        heading = float(facing(trim(settled.source.clip, settled.start_frame, settled.start_frame + 1))[0])
    floor = settled.source.clip.root_positions[settled.start_frame] * np.array([1.0, 0.0, 1.0])
    return np.round(quat.rotate(quat.yaw(-heading), positions - floor), 4)


def _with_cameras(protocol: Protocol, library: Library, drafts: dict[Film, _Draft]) -> dict[Film, Stimulus]:
    """Figures, one camera a group, and names."""
    from renderer.camera import frame_group
    from renderer.errors import RendererError
    from renderer.viewpoint import best_view

    settings = protocol.stimuli
    groups: dict[str, list[Film]] = {}
    for key, draft in drafts.items():
        groups.setdefault(_group(protocol, draft), []).append(key)
    stimuli: dict[Film, Stimulus] = {}
    try:
        for group, keys in groups.items():
            moving, size = [drafts[key].positions for key in keys], (settings.width, settings.height)
            following: dict[str, Any] = {"track_seconds": settings.track_s, "fps": protocol.fps}
            clearest = settings.view == "clearest"
            view = best_view(moving, size=size, heading=0.0, **following) if clearest else settings.view
            camera = frame_group(moving, size=size, view=view, heading=0.0, **following)
            for key in keys:
                stimuli[key] = _stimulus(protocol, library, drafts[key], group, camera)
    except RendererError as error:
        raise StimulusError(str(error)) from error
    return {key: stimuli[key] for key in drafts}


def _group(protocol: Protocol, draft: _Draft) -> str:
    kind = protocol.stimuli.camera_group
    if kind == "study":
        return protocol.name
    return draft.settled.transition.category if kind == "category" else draft.settled.transition.name


def _stimulus(protocol: Protocol, library: Library, draft: _Draft, group: str, camera: Camera) -> Stimulus:
    figure = _figure(protocol, draft.clip)
    settled = draft.settled
    record = StimulusRecord(
        id=_content_hash(protocol.fps, draft.positions, figure, camera),
        transition=settled.transition.name,
        category=settled.transition.category,
        method=draft.method,
        optimal_frames=settled.lengths[draft.method].blend_frames,
        difference_frames=draft.difference_frames,
        blend_frames=draft.blend_frames,
        frames=len(draft.positions),
        blend_start=draft.blend[0],
        blend_stop=draft.blend[1],
        source=_use(settled.source, settled.start_frame),
        destination=_use(settled.destination, settled.end_frame),
        group=group,
        synthetic=library.synthetic,
        notes=draft.notes,
    )
    return Stimulus(record, draft.positions, figure, camera)


def _use(supply: Supply, frame: int) -> MotionUse:
    return MotionUse(
        motion=supply.name,
        file=supply.file,
        frame=frame - supply.first,
        frames=supply.stop - supply.first,
        added_before=supply.added_before,
        added_after=supply.added_after,
        notes=(*supply.clip.history, *(note for note in supply.notes if note not in supply.clip.history)),
    )


def _figure(protocol: Protocol, clip: Clip) -> Figure:
    style, colours = protocol.stimuli.style, protocol.stimuli.colours
    own = {side: _rgb(text) for side in ("left", "right", "centre") if (text := getattr(colours, side))}
    background = _rgb(colours.background) if colours.background else None
    return figure_for(clip.skeleton, style, own, background, floor_m=0.0 if protocol.stimuli.floor else None)


def _rgb(text: str) -> tuple[int, int, int]:
    red, green, blue = bytes.fromhex(text.removeprefix("#"))
    return red, green, blue


def _content_hash(fps: float, positions: FloatArray, figure: Figure, camera: Camera) -> str:
    """Hash of all that is seen: points, figure, camera, size, frame rate and the renderer's look; 16 digits."""
    digest = hashlib.sha256(f"look {LOOK_VERSION}; {fps:g} fps; {camera.size}; {figure.style}; ".encode())
    digest.update(f"{figure.background}; {figure.lit}; {figure.floor_m}; {camera.track_seconds}; ".encode())
    digest.update(np.round(positions * 1e4).astype("<i4").tobytes())
    for array in (figure.ends, figure.along, figure.beyond, figure.radii, figure.colours):
        digest.update(np.round(np.asarray(array, dtype=np.float64) * 1e6).astype("<i8").tobytes())
    for array in (camera.eye, camera.axes, np.array([camera.focal_pixels])):
        digest.update(np.round(array * 1e5).astype("<i8").tobytes())
    return digest.hexdigest()[:16]


def _pair(study: StudySpec, showing: Showing, stimuli: dict[Film, Stimulus]) -> Pair:
    transition = showing.settled.transition
    name = f"{study.name}/{transition.name}"
    a, b = stimuli[showing.a].id, "" if showing.b is None else stimuli[showing.b].id
    if a == b and showing.method_a != showing.method_b:
        raise StimulusError(
            f"transition {transition.name!r}: expected two films by the methods {showing.method_a!r} and "
            f"{showing.method_b!r} of the study {study.name!r}, found that they look the same; choose other motions, "
            "other points, or another method."
        )
    if study.task == "same-different":
        name += f"/{showing.difference_frames:+d}"
    elif not study.paired:
        name += f"/{showing.method_a}"
    return Pair(
        name=name,
        study=study.name,
        task=study.task,
        motion=transition.name,
        category=transition.category,
        a=a,
        b=b,
        method_a=showing.method_a,
        method_b=showing.method_b if study.paired else "",
        difference_frames=showing.difference_frames,
    )
