"""Columns of another program's table: a table of texts and a name in; texts, numbers and chosen rows out."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from study.analysis.estimates import LARGEST
from study.analysis.foreign.words import BLANK
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

SMALLEST = 1e-12


@dataclass(frozen=True)
class Columns:
    """Names of columns in another program's table; what a task does not have stays None or empty."""

    answer: str
    """What was answered: right or wrong, yes or no, same or different, first or second (or the method chosen), a
    rating; the number of such answers where `shown` is given."""
    participant: str | None = None
    """Who answered; one participant where None."""
    level: str = ""
    """Stimulus level; the signed difference in a same-different task."""
    shown: str | None = None
    """Number of answers that a row stands for; one a row where None."""
    order: str | None = None
    """Which of a pair came first (same-different); not known where None."""
    first: str | None = None
    second: str | None = None
    """`first`, `second`: preference: the methods shown first and second (or left and right)."""
    method: str | None = None
    """Rating: the method that was rated."""
    motion: str | None = None
    item: str | None = None
    condition: str | None = None
    """`motion`, `item`, `condition`: the motion, the question of a rating, and what is compared (tasks with a stimulus
    level); not known where None."""
    yes: tuple[str, ...] = ()
    """What counts as right, yes, different or the first; the usual words where empty."""
    tie: tuple[str, ...] = ()
    """Preference: what counts as neither; nothing where empty."""
    where: tuple[tuple[str, str], ...] = ()
    """Rows to take: pairs of column and value."""
    decimal: str | None = None
    """Either "point" or "comma" in numbers; found out where None."""
    scale: tuple[tuple[str, float], ...] = ()
    """Rating: the points that words stand for, pairs of a word and a number."""
    ends: tuple[float, float] | None = None
    """Rating: the lowest and the highest point of the scale; not known where None."""


@dataclass(frozen=True, eq=False)
class Foreign:
    """What was read of another program's table."""

    table: pd.DataFrame
    """In our terms. Of tasks with a stimulus level: `participant` (str), `level`, `yes`, `shown` (floats), and `order`
    (str) where it is known. Else a table of answers, trials without a response among them."""
    rows: int
    used: int
    blank: int
    missed: int
    """`rows`, `used`, `blank`, `missed`: rows of the file, rows used, rows without a stimulus (instructions, breaks),
    rows with one and no answer."""


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


def named(table: pd.DataFrame, columns: Columns, answered: pd.Series[bool]) -> pd.Series[str]:
    """Return who answered in each row; "participant" where no column says so.

    Raises
    ------
    AnalysisError
        When a row that was answered has no participant.
    """
    import pandas as pd

    if columns.participant is None:
        return pd.Series("participant", index=table.index)
    who = column(table, columns.participant, "participant")
    nobody = who[(who == "") & answered]
    if len(nobody):
        raise AnalysisError(
            f"row {row_of(nobody)}, column {columns.participant!r}: expected a participant, found nothing"
        )
    return who


def row_of(chosen: pd.Series[str]) -> int:
    """The first row's line in the file; the heading is line 1."""
    return int(str(chosen.index[0])) + 2


def few(answer: pd.Series[str]) -> str:
    """Return a column's different values, the first eight of them."""
    values: Sequence[str] = sorted(set(answer))
    return ", ".join(repr(value) for value in values[:8]) + (" ..." if len(values) > 8 else "")
