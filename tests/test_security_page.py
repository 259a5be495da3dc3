"""The security page names what is installed, and an audit that could not be made does not pass."""

from __future__ import annotations

import json
from typing import Any

import pytest
from programs import ROOT, program


def test_every_package_that_segue_installs_stands_on_the_page() -> None:
    page = (ROOT / "docs" / "security.md").read_text(encoding="utf-8")
    missing = [name for name in program("scripts/licences").installed("segue") if f"| {name} | " not in page]
    assert not missing, "run `python scripts/licences.py` and put its lines onto the page"
    assert "libx264 and libx265 (GPL-2.0-or-later)" in page


@pytest.mark.parametrize(
    ("answer", "status", "said"),
    [
        ("", 2, "could not be asked"),
        ('{"error": "x"}', 2, "could not be asked"),
        ({"dependencies": []}, 2, "0 of 0 packages looked up"),
        ({"dependencies": [{"name": "av", "skip_reason": "not found"}]}, 2, "not looked up: av"),
        ({"dependencies": [{"name": "av", "version": "1", "vulns": []}]}, 0, "1 of 1 packages looked up, 0 with"),
        (
            {
                "dependencies": [
                    {"name": "segue", "skip_reason": "not found"},
                    {"name": "av", "version": "1", "vulns": []},
                ]
            },
            0,
            "1 of 1 packages looked up",
        ),
        (
            {"dependencies": [{"name": "av", "version": "1", "vulns": [{"id": "CVE-1", "fix_versions": ["2"]}]}]},
            1,
            "av 1: CVE-1, mended in 2",
        ),
    ],
)
def test_only_packages_that_were_looked_up_pass_an_audit(answer: Any, status: int, said: str) -> None:
    found, lines = program("scripts/audited").audited("pypi", answer if isinstance(answer, str) else json.dumps(answer))
    assert found == status
    assert said in "\n".join(lines)
