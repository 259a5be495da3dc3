"""Folding: the answers of a session into its studies' procedures, which then say what comes next.

A plan and answers come in; the trials that are known go out, and what is needed to find those that are not. It is the
same for constant stimuli, where all trials are known, and for procedures that wait for an answer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from study.errors import SessionError
from study.experiment.plan import Plan
from study.experiment.procedures.procedure import Procedure
from study.experiment.protocol.whole import Protocol
from study.experiment.steps import Earlier, breaks_of, by_trial, showing_due
from study.tasks.answer import CONFIDENCE, Answer
from study.tasks.trial import Trial


@dataclass(frozen=True)
class Folded:
    """What the procedures of a session say so far."""

    procedures: Mapping[str, Procedure]
    """Of each study."""
    trials: Mapping[int, Trial]
    """All that are known, by number, in the order of the studies."""
    given: Mapping[str, tuple[Answer, ...]]
    """The answers of each study to its trials that are finished, practice apart: one a trial, in their order."""
    unknown: Mapping[str, int]
    """How many trials of each study may come beside those that are known."""
    breaks: frozenset[int] = frozenset()
    """Trials that a break follows, of those that are not known beforehand."""

    def trial(self, number: int) -> Trial:
        """A trial that is known, by its number."""
        if number not in self.trials:
            raise SessionError(f"Expected a trial from 1 to {max(self.trials)} that is known, found {number}.")
        return self.trials[number]


def fold(protocol: Protocol, plan: Plan, answers: Sequence[Answer]) -> Folded:
    """Everything that follows from a plan and the answers so far.

    Raises
    ------
    SessionError
        Where an answer belongs to no trial that was asked.
    """
    procedures, earlier = plan.procedures(), by_trial(answers)
    trials: dict[int, Trial] = {}
    given: dict[str, tuple[Answer, ...]] = {}
    unknown: dict[str, int] = {}
    for study, procedure in procedures.items():
        known, given[study] = _known(protocol, procedure, earlier)
        unknown[study] = _unknown(procedure, given[study], len(known) - len(given[study]))
        trials |= {trial.trial: trial for trial in (*plan.practice(study), *known)}
    if strays := sorted(earlier.keys() - trials.keys()):
        raise SessionError(f"Expected answers to the plan's trials 1 to {plan.last}, found trials {strays}.")
    waits = {number for course in plan.courses for number in range(course.first, course.first + course.most)}
    return Folded(procedures, trials, given, unknown, frozenset(breaks_of(protocol, plan) & waits))


def _known(protocol: Protocol, procedure: Procedure, earlier: Earlier) -> tuple[list[Trial], tuple[Answer, ...]]:
    """The trials of a study that are finished or come whatever is answered, and the answers to the finished ones."""
    known: list[Trial] = []
    given: list[Answer] = []
    while fresh := procedure.next(given):
        known += fresh
        ends = [
            [end for end in earlier[trial.trial] if end[1].item != CONFIDENCE][-1]
            for trial in fresh
            if trial.trial in earlier and showing_due(protocol, trial, earlier)[1] is None
        ]
        given += [answer for _, answer in sorted(ends, key=lambda end: end[0])]
        if len(ends) < len(fresh):
            break
    return known, tuple(given)


def _unknown(procedure: Procedure, given: Sequence[Answer], ahead: int) -> int:
    """The trials that may still come, except for so many that are known."""
    done, most = procedure.progress(given)
    return most - done - ahead


def finished(folded: Folded, trial: Trial, answer: Answer) -> Folded:
    """After the last answer to a trial that will not come again."""
    return replace(folded, given={**folded.given, trial.study: (*folded.given[trial.study], answer)})


def continued(folded: Folded, study: str) -> tuple[Folded, tuple[Trial, ...]]:
    """The trials that a study goes on with once all that were known are finished; none where it is over."""
    procedure, given = folded.procedures[study], folded.given[study]
    fresh = procedure.next(given)
    trials = {**folded.trials, **{trial.trial: trial for trial in fresh}}
    unknown = {**folded.unknown, study: _unknown(procedure, given, len(fresh))}
    return replace(folded, trials=trials, unknown=unknown), fresh
