"""Preferences and ratings that another program wrote: its table and the names of its columns in, our answers out.

The result goes through `summary.analyse` as our own answers do.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from study.analysis.foreign.columns import Columns, Foreign, column, few, named, numbers, row_of, taken
from study.analysis.foreign.words import FIRST, SECOND
from study.counting import counted
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

# Numbers that questionnaires write where there is no answer.
CODES = (-9.0, -99.0, -999.0, 99.0, 999.0, 9999.0)


def read_preferences(table: pd.DataFrame, columns: Columns) -> Foreign:
    """Return preferences between methods.

    Parameters
    ----------
    table
        All cells texts, as `foreign_text.parse_table` gives it.
    columns
        Which column is what; `first` and `second` are needed.

    Notes
    -----
    Of each pair, the method that the file names first is the one whose percentage is given.

    Raises
    ------
    AnalysisError
        When a column is missing, a row compares a method with itself, or an answer can't be understood.
    """
    if columns.first is None or columns.second is None:
        raise AnalysisError("expected --first and --second, the columns of the methods that were shown")
    rows = len(table)
    table = taken(table, columns.where)
    first, second = column(table, columns.first, "method shown first"), column(table, columns.second, "method second")
    shown = (first != "") & (second != "")
    first, second, table = first[shown], second[shown], table[shown]
    answer = column(table, columns.answer, "answer")
    alone = first[first == second]
    if len(alone):
        raise AnalysisError(f"row {row_of(alone)}: expected two methods, found {alone.iloc[0]!r} twice")
    if not (answer != "").any():
        raise _nothing(f"{columns.first}, {columns.second} and {columns.answer}", rows)
    ranks = {name: place for place, name in enumerate(dict.fromkeys([*first, *second]))}
    a_first = np.array([ranks[one] < ranks[other] for one, other in zip(first, second, strict=True)])
    chose_first = _chose_first(answer, first, second, columns)
    found = _common(table, columns, "preference", answer)
    found["method_a"], found["method_b"] = np.where(a_first, first, second), np.where(a_first, second, first)
    found["a_first"] = a_first
    found["chose_a"] = np.where(a_first, chose_first, 1 - chose_first)
    return _counted(found, rows, found["chose_a"].notna())


def _chose_first(answer: pd.Series[str], first: pd.Series[str], second: pd.Series[str], columns: Columns) -> np.ndarray:
    """1 where the first was chosen, 0 where the second, one half for a tie, NaN where nothing was."""
    text = answer.str.lower().str.replace(r"\.0+$", "", regex=True)
    yes, tie = ([word.strip().lower() for word in words] for words in (columns.yes, columns.tie))
    found = np.full(len(text), np.nan)
    ties = text.isin(tie) & (text != "")
    if yes:
        # Whatever is not named as the first is the second: more than one other word would be a guess.
        others = sorted(set(text[(text != "") & ~ties]) - set(yes))
        if len(others) > 1 or not text.isin(yes).any():
            raise AnalysisError(
                f"column {columns.answer!r}: expected answers {' or '.join(columns.yes)} and one other, found "
                f"{few(answer[answer != ''])}; name with --yes what counts as the first, with --tie what as neither"
            )
        one, other = text.isin(yes), text.isin(others)
    else:
        one = text.isin(FIRST.split()) | (text == first.str.lower())
        other = text.isin(SECOND.split()) | (text == second.str.lower())
    found[one.to_numpy()], found[other.to_numpy()], found[ties.to_numpy()] = 1.0, 0.0, 0.5
    strange = answer[(text != "") & np.isnan(found)]
    if len(strange):
        raise AnalysisError(
            f"row {row_of(strange)}, column {columns.answer!r}: expected first or second, or the method chosen, found "
            f"{strange.iloc[0]!r}; say with --yes what counts as the first, with --tie what as neither"
        )
    return found


def read_ratings(table: pd.DataFrame, columns: Columns) -> Foreign:
    """Return ratings of methods.

    Parameters
    ----------
    table
        All cells texts, as `foreign_text.parse_table` gives it.
    columns
        Which column is what; all ratings are of one method where `method` is None.

    Raises
    ------
    AnalysisError
        When a column is missing, or a rating is no number and no word of the scale, or lies off the scale.
    """
    rows = len(table)
    table = taken(table, columns.where)
    if columns.method is not None:
        table = table[column(table, columns.method, "method") != ""]
    answer = column(table, columns.answer, "rating")
    rating = _ratings(answer, columns)
    if not rating.notna().any():
        raise _nothing(columns.answer, rows)
    found = _common(table, columns, "rating", answer)
    found["answer"] = rating.astype(object).where(rating.notna(), None)
    found["method_a"] = column(table, columns.method, "method") if columns.method else "all"
    if columns.item:
        found["item"] = column(table, columns.item, "question")
    return _counted(found, rows, rating.notna())


def _ratings(answer: pd.Series[str], columns: Columns) -> pd.Series[float]:
    """Points of the scale, from numbers or from the words that stand for them."""
    points = {word.strip().lower(): f"{point:g}" for word, point in columns.scale}
    text = answer.str.lower().map(points).fillna(answer) if points else answer
    first = text[text.str.contains(r"[^\W\d_]") & ~text.str.fullmatch(r"[-+]?[\d.,]+[eE][-+]?\d+")]
    if len(first):
        words = sorted(set(first))
        asked = " ".join(f'--scale "{word}=..."' for word in words[:12])
        raise AnalysisError(
            f"row {row_of(first)}, column {columns.answer!r}: expected a number as the rating, found "
            f"{first.iloc[0]!r}; give each word its point of the scale: {asked}, or take other rows with --where"
        )
    rating = numbers(text, columns.answer, "rating", columns.decimal)
    _refuse_off_scale(answer, rating, columns)
    return rating


def _refuse_off_scale(answer: pd.Series[str], rating: pd.Series[float], columns: Columns) -> None:
    """Ratings outside the ends that were given; else codes for no answer that lie far from all others."""
    if columns.ends is not None:
        low, high = columns.ends
        if off := list(rating.index[(rating < low) | (rating > high)]):
            raise AnalysisError(
                f"row {row_of(answer[off])}, column {columns.answer!r}: expected ratings of {low:g} to {high:g}, found "
                f"{answer[off[0]]!r}; correct it, or take other rows with --where"
            )
        return
    others = rating[rating.notna() & ~rating.isin(CODES)]
    far = (rating > 5 * others.max()) | ((rating < 0) & (others.min() >= 0))
    row = answer[rating.isin(CODES) & far]
    if len(row):
        raise AnalysisError(
            f"row {row_of(row)}, column {columns.answer!r}: expected ratings like the others ({others.min():g} to "
            f"{others.max():g}), found {row.iloc[0]!r}, which looks like a code for no answer; empty such cells, or "
            "say with --ends what the scale's lowest and highest points are"
        )


def _common(table: pd.DataFrame, columns: Columns, task: str, answer: pd.Series[str]) -> pd.DataFrame:
    """What both tasks have: who answered what, in the file's order."""
    import pandas as pd

    found = pd.DataFrame({"participant": named(table, columns, answer != ""), "task": task, "study": task})
    found["trial"] = np.arange(1, len(found) + 1)
    found["answer"] = answer.astype(object).where(answer != "", None)
    if columns.motion:
        found["motion"] = column(table, columns.motion, "motion")
    return found


def _counted(found: pd.DataFrame, rows: int, given: pd.Series[bool]) -> Foreign:
    used = int(given.sum())
    return Foreign(found.reset_index(drop=True), rows, used, rows - len(found), len(found) - used)


def _nothing(names: str, rows: int) -> AnalysisError:
    return AnalysisError(
        f"expected rows with {names}, found none in {counted(rows, 'row')}; check the columns' names and --where"
    )
