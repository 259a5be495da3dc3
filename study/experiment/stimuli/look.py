"""The look of stimuli: figures, one camera a group, and the hash of all that is seen, which is a stimulus's name.

Drafts come in; `Stimulus` objects go out. One camera serves a group (2004 section 4.1: groups of motions were shown
from the same position): what one trial compares is always seen by the same one. Transitions start over the same point
with the same heading, so that it sees all of them from the same side.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from study.errors import StimulusError
from study.experiment.protocol.whole import Protocol
from study.experiment.stimuli.audit import first_and_last
from study.experiment.stimuli.drafts import Draft
from study.experiment.stimuli.films import Film, Planned
from study.experiment.stimuli.shortcuts import largest_cue
from study.experiment.stimuli.stimulus import MotionUse, Stimulus, StimulusRecord
from study.experiment.stimuli.supply import Supply
from study.motion.clip import Clip
from study.motion.drawing import figure_for

if TYPE_CHECKING:
    from renderer.camera import Camera
    from renderer.figure import Figure
    from study.motion.library import Library

FloatArray = NDArray[np.float64]

LOOK_VERSION = 2
"""Part of every stimulus's name: raised when the renderer comes to draw the same figure otherwise."""


def with_cameras(
    protocol: Protocol, library: Library, planned: Sequence[Planned], drafts: Mapping[Film, Draft]
) -> dict[Film, Stimulus]:
    """Figures, one camera a group, and names."""
    from renderer.errors import RendererError
    from renderer.framing import frame_group
    from renderer.viewpoint import best_view

    settings = protocol.stimuli
    framing: dict[str, Any] = {
        "camera": settings.camera,
        "size": (settings.width, settings.height),
        "track_seconds": settings.smoothing_s,
        "fps": protocol.fps,
        "heading": 0.0,
    }
    stimuli: dict[Film, Stimulus] = {}
    try:
        for group, films in camera_groups(protocol, planned).items():
            moving, view = [drafts[film].positions for film in films], settings.view
            figures = [_figure(protocol, drafts[film].clip) for film in films]
            seen_from: str | float = view
            if view in ("clearest", "least-cue"):
                score = _evenness(protocol, planned, films, figures, drafts) if view == "least-cue" else None
                seen_from = best_view(moving, score=score, **framing)
            camera = frame_group(moving, figures=figures, view=seen_from, **framing)
            for film, figure in zip(films, figures, strict=True):
                stimuli[film] = _stimulus(protocol, library, drafts[film], group, figure, camera)
    except RendererError as error:
        raise StimulusError(str(error)) from error
    return {film: stimuli[film] for film in drafts}


def _evenness(
    protocol: Protocol,
    planned: Sequence[Planned],
    films: Sequence[Film],
    figures: Sequence[Figure],
    drafts: Mapping[Film, Draft],
) -> Callable[[Camera], float]:
    """How little a camera shows of what gives pairs of a group away; the higher, the less."""
    ends = {film: first_and_last(drafts[film].positions, figure) for film, figure in zip(films, figures, strict=True)}
    shown = (showing.films for each in planned for showing in each.showings)
    pairs = [pair for pair in shown if all(film in ends for film in pair)]
    return lambda camera: -largest_cue(pairs, ends, camera, protocol.fps)


def camera_groups(protocol: Protocol, planned: Sequence[Planned]) -> dict[str, list[Film]]:
    """Which films share a camera, by a name of their group.

    With `camera_group = "transition"` those of one transition in one study, and in others that show one of its films: a
    transition that two studies show at different points is seen by a camera for each.
    """
    kind = protocol.stimuli.camera_group
    groups: list[tuple[str, dict[Film, None]]] = []
    for each in planned:
        transition = each.settled.transition
        name = {"study": protocol.name, "category": transition.category, "transition": transition.name}[kind]
        films = dict.fromkeys(film for showing in each.showings for film in showing.films)
        same = [one for one in groups if one[0] == name and (kind != "transition" or one[1].keys() & films.keys())]
        merged = {film: None for _, own in same for film in own} | films
        groups = [one for one in groups if one not in same] + [(name, merged)]
    names: dict[str, int] = {}
    named = {}
    for name, own in groups:
        names[name] = names.get(name, 0) + 1
        named[name if names[name] == 1 else f"{name}-{names[name]}"] = list(own)
    return named


def _stimulus(
    protocol: Protocol, library: Library, draft: Draft, group: str, figure: Figure, camera: Camera
) -> Stimulus:
    settled = draft.settled
    record = StimulusRecord(
        id=_content_hash(protocol.fps, draft.positions, figure, camera),
        transition=settled.transition.name,
        category=settled.transition.category,
        method=draft.method,
        optimal_frames=draft.blend_frames - draft.difference_frames,
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
        flaws=draft.flaws,
        holds_feet=draft.holds_feet,
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
    figure = figure_for(clip.skeleton, style, own, background, floor_m=0.0 if protocol.stimuli.floor else None)
    frames = round(protocol.stimuli.ending_s * protocol.fps)
    return replace(figure, ending={"cut": (0, 0), "fade": (frames, 0), "cover": (0, frames)}[protocol.stimuli.ending])


def _rgb(text: str) -> tuple[int, int, int]:
    red, green, blue = bytes.fromhex(text.removeprefix("#"))
    return red, green, blue


def _content_hash(fps: float, positions: FloatArray, figure: Figure, camera: Camera) -> str:
    """Hash of all that is seen: points, figure, camera, size, frame rate and the renderer's look; 16 digits."""
    digest = hashlib.sha256(f"look {LOOK_VERSION}; {fps:g} fps; {camera.size}; {figure.style}; ".encode())
    floor = "" if figure.floor_m is None else f"{figure.floor_m}, fading"
    digest.update(f"{figure.background}; {figure.lit}; {floor}; {camera.track_seconds}; ".encode())
    digest.update(f"{figure.anchors}; {figure.part}; {figure.lift}; ".encode())
    if any(figure.ending):
        digest.update(f"ending {figure.ending}; ".encode())
    digest.update(np.round(positions * 1e4).astype("<i4").tobytes())
    for array in (figure.ends, figure.along, figure.beyond, figure.radii, figure.colours):
        digest.update(np.round(np.asarray(array, dtype=np.float64) * 1e6).astype("<i8").tobytes())
    turns = np.zeros(0) if camera.turns is None else camera.turns * 1e3
    for array in (camera.eye, camera.axes, np.array([camera.focal_pixels]), turns):
        digest.update(np.round(array * 1e5).astype("<i8").tobytes())
    return digest.hexdigest()[:16]
