"""Clips, transitions between two of them, what these cost, and how they look."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from segue.views import View, drawn
from study.arrays import AnyFloat
from study.errors import TransitionError
from study.motion.clip import Clip, retarget

if TYPE_CHECKING:
    from study.transitions.blend_length import BlendLength
    from study.transitions.methods.method import Made, Method
    from study.transitions.one_hop.play import Played
    from study.transitions.timewarp import WarpLength


def motions(library: str | Path = "synthetic") -> list[str]:
    """The names of the motions of a library: `synthetic`, or a folder of motion files."""
    from study.motion.library import open_library

    return list(open_library(library).names())


def read(name: str | Path, library: str | Path | None = None, *, fps: float | None = None, as_is: bool = False) -> Clip:
    """Read a clip.

    Parameters
    ----------
    name
        A motion file (.bvh, .asf/.amc, .glb, .gltf), or the name of a motion of the library.
    library
        A folder of motion files; the synthetic library unless given.
    fps
        Frames per second to work at; the file's own unless given (for synthetic motions 30).
    as_is
        Keep defects, such as an added T-pose, and the clip's own place on the floor.

    Raises
    ------
    SegueError
        For what can't be read; it says where and what to do.
    """
    from study.motion.entries import entry_of_file, motion_file
    from study.motion.library import open_library

    opened = open_library(library or "synthetic")
    own = library is None and motion_file(str(name)) is not None
    return opened.clip(entry_of_file(str(name)) if own else opened.find(str(name)), fps=fps, as_is=as_is)


def write(clip: Clip | Made, path: str | Path, *, metres_per_unit: float | None = None) -> Path:
    """Write a clip, or the clip of a transition, as BVH."""
    from study.motion.readers.bvh_writing import write_bvh

    write_bvh(_clip(clip), Path(path), metres_per_unit=metres_per_unit)
    return Path(path)


def blend_length(
    source: Clip, destination: Clip, *, start: int, end: int, method: str = "geodesic"
) -> BlendLength | WarpLength:
    """How long to blend from frame `start` of the source to frame `end` of the destination.

    The result has `blend_frames`, `blend_s`, `cost`, and of searches the `costs` of all lengths.
    """
    method_ = _method(method, {})
    return method_.length_at(source, retarget(destination, source.skeleton), start, end)


def blend(
    source: Clip,
    destination: Clip,
    *,
    start: int,
    end: int,
    method: str = "geodesic",
    frames: int | None = None,
    **settings: Any,
) -> Made:
    """A transition from frame `start` of the source to frame `end` of the destination, by a method that joins two.

    Parameters
    ----------
    method
        A name of `docs/transitions.md`, such as `geodesic`, `velocity`, `fixed`, `timewarp`, `cut`, `inertialize`.
    frames
        The blend length, in place of the method's own.
    settings
        Settings of the method, such as `fixed_frames`, `weight`, `clean_feet` or `halflife_s`.

    Returns
    -------
    Made
        `clip`, and `blend_start` and `blend_stop`, which bound the blend as a slice counts frames.
    """
    from study.transitions.methods.method import Place

    chosen = _method(method, settings)
    place = Place("", (source.name, destination.name), source, retarget(destination, source.skeleton), start, end)
    if frames is not None:
        windows = (frames, frames)
    elif chosen.length.windows == 0:
        windows = (0, 0)
    else:
        windows = chosen.length_at(place.source, place.destination, start, end).windows
    first, last = chosen.make.placed(start, end, windows[0])
    return chosen.make.way(replace(place, start_frame=first, end_frame=last), windows).made(place)


def costs(source: Clip, destination: Clip, *, weights: str = "wang2003", nu: float = 1.0) -> AnyFloat:
    """The cost of a cut from each frame of the source to each of the destination (Wang & Bodenheimer 2003, Eq. 2).

    Returns
    -------
    (source frames, destination frames)
        Squared half angles, and squared velocities `nu` times.
    """
    from study.transitions.cost_matrix import cost_matrix

    return cost_matrix(source, retarget(destination, source.skeleton), weights=weights, nu=nu)


def strip(shown: Clip | Made | Played, *, poses: int = 13, **look: Any) -> View:
    """Poses of a clip side by side; of a transition those around the blend, in the colours of its parts."""
    return _drawn(".png", shown, {"poses": poses, **look})


def film(shown: Clip | Made | Played, *, size: tuple[int, int] = (640, 360), **look: Any) -> View:
    """A film of a clip; of a transition two seconds on either side of the blend. `size` is in pixels."""
    return _drawn(".mp4", shown, {"size": size, **look})


def _drawn(suffix: str, shown: Clip | Made | Played, look: dict[str, Any]) -> View:
    from study.motion.drawing import draw_clip
    from study.transitions.one_hop.play import Played
    from study.transitions.one_hop.strip import draw_played

    clip = _clip(shown)
    words = f"{clip.name or 'a motion'}, {clip.frames} frames at {clip.fps:g} frames per second"
    if isinstance(shown, Played) and suffix == ".png":
        return drawn(suffix, words, lambda path: draw_played(shown, path, **look))
    blended = None if isinstance(shown, Clip | Played) else (shown.blend_start, shown.blend_stop)
    return drawn(suffix, words, lambda path: draw_clip(clip, path, blended=blended, **look))


def _clip(shown: Clip | Made | Played) -> Clip:
    return shown if isinstance(shown, Clip) else shown.clip


def _method(name: str, settings: dict[str, Any]) -> Method:
    from study.transitions.methods.registry import METHODS

    two = {known: method for known, method in METHODS.items() if known != "one-hop" and not known.startswith("cut-")}
    if name not in two:
        raise TransitionError(f"Expected a method that joins two clips, {', '.join(two)}, found {name!r}; choose one.")
    parts = (two[name].points, two[name].length, two[name].make)
    known = {setting for part in parts for setting in part.setting_names()}
    if unknown := sorted(set(settings) - known):
        raise TransitionError(
            f"Expected settings of {name} ({', '.join(sorted(known))}), found {', '.join(unknown)}; remove them."
        )
    return two[name].with_settings(settings)
