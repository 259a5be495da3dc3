"""The look of stimuli: figures, one camera a group, and the hash of all that is seen, which is a stimulus's name.

Drafts come in; `Stimulus` objects go out. One fixed camera serves a group (2004 section 4.1: groups of motions were
shown from the same position). Transitions start over the same point with the same heading, so that it sees all of them
from the same side, as close as possible.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from study.errors import StimulusError
from study.experiment.protocol.whole import Protocol
from study.experiment.stimuli.drafts import Draft
from study.experiment.stimuli.films import Film
from study.experiment.stimuli.stimulus import MotionUse, Stimulus, StimulusRecord
from study.experiment.stimuli.supply import Supply
from study.motion.clip import Clip
from study.motion.drawing import figure_for

if TYPE_CHECKING:
    from renderer.camera import Camera
    from renderer.figure import Figure
    from study.motion.library import Library

FloatArray = NDArray[np.float64]

LOOK_VERSION = 1
"""Part of every stimulus's name: raised when the renderer comes to draw the same figure otherwise."""


def with_cameras(protocol: Protocol, library: Library, drafts: Mapping[Film, Draft]) -> dict[Film, Stimulus]:
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


def _group(protocol: Protocol, draft: Draft) -> str:
    kind = protocol.stimuli.camera_group
    if kind == "study":
        return protocol.name
    return draft.settled.transition.category if kind == "category" else draft.settled.transition.name


def _stimulus(protocol: Protocol, library: Library, draft: Draft, group: str, camera: Camera) -> Stimulus:
    figure = _figure(protocol, draft.clip)
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
