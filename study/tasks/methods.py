"""What tasks over methods share: pairs of methods that differ, of which two make one pair a transition."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations

from study.models.choice import share_of_more
from study.tasks.task import Asked, Condition, Problem, Shortcut
from study.tasks.trial import Pair

CHOICE = Shortcut("comparison", lambda apart, _: share_of_more(apart), chance=0.5)
"""Somebody who chooses the stimulus that seems to have more of a property."""


def both_methods(asked: Asked, for_practice: bool) -> tuple[Condition, ...]:
    """Both methods of a study, as one pair; of more than two all pairs, but for practice."""
    methods = (asked.reference, asked.comparison or asked.reference, *asked.others)
    if len(methods) == 2 or for_practice:
        return (Condition("", methods[:2], (0, 0)),)
    return tuple(Condition(f"{a}_{b}", (a, b), (0, 0)) for a, b in combinations(methods, 2))


def any_practice(pairs: Sequence[Pair], count: int) -> list[Pair]:
    """Pairs as they were shuffled."""
    return list(pairs[:count])


def two_methods(asked: Asked) -> Iterator[Problem]:
    """A second method that is missing, or the same as the first."""
    if asked.comparison in (None, asked.reference):
        who = f"the {asked.task} study {asked.name!r}"
        yield "comparison", f"expected a comparison other than {asked.reference!r} in {who}; name one"
    named = (asked.reference, asked.comparison, *asked.others)
    if twice := next((name for name in asked.others if named.count(name) > 1), None):
        yield "others", f"expected each method once in the {asked.task} study {asked.name!r}, found {twice!r} twice"


def against(asked: Asked, blends: Callable[[str], str]) -> str:
    """The method, or both methods, in words."""
    first = blends(asked.reference)
    return first if asked.comparison is None else f"{first} and {blends(asked.comparison)}"
