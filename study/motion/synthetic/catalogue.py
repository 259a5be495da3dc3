"""The names of the synthetic motions, what each is, and the one function that makes them.

A motion is made for the seconds asked for: what leads up to its event (a start, a stop, a turn) and what follows
both grow with the length, and `event_s` places the event.
"""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from study.errors import MotionError
from study.motion.clip import Clip
from study.motion.synthetic import boxing, courses, dancing, modern_dance, standing, tai_chi
from study.motion.synthetic.targets import Targets, pose

Generator = Callable[..., Targets]
_LONGEST_S = 3600.0


@dataclass(frozen=True)
class Description:
    """What a synthetic motion is."""

    name: str
    kind: str
    """Its name and its category (`walking`, `running`, `standing`, `turning`, `idle`, `boxing`, `dancing`, `tai-chi`).
    """
    cyclic_start: bool
    cyclic_end: bool
    """Whether it starts, or ends, in steady walking or running, so that whole gait cycles could be added there."""
    seconds: float
    """Its length where none is asked for."""
    line: str
    """What is to be seen, in a line."""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """Further parameters than length, frame rate and seed, with their defaults."""


@dataclass(frozen=True)
class _Entry:
    generator: Generator
    kind: str
    cyclic: tuple[bool, bool]
    seconds: float
    line: str
    preset: Mapping[str, Any] = field(default_factory=dict)


def _steady(kind: str, speed: float, line: str) -> _Entry:
    return _Entry(courses.steady, kind, (True, True), 10.0, line, {"speed": speed})


def _turn(kind: str, speed: float, angle: float) -> _Entry:
    side = "left" if angle > 0 else "right"
    line = f"{kind} straight on, a turn of {abs(angle):g} degrees to the {side}, straight on"
    return _Entry(courses.turn, "turning", (True, True), 12.0, line, {"speed": speed, "angle": angle})


_ENTRIES: dict[str, _Entry] = {
    "walk_slow": _steady("walking", 0.8, "walking slowly, 0.8 m/s"),
    "walk": _steady("walking", 1.3, "walking at ease, 1.3 m/s"),
    "walk_fast": _steady("walking", 1.8, "walking fast, 1.8 m/s"),
    "jog": _steady("running", 2.4, "jogging, 2.4 m/s"),
    "run": _steady("running", 3.3, "running, 3.3 m/s"),
    "run_fast": _steady("running", 4.5, "running fast, 4.5 m/s"),
    "stand": _Entry(standing.stand, "standing", (False, False), 10.0, "standing at ease, hardly moving"),
    "idle": _Entry(standing.idle, "idle", (False, False), 15.0, "waiting: shifts of weight, glances, small steps"),
    "stand_to_walk": _Entry(
        courses.start, "standing", (False, True), 12.0, "standing, then walking at 1.3 m/s", {"speed": 1.3}
    ),
    "stand_to_run": _Entry(
        courses.start, "standing", (False, True), 12.0, "standing, then running at 3.3 m/s", {"speed": 3.3}
    ),
    "walk_to_stop": _Entry(
        courses.stop, "walking", (True, False), 12.0, "walking at 1.3 m/s, then standing", {"speed": 1.3}
    ),
    "run_to_stop": _Entry(
        courses.stop, "running", (True, False), 12.0, "running at 3.3 m/s, then standing", {"speed": 3.3}
    ),
    "walk_turn_left": _turn("walking", 1.25, 90.0),
    "walk_turn_right": _turn("walking", 1.25, -90.0),
    "run_turn_left": _turn("running", 3.0, 90.0),
    "run_turn_right": _turn("running", 3.0, -90.0),
    "box": _Entry(boxing.box, "boxing", (False, False), 24.0, "boxing: guard, steps, single punches"),
    "box_combination": _Entry(
        boxing.box_combination, "boxing", (False, False), 24.0, "boxing: combinations of three to five punches"
    ),
    "dance": _Entry(dancing.dance, "dancing", (False, False), 24.0, "dancing to a beat: steps, sways, twists, points"),
    "dance_modern": _Entry(
        modern_dance.dance_modern, "dancing", (False, False), 24.0, "modern dance: lunges, contractions, lifted knees"
    ),
    "dance_turns": _Entry(
        dancing.dance_turns, "dancing", (False, False), 24.0, "dancing with whole turns in three steps"
    ),
    "tai_chi": _Entry(
        tai_chi.tai_chi, "tai-chi", (False, False), 30.0, "a slow form: parting, brushing, pushing, clouds"
    ),
    "tai_chi_slow": _Entry(tai_chi.tai_chi_slow, "tai-chi", (False, False), 30.0, "a slower form: clouds and pushes"),
}

NAMES: tuple[str, ...] = tuple(_ENTRIES)


def describe(name: str) -> Description:
    """What a motion is; `MotionError` with the nearest known name where there is none."""
    entry = _entry(name)
    return Description(name, entry.kind, *entry.cyclic, entry.seconds, entry.line, MappingProxyType(_parameters(entry)))


def synthesize(name: str, *, seconds: float | None = None, fps: float = 30.0, seed: int = 0, **parameters: Any) -> Clip:
    """A synthetic motion.

    Parameters
    ----------
    name
        One of `NAMES`.
    seconds
        Length; `describe(name).seconds` where none is given. The clip has `round(seconds * fps)` frames.
    fps
        Frames per second. The motion does not depend on it: every second frame at 60 is a frame at 30.
    seed
        Draws the person's habits and every small variation.
    **parameters
        What `describe(name).parameters` lists: `speed` (m/s), `angle` (degrees, to the left), `event_s` (when a start,
        stop or turn happens, seconds), and so on.

    Raises
    ------
    MotionError
        For an unknown name or parameter, and for values out of range.
    """
    entry = _entry(name)
    seconds = entry.seconds if seconds is None else float(seconds)
    if not (np.isfinite(seconds) and 0.0 < seconds <= _LONGEST_S):
        raise MotionError(f"Expected above 0 and up to {_LONGEST_S:g} seconds of {name}, got {seconds:g}.")
    if not (np.isfinite(fps) and fps > 0):
        raise MotionError(f"Expected a frame rate above 0 for {name}, got {fps}.")
    known = _parameters(entry)
    for key in parameters:
        if key not in known:
            hint = _nearest(key, tuple(known))
            raise MotionError(f"{name} has no parameter {key!r}{hint}; it has {', '.join(known) or 'none'}.")
    settings = {**known, **parameters}
    rng = np.random.default_rng(seed)
    targets = entry.generator(seconds, rng, **settings)
    said = "".join(f", {key} {value:g}" for key, value in settings.items() if isinstance(value, (int, float)))
    history = (f"synthesized {name} for {seconds:g} s{said}, seed {seed}",)
    return pose(targets, seconds=seconds, fps=float(fps), name=name, history=history)


def _parameters(entry: _Entry) -> dict[str, Any]:
    """Keyword-only parameters of the generator with their defaults, as this entry presets them."""
    signature = inspect.signature(entry.generator).parameters.values()
    return {p.name: entry.preset.get(p.name, p.default) for p in signature if p.kind is p.KEYWORD_ONLY}


def _entry(name: str) -> _Entry:
    if name not in _ENTRIES:
        hint = _nearest(name, NAMES)
        raise MotionError(f"There is no synthetic motion {name!r}{hint}. There are {', '.join(NAMES)}.")
    return _ENTRIES[name]


def _nearest(word: str, known: tuple[str, ...]) -> str:
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    return f" (did you mean {close[0]!r}?)" if close else ""
