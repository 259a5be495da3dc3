"""That work grows in line with its size: a ratio within one run, so neither machine nor load decides."""

from __future__ import annotations

import time
from collections.abc import Callable

TIMES = 8  # how much larger the large work is than the small one
MOST = 24.0  # between what a line gives (8) and what a square does (64)
LEAST_S = 0.002  # anything shorter counts as this long


def _seconds(work: Callable[[], object]) -> float:
    # This thread's own processor time, as other tests run beside this one.
    started = time.thread_time()
    work()
    return max(time.thread_time() - started, LEAST_S)


def assert_linear(prepare: Callable[[int], Callable[[], object]], size: int) -> None:
    """Fails where work of `size` takes much more than eight times as long as work of an eighth of it.

    `prepare(size)` gives the work; only that is timed. The least of three runs counts.
    """
    small, large = prepare(size // TIMES), prepare(size)
    ratio = min(_seconds(large) for _ in range(3)) / min(_seconds(small) for _ in range(3))
    assert ratio < MOST, f"{TIMES} times the size takes {ratio:.1f} times the time"
