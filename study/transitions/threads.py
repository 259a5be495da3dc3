"""Work on all cores: threads of our own, each with one BLAS thread.

The search's arrays are small enough for a core's cache, so cores are best used by giving each its own piece. NumPy lets
other threads run during its loops; BLAS threads of its own would only get in their way.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

import numpy as np


@lru_cache(maxsize=1)
def _openblas() -> tuple[ctypes.CDLL, str, str] | None:
    """NumPy's own OpenBLAS with the names of its two functions; None where NumPy uses another BLAS."""
    package = Path(np.__file__).parent
    for folder in (package.parent / "numpy.libs", package / ".dylibs", package / ".libs"):
        for file in sorted(folder.glob("*openblas*")):
            try:
                library = ctypes.CDLL(str(file))
            except OSError:
                continue
            for prefix, suffix in (
                ("scipy_openblas", "64_"),
                ("openblas", "64_"),
                ("scipy_openblas", ""),
                ("openblas", ""),
            ):
                names = f"{prefix}_get_num_threads{suffix}", f"{prefix}_set_num_threads{suffix}"
                if hasattr(library, names[0]) and hasattr(library, names[1]):
                    return library, *names
    return None


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """One thread for each matrix product while this lasts; does nothing where NumPy's BLAS can't be asked."""
    found = _openblas()
    if found is None:
        yield
        return
    library, get, set_to = found
    before = int(getattr(library, get)())
    getattr(library, set_to)(1)
    try:
        yield
    finally:
        getattr(library, set_to)(before)


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
