"""Work on all cores: threads of our own, each with one BLAS thread.

The search's arrays are small enough for a core's cache, so cores are best used by giving each its own piece. NumPy lets
other threads run during its loops; BLAS threads of its own would only get in their way.
"""

from __future__ import annotations

from threadpoolctl import threadpool_limits


def one_blas_thread() -> threadpool_limits:
    """A context in which each matrix product takes one thread."""
    return threadpool_limits(1, user_api="blas")
