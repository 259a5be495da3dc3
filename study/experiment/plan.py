"""Plan: the trials of one participant, drawn once and stored with its seed.

Pairs of stimuli come in (`stimuli.prepare`, or the manifest of a results folder); a `Plan` goes out: the trial table
that window, browser and simulated observer all follow. Showing a plan draws nothing. 2004 section 4.2: each pair in
both orders, the order of pairs and the order within a pair both at random.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from study.errors import SessionError
from study.experiment.chance import generator
from study.experiment.protocol.whole import Protocol, StudySpec
from study.tasks.trial import Pair, Trial, trial_from_json, trial_of

PLAN_VERSION = 2


@dataclass(frozen=True)
class Plan:
    """All trials of one participant, in order."""

    protocol: str
    protocol_sha256: str
    participant: str
    seed: int
    group: int
    trials: tuple[Trial, ...]

    def trial(self, number: int) -> Trial:
        """A trial by its number, counted from 1."""
        if not 1 <= number <= len(self.trials):
            raise SessionError(f"Expected a trial from 1 to {len(self.trials)}, found {number}.")
        return self.trials[number - 1]

    def to_json(self) -> str:
        """The plan as JSON; `plan_from_json` gives it back."""
        return json.dumps({"version": PLAN_VERSION, **asdict(self)}, separators=(",", ":"))


def plan_from_json(text: str) -> Plan:
    """A stored plan."""
    try:
        data: dict[str, Any] = json.loads(text)
        version = data.pop("version")
        if version not in range(1, PLAN_VERSION + 1):
            raise SessionError(
                f"Expected a plan of version {PLAN_VERSION} or older, found {version}; use the Segue that wrote it."
            )
        return Plan(**{**data, "trials": tuple(trial_from_json(trial, version) for trial in data["trials"])})
    except (ValueError, KeyError, TypeError) as error:
        raise SessionError(f"Expected a stored plan, found JSON that is none: {error}.") from error


def draw_plan(
    protocol: Protocol, pairs: Sequence[Pair], participant: str, seed: int | None = None, *, group: int = 0
) -> Plan:
    """Draw a participant's trials.

    Parameters
    ----------
    protocol
        Orders, repeats and the order of studies.
    pairs
        In the protocol's order, which matters: the draw counts on it.
    participant
        A name; with the seed it decides the whole plan.
    seed
        Instead of the protocol's own.
    group
        For studies whose order is `by-group`.
    """
    if not participant.strip():
        raise SessionError("Expected a participant's name, found none; write one, such as p01.")
    seed = protocol.seed if seed is None else seed
    rng = generator(seed, "plan", protocol.name, participant)
    studies = list(protocol.studies)
    if protocol.study_order == "random":
        studies = [studies[i] for i in rng.permutation(len(studies))]
    trials: list[Trial] = []
    for study in studies:
        own, for_practice = _pairs_of(study, pairs)
        if not own:
            raise SessionError(
                f"Expected pairs for the study {study.name!r}, found none; prepare this protocol's stimuli."
            )
        shown: list[Trial] = []
        for repeat in range(1, study.repeats + 1):
            shown += _draw_set(study, own, repeat, rng, group)
        # Practice and checks draw from generators of their own, so that they leave the trials as they are.
        practice = _draw_practice(
            study, for_practice or own, generator(seed, "practice", protocol.name, participant, study.name)
        )
        checks = generator(seed, "checks", protocol.name, participant, study.name)
        trials += [*practice, *_with_checks(study, shown, checks)]
    numbered = tuple(replace(trial, trial=number) for number, trial in enumerate(trials, start=1))
    return Plan(protocol.name, protocol.sha256, participant, seed, group, numbered)


def _pairs_of(study: StudySpec, pairs: Sequence[Pair]) -> tuple[list[Pair], list[Pair]]:
    """A study's pairs: those of its trials, and those for its practice alone."""
    own = [pair for pair in pairs if pair.study == study.name]
    for_practice = [pair for pair in own if pair.motion in study.practice_transitions]
    return [pair for pair in own if pair.motion not in study.practice_transitions], for_practice


def _draw_set(
    study: StudySpec, pairs: Sequence[Pair], repeat: int, rng: np.random.Generator, group: int
) -> list[Trial]:
    """One repeat of a study: each pair in its order or orders, shuffled."""
    count = len(pairs)
    if not study.paired:
        if study.order == "by-group":
            turn = group % count
            return [trial_of(pair, (0,), repeat) for pair in [*pairs[turn:], *pairs[:turn]]]
        return [trial_of(pairs[i], (0,), repeat) for i in rng.permutation(count)]
    if study.order == "both":
        shown = [(pair, a_first) for pair in pairs for a_first in (True, False)]
    elif study.order == "random":
        shown = [(pair, bool(a)) for pair, a in zip(pairs, rng.integers(0, 2, count), strict=True)]
    elif study.order == "balanced":
        # An odd count leaves one pair over; which way it goes is drawn too.
        halves = (np.arange(count) + int(rng.integers(0, 2))) % 2 == 0
        shown = [(pair, bool(a)) for pair, a in zip(pairs, rng.permutation(halves), strict=True)]
    else:
        shown = [(pair, group % 2 == 0) for pair in pairs]
    return [trial_of(shown[i][0], _both(shown[i][1]), repeat) for i in rng.permutation(len(shown))]


def _draw_practice(study: StudySpec, pairs: Sequence[Pair], rng: np.random.Generator) -> list[Trial]:
    """Practice trials: at random, but in same-different studies half the same and half as different as can be."""
    if not study.practice:
        return []
    chosen = [pairs[i] for i in rng.permutation(len(pairs))]
    if study.task == "same-different":
        same = [pair for pair in chosen if not pair.difference_frames]
        differ = sorted(
            (pair for pair in chosen if pair.difference_frames), key=lambda pair: -abs(pair.difference_frames or 0)
        )
        kinds = [kind for kind in (differ, same) if kind]
        chosen = [kind[i % len(kind)] for i in range(study.practice) for kind in kinds][: study.practice]
    chosen = [chosen[i % len(chosen)] for i in range(study.practice)]
    order = rng.permutation(study.practice)
    sides = rng.integers(0, 2, study.practice)
    if study.paired:
        trials = [trial_of(chosen[i], _both(bool(sides[i])), 0) for i in order]
    else:
        trials = [trial_of(chosen[i], (0,), 0) for i in order]
    return [replace(trial, role="practice") for trial in trials]


def _with_checks(study: StudySpec, trials: Sequence[Trial], rng: np.random.Generator) -> list[Trial]:
    """The trials with attention checks among them: copies of trials that ask for a stated answer."""
    mixed = list(trials)
    for _ in range(study.attention_checks):
        model = trials[int(rng.integers(len(trials)))]
        legal = legal_answers(study)
        check = replace(model, role="check", expected=legal[int(rng.integers(len(legal)))])
        mixed.insert(int(rng.integers(1, len(mixed) + 1)), check)
    return mixed


def legal_answers(study: StudySpec) -> tuple[str, ...]:
    """The answers that count in a study."""
    if study.task == "same-different":
        return ("same", "different")
    if study.task == "preference":
        return ("first", "second")
    return tuple(str(point) for point in range(study.scale_points))


def groups_of(protocol: Protocol, pairs: Sequence[Pair]) -> int:
    """How many groups of participants the orders `by-group` tell apart; 1 where there are none."""
    groups = 1
    for study in protocol.studies:
        if study.order == "by-group":
            own = len(_pairs_of(study, pairs)[0])
            groups = math.lcm(groups, 2 if study.paired else max(own, 1))
    return groups


def _both(a_first: bool) -> tuple[int, int]:
    """The members of a pair in their slots, where both are shown."""
    return (0, 1) if a_first else (1, 0)
