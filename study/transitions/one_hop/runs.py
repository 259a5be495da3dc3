"""Neighbouring triggered frames share an entry: a table as runs, without loss, which a runtime finds by bisection.

In: a table's entries. Out: runs, `(runs, 1 + columns) int32`. Most triggers wait for the same moment as the one before
them (one frame of stay less), go through the same hop a frame later, or are alike; a run holds its first entry and
which of these `KINDS` goes on. Its first number is three times the place of its first entry, plus the kind.
"""

from __future__ import annotations

import numpy as np

from study.arrays import CountArray

KINDS = ("alike", "one stay less in the source", "the hop one frame later")
_STEPS = np.array([[0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0]], dtype=np.int32)
"""What each kind adds to hop, offset and both stays from one entry to the next."""


def to_runs(entries: CountArray) -> CountArray:
    """The fewest runs that hold the entries `(n, 4 or 6)`: each is as long as it can be."""
    count = len(entries)
    # How many entries from each on are in one run of each kind.
    reach = np.ones((len(KINDS), count + 1), dtype=np.int64)
    for kind, step in enumerate(_steps(entries.shape[1])):
        ends = np.flatnonzero((entries[1:] != entries[:-1] + step).any(axis=1)) + 1
        reach[kind, :count] = np.append(ends, count)[np.searchsorted(ends, np.arange(count), side="right")]
    runs, place = [], 0
    while place < count:
        kind = int(np.argmax(reach[:, place]))
        runs.append((place * len(KINDS) + kind, *entries[place]))
        place = int(reach[kind, place])
    return np.array(runs, dtype=np.int32).reshape(-1, 1 + entries.shape[1])


def from_runs(runs: CountArray, places: range) -> CountArray:
    """The entries at some places, as a runtime looks one up.

    Each is in the last run that does not begin after it, as many steps on as it is from there.
    """
    starts, kinds = np.divmod(runs[:, 0], len(KINDS))
    wanted = np.arange(places.start, places.stop)
    own = np.searchsorted(starts, wanted, side="right") - 1
    steps = _steps(runs.shape[1] - 1)[kinds[own]]
    return np.asarray(runs[own, 1:] + (wanted - starts[own])[:, None] * steps, dtype=np.int32)


def _steps(columns: int) -> CountArray:
    return np.pad(_STEPS, ((0, 0), (0, columns - _STEPS.shape[1])))
