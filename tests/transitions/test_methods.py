"""The registry of methods: every member answers what the house asks of its kind."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import fields
from pathlib import Path
from typing import get_type_hints

import pytest

from study.transitions.methods.method import MethodPart
from study.transitions.methods.registry import LENGTHS, MAKES, METHODS, POINTS

ROOT = Path(__file__).parents[2]
KINDS = {"points": POINTS, "lengths": LENGTHS, "makes": MAKES}
MEMBERS = [(kind, name, part) for kind, known in KINDS.items() for name, part in known.items()]
# Members that a Methods section says nothing of, and those that come from no paper.
NO_WORDS, NO_SOURCE = {"shared", "none"}, {"shared", "none", "given"}


@pytest.mark.parametrize(("kind", "name", "part"), MEMBERS)
def test_a_member_has_words_a_source_and_a_line_of_documentation(kind: str, name: str, part: type[MethodPart]) -> None:
    assert part.name == name
    assert part.__module__.startswith(f"study.transitions.methods.{kind}.")
    assert bool(part.words) == (name not in NO_WORDS)
    assert bool(part.sources) == (name not in NO_SOURCE)
    lines = (ROOT / "docs" / "transitions.md").read_text(encoding="utf-8").splitlines()
    kinds = {"points": "points", "lengths": "length", "makes": "make"}
    assert [line for line in lines if line.startswith(f"| {kinds[kind]} | `{name}` |")], "a line in docs/transitions.md"


@pytest.mark.parametrize(("kind", "name", "part"), MEMBERS)
def test_a_setting_is_explained_and_means_one_thing(kind: str, name: str, part: type[MethodPart]) -> None:
    for setting in fields(part):
        assert setting.metadata["words"].endswith((".", "]")), f"{kind} {name}: explain {setting.name}"
        for _, other, another in MEMBERS:
            hints = (get_type_hints(one, include_extras=True).get(setting.name) for one in (part, another))
            own, theirs = hints
            assert theirs in (None, own), f"{setting.name} is one thing in {name} and another in {other}"


@pytest.mark.parametrize("name", METHODS)
def test_a_method_has_words_sources_a_utility_and_a_line_of_documentation(name: str) -> None:
    method = METHODS[name]
    assert method.name == name
    assert method.in_words(30.0)
    assert "{" not in method.in_words(30.0)
    assert method.sources
    assert -10 <= method.utility <= 10
    assert method.length.windows == method.make.windows
    room = method.room(30.0, None)
    assert 1 <= room.blend <= room.search
    lines = (ROOT / "docs" / "transitions.md").read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if line.startswith(f"| `{name}` |")], "a line in docs/transitions.md"


def test_the_parts_of_a_method_are_those_of_their_sources() -> None:
    triples = {name: (method.points.name, method.length.name, method.make.name) for name, method in METHODS.items()}
    assert triples == {
        "fixed": ("shared", "fixed", "slerp"),
        "velocity": ("shared", "velocity", "slerp"),
        "geodesic": ("shared", "geodesic", "slerp"),
        "timewarp": ("shared", "timewarp", "timewarp"),
        "registration-curve": ("shared", "geodesic", "registration-curve"),
        "cut": ("shared", "none", "cut"),
        "cut-lee2002": ("least-cost", "none", "cut"),
        "cut-wang2003": ("least-cost", "none", "cut"),
        "cut-pointcloud": ("least-cost", "none", "cut"),
        "inertialize": ("shared", "geodesic", "inertialize"),
        "inertialize-quintic": ("shared", "geodesic", "inertialize-quintic"),
        "dead-blend": ("shared", "geodesic", "dead-blend"),
        "one-hop": ("shared", "fixed", "one-hop"),
    }


def test_the_registry_waits_with_numpy_until_a_method_is_used() -> None:
    code = (
        "import sys, study.transitions.methods.registry; print(sorted({'numpy', 'scipy', 'pydantic'} & {*sys.modules}))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert found.stdout.strip() == "[]"


def test_a_warp_asks_for_the_poses_beside_its_windows() -> None:
    shared = METHODS["geodesic"].length.room(30.0, 20)
    warped = METHODS["timewarp"].length.room(30.0, 20)
    assert (warped.blend, warped.search) == (shared.blend + 1, shared.search + 1)
    assert (warped.entry, warped.after) == (1, shared.blend - 1)
