"""axe, the checker of accessibility that others use, finds nothing against WCAG 2.2 AA on pages and report."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from test_answers import ANSWERS
from test_pages import LAPTOP
from test_together import TOGETHER
from walking import LOOK, PATIENT, go_on

from study.apps.cli import run

pytestmark = pytest.mark.gl

AXE = Path(__file__).parents[3] / "build" / "node_modules" / "axe-core" / "axe.min.js"
FOUND = """axe.run(document, {runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"]}).then(
  (found) => JSON.stringify(found.violations.map(({ id, nodes }) => [id, nodes.map((node) => node.html)])))"""


def complaints(tab: Any) -> list[Any]:
    if not AXE.exists():
        pytest.skip("axe is missing: npm install --prefix build axe-core")
    tab.run(AXE.read_text(encoding="utf-8") + "; 0")
    found = json.loads(tab.run(FOUND))
    assert isinstance(found, list)
    return found


@pytest.mark.parametrize(
    ("text", "size"),
    [(PATIENT, LAPTOP), (ANSWERS, (390, 844)), (TOGETHER, (390, 844))],
    ids=["words, laptop", "answers, telephone", "together, telephone"],
)
def test_every_page_of_a_session(
    make_site: Callable[..., Any], make_tab: Callable[..., Any], text: str, size: tuple[int, int]
) -> None:
    site, tab = make_site(text), make_tab()
    tab.size(*size)
    tab.open(site.address)
    seen: dict[str, list[Any]] = {}

    def look() -> None:
        here = tab.run(LOOK)
        if here and here not in seen:
            seen[here] = complaints(tab)

    go_on(tab, False, look)
    look()
    assert len(seen) > 2
    assert {page: found for page, found in seen.items() if found} == {}


def test_a_report(make_tab: Callable[..., Any], tmp_path: Path) -> None:
    assert run(["simulate", "demo", "--participants", "6", "--out", str(tmp_path)]) == 0
    assert run(["report", str(tmp_path)]) == 0
    tab = make_tab()
    tab.open((tmp_path / "report.html").as_uri())
    tab.wait("document.querySelector('table') !== null")
    tab.run("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    assert complaints(tab) == []
