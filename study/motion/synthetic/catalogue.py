"""The names of the synthetic motions, what each is, and the one function that makes them.

A motion is made for the seconds asked for: what leads up to its event (a start, a stop, a turn) and what follows
both grow with the length, and `event_s` places the event.
"""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from study.errors import MotionError
from study.motion.clip import Clip
from study.motion.synthetic import boxing, courses, dancing, modern_dance, standing, tai_chi
from study.motion.synthetic.targets import Targets, pose

_LONGEST_S = 3600.0


@dataclass(frozen=True)
class Description:
    """What a synthetic motion is."""

    kind: str
    """Its category: walking, running, standing, turning, idle, boxing, dancing, tai-chi."""
    line: str
    """What is to be seen, in a line."""
    generator: Callable[..., Targets]
    seconds: float
    """Its length where none is asked for."""
    cyclic: tuple[bool, bool] = (False, False)
    """Whether it starts, and ends, in steady walking or running, so that whole gait cycles could be added there."""
    preset: Mapping[str, Any] = field(default_factory=dict)
    """Parameters of the generator that make this motion of it."""

    @property
    def parameters(self) -> dict[str, Any]:
        """Further parameters than length, frame rate and seed, with their defaults."""
        keys = inspect.signature(self.generator).parameters.values()
        return {key.name: self.preset.get(key.name, key.default) for key in keys if key.kind is key.KEYWORD_ONLY}


def _steady(kind: str, speed: float, line: str) -> Description:
    return Description(kind, line, courses.steady, 10.0, (True, True), {"speed": speed})


def _turn(kind: str, speed: float, angle: float) -> Description:
    side = "left" if angle > 0 else "right"
    line = f"{kind} straight on, a turn of {abs(angle):g} degrees to the {side}, straight on"
    return Description("turning", line, courses.turn, 12.0, (True, True), {"speed": speed, "angle": angle})


_MOTIONS: dict[str, Description] = {
    "walk_slow": _steady("walking", 0.8, "walking slowly, 0.8 m/s"),
    "walk": _steady("walking", 1.3, "walking at ease, 1.3 m/s"),
    "walk_fast": _steady("walking", 1.8, "walking fast, 1.8 m/s"),
    "jog": _steady("running", 2.4, "jogging, 2.4 m/s"),
    "run": _steady("running", 3.3, "running, 3.3 m/s"),
    "run_fast": _steady("running", 4.5, "running fast, 4.5 m/s"),
    "stand": Description("standing", "standing at ease, hardly moving", standing.stand, 10.0),
    "idle": Description("idle", "waiting: shifts of weight, glances, small steps", standing.idle, 15.0),
    "stand_to_walk": Description(
        "standing", "standing, then walking at 1.3 m/s", courses.start, 12.0, (False, True), {"speed": 1.3}
    ),
    "stand_to_run": Description(
        "standing", "standing, then running at 3.3 m/s", courses.start, 12.0, (False, True), {"speed": 3.3}
    ),
    "walk_to_stop": Description(
        "walking", "walking at 1.3 m/s, then standing", courses.stop, 12.0, (True, False), {"speed": 1.3}
    ),
    "run_to_stop": Description(
        "running", "running at 3.3 m/s, then standing", courses.stop, 12.0, (True, False), {"speed": 3.3}
    ),
    "walk_turn_left": _turn("walking", 1.25, 90.0),
    "walk_turn_right": _turn("walking", 1.25, -90.0),
    "run_turn_left": _turn("running", 3.0, 90.0),
    "run_turn_right": _turn("running", 3.0, -90.0),
    "box": Description("boxing", "boxing: guard, steps, single punches", boxing.box, 24.0),
    "box_combination": Description(
        "boxing", "boxing: combinations of three to five punches", boxing.box_combination, 24.0
    ),
    "dance": Description("dancing", "dancing to a beat: steps, sways, twists, points", dancing.dance, 24.0),
    "dance_modern": Description(
        "dancing", "modern dance: lunges, contractions, lifted knees", modern_dance.dance_modern, 24.0
    ),
    "dance_turns": Description("dancing", "dancing with whole turns in three steps", dancing.dance_turns, 24.0),
    "tai_chi": Description("tai-chi", "a slow form: parting, brushing, pushing, clouds", tai_chi.tai_chi, 30.0),
    "tai_chi_slow": Description("tai-chi", "a slower form: clouds and pushes", tai_chi.tai_chi_slow, 30.0),
}

NAMES: tuple[str, ...] = tuple(_MOTIONS)


def describe(name: str) -> Description:
    """What a motion is; `MotionError` with the nearest known name where there is none."""
    if name not in _MOTIONS:
        hint = _nearest(name, NAMES)
        raise MotionError(f"There is no synthetic motion {name!r}{hint}. There are {', '.join(NAMES)}.")
    return _MOTIONS[name]


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
    motion = describe(name)
    seconds = motion.seconds if seconds is None else float(seconds)
    if not (np.isfinite(seconds) and 0.0 < seconds <= _LONGEST_S):
        raise MotionError(f"Expected above 0 and up to {_LONGEST_S:g} seconds of {name}, got {seconds:g}.")
    if not (np.isfinite(fps) and fps > 0):
        raise MotionError(f"Expected a frame rate above 0 for {name}, got {fps}.")
    known = motion.parameters
    for key in parameters:
        if key not in known:
            hint = _nearest(key, tuple(known))
            raise MotionError(f"{name} has no parameter {key!r}{hint}; it has {', '.join(known) or 'none'}.")
    settings = {**known, **parameters}
    rng = np.random.default_rng(seed)
    targets = motion.generator(seconds, rng, **settings)
    said = "".join(f", {key} {value:g}" for key, value in settings.items() if isinstance(value, (int, float)))
    history = (f"synthesized {name} for {seconds:g} s{said}, seed {seed}",)
    return pose(targets, seconds=seconds, fps=float(fps), name=name, history=history)


def _nearest(word: str, known: tuple[str, ...]) -> str:
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    return f" (did you mean {close[0]!r}?)" if close else ""
