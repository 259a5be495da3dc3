"""CITATION.cff and CHANGELOG.md: the version is that of the package, and the papers are cited as reports cite them."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from study.transitions.methods.makes.one_hop import KOYAMA_2019
from study.transitions.methods.method import WANG_2003, WANG_2004

ROOT = Path(__file__).parents[1]
CITATION = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def values(key: str) -> list[str]:
    """The values of a key, wherever it stands, in order."""
    found = re.findall(rf"^[ -]*{key}: *(.+)$", CITATION, re.MULTILINE)
    return [value.strip('"') for value in found]


def test_every_line_is_a_key_an_entry_or_a_text() -> None:
    for line in CITATION.splitlines():
        assert re.fullmatch(r'(?:  )*(?:- )?(?:[a-z-]+:(?: (?:"[^"]*"|[\w.-]+))?|[\w. ]+)', line), line


def test_version_licence_and_authors_are_those_of_the_package() -> None:
    assert values("cff-version") == ["1.2.0"]
    assert values("version") == [PROJECT["version"]]
    assert values("license") == [PROJECT["license"]]
    assert values("name") == [author["name"] for author in PROJECT["authors"]]
    newest = re.search(r"^## ([\d.]+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert newest
    assert newest[1] == PROJECT["version"]


def test_the_papers_are_those_of_reports() -> None:
    papers = list(zip(values("title")[1:], values("year"), strict=True))
    assert len(papers) == 3
    for (title, year), source in zip(papers, (WANG_2003, WANG_2004, KOYAMA_2019), strict=True):
        assert f"({year})" in source
        assert title.lower() in source.lower()
