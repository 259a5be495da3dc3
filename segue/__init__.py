"""Segue in Python: the functions behind the command line, by short names, for scripts and notebooks.

    import segue

    walk, run = segue.read("walk.bvh"), segue.read("run.bvh")
    segue.strip(segue.blend(walk, run, start=60, end=80, method="geodesic"))

Nothing is imported before it is used. Frames are counted at each clip's own rate, `clip.fps`.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from segue.clips import blend, blend_length, costs, film, motions, read, strip, write
    from segue.fits import fit
    from segue.hops import one_hop, play
    from segue.studies import Results, Study, analyse
    from segue.views import View
    from study import __version__
    from study.errors import SegueError
    from study.motion.clip import Clip, trim

__all__ = [
    "Clip", "Results", "SegueError", "Study", "View", "__version__", "analyse", "blend", "blend_length", "costs",
    "film", "fit", "motions", "one_hop", "play", "read", "strip", "trim", "write",
]  # fmt: skip

_FROM = {
    "segue.clips": ("blend", "blend_length", "costs", "film", "motions", "read", "strip", "write"),
    "segue.fits": ("fit",),
    "segue.hops": ("one_hop", "play"),
    "segue.studies": ("Results", "Study", "analyse"),
    "segue.views": ("View",),
    "study": ("__version__",),
    "study.errors": ("SegueError",),
    "study.motion.clip": ("Clip", "trim"),
}


def __getattr__(name: str) -> Any:
    """A public name, imported now."""
    for module, names in _FROM.items():
        if name in names:
            return getattr(importlib.import_module(module), name)
    raise AttributeError(f"segue has {', '.join(__all__)}; found {name!r}")


def __dir__() -> list[str]:
    return __all__
