"""Plan: the trials of one participant, drawn once and stored with its seed.

Pairs of stimuli come in (`stimuli.prepare`, or the manifest of a results folder); a `Plan` goes out: the trials that
window, browser and simulated observer all follow, and the course of studies whose trials depend on the answers
(`procedures`). Showing a plan draws nothing.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from study.errors import SessionError
from study.experiment.chance import generator
from study.experiment.procedures.constant_stimuli import ConstantStimuli, drawn_orders
from study.experiment.procedures.procedure import Adaptive, Course, Draw, Procedure
from study.experiment.procedures.registry import course_from_json, course_to_json
from study.experiment.protocol.whole import Protocol, StudySpec
from study.experiment.sets import own_set
from study.models.latin_square import latin_square
from study.tasks.registry import orders_of, stated_answers, task_of
from study.tasks.trial import Pair, Trial, trial_from_json, trial_of

PLAN_VERSION = 2


@dataclass(frozen=True)
class Plan:
    """All trials of one participant, in order; `examples` are stimuli that instructions show, by study."""

    protocol: str
    protocol_sha256: str
    participant: str
    seed: int
    group: int
    trials: tuple[Trial, ...]
    courses: tuple[Course, ...] = ()
    examples: Mapping[str, str] = field(default_factory=dict)

    @property
    def last(self) -> int:
        """The largest number that a trial may have."""
        ends = (course.first + course.most - 1 for course in self.courses)
        return max([*ends, *(trial.trial for trial in self.trials[-1:])], default=0)

    @property
    def stimuli(self) -> set[str]:
        """The ids of all stimuli that may be shown."""
        shown: list[Trial | Pair] = [*self.trials, *(pair for course in self.courses for pair in course.pairs)]
        return {name for one in shown for name in one.stimuli} | set(self.examples.values())

    def practice(self, study: str) -> tuple[Trial, ...]:
        """The practice trials of a study."""
        return tuple(trial for trial in self.trials if trial.study == study and trial.role == "practice")

    def procedures(self) -> dict[str, Procedure]:
        """The procedure of each study, study after study in their order."""
        first = {course.study: course.first for course in self.courses}
        for trial in self.trials:
            first[trial.study] = min(first.get(trial.study, trial.trial), trial.trial)
        found: dict[str, Procedure] = {
            study: ConstantStimuli(
                tuple(trial for trial in self.trials if trial.study == study and trial.role != "practice")
            )
            for study in sorted(first, key=lambda study: first[study])
        }
        for course in self.courses:
            rng = generator(self.seed, "procedure", self.protocol, self.participant, course.study)
            found[course.study] = course.settings.begun(course, rng)
        return found

    def to_json(self) -> str:
        """The plan as JSON; `plan_from_json` gives it back."""
        data = {"version": PLAN_VERSION, **asdict(replace(self, courses=()))}
        del data["courses"]
        if not self.examples:
            del data["examples"]
        if self.courses:
            data["courses"] = [course_to_json(course) for course in self.courses]
        return json.dumps(data, separators=(",", ":"))


def plan_from_json(text: str) -> Plan:
    """A stored plan."""
    try:
        data: dict[str, Any] = json.loads(text)
        version = data.pop("version")
        if version not in range(1, PLAN_VERSION + 1):
            raise SessionError(
                f"Expected a plan of version {PLAN_VERSION} or older, found {version}; use the Segue that wrote it."
            )
        trials = tuple(trial_from_json(trial, version) for trial in data["trials"])
        courses = tuple(course_from_json(course) for course in data.get("courses", ()))
        return Plan(**{**data, "trials": trials, "courses": courses})
    except (ValueError, KeyError, TypeError) as error:
        raise SessionError(f"Expected a stored plan, found JSON that is not one: {error}.") from error


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
        For studies whose order is `by-group`, for those whose pairs are divided into sets, and for their own order by a
        Latin square.
    """
    if not participant.strip():
        raise SessionError("Expected a participant's name, found none; write one, such as p01.")
    seed = protocol.seed if seed is None else seed
    rng = generator(seed, "plan", protocol.name, participant)
    studies = list(protocol.studies)
    if protocol.study_order == "random":
        studies = [studies[i] for i in rng.permutation(len(studies))]
    if protocol.study_order == "latin-square":
        rows = latin_square(len(studies))
        studies = [studies[i] for i in rows[group % len(rows)]]
    trials: list[Trial] = []
    courses: list[Course] = []
    examples: dict[str, str] = {}
    number = 1
    for study in studies:
        own, for_practice = _pairs_of(study, pairs)
        if shown_before := [pair for pair in for_practice if pair.motion == study.example_transition]:
            examples[study.name] = shown_before[0].stimuli[0]
            for_practice = [pair for pair in for_practice if pair not in shown_before]
        if not own:
            raise SessionError(
                f"Expected pairs for the study {study.name!r}, found none; prepare this protocol's stimuli."
            )
        if study.sets:
            own = own_set(own, study.sets, group)
        draw = Draw(study.name, tuple(own), orders_of(study), study.order, study.repeats, group, study.blocks)
        shown = study.procedure.drawn(draw, rng)
        # Practice and checks draw from generators of their own, so that they leave the trials as they are.
        practice = _draw_practice(
            study, for_practice or own, generator(seed, "practice", protocol.name, participant, study.name)
        )
        checks = generator(seed, "checks", protocol.name, participant, study.name)
        known = [*practice, *_with_checks(study, shown, checks)]
        trials += [replace(trial, trial=place) for place, trial in enumerate(known, start=number)]
        number += len(known)
        # Numbers are reserved for all trials that may come, so that later studies do not depend on the answers.
        if isinstance(study.procedure, Adaptive):
            courses.append(study.procedure.course(draw, number))
            number += courses[-1].most
    return Plan(protocol.name, protocol.sha256, participant, seed, group, tuple(trials), tuple(courses), examples)


def _pairs_of(study: StudySpec, pairs: Sequence[Pair]) -> tuple[list[Pair], list[Pair]]:
    """A study's pairs: those of its trials, and those for its practice alone."""
    own = [pair for pair in pairs if pair.study == study.name]
    for_practice = [pair for pair in own if pair.motion in study.practice_transitions]
    return [pair for pair in own if pair.motion not in study.practice_transitions], for_practice


def _draw_practice(study: StudySpec, pairs: Sequence[Pair], rng: np.random.Generator) -> list[Trial]:
    """Practice trials, of the pairs that the task takes for it, in orders at random."""
    if not study.practice:
        return []
    task = task_of(study)
    chosen = task.practice([pairs[i] for i in rng.permutation(len(pairs))], study.practice)
    order = rng.permutation(study.practice)
    orders = orders_of(study)
    drawn = drawn_orders(len(orders), study.practice, "random", rng)
    trials = [trial_of(chosen[i % len(chosen)], orders[drawn[i]], 0) for i in order]
    return [replace(trial, role="practice") for trial in trials]


def _with_checks(study: StudySpec, trials: Sequence[Trial], rng: np.random.Generator) -> list[Trial]:
    """The trials with attention checks among them: copies of trials that ask for a stated answer."""
    mixed = list(trials)
    for _ in range(study.attention_checks):
        model = trials[int(rng.integers(len(trials)))]
        legal = stated_answers(study)
        check = replace(model, role="check", expected=legal[int(rng.integers(len(legal)))])
        mixed.insert(int(rng.integers(1, len(mixed) + 1)), check)
    return mixed


def groups_of(protocol: Protocol, pairs: Sequence[Pair]) -> int:
    """How many groups of participants orders `by-group`, sets and a Latin square tell apart; 1 without any."""
    groups = len(latin_square(len(protocol.studies))) if protocol.study_order == "latin-square" else 1
    for study in protocol.studies:
        if study.order == "by-group":
            own = len(_pairs_of(study, pairs)[0])
            orders = len(orders_of(study))
            groups = math.lcm(groups, orders if orders > 1 else max(own, 1))
        groups = math.lcm(groups, study.sets or 1)
    return groups


def questions(protocol: Protocol, plan: Plan) -> int:
    """How many answers a plan asks for at most, without repeats after display failures."""
    items = {study.name: max(1, len(study.items)) + bool(study.confidence_points) for study in protocol.studies}
    rounds = {study.name: study.practice_most if study.practice_until else 1 for study in protocol.studies}
    known = sum(
        1 if trial.role == "check" else items[trial.study] * (rounds[trial.study] if trial.role == "practice" else 1)
        for trial in plan.trials
    )
    return known + sum(course.most * items[course.study] for course in plan.courses)
