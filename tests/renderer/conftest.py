"""A puppet to draw, a context to draw it with, and the comparison of pictures by their foreground."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from parts import unavailable

EXPECTED = Path(__file__).parent / "expected"


@dataclass(frozen=True)
class Puppet:
    """A body of 22 points: bones, sides, parts, and a walk along +Z."""

    bones: np.ndarray
    sides: tuple[str, ...]
    parts: dict[str, int]
    walk: Callable[..., np.ndarray]


_CENTRE = ("pelvis", "spine", "chest", "neck", "head", "crown")
_LIMB = ("hip", "knee", "ankle", "toe", "shoulder", "elbow", "wrist", "tip")
_NAMES = _CENTRE + tuple(f"{name}.{side}" for side in "LR" for name in _LIMB)
_PARENT = {
    "spine": "pelvis",
    "chest": "spine",
    "neck": "chest",
    "head": "neck",
    "crown": "head",
    "hip": "pelvis",
    "knee": "hip",
    "ankle": "knee",
    "toe": "ankle",
    "shoulder": "chest",
    "elbow": "shoulder",
    "wrist": "elbow",
    "tip": "wrist",
}


def _walk(frames: int = 40, *, speed: float = 1.3, fps: float = 30.0, start: float = 0.0) -> np.ndarray:
    """Legs and arms that swing, `(frames, 22, 3)` metres, Y up, towards +Z; left is +X."""
    time = start + np.arange(frames) / fps
    phase = 2 * np.pi * time / 1.1
    points = np.zeros((frames, len(_NAMES), 3))
    at = {name: points[:, i] for i, name in enumerate(_NAMES)}
    at["pelvis"][:] = np.stack([0 * time, 0.93 + 0.02 * np.cos(2 * phase), speed * time], axis=1)
    for low, high, rise in (("pelvis", "spine", 0.12), ("spine", "chest", 0.28), ("chest", "neck", 0.12)):
        at[high][:] = at[low] + [0, rise, 0]
    at["head"][:] = at["neck"] + [0, 0.08, 0.01]
    at["crown"][:] = at["head"] + [0, 0.16, 0.01]
    for side, out in (("L", 1.0), ("R", -1.0)):
        swing = 0.45 * np.sin(phase) * out
        bend = 0.35 + 0.35 * np.cos(phase) * out
        at[f"hip.{side}"][:] = at["pelvis"] + [0.09 * out, -0.03, 0]
        at[f"knee.{side}"][:] = at[f"hip.{side}"] + 0.43 * _down(swing)
        at[f"ankle.{side}"][:] = at[f"knee.{side}"] + 0.41 * _down(swing - bend)
        at[f"toe.{side}"][:] = at[f"ankle.{side}"] + [0, -0.04, 0.15]
        at[f"shoulder.{side}"][:] = at["chest"] + [0.18 * out, 0.06, 0]
        at[f"elbow.{side}"][:] = at[f"shoulder.{side}"] + 0.28 * _down(-swing)
        at[f"wrist.{side}"][:] = at[f"elbow.{side}"] + 0.25 * _down(-swing + 0.4)
        at[f"tip.{side}"][:] = at[f"wrist.{side}"] + 0.16 * _down(-swing + 0.4)
    return points


def _down(angle: np.ndarray) -> np.ndarray:
    return np.stack([0 * angle, -np.cos(angle), np.sin(angle)], axis=1)


@pytest.fixture(scope="session")
def puppet() -> Puppet:
    index = {name: i for i, name in enumerate(_NAMES)}
    bones = []
    for name in _NAMES[1:]:
        base, _, side = name.partition(".")
        parent = _PARENT[base]
        bones.append((index[parent if parent in _CENTRE else f"{parent}.{side}"], index[name]))
    sides = tuple({"L": "left", "R": "right"}.get(name.partition(".")[2], "centre") for name in _NAMES)
    parts = {name: i for name, i in index.items() if name != "crown" and not name.startswith("tip")}
    return Puppet(np.array(bones), sides, parts, _walk)


@pytest.fixture(scope="session")
def context() -> Any:
    """The process's own GL context; without one the test fails where all is required, and is skipped elsewhere."""
    from renderer.context import shared_context
    from renderer.errors import RendererError

    try:
        return shared_context()
    except RendererError as error:
        unavailable("a context to draw with", str(error))


@pytest.fixture
def same_picture(tmp_path: Path) -> Callable[[str, np.ndarray], None]:
    """Compare a small picture with the one in `expected/`, byte by byte; what differs is kept and named."""

    def check(name: str, picture: np.ndarray) -> None:
        kept = EXPECTED / f"{name}.txt"
        got = tmp_path / f"{name}.txt"
        np.savetxt(got, picture, fmt="%3d")
        if not kept.exists():
            pytest.fail(f"The expected picture {kept} is missing; look at {got}, and copy it there if it is right.")
        wanted = np.loadtxt(kept, dtype=np.int64, ndmin=2)
        assert wanted.shape == picture.shape
        wrong = np.argwhere(wanted != picture)
        assert len(wrong) == 0, f"{len(wrong)} pixels differ, the first at {wrong[0]}; what was drawn is in {got}"

    return check


def foreground_share(one: np.ndarray, other: np.ndarray, background: np.ndarray, tolerance: int = 12) -> float:
    """The share of the pixels that are foreground in either picture in which they differ.

    Of the whole picture a leg is one pixel in a hundred; of the figure it is one in five.
    """
    is_one = (np.abs(one.astype(int) - background) > tolerance).any(axis=-1)
    is_other = (np.abs(other.astype(int) - background) > tolerance).any(axis=-1)
    differs = (np.abs(one.astype(int) - other) > tolerance).any(axis=-1)
    either = is_one | is_other
    return float((differs & either).sum() / max(1, either.sum()))


@pytest.fixture(scope="session")
def compare_foreground() -> Callable[..., float]:
    return foreground_share
