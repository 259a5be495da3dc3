"""A task is whole: its answers have an analysis, every result a section of the report, and power an effect."""

from __future__ import annotations

import pytest

from study.analysis.registry import ANALYSES, analysis_of
from study.errors import AnalysisError
from study.power.registry import EFFECTS
from study.report.sections.registry import SECTIONS
from study.tasks.registry import NAMES

KINDS = [kind for analysis in ANALYSES.values() for kind in analysis.kinds]


def test_every_task_has_an_analysis_and_an_effect() -> None:
    assert set(ANALYSES) == set(EFFECTS) == set(NAMES)


def test_every_kind_of_result_has_a_section_and_keys_of_its_own() -> None:
    assert set(SECTIONS) == set(KINDS)
    keys = [key for kind in KINDS for key in kind.keys]
    assert len(set(keys)) == len(keys)
    for kind in KINDS:
        assert set(kind.keys.values()) <= {"", *kind.__dataclass_fields__}  # type: ignore[attr-defined]


def test_an_unknown_task_is_refused() -> None:
    with pytest.raises(AnalysisError, match=r"expected one of the tasks .*, found 'guessing'"):
        analysis_of("guessing")
