"""Data quality: a table of answers in, what is missing, too quick or too uniform out. Nothing is excluded silently.

The rules are few and given in words; they flag participants and exclude no one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from study.arrays import FloatArray
from study.counting import counted

if TYPE_CHECKING:
    import pandas as pd

FASTEST_S = 0.2
MANY_MISSED = 0.1
MANY_FAST = 0.1
LONG_RUN = 20
FEWEST_FOR_UNIFORM = 8


def _numbers(answers: pd.DataFrame, column: str) -> FloatArray:
    """A column as numbers; NaN where there is none."""
    import pandas as pd

    if column not in answers:
        return np.full(len(answers), np.nan)
    return pd.to_numeric(answers[column], errors="coerce").to_numpy(dtype=np.float64, na_value=np.nan)


def _longest_run(answers: list[str]) -> int:
    longest = run = 0
    previous: str | None = None
    for answer in answers:
        run = run + 1 if answer == previous else 1
        previous, longest = answer, max(longest, run)
    return longest


@dataclass(frozen=True)
class ParticipantQuality:
    """How complete and plausible the answers of one participant are.

    `shown_badly` counts answers after a display failure, `longest_run` one and the same answer,
    `false_alarms` "different" at `same_pairs`; `flags` are in words, empty where there is nothing to say.
    """

    participant: str
    simulated: bool
    trials: int
    answered: int
    missed: int
    missed_percent: float
    median_response_s: float | None
    too_fast: int
    shown_badly: int
    longest_run: int
    false_alarms: int | None
    same_pairs: int | None
    flags: str


@dataclass(frozen=True)
class Quality:
    """How complete and how plausible the answers are.

    An answer sooner than `fastest_s` seconds can't be one; `response_s` are quantiles by percent, empty where no times
    are known; `table` has one entry a participant.
    """

    participants: int
    simulated_participants: int
    trials: int
    answered: int
    missed: int
    missed_percent: float | None
    too_fast: int
    shown_badly: int
    fastest_s: float
    response_s: dict[str, float]
    flagged: int
    rules: tuple[str, ...]
    table: tuple[ParticipantQuality, ...]


def quality(answers: pd.DataFrame, fastest_s: float = FASTEST_S) -> Quality:
    """Return how complete and how plausible the answers are."""
    table = participant_table(answers, fastest_s)
    given = answers[answers["answer"].notna()]
    times = _numbers(given, "response_s")
    times = times[np.isfinite(times)]
    levels = (5, 25, 50, 75, 95)
    quantiles: list[float] = np.percentile(times, levels).tolist() if len(times) else []
    missed = len(answers) - len(given)
    return Quality(
        participants=len(table),
        simulated_participants=sum(row.simulated for row in table),
        trials=len(answers),
        answered=len(given),
        missed=missed,
        missed_percent=100 * missed / len(answers) if len(answers) else None,
        too_fast=sum(row.too_fast for row in table),
        shown_badly=sum(row.shown_badly for row in table),
        fastest_s=fastest_s,
        response_s={str(level): value for level, value in zip(levels, quantiles, strict=False)},
        flagged=sum(bool(row.flags) for row in table),
        rules=_rules(fastest_s),
        table=table,
    )


def participant_table(answers: pd.DataFrame, fastest_s: float = FASTEST_S) -> tuple[ParticipantQuality, ...]:
    """Return one row a participant."""
    if answers.empty:
        return ()
    # Arrays taken out once: a table cut apart for every participant costs ten times as much.
    columns = {name: answers[name].to_numpy() for name in _COLUMNS if name in answers.columns}
    columns["answer"] = answers["answer"].astype(object).where(answers["answer"].notna(), None).to_numpy()
    columns["response_s"] = _numbers(answers, "response_s")
    if "difference_frames" in answers.columns:
        columns["difference_frames"] = _numbers(answers, "difference_frames")
    names, person = np.unique(answers["participant"].astype(str).to_numpy(), return_inverse=True)
    parts = np.split(np.argsort(person, kind="stable"), np.cumsum(np.bincount(person))[:-1])
    return tuple(
        _row(str(name), {key: values[own] for key, values in columns.items()}, fastest_s)
        for name, own in zip(names, parts, strict=True)
    )


_COLUMNS = ("simulated", "shown_well", "task")


def _row(name: str, columns: dict[str, NDArray[Any]], fastest_s: float) -> ParticipantQuality:
    """One participant's answers, as arrays by column."""
    kept = np.array([answer is not None for answer in columns["answer"]], dtype=bool)
    given = {key: values[kept] for key, values in columns.items()}
    times = given["response_s"][np.isfinite(given["response_s"])]
    trials, answered = len(kept), int(kept.sum())
    false_alarms, same_pairs = _false_alarms(given)
    row = ParticipantQuality(
        participant=name,
        simulated=bool(columns["simulated"].astype(bool).any()) if "simulated" in columns else False,
        trials=trials,
        answered=answered,
        missed=trials - answered,
        missed_percent=100 * (trials - answered) / trials,
        median_response_s=float(np.median(times)) if len(times) else None,
        too_fast=int((times < fastest_s).sum()),
        shown_badly=int((~given["shown_well"].astype(bool)).sum()) if "shown_well" in given else 0,
        longest_run=_longest_run([str(answer) for answer in given["answer"]]),
        false_alarms=false_alarms,
        same_pairs=same_pairs,
        flags="",
    )
    return replace(row, flags="; ".join(_flags(row, given, fastest_s)))


def _false_alarms(given: dict[str, NDArray[Any]]) -> tuple[int, int] | tuple[None, None]:
    if "difference_frames" not in given:
        return None, None
    same = given["difference_frames"] == 0
    if "task" in given:
        same &= given["task"] == "same-different"
    return int((given["answer"][same] == "different").sum()), int(same.sum())


def _flags(row: ParticipantQuality, given: dict[str, NDArray[Any]], fastest_s: float) -> list[str]:
    flags = []
    if row.missed > MANY_MISSED * row.trials:
        flags.append(f"missed {row.missed} of {row.trials}")
    if row.too_fast > MANY_FAST * max(row.answered, 1):
        flags.append(f"{counted(row.too_fast, 'answer')} sooner than {fastest_s:g} s")
    if row.longest_run >= LONG_RUN:
        flags.append(f"{row.longest_run} times the same answer in a row")
    tasks = given["task"] if "task" in given else np.full(len(given["answer"]), "answers")
    for task in sorted(set(tasks)):
        answers = given["answer"][tasks == task]
        if len(answers) >= FEWEST_FOR_UNIFORM and len(set(answers)) == 1:
            flags.append(f'always "{answers[0]}" ({task})')
    return flags


def _rules(fastest_s: float) -> tuple[str, ...]:
    return (
        f"no response in more than {100 * MANY_MISSED:g}% of the trials",
        f"more than {100 * MANY_FAST:g}% of the answers sooner than {fastest_s:g} s",
        f"the same answer {LONG_RUN} times in a row or more",
        "the same answer throughout a task",
    )
