"""Exclusions by rules stated before there was data: answers come in; those that are kept, and counts, go out.

Rules come from the protocol. Each excluded answer or participant is counted under the first rule that it breaks, and
the analysis is given with and without them, so that their effect can be seen.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Rules:
    """Rules of exclusion; None and False exclude nothing."""

    fastest_s: float | None = None
    """Answers sooner than this. [seconds]"""
    badly_shown: bool = False
    """Answers after a stimulus that stalled or was hidden."""
    most_missed: float | None = None
    """Participants who missed a larger share of their trials."""
    most_failed_checks: float | None = None
    """Participants who failed a larger share of the attention checks."""
    most_too_fast: float | None = None
    """Participants with a larger share of answers sooner than `fastest_s` (0.2 s where that is not stated)."""


@dataclass(frozen=True)
class RuleCount:
    """A rule in words, and how many participants and answers it excluded."""

    rule: str
    participants: int
    answers: int


@dataclass(frozen=True)
class LeftOut:
    """An excluded participant, and why."""

    participant: str
    reason: str


@dataclass(frozen=True)
class Exclusions:
    """The exclusions: by which rules, which participants entirely, and how many answers, theirs included."""

    rules: tuple[RuleCount, ...]
    participants: tuple[LeftOut, ...]
    answers_left_out: int


IMPOSSIBLE_S = 0.2


def rules_of(stated: object) -> Rules:
    """Return rules from an object with their attributes, such as a protocol's."""
    return Rules(**{rule.name: getattr(stated, rule.name) for rule in fields(Rules)})


def exclude(answers: pd.DataFrame, rules: Rules, checks: pd.DataFrame | None = None) -> tuple[pd.DataFrame, Exclusions]:
    """Apply the rules: the answers that are kept, and the exclusions.

    Parameters
    ----------
    rules
        From the protocol.
    checks
        Answers to attention checks: `participant`, `answer`, `expected`; needed by that rule alone.

    Notes
    -----
    Participants are judged by all their answers, before single answers are excluded.
    """
    import pandas as pd

    who = answers["participant"].astype(str)
    gone = pd.Series(False, index=answers.index)
    counts: list[RuleCount] = []
    people: dict[str, str] = {}
    for words, reasons in _participants_out(answers, rules, checks):
        fresh = {name: reason for name, reason in sorted(reasons.items()) if name not in people}
        rows = who.isin(list(fresh)) & ~gone
        gone |= rows
        people |= fresh
        counts.append(RuleCount(words, len(fresh), int(rows.sum())))
    for words, rows in _answers_out(answers, rules):
        rows &= ~gone
        gone |= rows
        counts.append(RuleCount(words, 0, int(rows.sum())))
    left_out = tuple(LeftOut(*one) for one in people.items())
    return answers[~gone], Exclusions(tuple(counts), left_out, int(gone.sum()))


def _times(answers: pd.DataFrame) -> pd.Series[float]:
    import pandas as pd

    if "response_s" not in answers.columns:
        return pd.Series(np.nan, index=answers.index)
    return pd.to_numeric(answers["response_s"], errors="coerce").astype(float)


def _participants_out(
    answers: pd.DataFrame, rules: Rules, checks: pd.DataFrame | None
) -> list[tuple[str, dict[str, str]]]:
    """For each rule on participants, in words, the participants that it excludes and why."""
    found = []
    missed = answers["answer"].isna().groupby(answers["participant"].astype(str)).mean()
    if rules.most_missed is not None:
        words = f"participants with no response in more than {100 * rules.most_missed:g}% of their trials"
        found.append((words, {str(n): f"missed {100 * s:.0f}%" for n, s in missed.items() if s > rules.most_missed}))
    if rules.most_failed_checks is not None:
        words = f"participants who failed more than {100 * rules.most_failed_checks:g}% of the attention checks"
        failed: dict[str, str] = {}
        if checks is not None and len(checks):
            wrong = (checks["answer"].isna() | (checks["answer"] != checks["expected"])).astype(float)
            shares = wrong.groupby(checks["participant"].astype(str)).mean()
            failed = {
                str(n): f"failed {100 * s:.0f}% of the checks"
                for n, s in shares.items()
                if s > rules.most_failed_checks
            }
        found.append((words, failed))
    if rules.most_too_fast is not None:
        least = rules.fastest_s if rules.fastest_s is not None else IMPOSSIBLE_S
        words = f"participants with more than {100 * rules.most_too_fast:g}% of answers sooner than {least:g} s"
        given = answers[answers["answer"].notna()]
        fast = (_times(given) < least).groupby(given["participant"].astype(str)).mean()
        found.append((words, {str(n): f"{100 * s:.0f}% too fast" for n, s in fast.items() if s > rules.most_too_fast}))
    return found


def _answers_out(answers: pd.DataFrame, rules: Rules) -> list[tuple[str, pd.Series[bool]]]:
    """For each rule on answers, in words, the answers that it excludes."""
    found = []
    if rules.fastest_s is not None:
        found.append((f"answers sooner than {rules.fastest_s:g} s", (_times(answers) < rules.fastest_s).fillna(False)))
    if rules.badly_shown:
        import pandas as pd

        badly = pd.Series(False, index=answers.index)
        if "shown_well" in answers.columns:
            badly = answers["answer"].notna() & ~answers["shown_well"].fillna(True).astype(bool)
        found.append(("answers after a display failure", badly))
    return found
