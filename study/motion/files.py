"""Any motion file to a clip, by its suffix, with Y up."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from study.errors import MotionError, MotionFileError
from study.motion.acclaim import CMU_FPS, read_amc
from study.motion.bvh import read_bvh
from study.motion.clip import Clip
from study.motion.upright import put_upright

SUFFIXES = (".bvh", ".amc")


def read_clip(
    path: Path | str,
    *,
    metres_per_unit: float | None = None,
    fps: float | None = None,
    mapping: Mapping[str, str] | None = None,
) -> Clip:
    """Read a motion file; where another axis than Y is up, the clip is put upright and its history says so.

    Parameters
    ----------
    path
        A `.bvh` file, or an `.amc` file with its `.asf` beside it.
    metres_per_unit
        Metres in a unit of the file; by default found from the body, and said in the clip's history.
    fps
        Frames per second in place of what the file says (AMC files don't say; 120 is assumed).
    mapping
        Joint names by role, where they are known; `study.motion.skeleton.find_roles` finds the others.

    Raises
    ------
    MotionFileError
        For another suffix, or a file that can't be read.
    """
    path = Path(path)
    for label, value in (("metres_per_unit", metres_per_unit), ("fps", fps)):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise MotionError(f"Expected {label} above 0 for {path}, got {value}.")
    suffix = path.suffix.lower()
    if suffix == ".amc":
        rate = CMU_FPS if fps is None else fps
        return put_upright(read_amc(path, metres_per_unit=metres_per_unit, fps=rate, mapping=mapping))
    if suffix == ".bvh":
        return put_upright(read_bvh(path, metres_per_unit=metres_per_unit, fps=fps, mapping=mapping))
    hint = "; name the .amc file, and its .asf is found beside it" if suffix == ".asf" else ""
    raise MotionFileError(f"Expected a motion file ({', '.join(SUFFIXES)}), found {suffix or 'no suffix'}{hint}.", path)
