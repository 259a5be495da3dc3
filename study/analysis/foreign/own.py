"""Answers that Segue exported: a table of texts known by its columns in, one row an answer as the analysis takes it.

Practice and checks are left out, and all showings of a trial but the last.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from study.analysis.foreign.columns import Foreign, taken

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

KNOWN_BY = frozenset({"participant", "study", "task", "trial", "answer", "missed", "role", "motion"})
"""Columns that together no other program's table has."""

NUMBERS = ("trial", "attempt", "repeat", "difference_frames", "chose_a", "response_s")
WORDS = {"true": True, "false": False}


def is_own(table: pd.DataFrame) -> bool:
    """Return whether a table is an export of Segue's."""
    return set(table.columns) >= KNOWN_BY


def read_own(table: pd.DataFrame, where: Sequence[tuple[str, str]] = ()) -> Foreign:
    """Return the answers of all studies in an export.

    Parameters
    ----------
    table
        All cells texts.
    where
        Columns, and the value that a row must hold there.

    Raises
    ------
    AnalysisError
        When no row holds these values.
    """
    import pandas as pd

    chosen = taken(table, where)
    found = own_trials(chosen).replace("", None)
    for column in found.columns:
        text = found[column].str.lower()
        if column in NUMBERS:
            found[column] = pd.to_numeric(text.replace({"true": "1", "false": "0"}), errors="coerce")
        elif text.notna().any() and text.dropna().isin(list(WORDS)).all():
            found[column] = text.map(WORDS)
    found.loc[found["missed"].eq(True), "answer"] = None
    given = int(found["answer"].notna().sum())
    return Foreign(found.reset_index(drop=True), len(table), given, len(chosen) - len(found), len(found) - given)


def own_trials(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of an export that count: no practice and no checks, and of each trial the last showing."""
    keys = [name for name in ("participant", "study", "trial", "item") if name in table.columns]
    return table[table["role"] == "trial"].drop_duplicates(keys, keep="last")
