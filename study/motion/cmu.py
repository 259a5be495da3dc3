"""The index of CMU trials: which trial of the CMU Graphics Lab database shows which motion.

In: `cmu_index.toml`, beside this module (our annotation, not their data). Out: `IndexedMotion` by name.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from types import MappingProxyType
from typing import Literal

CMU_ACKNOWLEDGEMENT = (
    "The data used in this project was obtained from mocap.cs.cmu.edu. "
    "The database was created with funding from NSF EIA-0196217."
)
CMU_SITE = "http://mocap.cs.cmu.edu"

_TRIAL = re.compile(r"(\d{2,3})_(\d{2,3})")

Boundary = Literal["gait", "still", ""]


@dataclass(frozen=True)
class Take:
    """One trial that shows a motion."""

    trial: str
    """Subject and number, as in `16_35`."""
    first: int = 0
    last: int | None = None
    """Usable frames, both included, from 0 at the trial's own rate; `last` is None for the trial's last."""
    start: Boundary = ""
    end: Boundary = ""
    """How the take begins and ends: `"gait"`, `"still"`, or `""` where it can't be continued."""
    mirrored: bool = False
    """Whether it shows the motion to the other side."""

    @property
    def files(self) -> tuple[str, str]:
        """Where the official site keeps the motion and its skeleton, below its root."""
        return trial_files(self.trial)


@dataclass(frozen=True)
class IndexedMotion:
    """A motion of the index: its name, kind, a few words, and the takes that show it, best first."""

    name: str
    kind: str
    words: str
    takes: tuple[Take, ...]


def is_trial(text: str) -> bool:
    """Whether a text has the form of a trial, as `16_35`."""
    return _TRIAL.fullmatch(text) is not None


def trial_files(trial: str) -> tuple[str, str]:
    """Paths of a trial's motion and skeleton in the official layout: `subjects/16/16_35.amc`, `subjects/16/16.asf`."""
    subject = trial.split("_")[0]
    return f"subjects/{subject}/{trial}.amc", f"subjects/{subject}/{subject}.asf"


@cache
def cmu_index() -> Mapping[str, IndexedMotion]:
    """The motions of the index by name, in its order."""
    text = resources.files("study.motion").joinpath("cmu_index.toml").read_text(encoding="utf-8")
    motions = tomllib.loads(text)["motions"]
    index = {
        name: IndexedMotion(name, motion["kind"], motion["words"], tuple(Take(**take) for take in motion["takes"]))
        for name, motion in motions.items()
    }
    return MappingProxyType(index)
