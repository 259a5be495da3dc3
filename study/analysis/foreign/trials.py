"""Answers that another program wrote: its table and the names of its columns in, one row a trial in our terms out.

PsychoPy, jsPsych and Gorilla write one row a screen or a trial, with blanks where a column says nothing, and each its
own words for right and wrong. Nothing is guessed: a word that can't be understood is refused with its row. Tasks with a
stimulus level here; preferences and ratings in `foreign_answers`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from study.analysis.foreign.columns import Columns, Foreign, column, few, named, numbers, row_of, taken
from study.analysis.foreign.words import NO, YES
from study.counting import counted
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

TASKS = ("2afc", "yes-no", "same-different")
MOST_ANSWERS = 1_000_000


def read_trials(table: pd.DataFrame, columns: Columns, task: str) -> Foreign:
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
    table = taken(table, columns.where)
    level = numbers(column(table, columns.level, "stimulus level"), columns.level, "stimulus level", columns.decimal)
    answer = column(table, columns.answer, "answer")
    placed, given = level.notna(), level.notna() & (answer != "")
    if not given.any():
        raise AnalysisError(
            f"expected rows with a {columns.level} and an {columns.answer}, found none in "
            f"{counted(rows, 'row')}; check the columns' names and --where"
        )
    yes, shown = _answers(table, answer[given], columns, task)
    who = named(table[given], columns, given[given])
    result = pd.DataFrame({"participant": who, "level": level[given], "yes": yes, "shown": shown})
    if columns.order:
        result["order"] = column(table, columns.order, "order of a pair")[given]
    if columns.motion:
        result["motion"] = column(table, columns.motion, "motion")[given]
    if columns.condition:
        result["condition"] = column(table, columns.condition, "condition")[given]
    missed = int((placed & ~given).sum())
    return Foreign(result.reset_index(drop=True), rows, len(result), int((~placed).sum()), missed)


def _answers(
    table: pd.DataFrame, answer: pd.Series[str], columns: Columns, task: str
) -> tuple[pd.Series[float], pd.Series[float]]:
    """Answers “yes”, and all answers, of every row."""
    if columns.shown is None:
        yes = _understood(answer, columns, task)
        return yes, yes * 0 + 1
    shown = numbers(column(table, columns.shown, "number of answers"), columns.shown, "number of answers", "point")
    shown = shown.reindex(answer.index).fillna(0.0)
    count = numbers(answer, columns.answer, "number of answers “yes”")
    wrong = answer[(count < 0) | (count > shown)]
    if len(wrong):
        raise AnalysisError(
            f"row {row_of(wrong)}: expected at most {columns.shown} answers, found {wrong.iloc[0]} of "
            f"{shown[wrong.index[0]]:g}"
        )
    parts = answer[(count % 1 != 0) | (shown % 1 != 0)]
    if len(parts):
        raise AnalysisError(
            f"row {row_of(parts)}: expected whole numbers of answers, found {count[parts.index[0]]:g} of "
            f"{shown[parts.index[0]]:g}; give counts, not shares or means"
        )
    if shown.sum() > MOST_ANSWERS:
        raise AnalysisError(
            f"expected at most {MOST_ANSWERS:,} answers in all, found {shown.sum():,.0f}; check --shown"
        )
    return count, shown


def _understood(answer: pd.Series[str], columns: Columns, task: str) -> pd.Series[float]:
    """Ones and zeros from words."""
    text = answer.str.lower().str.replace(r"\.0+$", "", regex=True)
    if columns.yes:
        words = {word.strip().lower() for word in columns.yes}
        found = text.isin(words)
        if not found.any():
            seen = few(answer)
            raise AnalysisError(
                f"column {columns.answer!r}: expected answers {' or '.join(columns.yes)}, found only {seen}; name with "
                "--yes what counts as right, yes or different"
            )
        return found.astype(float)
    right, wrong = YES[task].split(), NO[task].split()
    strange = answer[~text.isin([*right, *wrong])]
    if len(strange):
        counts_as = {"2afc": "right", "yes-no": "yes"}.get(task, "different")
        raise AnalysisError(
            f"row {row_of(strange)}, column {columns.answer!r}: expected {right[0]} or {wrong[0]} (or such "
            f"words), found {strange.iloc[0]!r}; say with --yes which of {few(answer)} counts as {counts_as}"
        )
    return text.isin(right).astype(float)
