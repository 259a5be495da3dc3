"""What a report is made of: a results folder in, its protocol, stimuli, answers and presentations out."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from study.errors import AnalysisError
from study.report.power import FoundPower, read_power

if TYPE_CHECKING:
    import pandas as pd
    import sqlalchemy as sa

    from study.experiment.protocol.whole import Protocol
    from study.experiment.stimuli.manifest import Manifest
    from study.experiment.store.responses import Responses


@dataclass(frozen=True, eq=False)
class Material:
    """What a report is made of."""

    protocol: Protocol
    manifest: Manifest
    """`protocol`, `manifest`: what was asked, and what was shown."""
    answers: pd.DataFrame
    checks: pd.DataFrame
    """`answers`, `checks`: one row an answer; answers to attention checks apart."""
    sessions: pd.DataFrame
    """One row a session, those without answers too."""
    presentations: pd.DataFrame
    """One row a stimulus that was shown."""
    form: Mapping[str, tuple[str, ...]]
    """What participants with analysed answers filled in, by question of the form."""
    withdrawn: int
    """How many participants had their answers deleted."""
    power: tuple[FoundPower, ...]
    """Results of `segue power` that lie in the folder."""


def gather(folder: Path, database: str | None = None) -> Material:
    """Read a results folder; answers from another database where one is named (a file, or a URL).

    Raises
    ------
    AnalysisError
        When there are no answers yet.
    SegueError
        When a part of the folder is missing or can't be read.
    """
    from study.experiment.folder import PROTOCOL
    from study.experiment.protocol.whole import load_protocol
    from study.experiment.stimuli.manifest import read_manifest
    from study.experiment.store.frames import answers_frame
    from study.experiment.store.responses import open_answers
    from study.experiment.store.sessions import session_table
    from study.experiment.store.tables import presentations, withdrawals

    protocol, manifest = load_protocol(folder / PROTOCOL), read_manifest(folder)
    with open_answers(folder, database) as responses:
        answers = answers_frame(responses)
        material = Material(
            protocol=protocol,
            manifest=manifest,
            answers=answers,
            checks=answers_frame(responses, roles=("check",)),
            sessions=session_table(responses),
            presentations=_table(responses, presentations),
            form=_form(responses, {str(name) for name in answers["participant"]}),
            withdrawn=len(_table(responses, withdrawals)),
            power=tuple(read_power(folder)),
        )
    if material.answers.empty:
        gone = f" ({material.withdrawn} withdrawn)" if material.withdrawn else ""
        raise AnalysisError(
            f"{responses.place}: expected answers, found none{gone}; collect or simulate sessions first"
        )
    return material


def _form(responses: Responses, participants: Collection[str]) -> dict[str, tuple[str, ...]]:
    """What these participants filled in, by question."""
    from study.experiment.store.frames import form_given

    found: dict[str, tuple[str, ...]] = {}
    for (person, name), value in form_given(responses).items():
        if person in participants:
            found[name] = (*found.get(name, ()), value)
    return found


def _table(responses: Responses, table: sa.Table) -> pd.DataFrame:
    """A table without its details, which hold the times of all frames."""
    import pandas as pd
    import sqlalchemy as sa

    from study.experiment.store.responses import rows_of

    columns = [column for column in table.c if column.name != "detail_json"]
    rows = rows_of(responses, sa.select(*columns).order_by(*table.primary_key))
    return pd.DataFrame([dict(row) for row in rows], columns=[column.name for column in columns])
