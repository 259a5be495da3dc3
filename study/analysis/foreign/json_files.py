"""Trials as jsPsych and lab.js write them in JSON: text in, a table of texts out.

A file holds one list of trials, or several one after the other, as JATOS puts the results of participants into one
file, or one trial a line. Lists may be in objects under a name such as `trials` or `data`.
"""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

HOLDERS = ("trials", "data", "results")


def looks_like_json(text: str) -> bool:
    """Return whether a text begins as JSON does, and not as a table whose first heading has a bracket."""
    return re.match(r'\s*(\[\s*["\[{\]]|\{\s*["}])', text) is not None


def parse_json(text: str) -> pd.DataFrame:
    """Return one row a trial, all cells as text: objects and lists as JSON, nothing where a trial has no such key.

    Returns
    -------
    DataFrame
        Indexed from -1, so that messages, which count a heading in, call the first trial row 1.

    Raises
    ------
    AnalysisError
        When the text is not JSON, or holds no trials.
    """
    import pandas as pd

    trials = [trial for value in _values(text) for trial in _trials(value)]
    if not trials:
        raise AnalysisError(
            "expected trials, found JSON without a list of objects; export the data as CSV, or as a list of trials"
        )
    names = list(dict.fromkeys(str(name) for trial in trials for name in trial))
    rows = [[_cell(trial.get(name)) for name in names] for trial in trials]
    return pd.DataFrame(rows, columns=names, index=range(-1, len(rows) - 1), dtype=str)


def _values(text: str) -> list[Any]:
    """All values of a text that holds one after the other."""
    decoder, found, at = json.JSONDecoder(), [], 0
    while (at := _next(text, at)) < len(text):
        try:
            value, at = decoder.raw_decode(text, at)
        except ValueError as error:
            place = f"line {text.count(chr(10), 0, at) + 1}"
            raise AnalysisError(
                f"{place}: expected JSON, found what can't be read as such: {error}; export the data again, or as CSV"
            ) from error
        except RecursionError:
            raise AnalysisError("expected a list of trials, found JSON that is nested too deeply") from None
        found.append(value)
    return found


def _next(text: str, at: int) -> int:
    while at < len(text) and text[at] in " \t\r\n,\ufeff":
        at += 1
    return at


def _trials(value: Any) -> list[dict[str, Any]]:
    """The trials in a value: the objects of a list, or of the list that an object holds under a usual name."""
    if isinstance(value, str) and value.lstrip()[:1] in ("[", "{"):
        return [trial for inner in _values(value) for trial in _trials(inner)]
    if isinstance(value, list):
        return [trial for item in value for trial in ([item] if isinstance(item, dict) else _trials(item))]
    if not isinstance(value, dict):
        return []
    return next((_trials(value[name]) for name in HOLDERS if isinstance(value.get(name), list)), [value])


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return value.strip() if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
