"""Latin squares: orders in which each of several things stands at each place equally often (Williams 1949)."""

from __future__ import annotations


def latin_square(size: int) -> tuple[tuple[int, ...], ...]:
    """Rows of numbers from 0, in which each number also follows every other one equally often.

    There are as many rows as numbers, and of an odd number twice as many.

    Notes
    -----
    Williams, E. J. (1949). Experimental designs balanced for the estimation of residual effects of treatments.
    Australian Journal of Scientific Research A, 2, 149-168. The first row is 0, 1, n-1, 2, n-2, ...; in each further
    row all numbers are one higher. Of an odd number the rows read backwards are needed as well.

    Examples
    --------
    >>> latin_square(4)
    ((0, 1, 3, 2), (1, 2, 0, 3), (2, 3, 1, 0), (3, 0, 2, 1))
    """
    first = [0, *((place + 1) // 2 if place % 2 else size - place // 2 for place in range(1, size))]
    rows = [tuple((number + turn) % size for number in first) for turn in range(size)]
    return (*rows, *(row[::-1] for row in rows)) if size % 2 and size > 1 else tuple(rows)
