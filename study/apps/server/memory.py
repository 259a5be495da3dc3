"""The server's memory: how it is taken from the system, and handed back."""

from __future__ import annotations

import contextlib
import ctypes
import gc

# Numbers of options in glibc's malloc.h.
_M_MMAP_THRESHOLD, _M_ARENA_MAX = -3, -8
_LARGE = 2**19


def set_up() -> None:
    """Let all threads take memory from one heap, and pieces of half a megabyte and more from the system itself.

    glibc gives each thread a heap of its own, and what one frees no other can use; and it learns to take ever larger
    pieces from the heap, which they then break up. Threads of Python wait for each other anyway. Two hundred answers
    at one instant are so many new objects that the collector of cycles would look through all sessions several times,
    a quarter of all work: it is called when there is time (`hand_back`).
    """
    with contextlib.suppress(AttributeError, OSError, TypeError):  # other systems have no such choice
        libc = ctypes.CDLL(None)
        libc.mallopt(_M_ARENA_MAX, 1)
        libc.mallopt(_M_MMAP_THRESHOLD, _LARGE)
    gc.freeze()
    gc.set_threshold(100_000, 10, 10)


def hand_back() -> None:
    """Free what only cycles hold, such as connections that were closed, and give free memory back to the system."""
    gc.collect()
    with contextlib.suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)
