"""The shell scripts and the pinned versions: what is installed is found for certain, and the same on every machine."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
SCRIPTS = [path for name in ("scripts", ".ci") for path in sorted((ROOT / name).iterdir()) if path.suffix != ".py"]

# Goes on printing, slowly, after the line that is looked for: a reader that stops early would end this with SIGPIPE.
SLOW_APT_CACHE = """#!/usr/bin/env bash
[ "$1" = policy ] || exit 2
case "$2" in
    firefox-esr) printf '%s:\\n  Installed: (none)\\n  Candidate: 153.0esr-1\\n' "$2";;
    libosmesa6) printf '%s:\\n  Installed: (none)\\n  Candidate: (none)\\n' "$2";;
    libavcodec-extra) printf '%s:\\n  Installed: (none)\\n  Candidate: 7:5.1.6-0+deb12u1\\n' "$2";;
    broken) exit 100;;
    *) exit 0;;
esac
for line in 1 2 3 4 5; do sleep 0.02; printf '     version table, line %s\\n' "$line"; done
"""
DPKG_QUERY = """#!/usr/bin/env bash
case "${!#}" in
    xvfb) printf 'install ok installed';;
    postgresql) printf 'deinstall ok config-files';;
    *) exit 1;;
esac
"""


@pytest.fixture
def ask(tmp_path: Path) -> Any:
    """`ask(command)`: what a function of `.ci/packages` prints, with programs in place of the system's own."""
    for name, text in (("apt-cache", SLOW_APT_CACHE), ("dpkg-query", DPKG_QUERY)):
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)

    def run(command: Any) -> Any:
        script = f"set -euo pipefail; source {ROOT / '.ci' / 'packages'}; {command}"
        return subprocess.run(
            ["bash", "-c", script],
            capture_output=True,
            text=True,
            check=False,
            env={"PATH": f"{tmp_path}:/usr/bin:/bin"},
        )

    return run


def test_what_the_distribution_has_is_wanted_however_slowly_it_says_so(ask: Any) -> None:
    for _ in range(10):
        found = ask("wanted_packages chromium libosmesa6 firefox-esr libavcodec-extra unheard-of")
        assert found.returncode == 0, found.stderr
        assert found.stdout.split() == ["chromium", "firefox-esr", "libavcodec-extra"]


def test_a_look_up_that_fails_is_not_taken_for_a_missing_package(ask: Any) -> None:
    found = ask("wanted=$(wanted_packages libosmesa6 broken firefox-esr); echo went on")
    assert found.returncode != 0
    assert "apt-cache policy broken failed" in found.stderr
    assert "went on" not in found.stdout


def test_removed_packages_count_as_missing(ask: Any) -> None:
    found = ask("missing_packages").stdout.split()
    assert "xvfb" not in found
    assert {"postgresql", "chromium", "firefox-esr", "libosmesa6"} <= set(found)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_no_script_pipes_into_a_reader_that_stops_early(script: Path) -> None:
    """Under `pipefail` the writer then dies of SIGPIPE now and then, and a finding reads as none."""
    text = script.read_text()
    assert not re.findall(r"\|\s*(?:grep\s+-\w*[qm]|head\b|sed\s+-n\s+\S*q|awk\b[^|]*\bexit\b)", text)
    assert subprocess.run(["bash", "-n", script], check=False).returncode == 0


@pytest.mark.parametrize("script", ["scripts/setup", ".ci/wheel"])
def test_what_python_compiles_is_kept_also_where_a_container_says_otherwise(script: str) -> None:
    """Without, each command and each process of a test compiles all that it imports: twice the time."""
    lines = (ROOT / script).read_text().splitlines()
    told = lines.index("unset PYTHONDONTWRITEBYTECODE")
    assert told < min(
        k for k, line in enumerate(lines) if re.search(r"python\S* -m (venv|pip)", line) and "#" not in line
    )


def pinned() -> list[Any]:
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    requirements = [Requirement(line) for line in lines if line and not line.startswith("#")]
    return [r for r in requirements if r.marker is None or r.marker.evaluate()]


def needed() -> Any:
    """Every distribution that Segue with all its extras asks for, by way of others too, as installed here."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"].values()
    todo = [Requirement(text) for group in (project["dependencies"], *extras) for text in group]
    names: set[str] = set()
    seen = set()
    while todo:
        requirement = todo.pop()
        name = canonicalize_name(requirement.name)
        wanted = [(name, extra) for extra in ("", *requirement.extras)]
        if name == "segue" or all(one in seen for one in wanted):
            continue
        if requirement.marker is not None and not requirement.marker.evaluate({"extra": ""}):
            continue
        seen |= set(wanted)
        names.add(name)
        try:
            asked = metadata.requires(name) or []
        except metadata.PackageNotFoundError:
            continue  # an extra that isn't installed here
        for line in asked:
            inner = Requirement(line)
            if inner.marker is None or any(
                inner.marker.evaluate({"extra": extra}) for extra in ("", *requirement.extras)
            ):
                inner.marker = None
                todo.append(inner)
    return names


def test_every_dependency_is_pinned_to_one_version() -> None:
    versions = {canonicalize_name(r.name): str(r.specifier) for r in pinned()}
    assert len(versions) == len(pinned())
    assert all(re.fullmatch(r"==[\w.!+]+", version) for version in versions.values())
    assert needed() <= set(versions), "run scripts/constraints --keep"


def test_the_scripts_install_the_pinned_versions() -> None:
    """Only an environment that the scripts made is held to them: `pip install .` stays free."""
    if Path(sys.prefix) != ROOT / ".venv":
        pytest.skip("this environment was not made by scripts/setup")
    versions = {canonicalize_name(r.name): str(r.specifier)[2:] for r in pinned()}
    there = {canonicalize_name(found.name) for found in metadata.distributions()}  # not every extra is installed
    here = {name: metadata.version(name) for name in needed() & set(versions) & there}
    assert {"numpy", "pytest", "starlette"} <= set(here)
    assert here == {name: versions[name] for name in here}
