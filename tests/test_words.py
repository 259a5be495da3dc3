"""Plain English: turns that a reader stumbles over are found in docs, help, docstrings, messages, pages and texts.

The list is short and only holds what has a plain wording; a new turn is one line.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

# What to look for, and what to write instead.
TURNS = {
    r"straight lines between|off straight lines|by straight lines": "linear interpolation",
    r"\ban own\b|\bown one\b": "their own, its own",
    r"\bJSON that is none\b|that there (is|are) not\b": "unknown, invalid, missing",
    r"\bfor ever\b": "always, indefinitely",
    r"\bheard of\b": "active",
    r"\bas may be\b": "possibly",
    r"\bis wary\b": "is conservative",
    r"\bhow many are at it\b": "in progress",
    r"\bbadly shown\b": "display failure",
    r"\bmissed answers?\b": "no response",
    r"\bgoes? on from there\b|\bgoes on where\b": "resumes",
    r"\bgiven back\b": "become available again, are returned",
    r"\bby way of\b": "through",
    r"\bIn goe?s?\b|\bout comes? (a|the|one|two|its|pixels|numbers)\b": "comes in, goes out",
    r"\bsees? to it\b": "guarantees",
    r"\bcan(no|')t be told\b": "cannot be estimated, distinguished",
    r"\btak(e|es|ing) (\w+ ){1,5}for independent\b": "treats as independent",
    r"\bis not chance\b|\bnot be told from chance\b": "is significant, is not significant",
    r"\bis let go\b": "is released, is closed",
    r"\bso much of (it|what)\b": "this number of",
    r"\bnobody has come\b": "no participant has",
    r"\bleaves? nobody out\b": "excludes no one",
    r"\bwould go wrong later\b": "problems, errors",
}
# Words of ours that docs and help texts replace by the field's.
IN_DOCS = {r"\bsittings?\b": "session", r"\bleft out\b|\bleave out\b": "excluded, omitted"}


def python_texts() -> Iterator[tuple[str, str]]:
    """Every string and docstring of the programs, with its place."""
    for folder in ("study", "renderer"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            place = path.relative_to(ROOT)
            for node in ast.walk(tree):
                if isinstance(node, ast.JoinedStr):
                    parts = [part.value for part in node.values if isinstance(part, ast.Constant)]
                    yield f"{place}:{node.lineno}", "\0".join(str(part) for part in parts)
                elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                    yield f"{place}:{node.lineno}", node.value


def files(*patterns: str) -> Iterator[tuple[str, str]]:
    for pattern in patterns:
        for path in sorted(ROOT.glob(pattern)):
            for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
                yield f"{path.relative_to(ROOT)}:{number}", line


def found(texts: Iterator[tuple[str, str]], turns: dict[str, str]) -> list[str]:
    any_turn = re.compile("|".join(turns))
    lines = ((place, " ".join(text.split())) for place, text in texts)
    return [
        f"{place}: {match.group()!r}; write: {better}"
        for place, line in lines
        if any_turn.search(line)
        for pattern, better in turns.items()
        if (match := re.search(pattern, line))
    ]


def test_programs_speak_plainly() -> None:
    assert found(python_texts(), TURNS) == []


def test_pages_and_texts_speak_plainly() -> None:
    pages = files("study/apps/pages/*.js", "study/apps/pages/*.html", "study/report/templates/*.jinja")
    assert found(pages, TURNS) == []
    assert found(files("study/experiment/protocol/words/en.toml"), TURNS) == []


def test_documentation_speaks_plainly() -> None:
    assert found(files("README.md", "docs/*.md"), {**TURNS, **IN_DOCS}) == []


@pytest.mark.parametrize(
    "text", ["expected a plan, found JSON that is none", "the same command goes on from there", "an own clock"]
)
def test_the_check_finds_what_it_should(text: str) -> None:
    assert len(found(iter([("here:1", text)]), TURNS)) == 1
