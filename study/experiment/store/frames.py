"""Tables of answers: one row an answer, for the analysis and for other programs (CSV, Parquet)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import sqlalchemy as sa

from study.errors import SessionError
from study.experiment.protocol.texts import FormField
from study.experiment.store.responses import Responses, rows_of
from study.experiment.store.tables import answer_stimuli, answers, form_values, sessions
from study.experiment.store.variables import ANSWERS, EXPORTED, form_columns
from study.files import whole_file, write_whole
from study.spreadsheets import safe_table
from study.tasks.answer import CONFIDENCE
from study.tasks.trial import PLACES

if TYPE_CHECKING:
    import pandas as pd

Blends = Mapping[str, tuple[int, float]]
"""Blend lengths by stimulus, in frames and in seconds (`Manifest.blends`)."""

ROLES = ("trial", "practice", "check")
ANSWER_COLUMNS = tuple(ANSWERS)
"""The seam with the analysis: one row an answer."""


def answers_frame(
    responses: Responses,
    *,
    all_attempts: bool = False,
    roles: Sequence[str] = ("trial",),
    protocol_sha256: str | None = None,
) -> pd.DataFrame:
    """All answers as one table, one row an answer, in `ANSWER_COLUMNS`.

    Parameters
    ----------
    roles
        Which trials: `trial`, and where asked for `practice` and `check`, which no analysis counts.
    all_attempts
        With it every showing of a trial; without, the last one of each.
    protocol_sha256
        Which protocol's answers, where a database was merged from several.

    Raises
    ------
    SessionError
        Where answers under different protocols would be mixed.
    """
    import pandas as pd

    query = sa.select(answers, sessions.c.participant, sessions.c.simulated, sessions.c.protocol_sha256).join(
        sessions, answers.c.session_id == sessions.c.id
    )
    for slot, place in enumerate(PLACES[2:3], start=3):  # the table of answers itself has two
        own = answer_stimuli.alias(place)
        same = [own.c[name] == answers.c[name] for name in ("session_id", "trial", "item", "attempt")]
        query = query.outerjoin(own, sa.and_(*same, own.c.slot == slot))
        query = query.add_columns(sa.func.coalesce(own.c.stimulus, "").label(place))
    if protocol_sha256 is not None:
        query = query.where(sessions.c.protocol_sha256 == protocol_sha256)
    query = query.where(answers.c.role.in_(roles))
    rows = rows_of(responses, query.order_by(answers.c.session_id, answers.c.id))
    hashes = sorted({row["protocol_sha256"] for row in rows})
    if len(hashes) > 1:
        raise SessionError(
            f"{responses.place}: expected answers under one protocol, found {len(hashes)}: "
            f"{', '.join(sha256[:12] for sha256 in hashes)}. Say which one by its sha256."
        )
    table = pd.DataFrame(_by_slider(responses, rows), columns=[*ANSWER_COLUMNS, "session_id"])
    # How sure somebody was stands beside the answer that it is about.
    showing = pd.MultiIndex.from_frame(table[["session_id", "trial", "attempt"]])
    about = table["item"] == CONFIDENCE
    sure = pd.Series(pd.to_numeric(table["answer"][about]).to_numpy(), showing[about], dtype="Int64")
    table["confidence"] = sure.reindex(showing).to_numpy()
    table = table[~about]
    if not all_attempts:
        table = table.drop_duplicates(["session_id", "trial", "item", "slot"], keep="last")
    table["answered_at"] = [at.isoformat() for at in table["answered_at"]]
    # Answers without a meaning (missed, another task) stay empty rather than false.
    for column in ("reference_first", "a_first", "correct", "chose_a"):
        table[column] = table[column].astype("boolean")
    for column in ("simulated", "missed", "shown_well"):
        table[column] = table[column].astype(bool)
    for column in ("difference_frames", "confidence", "slot"):
        table[column] = table[column].astype("Int64")
    table["response_s"] = table["response_s"].astype(float)
    return table[list(ANSWER_COLUMNS)].reset_index(drop=True)


def _by_slider(responses: Responses, rows: Sequence[sa.RowMapping]) -> list[dict[str, Any]]:
    """A row for each slider of a trial that has several, with the method and the film that were rated there."""
    key = ("session_id", "trial", "item", "attempt")
    films: dict[tuple[Any, ...], list[Any]] = {}
    if any(" " in (row["answer"] or "") for row in rows):
        for film in rows_of(responses, sa.select(answer_stimuli).order_by(answer_stimuli.c.slot)):
            films.setdefault(tuple(film[name] for name in key), []).append(film)
    found: list[dict[str, Any]] = []
    for row in rows:
        values = (row["answer"] or "").split(" ")
        if len(values) < 2:
            found.append(dict(row))
            continue
        for value, film in zip(values, films[tuple(row[name] for name in key)], strict=True):
            own = {"answer": value, "slot": film["slot"], "method_a": film["method"], "first": film["stimulus"]}
            found.append({**row, **own, "method_b": "", "second": "", "third": ""})
    return found


def with_blends(table: pd.DataFrame, blends: Blends) -> pd.DataFrame:
    """A table of answers, and how long the blends of their stimuli were (`variables.BLENDS`)."""
    import pandas as pd

    columns: dict[str, pd.api.extensions.ExtensionArray] = {}
    for place in PLACES[:3]:
        found = [blends.get(stimulus, (pd.NA, float("nan"))) for stimulus in table[place]]
        columns[f"{place}_blend_frames"] = pd.array([frames for frames, _ in found], dtype="Int64")
        columns[f"{place}_blend_s"] = pd.array([seconds for _, seconds in found], dtype="float64")
    return table.assign(**columns)


def form_given(responses: Responses) -> dict[tuple[str, str], str]:
    """What was filled into the form, by participant and question."""
    query = sa.select(sessions.c.participant, form_values.c.name, form_values.c.value)
    rows = rows_of(responses, query.join(form_values, form_values.c.session_id == sessions.c.id))
    return {(row["participant"], row["name"]): row["value"] for row in rows}


def with_form(table: pd.DataFrame, responses: Responses, form: Mapping[str, FormField]) -> pd.DataFrame:
    """A table with a participant in each row, and what they filled into the form (`variables.form_columns`)."""
    import pandas as pd

    said, columns = form_given(responses), {}
    for name, field in form.items():
        values = pd.Series([said.get((person, name)) for person in table["participant"]], table.index, dtype="str")
        columns[f"form_{name}"] = pd.to_numeric(values, errors="coerce") if field.kind == "number" else values
    return table.assign(**columns)


def exported_frame(responses: Responses, blends: Blends, form: Mapping[str, FormField]) -> pd.DataFrame:
    """All answers for other programs, every showing and every role: `variables.EXPORTED`, then `form_columns`."""
    table = with_blends(answers_frame(responses, all_attempts=True, roles=ROLES), blends)
    return safe_table(with_form(table, responses, form))


def answers_csv(responses: Responses, blends: Blends, form: Mapping[str, FormField]) -> str:
    """All answers as CSV (ISO times, empty where nothing is meant)."""
    return str(exported_frame(responses, blends, form).to_csv(index=False))


def export_csv(responses: Responses, path: str | Path, blends: Blends, form: Mapping[str, FormField]) -> Path:
    """Write `answers_csv` to a file, and what its columns mean beside it (`dictionary_beside`)."""
    write_whole(path, answers_csv(responses, blends, form))
    columns = {**EXPORTED, **form_columns(form)}
    entries = {name: {**one.entry(), "Type": one.kind} for name, one in columns.items()}
    write_whole(dictionary_beside(path), json.dumps(entries, indent=2, ensure_ascii=False) + "\n")
    return Path(path)


def dictionary_beside(path: str | Path) -> Path:
    """Where the meaning of a table's columns stands: `answers_columns.json` beside `answers.csv`."""
    return Path(path).with_name(f"{Path(path).stem}_columns.json")


def export_parquet(responses: Responses, path: str | Path, blends: Blends, form: Mapping[str, FormField]) -> Path:
    """Write all answers as Parquet, with the meaning and unit of each column in the metadata of its field.

    Whole numbers, other numbers, truth values and times (UTC) keep their types.

    Raises
    ------
    SessionError
        Where the extra `parquet` is not installed.
    """
    try:
        from arro3 import core, io
    except ImportError as error:
        raise SessionError(
            f"Expected what writes Parquet, found none ({error}); install it: pip install arro3-core arro3-io."
        ) from error
    table = exported_frame(responses, blends, form).replace("", None)
    kinds = {"b": core.DataType.bool(), "i": core.DataType.int64(), "f": core.DataType.float64()}
    fields, columns = [], []
    for name, variable in {**EXPORTED, **form_columns(form)}.items():
        given_as = stored_as = kinds.get(table[name].dtype.kind, core.DataType.utf8())
        values = [None if missing else value for value, missing in zip(table[name], table[name].isna(), strict=True)]
        if variable.kind == "time":
            given_as, stored_as = core.DataType.int64(), core.DataType.timestamp("us", tz="UTC")
            values = [round(datetime.fromisoformat(str(value)).timestamp() * 1e6) for value in values]
        columns.append(core.Array(values, given_as).cast(stored_as))
        entry = {key: value if isinstance(value, str) else json.dumps(value) for key, value in variable.entry().items()}
        fields.append(core.Field(name, stored_as, metadata=entry))
    with whole_file(path) as unfinished:
        io.write_parquet(core.Table.from_arrays(columns, schema=core.Schema(fields)), unfinished)
    return Path(path)
