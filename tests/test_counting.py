from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from study.counting import counted, noun

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize(
    ("count", "said"),
    [
        (0, "0 studies"),
        (1, "1 study"),
        (1.0, "1 study"),
        (np.int64(1), "1 study"),
        (2, "2 studies"),
        (2500, "2,500 studies"),
        (1.5, "1.5 studies"),
    ],
)
def test_a_noun_goes_with_its_count(count: float, said: str) -> None:
    assert counted(count, "study", "studies") == said


def test_other_words_go_with_a_count_too() -> None:
    assert [noun(count, "is", "are") for count in (0, 1, 2)] == ["are", "is", "are"]
    assert counted(1, "participant is", "participants are") == "1 participant is"


def test_no_message_counts_people_by_hand() -> None:
    """What counts participants, answers, trials or minutes in a sentence asks `counted`."""
    by_hand = re.compile(r"\{[^{}]*\} (participants|answers|trials|minutes|studies|clips|videos)\b")
    # The first two count nothing, and the last names a column.
    allowed = {
        "study/report/sections/pair_ratings/section.py",
        "study/tasks/registry.py",
        "study/analysis/foreign/trials.py",
    }
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in sorted((ROOT / "study").rglob("*.py"))
        if str(path.relative_to(ROOT)) not in allowed
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        if by_hand.search(line) and 'f"' in line
    ]
    assert found == []
