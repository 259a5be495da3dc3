"""Answers that another program wrote: its table and the names of its columns in, one row a trial in our terms out.

PsychoPy, jsPsych and Gorilla write one row a screen or a trial, with blanks where a column says nothing, and each its
own words for right and wrong. Nothing is guessed: a word that can't be understood is refused with its row. Tasks with a
stimulus level here; preferences and ratings in `foreign_answers`.
"""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from study.analysis.estimates import LARGEST
from study.analysis.foreign.words import BLANK, NO, YES
from study.counting import counted
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

TASKS = ("2afc", "yes-no", "same-different")
SMALLEST, MOST_ANSWERS = 1e-12, 1_000_000


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
    decimal
        "point" or "comma"; found out where None.
    """

    level: str
    answer: str
    shown: str | None = None
    participant: str | None = None
    order: str | None = None
    yes: tuple[str, ...] = ()
    where: tuple[tuple[str, str], ...] = ()
    decimal: str | None = None


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


def column(table: pd.DataFrame, name: str, means: str) -> pd.Series[str]:
    """Return one column as trimmed text, empty where it says nothing.

    A list of one answer (PsychoPy) or an object with one (jsPsych) is that answer; `response.Q0` is the answer `Q0` of
    the objects in `response`.

    Raises
    ------
    AnalysisError
        When there is no such column, or a cell holds several answers.
    """
    whole, _, key = name.rpartition(".")
    if name not in table.columns and whole in table.columns:
        return _answers_in(_text(table, whole), whole, key)
    if name not in table.columns:
        near = difflib.get_close_matches(name, [str(there) for there in table.columns], n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}?" if near else "name one of them"
        there = ", ".join(str(there) for there in table.columns[:30])
        raise AnalysisError(f"expected a column {name!r} for the {means}, found {there}; {hint}")
    return _answers_in(_text(table, name), name, None)


def _text(table: pd.DataFrame, name: str) -> pd.Series[str]:
    text = table[name].fillna("").astype(str).str.strip()
    return text.where(~text.str.lower().isin(BLANK), "")


def _answers_in(text: pd.Series[str], name: str, key: str | None) -> pd.Series[str]:
    """Texts with lists and objects replaced by the one answer that they hold."""
    packed = text.str.startswith(("{", "["))
    if key is None and not packed.any():
        return text
    found = text.copy()
    for row in text.index[packed]:
        found.loc[row] = _one_answer(str(text.loc[row]), f"row {int(row) + 2}, column {name!r}", name, key)
    if key is not None:
        found = found.where(packed, "")
    return found.where(~found.str.lower().isin(BLANK), "")


def _one_answer(cell: str, place: str, name: str, key: str | None) -> str:
    try:
        # PsychoPy writes lists as Python does, with single quotes.
        value = json.loads(cell if cell.startswith("{") else cell.replace("'", '"'))
    except ValueError:
        return cell
    if isinstance(value, dict):
        if key is not None:
            value = value.get(key, "")
        elif len(value) > 1:
            named = " or ".join(f"{name}.{one}" for one in value)
            raise AnalysisError(f"{place}: expected one answer, found {len(value)}; name one of them: {named}")
        else:
            value = next(iter(value.values()), "")
    if isinstance(value, list):
        if len(value) > 1:
            raise AnalysisError(f"{place}: expected one answer, found {cell}; take other rows with --where")
        value = value[0] if value else ""
    return "" if value is None else str(value).strip()


def numbers(text: pd.Series[str], name: str, means: str, decimal: str | None = None) -> pd.Series[float]:
    """Return numbers from texts, NaN where these are empty.

    Parameters
    ----------
    decimal
        "point" or "comma"; found out where None.

    Raises
    ------
    AnalysisError
        When a cell holds something else, or a comma may stand for thousands as well as for decimals.
    """
    import pandas as pd

    text = text.str.replace("\u2212", "-", regex=False)
    given = text[text != ""]
    if decimal == "comma" or (decimal is None and _has_decimal_commas(given, name)):
        text = text.where(~text.str.fullmatch(_WITH_COMMA), text.str.replace(",", ".", regex=False))
    found = pd.to_numeric(text.where(text != ""), errors="coerce").astype(float)
    strange = text[(text != "") & ~found.abs().lt(float("inf"))]
    if len(strange):
        raise AnalysisError(
            f"row {row_of(strange)}, column {name!r}: expected a number as the {means}, found {strange.iloc[0]!r}; "
            "correct it, or take other rows with --where"
        )
    size = found.abs()
    unusual = text[(size > LARGEST) | ((size > 0) & (size < SMALLEST))]
    if len(unusual):
        raise AnalysisError(
            f"row {row_of(unusual)}, column {name!r}: expected a {means} between {SMALLEST:g} and {LARGEST:g} in size, "
            f"or 0, found {unusual.iloc[0]!r}; correct it, or write all in another unit"
        )
    return found


_WITH_COMMA = r"[-+]?\d*,\d+"


def _has_decimal_commas(given: pd.Series[str], name: str) -> bool:
    """Whether commas in numbers stand for decimals; refused where they may as well part thousands."""
    commas = given[given.str.fullmatch(_WITH_COMMA)]
    if not len(commas):
        return False
    points = given[given.str.fullmatch(r"[-+]?\d*\.\d+")]
    if len(points):
        raise AnalysisError(
            f"column {name!r}: expected one way to write decimals, found {commas.iloc[0]!r} in row {row_of(commas)} "
            f"and {points.iloc[0]!r} in row {row_of(points)}; write all in one way"
        )
    if all(re.fullmatch(r"[-+]?[1-9]\d{0,2},\d{3}", str(value)) for value in commas):
        raise AnalysisError(
            f"row {row_of(commas)}, column {name!r}: {commas.iloc[0]!r} may be thousands or decimals; say which with "
            "--decimal comma, or write it without the comma"
        )
    return True


def taken(table: pd.DataFrame, where: Sequence[tuple[str, str]]) -> pd.DataFrame:
    """Return the rows that hold all these values, whatever the case.

    Raises
    ------
    AnalysisError
        When there are none.
    """
    for name, value in where:
        held = column(table, name, "rows to take")
        matches = held.str.lower() == value.strip().lower()
        if not matches.any():
            seen = ", ".join(sorted(set(held))[:12])
            raise AnalysisError(f"expected rows with {name} = {value}, found none; {name} holds {seen}")
        table = table[matches]
    return table


def row_of(chosen: pd.Series[str]) -> int:
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
    who: pd.Series[str] | str = "participant"
    if columns.participant:
        who = column(table, columns.participant, "participant")[given]
        if (who == "").any():
            raise AnalysisError(
                f"row {row_of(who[who == ''])}, column {columns.participant!r}: expected who answered, found nothing"
            )
    result = pd.DataFrame({"participant": who, "level": level[given], "yes": yes, "shown": shown})
    if columns.order:
        result["order"] = column(table, columns.order, "order of a pair")[given]
    missed = int((placed & ~given).sum())
    return Trials(result.reset_index(drop=True), rows, len(result), int((~placed).sum()), missed)


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


def few(answer: pd.Series[str]) -> str:
    """Return a column's different values, the first eight of them."""
    values: Sequence[str] = sorted(set(answer))
    return ", ".join(repr(value) for value in values[:8]) + (" ..." if len(values) > 8 else "")
