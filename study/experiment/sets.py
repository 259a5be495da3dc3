"""Sets: which pairs of a study one participant sees, where nobody can see them all.

The pairs of a study come in, and into how many sets they are divided; one set goes out. Every pair of methods at every
motion is in one set, so that over as many participants as there are sets each is seen equally often; in each set every
pair of methods is shown equally often, each time at another motion, and the methods are spread evenly over motions.
"""

from __future__ import annotations

from collections.abc import Sequence

from study.tasks.trial import Pair


def own_set(pairs: Sequence[Pair], sets: int, number: int) -> list[Pair]:
    """The pairs of one set, in their order; sets count from 0, and on from the first after the last.

    Notes
    -----
    A cyclic design: the pairs of methods, in the order of a round robin (in whose rounds no method stands twice), are
    divided into as many blocks as there are sets, and a block's set moves on by one from motion to motion. In a set a
    motion so has one block, in which methods differ as far as they can.
    """
    motions = {name: place for place, name in enumerate(dict.fromkeys(pair.motion for pair in pairs))}
    order = {games: place for place, games in enumerate(round_robin([pair.methods for pair in pairs]))}
    wanted = number % sets
    return [
        pair
        for pair in pairs
        if (order[frozenset(pair.methods)] * sets // len(order) + motions[pair.motion]) % sets == wanted
    ]


def round_robin(compared: Sequence[tuple[str, ...]]) -> list[frozenset[str]]:
    """The pairs of methods that are compared, each once, round after round (the circle method)."""
    names = list(dict.fromkeys(name for pair in compared for name in pair))
    circle: list[str | None] = [*names, *([None] if len(names) % 2 else [])]
    there, found = {frozenset(pair) for pair in compared}, []
    for _ in range(len(circle) - 1):
        half = len(circle) // 2
        games = zip(circle[:half], reversed(circle[half:]), strict=True)
        found += [frozenset((a, b)) for a, b in games if a is not None and b is not None]
        circle = [circle[0], circle[-1], *circle[1:-1]]
    return [game for game in found if game in there]
