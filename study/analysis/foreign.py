"""Answers that another program wrote: its table and the names of its columns in, one row a trial in our terms out.

PsychoPy, jsPsych and Gorilla write one row a screen or a trial, with blanks where a column says nothing, and each its
own words for right and wrong. Nothing is guessed: a word that can't be understood is refused with its row.
"""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

TASKS = ("2afc", "yes-no", "same-different")
YES = {
    "2afc": ("1", "true", "correct", "right", "yes", "hit"),
    "yes-no": ("1", "true", "yes", "y", "seen", "present"),
    "same-different": ("different", "d", "diff", "1", "true"),
}
NO = {
    "2afc": ("0", "false", "incorrect", "wrong", "no", "miss"),
    "yes-no": ("0", "false", "no", "n", "unseen", "absent"),
    "same-different": ("same", "s", "0", "false"),
}
BLANK = ("", "nan", "none", "null", "na", "n/a")


@dataclass(frozen=True)
class Columns:
    """Names of columns in another program's table.

    Attributes
    ----------
    level
        Stimulus level; signed difference in a same-different task.
    answer
        Right or wrong (2AFC), yes or no, same or different; the number of such answers where `shown` is given.
    shown
        Number of answers a row stands for; one a row where None.
    participant
        Who answered; one participant where None.
    order
        Which of a pair came first (same-different); not known where None.
    yes
        What counts as right, yes or different; the usual words where empty.
    where
        Rows to take: pairs of column and value.
    """

    level: str
    answer: str
    shown: str | None = None
    participant: str | None = None
    order: str | None = None
    yes: tuple[str, ...] = ()
    where: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, eq=False)
class Trials:
    """What was read.

    Attributes
    ----------
    table
        Columns `participant` (str), `level`, `yes`, `shown` (floats), and `order` (str) where it is known.
    rows, used, blank, missed
        Rows of the file, rows used, rows without a level (instructions, breaks), rows with a level and no answer.
    """

    table: pd.DataFrame
    rows: int
    used: int
    blank: int
    missed: int


def _column(table: pd.DataFrame, name: str, means: str) -> pd.Series[str]:
    """One column as trimmed text."""
    if name not in table.columns:
        near = difflib.get_close_matches(name, [str(column) for column in table.columns], n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}?" if near else "name one of them"
        there = ", ".join(str(column) for column in table.columns[:30])
        raise AnalysisError(f"expected a column {name!r} for the {means}, found {there}; {hint}")
    text = table[name].fillna("").astype(str).str.strip()
    return text.where(~text.str.lower().isin(BLANK), "")


def _numbers(text: pd.Series[str], name: str, means: str) -> pd.Series[float]:
    import pandas as pd

    numbers = pd.to_numeric(text.where(text != ""), errors="coerce")
    strange = text[(text != "") & numbers.isna()]
    if len(strange):
        raise AnalysisError(
            f"row {_row(strange)}, column {name!r}: expected a number as the {means}, found {strange.iloc[0]!r}; "
            "correct it, or take other rows with --where"
        )
    return numbers.astype(float)


def _row(chosen: pd.Series[str]) -> int:
    """The first row's line in the file; the heading is line 1."""
    return int(str(chosen.index[0])) + 2


def read_trials(table: pd.DataFrame, columns: Columns, task: str) -> Trials:
    """Return another program's table in our terms.

    Parameters
    ----------
    table
        As read from a file, rows numbered from 0; texts or numbers.
    columns
        Which column is what.
    task
        "2afc", "yes-no" or "same-different".

    Raises
    ------
    AnalysisError
        When a column is missing, or a cell can't be understood.
    """
    import pandas as pd

    if task not in TASKS:
        raise AnalysisError(f"expected one of the tasks {', '.join(TASKS)}, found {task!r}")
    rows = len(table)
    for name, value in columns.where:
        matches = _column(table, name, "rows to take").str.lower() == value.strip().lower()
        if not matches.any():
            seen = ", ".join(sorted(set(_column(table, name, "rows to take")))[:12])
            raise AnalysisError(f"expected rows with {name} = {value}, found none; {name} holds {seen}")
        table = table[matches]
    level = _numbers(_column(table, columns.level, "stimulus level"), columns.level, "stimulus level")
    answer = _column(table, columns.answer, "answer")
    placed, given = level.notna(), level.notna() & (answer != "")
    if not given.any():
        raise AnalysisError(
            f"expected rows with a {columns.level} and an {columns.answer}, found none in {rows} rows; check the "
            "columns' names and --where"
        )
    yes, shown = _answers(table, answer[given], columns, task)
    who = _column(table, columns.participant, "participant")[given] if columns.participant else "participant"
    result = pd.DataFrame({"participant": who, "level": level[given], "yes": yes, "shown": shown})
    if columns.order:
        result["order"] = _column(table, columns.order, "order of a pair")[given]
    missed = int((placed & ~given).sum())
    return Trials(result.reset_index(drop=True), rows, len(result), int((~placed).sum()), missed)


def _answers(
    table: pd.DataFrame, answer: pd.Series[str], columns: Columns, task: str
) -> tuple[pd.Series[float], pd.Series[float]]:
    """Answers “yes”, and all answers, of every row."""
    if columns.shown is None:
        yes = _understood(answer, columns, task)
        return yes, yes * 0 + 1
    shown = _numbers(_column(table, columns.shown, "number of answers"), columns.shown, "number of answers")
    shown = shown.reindex(answer.index).fillna(0.0)
    count = _numbers(answer, columns.answer, "number of answers “yes”")
    wrong = answer[(count < 0) | (count > shown)]
    if len(wrong):
        raise AnalysisError(
            f"row {_row(wrong)}: expected at most {columns.shown} answers, found {wrong.iloc[0]} of "
            f"{shown[wrong.index[0]]:g}"
        )
    return count, shown


def _understood(answer: pd.Series[str], columns: Columns, task: str) -> pd.Series[float]:
    """Ones and zeros from words."""
    text = answer.str.lower().str.replace(r"\.0+$", "", regex=True)
    if columns.yes:
        words = {word.strip().lower() for word in columns.yes}
        found = text.isin(words)
        if not found.any():
            seen = _few(answer)
            raise AnalysisError(
                f"column {columns.answer!r}: expected answers {' or '.join(columns.yes)}, found only {seen}; name with "
                "--yes what counts as right, yes or different"
            )
        return found.astype(float)
    strange = answer[~text.isin([*YES[task], *NO[task]])]
    if len(strange):
        counts_as = {"2afc": "right", "yes-no": "yes"}.get(task, "different")
        raise AnalysisError(
            f"row {_row(strange)}, column {columns.answer!r}: expected {YES[task][0]} or {NO[task][0]} (or such "
            f"words), found {strange.iloc[0]!r}; say with --yes which of {_few(answer)} counts as {counts_as}"
        )
    return text.isin(YES[task]).astype(float)


def _few(answer: pd.Series[str]) -> str:
    values: Sequence[str] = sorted(set(answer))
    return ", ".join(repr(value) for value in values[:8]) + (" ..." if len(values) > 8 else "")
