"""The readers of motion files by suffix, and any motion file to a clip with Y up."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Protocol

from study.errors import MotionError, MotionFileError
from study.motion.clip import HIGHEST_FPS, LOWEST_FPS, Clip
from study.motion.readers.amc import read_amc
from study.motion.readers.bvh import read_bvh
from study.motion.readers.gltf import read_gltf
from study.motion.readers.gltf_file import buffers_of, file_of
from study.motion.readers.other_formats import by_suffix
from study.motion.upright import put_upright


class Reader(Protocol):
    """What `read_clip` asks of a reader; None stands for what the file says or the reader finds."""

    def __call__(
        self,
        path: Path,
        *,
        metres_per_unit: float | None,
        fps: float | None,
        mapping: Mapping[str, str] | None,
    ) -> Clip:
        """Read the file, whichever axis of it is up."""


READERS: dict[str, Reader] = {".bvh": read_bvh, ".amc": read_amc, ".glb": read_gltf, ".gltf": read_gltf}
SUFFIXES = tuple(READERS)


def with_their_parts(paths: Iterable[Path]) -> list[Path]:
    """Motion files, and those that are read with them: skeletons beside AMC files, the buffers of glTF files."""
    files = list(paths)
    folders = dict.fromkeys(path.parent for path in files if path.suffix.lower() == ".amc")
    skeletons = [one for folder in folders for one in sorted(folder.glob("*.[aA][sS][fF]"))]
    buffers = [one for path in files if path.suffix.lower() == ".gltf" for one in buffers_of(path)]
    return [*files, *skeletons, *buffers]


def read_clip(
    path: Path | str,
    *,
    metres_per_unit: float | None = None,
    fps: float | None = None,
    mapping: Mapping[str, str] | None = None,
) -> Clip:
    """Read a motion file; if another axis than Y is up, the clip is turned upright, and its history says so.

    Parameters
    ----------
    path
        A `.bvh` file, an `.amc` file with its `.asf` beside it, a `.glb` or `.gltf` file with one animation, or an
        animation in one with several, `hero.glb/walk`.
    metres_per_unit
        Metres in a unit of the file; by default found from the body, and said in the clip's history.
    fps
        Frames per second in place of what the file says (AMC files don't say; 120 is assumed); of a glTF file, whose
        keys have times, those at which it is sampled.
    mapping
        Joint names by role (`{"hip.L": "bone_12"}`), where the roles found are wrong or missing.

    Raises
    ------
    MotionFileError
        For another suffix, or a file that can't be read.
    """
    path = Path(path)
    for label, value, low, high in (
        ("metres_per_unit", metres_per_unit, 1e-9, 1e3),
        ("fps", fps, LOWEST_FPS, HIGHEST_FPS),
    ):
        if value is not None and not low <= value <= high:
            raise MotionError(f"Expected {label} above 0, from {low:.0e} to {high:.0e}, for {path}, got {value}.")
    suffix = file_of(path).suffix.lower()
    if suffix in READERS:
        return put_upright(READERS[suffix](path, metres_per_unit=metres_per_unit, fps=fps, mapping=mapping))
    hint = "; name the .amc file, and its .asf is found beside it" if suffix == ".asf" else ""
    found = by_suffix(path) or f"found {suffix or 'no suffix'}{hint}."
    raise MotionFileError(f"Expected a motion file ({', '.join(SUFFIXES)}), {found}", path)
