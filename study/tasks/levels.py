"""What tasks over differences of blend length share: one comparison a level, and the plainest ones for practice."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from study.tasks.task import Asked, Condition, Problem
from study.tasks.trial import Pair

MOST_LISTED = 15
"""Longer lists of levels are given by their ends."""


def level_conditions(asked: Asked, for_practice: bool) -> tuple[Condition, ...]:
    """The reference beside each level; practice has the largest ones and no difference."""
    levels, methods = asked.differences_frames, (asked.reference, asked.reference)
    if for_practice:
        levels = tuple(level for level in levels if level in (0, min(levels), max(levels)))
    return tuple(Condition(f"{level:+d}", methods, (0, level), level) for level in levels)


def level_practice(pairs: Sequence[Pair], count: int) -> list[Pair]:
    """Half without a difference, where there are such pairs, and half as different as can be."""
    same = [pair for pair in pairs if not pair.difference_frames]
    differ = sorted(
        (pair for pair in pairs if pair.difference_frames), key=lambda pair: -abs(pair.difference_frames or 0)
    )
    kinds = [kind for kind in (differ, same) if kind]
    return [kind[i % len(kind)] for i in range(count) for kind in kinds][:count]


def level_problems(asked: Asked) -> Iterator[Problem]:
    """Levels that are missing, and a comparison besides them."""
    who = f"the {asked.task} study {asked.name!r}"
    if not asked.differences_frames:
        yield "", f"expected differences_frames in {who}, found none; write for example [-5, 0, 5]"
    if asked.comparison is not None:
        yield "comparison", f"expected no comparison in {who}: differences_frames says it; remove it"


def levels_in_words(asked: Asked, blends: Callable[[str], str]) -> str:
    """The reference, and by how much the comparisons differ from it."""
    each = [f"{value:+d}".replace("-", "−") if value else "0" for value in asked.differences_frames]
    levels = ", ".join(each) if len(each) <= MOST_LISTED else f"{each[0]} to {each[-1]}"
    return f"{blends(asked.reference)}, against blends that differ from their length by {levels} frames"
