"""The documentation explains every column of an export, in the words of its data dictionary."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from study.experiment.store.variables import EXPORTED, PARTICIPANTS, PRESENTATIONS, SHARED, SHOWN_TO, STIMULI, Variable

PAGE = Path(__file__).parents[3] / "docs" / "exporting.md"


@pytest.mark.parametrize("columns", [EXPORTED, SHARED, PRESENTATIONS, STIMULI, PARTICIPANTS | SHOWN_TO])
def test_every_column_stands_in_the_documentation(columns: Mapping[str, Variable]) -> None:
    page = PAGE.read_text(encoding="utf-8").splitlines()
    missing = [line for name, one in columns.items() if (line := one.line(name)) not in page]
    assert not missing, "put these lines into docs/exporting.md:\n" + "\n".join(missing)
