"""How many planted bugs do the tests find? A mutant changes one operator, constant or call; some test has to fail then.

    pip install pytest-cov
    python benchmarks/mutants.py --count 100 --seed 1
    python benchmarks/mutants.py --rooms analysis --count 50 --seed 2 --workers 1

First the tests run once, to learn which test runs which line; that is kept in the folder `--keep`, for further seeds
of the same code. A few tests that fail then, as those that wait for time do on a busy machine, are named and left out.
Then mutants are drawn at random from all functions of the rooms, and each is met by the tests that run its line. What
no test notices is printed: either a test is missing, or the change means nothing (an equivalent mutant, which only a
reader can tell). A mutant on a line that no test runs counts as survived.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

ROOT = Path(__file__).parents[1]
ROOMS = ("analysis", "experiment", "transitions", "models")
TESTS = (
    "tests/analysis",
    "tests/experiment",
    "tests/transitions",
    "tests/models",
    "tests/papers",
    "tests/report",
    "tests/apps",
)
SLOW_TO_START = ("tests/apps/browser", "tests/apps/player")
MOST_SECONDS = 600
MOST_FAILED = 10

COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
}  # fmt: skip
OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Div, ast.Mod: ast.Mult,
    ast.Pow: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
}  # fmt: skip
CALLS = {"min": "max", "max": "min", "any": "all", "all": "any", "floor": "ceil", "ceil": "floor", "mean": "median",
         "argmin": "argmax", "argmax": "argmin", "minimum": "maximum", "maximum": "minimum"}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """One planted bug: a file, the place of the changed piece, and what stands there instead."""

    path: str
    line: int
    column: int
    end_line: int
    end_column: int
    text: str

    def planted(self, source: str) -> str:
        """The file's text with the bug in it."""
        lines = source.encode().splitlines(keepends=True)
        start = sum(map(len, lines[: self.line - 1])) + self.column
        end = sum(map(len, lines[: self.end_line - 1])) + self.end_column
        whole = source.encode()
        return (whole[:start] + self.text.encode() + whole[end:]).decode()


def changed(node: ast.AST) -> Iterator[ast.expr]:
    """What could stand instead of an expression."""
    if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in COMPARISONS:
        yield ast.Compare(node.left, [COMPARISONS[type(node.ops[0])]()], node.comparators)
    elif isinstance(node, ast.BinOp) and type(node.op) in OPERATORS and not is_text(node):
        yield ast.BinOp(node.left, OPERATORS[type(node.op)](), node.right)
    elif isinstance(node, ast.BoolOp):
        yield ast.BoolOp(ast.Or() if isinstance(node.op, ast.And) else ast.And(), node.values)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
        yield node.operand
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield ast.Constant(not node.value)
    elif isinstance(node, ast.Constant) and isinstance(node.value, int):
        yield ast.Constant(node.value + 1)
    elif isinstance(node, ast.Constant) and isinstance(node.value, float):
        yield ast.Constant(node.value * 1.5 if node.value else 1.0)
    elif isinstance(node, ast.Call):
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name in CALLS:
            called = CALLS[name]
            func = ast.Attribute(node.func.value, called) if isinstance(node.func, ast.Attribute) else ast.Name(called)
            yield ast.Call(func, node.args, node.keywords)
    elif isinstance(node, ast.IfExp):
        yield node.body
        yield node.orelse


def is_text(node: ast.BinOp) -> bool:
    return any(isinstance(side, ast.JoinedStr) or isinstance(getattr(side, "value", None), str)
               for side in (node.left, node.right))  # fmt: skip


def expressions(tree: ast.AST) -> Iterator[ast.AST]:
    """Everything that computes: no annotations, decorators, refusals, texts, or what stands at a module's top."""
    for name, value in ast.iter_fields(tree):
        if name in ("annotation", "returns", "decorator_list", "type_params"):
            continue
        for node in value if isinstance(value, list) else [value]:
            if isinstance(node, ast.Raise | ast.JoinedStr | ast.Assert) or not isinstance(node, ast.AST):
                continue
            if isinstance(node, ast.expr):
                yield node
            yield from expressions(node)


def mutants_of(path: Path) -> Iterator[Mutant]:
    """All mutants of a file's functions."""
    source = path.read_text(encoding="utf-8")
    name = path.relative_to(ROOT).as_posix()
    functions = [n for n in ast.walk(ast.parse(source)) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)]
    seen = set()
    for function in functions:
        for node in expressions(function):
            for other in changed(node):
                mutant = Mutant(name, node.lineno, node.col_offset, node.end_lineno, node.end_col_offset,
                                f"({ast.unparse(ast.fix_missing_locations(other))})")  # fmt: skip
                if mutant not in seen:
                    seen.add(mutant)
                    yield mutant


def copy_to(folder: Path) -> None:
    """The files of the work tree that git knows."""
    files = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    for name in filter(lambda name: (ROOT / name).is_file(), files.stdout.splitlines()):
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, target)


def environment() -> dict[str, str]:
    mocap = os.environ.get("SEGUE_MOCAP", str(ROOT.parent / "shared" / "motions"))
    return {**os.environ, "SEGUE_MOCAP": mocap, "PYTHONDONTWRITEBYTECODE": "1"}


def covered(keep: Path, rooms: list[str]) -> dict[tuple[str, int], list[str]]:
    """For each line of the rooms, the tests that run it; measured once and kept."""
    data, failures = keep / "coverage.sqlite", keep / "failed.json"
    if not (data.exists() and failures.exists()):
        tests = [name for name in TESTS if (ROOT / name).is_dir()]
        with tempfile.TemporaryDirectory() as folder:
            copy_to(Path(folder))
            command = [sys.executable, "-m", "pytest", "-q", "-n", "auto", "-m", "not slow", "--cov=study",
                       "--cov-context=test", "--cov-report=",
                       *tests, *(f"--ignore={name}" for name in SLOW_TO_START)]  # fmt: skip
            done = subprocess.run(command, cwd=folder, env=environment(), check=False)
            known = Path(folder) / ".pytest_cache" / "v" / "cache" / "lastfailed"
            failed = sorted(json.loads(known.read_text())) if done.returncode and known.exists() else []
            if done.returncode and not 0 < len(failed) <= MOST_FAILED:
                sys.exit(f"the tests have to pass before bugs are planted, but for {MOST_FAILED} at most")
            failures.write_text(json.dumps(failed))
            shutil.copy2(Path(folder) / ".coverage", data)
    left_out = set(json.loads(failures.read_text()))
    for test in sorted(left_out):
        print(f"left out, since it fails without a bug: {test}")
    found = read_coverage(data, rooms)
    return {line: [test for test in tests if test not in left_out] for line, tests in found.items()}


def read_coverage(data: Path, rooms: list[str]) -> dict[tuple[str, int], list[str]]:
    import coverage.numbits

    found: dict[tuple[str, int], list[str]] = {}
    with sqlite3.connect(data) as connection:
        rows = connection.execute(
            "select file.path, context.context, numbits from line_bits join file on file.id = file_id "
            "join context on context.id = context_id where context.context != ''"
        )
        for path, context, numbits in rows:
            name = "study/" + path.split("/study/", 1)[1]
            if name.split("/")[1] in rooms:
                test = context.split("|")[0]
                for line in coverage.numbits.numbits_to_nums(numbits):
                    found.setdefault((name, line), []).append(test)
    return found


def is_killed(folder: Path, mutant: Mutant, tests: list[str]) -> bool:
    """Whether a test fails, or does not end, with the bug planted in a copy of the tree."""
    place = folder / mutant.path
    source = place.read_text(encoding="utf-8")
    place.write_text(mutant.planted(source), encoding="utf-8")
    # Tests of the same name as the module first: they are the likeliest to find it, and the first finding ends the run.
    own = Path(mutant.path).stem
    ordered = sorted(set(tests), key=lambda test: (own not in test.split("::")[0], test))
    try:
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *ordered]
        done = subprocess.run(
            command, cwd=folder, env=environment(), capture_output=True, timeout=MOST_SECONDS, check=False
        )
        return done.returncode != 0
    except subprocess.TimeoutExpired:
        return True
    finally:
        place.write_text(source, encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rooms", nargs="+", default=list(ROOMS))
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--keep", type=Path, default=Path(tempfile.gettempdir()) / "segue-mutants")
    options = parser.parse_args()
    options.keep.mkdir(parents=True, exist_ok=True)
    tests = covered(options.keep, options.rooms)
    files = [path for room in options.rooms for path in sorted((ROOT / "study" / room).rglob("*.py"))]
    every = [mutant for path in files for mutant in mutants_of(path)]
    chosen = random.Random(options.seed).sample(every, min(options.count, len(every)))
    print(f"{len(every)} mutants of {len(files)} files; {len(chosen)} drawn with seed {options.seed}")
    folders: SimpleQueue[Path] = SimpleQueue()
    with tempfile.TemporaryDirectory() as base, ThreadPoolExecutor(options.workers) as pool:
        for number in range(options.workers):
            copy_to(Path(base) / str(number))
            folders.put(Path(base) / str(number))

        def tried(mutant: Mutant) -> bool:
            folder = folders.get()
            begin = time.monotonic()
            own = tests.get((mutant.path, mutant.line), [])
            killed = bool(own) and is_killed(folder, mutant, own)
            folders.put(folder)
            if not killed:
                line = (ROOT / mutant.path).read_text(encoding="utf-8").splitlines()[mutant.line - 1].strip()
                how = "SURVIVED" if own else "RUN BY NO TEST"
                print(f"{how} {mutant.path}:{mutant.line}: {line}\n    with {mutant.text}", flush=True)
            elif time.monotonic() - begin > 120:
                print(f"(slow: {mutant.path}:{mutant.line}, {time.monotonic() - begin:.0f} s)", flush=True)
            return killed

        results = list(pool.map(tried, chosen))
    print(f"killed {sum(results)} of {len(results)} ({100 * sum(results) / max(1, len(results)):.1f}%)")


if __name__ == "__main__":
    main()
