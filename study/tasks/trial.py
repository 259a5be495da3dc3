"""Trials: the stimuli that belong together (a pair), and the trial that shows them in slots, in some order.

A pair names stimuli; a trial says for each slot which of them it shows. A task with three intervals has pairs of two
stimuli and trials of three slots. Plans and manifests of version 1 knew two slots at most, under keys of their own
(`a` and `b`, `first` and `second`): they are still read.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

PLACES = ("first", "second", "third", "fourth", "fifth", "sixth")
"""What records call the slots of a trial, in their order."""


@dataclass(frozen=True)
class Pair:
    """Stimuli that are compared, mostly two, or one to rate."""

    name: str
    """Unique in the protocol: `jnd/walking/+5`."""
    study: str
    task: str
    motion: str
    category: str
    """The study, its task, the transition's name and its type of motion."""
    stimuli: tuple[str, ...]
    """Stimulus ids: reference and comparison (same-different), methods a and b (preference, rating of a pair), or the
    one that is rated."""
    methods: tuple[str, ...]
    """How the blend length of each was found."""
    difference_frames: int | None = None
    """Comparison minus reference, signed; None where two methods are compared."""


@dataclass(frozen=True, slots=True)
class Trial:
    """One trial: what is shown in each slot, and what the answer will mean."""

    trial: int
    study: str
    task: str
    repeat: int
    """Number of the trial in the session, and which repeat of the pair it is, both from 1."""
    pair: str
    motion: str
    category: str
    stimuli: tuple[str, ...]
    """Stimulus ids, slot by slot."""
    members: tuple[int, ...]
    """Which of the pair's stimuli each slot shows, from 0: `(1, 0)` shows the comparison first."""
    methods: tuple[str, ...]
    """Those of the pair, in the pair's order."""
    difference_frames: int | None
    role: str = "trial"
    """`trial`, `practice` (counts for nothing) or `check` (asks for `expected`, whatever is shown)."""
    expected: str = ""

    @property
    def a_first(self) -> bool:
        """Whether the first slot shows the pair's first stimulus (the reference, method a)."""
        return self.members[0] == 0


def trial_of(pair: Pair, members: Sequence[int], repeat: int) -> Trial:
    """A trial that shows these members of a pair, slot by slot; it has no number yet."""
    return Trial(
        trial=0,
        study=pair.study,
        task=pair.task,
        repeat=repeat,
        pair=pair.name,
        motion=pair.motion,
        category=pair.category,
        stimuli=tuple(pair.stimuli[member] for member in members),
        members=tuple(members),
        methods=pair.methods,
        difference_frames=pair.difference_frames,
    )


def trial_from_json(data: Mapping[str, Any], version: int) -> Trial:
    """A trial of a stored plan of this version."""
    own = dict(data)
    if version == 1:
        a_first = own.pop("a_first"), own.pop("reference_first")
        own |= _listed(own, "first", "second")
        own["members"] = (0,) if len(own["stimuli"]) == 1 else (0, 1) if True in a_first else (1, 0)
    return Trial(**{key: _shared(value) for key, value in own.items()})


def _shared(value: Any) -> Any:
    """The same value with each text as one object in all trials: a server keeps the plans of many sessions."""
    if isinstance(value, list | tuple):
        return tuple(map(_shared, value))
    return sys.intern(value) if isinstance(value, str) else value


def pair_since_version_1(data: Mapping[str, Any]) -> dict[str, Any]:
    """A pair of a manifest of version 1, in today's keys."""
    own = dict(data)
    return own | _listed(own, "a", "b")


def _listed(data: dict[str, Any], one: str, other: str) -> dict[str, list[str]]:
    """Take two stimuli and their methods out of keys of their own; the second is empty where there is one alone."""
    stimuli, methods = [data.pop(one), data.pop(other)], [data.pop("method_a"), data.pop("method_b")]
    count = 2 if stimuli[1] else 1
    return {"stimuli": stimuli[:count], "methods": methods[:count]}
