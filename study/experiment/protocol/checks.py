"""What has to fit together in a whole protocol: names, practice, points and the analysis.

A protocol comes in whose parts are sound; nothing goes out, or a `KeyMismatchError` that names the key.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from difflib import get_close_matches
from functools import partial

from pydantic import ValidationError

from study.counting import counted
from study.experiment.protocol.content import Content
from study.experiment.protocol.errors import KeyMismatchError, refuse_all, short
from study.experiment.protocol.stimuli import TransitionSpec
from study.experiment.protocol.studies import StudySpec, check_once, repeated
from study.experiment.protocol.texts import LONGEST_NAME
from study.tasks.registry import task_of
from study.transitions.methods.method import OwnPoints

MOST_TRIALS = 100_000
"""Of one participant in one study: far beyond what anybody could answer."""


def check_whole(protocol: Content) -> None:
    """Refuse a protocol whose parts contradict each other; what is wrong in several studies is told at once."""
    for kind in ("transitions", "methods", "studies", "form"):
        _check_unique(protocol, kind)
    known = [transition.name for transition in protocol.transitions]
    for index, own in enumerate(protocol.methods):
        _check_known(own.method({}).make.transitions(), known, "transitions", "methods", index)
    studies = list(enumerate(protocol.studies))
    refuse_all(_refusals(partial(_check_study, protocol, study, index, known) for index, study in studies))
    points = (partial(_check_points_of, protocol, study) for study in protocol.studies)
    refuse_all(_refusals((*points, partial(_check_analysis, protocol))))


def _refusals(checks: Iterable[Callable[[], None]]) -> Iterator[KeyMismatchError]:
    """What checks that do not depend on each other refuse."""
    for check in checks:
        try:
            check()
        except KeyMismatchError as error:
            yield error


def _check_unique(protocol: Content, kind: str) -> None:
    names = [part.name for part in getattr(protocol, kind)]
    if (index := repeated(names)) is not None:
        message = f"expected each name in {kind} once, found {names[index]!r} twice; rename one"
        raise KeyMismatchError(message, kind, index, "name")


def _check_study(protocol: Content, study: StudySpec, index: int, known: Sequence[str]) -> None:
    """Refuse unknown transitions and methods, practice that does not suit, and too few or too many trials."""
    for key in ("transitions", "practice_transitions"):
        names = getattr(study, key)
        _check_known(names, known, "transitions", "studies", index, key)
        check_once(names, "transition", "studies", index, key)
    _check_methods(protocol, study, index)
    _check_practice(protocol, study, index)
    _check_lengths(protocol, study, index)


def _check_methods(protocol: Content, study: StudySpec, index: int) -> None:
    """Refuse unknown methods, methods that do not suit the task, and pairs that cannot be compared."""
    where, who = ("studies", index), f"the {study.task} study {study.name!r}"
    named = [*((key, name) for key in ("reference", "comparison", "hidden_reference") if (name := getattr(study, key)))]
    named += [("others", name) for name in study.others]
    for key, name in named:
        _check_known([name], protocol.method_names, "methods", *where, key)
    methods = protocol.methods_of(study)
    if study.differences_frames and not methods[study.reference].make.levels:
        raise KeyMismatchError(
            f"expected a reference with one blend length in {who}, found {study.reference!r}; change it",
            *where,
            "reference",
        )
    if len({isinstance(method.points, OwnPoints) for method in methods.values()}) > 1:
        raise KeyMismatchError(
            f"expected in {who} either cuts where a metric is least or methods at common points, found "
            f"{' and '.join(map(repr, study.methods))}; change one",
            *where,
            "comparison",
        )
    if protocol.stimuli.match != "none" and task_of(study).shortcut is not None:
        for key, name in named:
            if not methods[name].make.moves:
                raise KeyMismatchError(
                    f"expected in {who} methods whose blends can be moved, as [stimuli] match = "
                    f"{protocol.stimuli.match!r} asks, found {name!r}; change it, or remove match",
                    *where,
                    key,
                )
    for transition in (*protocol.transitions_of(study), *protocol.practice_of(study)):
        for method in methods.values():
            if lacking := method.make.lacks(transition.name):
                raise KeyMismatchError(f"the method {method.name!r} of {who}: {lacking}", *where)


def _check_known(names: Sequence[str], known: Sequence[str], what: str, *location: int | str) -> None:
    """Refuse unknown names, with the nearest known one."""
    there = set(known)
    if (name := next((name for name in names if name not in there), None)) is not None:
        near = get_close_matches(name, known, n=1) if len(name) <= LONGEST_NAME else []
        hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(known)}"
        raise KeyMismatchError(f"expected names of {what}, found {short(name)}; {hint}", *location)


def _check_analysis(protocol: Content) -> None:
    """Refuse decisions about the analysis that the studies can't carry out."""
    preferences = [study.name for study in protocol.studies if task_of(study).tested]
    names = protocol.analysis.confirmatory
    _check_known(names, preferences, "preference studies", "analysis", "confirmatory")
    check_once(names, "study", "analysis", "confirmatory")
    if protocol.failed_checks.most is not None and not any(study.attention_checks for study in protocol.studies):
        raise KeyMismatchError(
            "expected attention_checks in a study with this rule, found none; add some, or remove the rule",
            "failed_checks",
            "most",
        )
    rules, where = protocol.analysis.exclusions, ("analysis", "exclusions")
    if rules.most_failed_checks is not None and not any(study.attention_checks for study in protocol.studies):
        raise KeyMismatchError(
            "expected attention_checks in a study with this rule, found none; add some, or remove the rule",
            *where,
            "most_failed_checks",
        )
    timed = any(task_of(study).timed for study in protocol.studies)
    if timed and rules.fastest_s is not None and rules.fastest_s >= protocol.timing.answer_s:
        raise KeyMismatchError(
            f"expected less than timing.answer_s, {protocol.timing.answer_s:g} s, found {rules.fastest_s:g}, which "
            "leaves no answer; lower it",
            *where,
            "fastest_s",
        )


def _check_lengths(protocol: Content, study: StudySpec, index: int) -> None:
    """Refuse sets of different size, and more practice, or more attention checks, than a study has trials."""
    if study.sets:
        pairs, motions = len(study.methods) * (len(study.methods) - 1) // 2, len(protocol.transitions_of(study))
        if (pairs % study.sets and motions % study.sets) or study.order == "by-group":
            raise KeyMismatchError(
                f"expected sets that divide the {counted(pairs, 'pair')} of methods or the "
                f"{counted(motions, 'transition')} of {study.name!r}, in another order than by-group, found "
                f"{study.sets}; change one",
                "studies",
                index,
                "sets",
            )
    trials = protocol.trials_of(study)
    if trials > MOST_TRIALS:
        raise KeyMismatchError(
            f"expected at most {counted(MOST_TRIALS, 'trial')} in {study.name!r}, found {trials:,}; lower repeats",
            "studies",
            index,
        )
    if study.blocks and study.procedure.differences() is not None:
        message = f"expected no blocks in {study.name!r}, whose procedure chooses the trials; remove it"
        raise KeyMismatchError(message, "studies", index, "blocks")
    for key in ("practice", "attention_checks"):
        found = getattr(study, key)
        if found > trials:
            raise KeyMismatchError(
                f"expected no more than the {counted(trials, 'trial')} of {study.name!r}, found {found}; lower it",
                "studies",
                index,
                key,
            )


def _check_practice(protocol: Content, study: StudySpec, index: int) -> None:
    """Refuse practice with the transitions of the study, and practice transitions without practice trials."""
    where = ("studies", index, "practice_transitions")
    if study.practice_transitions and not study.practice:
        raise KeyMismatchError("expected practice of one trial or more with them, found none; set practice", *where)
    if study.practice_until is not None and not (study.practice and study.differences_frames):
        raise KeyMismatchError(
            f"expected practice, and a task with right answers, with practice_until, found the {study.task} study "
            f"{study.name!r} with {counted(study.practice, 'practice trial')}; remove it",
            *where[:-1],
            "practice_until",
        )
    shown = protocol.transitions_of(study)
    if not shown:
        raise KeyMismatchError(f"expected a transition for the trials of {study.name!r}, found none but these", *where)
    for transition in shown:
        if transition.name in study.practice_transitions:
            raise KeyMismatchError(
                f"expected transitions that the trials do not show, found {transition.name!r}; name another", *where
            )
    if study.example_transition is not None:
        others = [name for name in study.practice_transitions if name != study.example_transition]
        if not study.example or len(others) != len(study.practice_transitions) - 1 or not others:
            raise KeyMismatchError(
                "expected an example_transition among practice_transitions, with another one to practise with, and "
                f"example = true, found {study.example_transition!r}; change it",
                *where[:-1],
                "example_transition",
            )


def _check_points_of(protocol: Content, study: StudySpec) -> None:
    places = {transition.name: index for index, transition in enumerate(protocol.transitions)}
    for transition in (*protocol.transitions_of(study), *protocol.practice_of(study)):
        _check_points(protocol, study, transition, places[transition.name])


def _check_points(protocol: Content, study: StudySpec, transition: TransitionSpec, index: int) -> None:
    """Refuse merged conditions that leave nothing to choose."""
    where = ("transitions", index)
    who = f"for the transition {transition.name!r} in the study {study.name!r}"
    try:
        points = protocol.points_for(study, transition)
    except ValidationError as error:
        raise KeyMismatchError(f"contradicting conditions {who}: {error.errors()[0]['ctx']['error']}", *where) from None
    if points.choose == "given" and isinstance(protocol.methods_of(study)[study.reference].points, OwnPoints):
        raise KeyMismatchError(
            f"expected no given points {who}: {study.reference!r} finds its own; remove choose or change the method",
            *where,
        )
    if points.choose == "given":
        for end in ("source", "destination"):
            given = [key for key in (f"{end}_s", f"{end}_frame") if getattr(points, key) is not None]
            if len(given) != 1:
                found = " and ".join(given) or "neither"
                raise KeyMismatchError(
                    f"expected one of {end}_s and {end}_frame {who}, found {found}; give one", *where
                )
    least = 1 - min((0, *study.differences_frames))
    if points.longest_frames is not None and points.longest_frames < least:
        raise KeyMismatchError(
            f"a level below one frame {who}: at longest_frames = {points.longest_frames} the difference "
            f"{min(study.differences_frames)} leaves no blend; expected longest_frames of {least} or more",
            *where,
        )
