"""The order of the house: data flows one way, and importing does nothing heavy."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FLOORS = ("motion", "models", "transitions", "tasks", "experiment", "analysis", "power", "report", "apps")
# Analysis takes tables, so it needs nothing of the experiment that made them.
FORBIDDEN = {("analysis", room) for room in ("experiment", "tasks", "motion", "transitions")} | {("models", "motion")}
# The rooms of the experiment: what each imports nothing of.
CLOSED = {
    "procedures": ("protocol", "plan", "session", "stimuli", "store"),
    "protocol": ("plan", "session", "stimuli", "store"),
    "stimuli": ("session", "store"),
    "store": ("stimuli",),
}


def imported_modules(path: Path) -> set[str]:
    modules = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import; write it absolute"
            modules |= {node.module or ""} | {f"{node.module}.{alias.name}" for alias in node.names}
    return modules


def floor(module: str) -> str | None:
    parts = module.split(".")
    return parts[1] if len(parts) > 1 and parts[0] == "study" and parts[1] in FLOORS else None


@pytest.mark.parametrize("path", sorted((ROOT / "study").rglob("*.py")), ids=lambda p: str(p.relative_to(ROOT)))
def test_a_module_imports_only_from_floors_above(path: Path) -> None:
    here = floor(".".join(path.relative_to(ROOT).with_suffix("").parts))
    for module in imported_modules(path):
        there = floor(module)
        if there is None or there == here:
            continue
        assert here is not None, f"{path}: study/ itself imports {module}"
        assert FLOORS.index(there) < FLOORS.index(here), f"{path} imports down the house: {module}"
        assert (here, there) not in FORBIDDEN, f"{path} imports {module}; analysis takes tables"


@pytest.mark.parametrize("room", CLOSED)
def test_the_rooms_of_the_experiment_keep_their_order(room: str) -> None:
    for path in (ROOT / "study" / "experiment" / room).rglob("*.py"):
        for module in imported_modules(path):
            parts = module.split(".")
            there = parts[2] if parts[:2] == ["study", "experiment"] and len(parts) > 2 else ""
            assert there not in CLOSED[room], f"{path} imports {module}; {room} stands above {there}"


@pytest.mark.parametrize("path", sorted((ROOT / "renderer").rglob("*.py")), ids=lambda p: str(p.relative_to(ROOT)))
def test_the_renderer_imports_nothing_of_study(path: Path) -> None:
    assert not [module for module in imported_modules(path) if module.split(".")[0] == "study"]


def test_no_cycles_between_modules() -> None:
    graph = {}
    for package in ("study", "renderer"):
        for path in (ROOT / package).rglob("*.py"):
            parts = list(path.relative_to(ROOT).with_suffix("").parts)
            name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            graph[name] = imported_modules(path)
    graph = {name: {m for m in modules if m in graph and m != name} for name, modules in graph.items()}
    seen: dict[str, int] = {}

    def visit(name: str, trail: tuple[str, ...]) -> None:
        assert name not in trail, f"import cycle: {' -> '.join((*trail, name))}"
        if name not in seen:
            for module in graph[name]:
                # A package's own __init__ may gather its modules.
                if not name.startswith(f"{module}."):
                    visit(module, (*trail, name))
            seen[name] = 1

    for name in graph:
        visit(name, ())


def test_the_command_line_imports_nothing_heavy() -> None:
    """`segue --help` must answer at once: numpy and its kin wait until a verb needs them."""
    code = (
        "import sys, click.testing, study.apps.cli as cli;"
        "r = click.testing.CliRunner().invoke(cli.segue, ['--help']); assert r.exit_code == 0, r.output;"
        "heavy = {'numpy', 'scipy', 'pandas', 'matplotlib', 'moderngl', 'av', 'sqlalchemy', 'pydantic', 'jinja2'};"
        "print(sorted(heavy & set(sys.modules)))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert found.stdout.strip() == "[]"
