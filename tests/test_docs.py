"""The documentation is true: commands of all pages run, and blocks of Python and TOML work.

What can't be run in a test is understood; `documented.NOT_RUN` and `OTHER_BLOCKS` say why.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import re
import runpy
import shutil
import socket
import sys
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click
import documented
import pytest
from documented import PAGES, ROOT, blocks, commands, furnish, program, small, to_run, verb_of, whole

from study.apps.cli import run
from study.apps.cli.examples import EXAMPLES
from study.motion.synthetic import synthesize

STARTS = re.compile("segue |python |PYTHONPATH=|xvfb-run ")
SEGUE = sorted({(line, page.name) for page in PAGES for line in commands(page) if line.startswith("segue ")})
SCRIPTS = sorted({
    (line[line.index("python ") :], page.name)
    for page in PAGES
    for line in commands(page)
    if STARTS.match(line) and "python " in line
})  # fmt: skip
FURNISHING = [
    "segue simulate my_study.toml --library . --out ./results/try",
    "segue motions download walk walk_fast stand run run_turn_left walk_slow jog --out path/to/cmu",
    "segue simulate blend_length_jnd --library path/to/cmu --participants 35",
    "segue export results/my_study --to csv --out answers.csv",
    "segue advise walk run box --out advice",
    "segue one-hop build dance dance_modern box --out dances.npz",
]
"""Commands of several pages, which are run once."""

SMALLER = {"power": ["--studies", "10"], "simulate": ["--participants", "4"]}


@pytest.mark.parametrize(("line", "page"), SEGUE)
def test_segue_knows_every_command_of_the_documentation(line: str, page: str) -> None:
    verb, words = verb_of(line)
    context = click.Context(verb)
    values, _, _ = verb.make_parser(context).parse_args(words)
    for parameter in verb.params:
        value = values.get(parameter.name)
        if isinstance(parameter.type, click.Choice | click.types.IntRange | click.types.FloatRange) and value:
            assert value is not None, f"{page}: {line}"
            parameter.type_cast_value(context, value)


class UnderstoodError(Exception):
    """A script has read its arguments."""


@pytest.mark.parametrize(("line", "page"), SCRIPTS)
def test_every_script_of_the_documentation_understands_its_arguments(
    line: str, page: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = program(line)[1:]
    assert (ROOT / words[0]).is_file() or words[0] == "-m", f"{page}: {line}"
    if words[0] == "-m":
        runpy.run_module(words[1], run_name="__main__")
        return
    script = ROOT / words[0]
    if "argparse" not in script.read_text(encoding="utf-8"):
        compile(script.read_text(encoding="utf-8"), script, "exec")
        return
    read = argparse.ArgumentParser.parse_args

    def parse(self: argparse.ArgumentParser, *given: Any, **named: Any) -> None:
        read(self, *given, **named)
        raise UnderstoodError

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", parse)
    monkeypatch.setattr(sys, "argv", words)
    monkeypatch.setattr(sys, "path", [str(script.parent), str(ROOT), *sys.path])
    with pytest.raises(UnderstoodError):
        runpy.run_path(str(script), run_name="__main__")


@pytest.fixture(scope="module")
def furnished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the pages speak of, among it a small study with simulated responses."""
    folder = tmp_path_factory.mktemp("documented")
    furnish(folder)
    with contextlib.chdir(folder), pytest.MonkeyPatch.context() as patched:
        stand_in(patched)
        type_all(["segue new walk.bvh run.bvh --study same-different", *FURNISHING])
    return folder


@pytest.fixture
def world(furnished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of that folder to work in."""
    folder = tmp_path / "world"
    shutil.copytree(furnished, folder)
    monkeypatch.chdir(folder)
    stand_in(monkeypatch)
    return folder


def stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    """Films are small, the server ends at once, and the CMU's site is this test."""
    from study.apps.server import running
    from study.motion import drawing, library
    from study.motion.readers.bvh_writing import write_bvh

    large = drawing.draw_clip
    monkeypatch.setattr(drawing, "draw_clip", lambda *given, **look: large(*given, **{**look, "size": (96, 64)}))
    monkeypatch.setattr(running, "serve", served_for_a_moment)
    monkeypatch.setattr(running, "listen", lambda host, _port: socket.create_server((host, 0)))

    def download(trial: str, out: Path) -> Path:
        out.mkdir(parents=True, exist_ok=True)
        write_bvh(synthesize("walk" if trial[0].isdigit() else trial, seconds=8), out / f"{trial}.bvh")
        return out / f"{trial}.bvh"

    monkeypatch.setattr(library, "download_trial", download)


def served_for_a_moment(app: Any, listening: socket.socket, **_: object) -> None:
    """The first page is there; then the server ends."""
    from starlette.testclient import TestClient

    listening.close()
    with TestClient(app, base_url="http://localhost") as client:
        assert client.get("/").status_code == 200


@pytest.mark.gl
@pytest.mark.usefixtures("world")
@pytest.mark.parametrize("page", [path for path in PAGES if to_run(path)], ids=lambda path: path.stem)
def test_every_command_of_a_page_runs(page: Path) -> None:
    type_all(line for line in to_run(page) if " ".join(program(line)) not in FURNISHING)


@pytest.mark.gl
@pytest.mark.usefixtures("world")
def test_every_example_of_the_help_runs() -> None:
    type_all(line for line in EXAMPLES.values() if whole(line) and line not in FURNISHING)


def type_all(lines: Iterable[str]) -> None:
    """Run commands one after another, as somebody does who types them; each once, with small films and studies."""
    for line in dict.fromkeys(documented.AFTER.sub("", line) for line in lines):
        words = program(line)[1:]
        written = Path("my_study.toml" if "--from" not in words else "mine.toml")
        if words[0] == "new":
            written.unlink(missing_ok=True)
            for folder in (written.stem, "try"):  # of another study
                shutil.rmtree(Path("results", folder), ignore_errors=True)
        if "--write" in words:
            Path("motions/library.toml").unlink(missing_ok=True)
        said = io.StringIO()
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
            status = run([*words, *SMALLER.get(words[0], [])])
        assert status == 0, f"{line}: {said.getvalue()}"
        if words[0] == "new" and "--from" not in words:
            small(written)
            assert run(["simulate", str(written), "--library", ".", "--participants", "4"]) == 0


@pytest.mark.gl
@pytest.mark.usefixtures("world")
@pytest.mark.parametrize("page", sorted({block.page for block in blocks() if block.language == "python"}))
def test_python_of_a_page_runs(page: str) -> None:
    names: dict[str, Any] = {}
    for block in blocks():
        if (block.page, block.language) == (page, "python"):
            exec(compile(block.text, page, "exec"), names)


@pytest.mark.parametrize("block", [one for one in blocks() if one.language == "toml"], ids=lambda one: one.text[:24])
def test_toml_of_a_page_is_understood(block: documented.Block, world: Path) -> None:
    from study.experiment.protocol.whole import load_protocol
    from study.motion.library import open_library

    tables = tomllib.loads(block.text)
    if "clips" in tables:
        for name in ("run.amc", "run.asf", "class/take 3.bvh"):
            place = world / "motions" / name
            place.parent.mkdir(exist_ok=True)
            shutil.copy(world / "walk.bvh", place)
        (world / "motions" / "library.toml").write_text(block.text, encoding="utf-8")
        assert set(tables["clips"]) <= set(open_library("motions").names())
        return
    text = (world / "my_study.toml").read_text(encoding="utf-8").replace('"walk_to_run"', '"walk_run"')
    if "[studies.procedure]" in block.text:
        given = re.compile("differences_frames|order|attention_checks|most_failed_checks")
        text = "\n".join(line for line in text.splitlines() if not given.match(line))
    (world / "with_block.toml").write_text(f"{text}\n{block.text}", encoding="utf-8")
    load_protocol(world / "with_block.toml")


def test_every_other_block_is_named_with_its_reason() -> None:
    rest = [
        block.text
        for block in blocks()
        if block.language not in ("python", "toml") and not any(map(STARTS.match, block.lines))
    ]
    for text in rest:
        assert any(beginning in text for beginning in documented.OTHER_BLOCKS), f"who tests this block?\n{text}"
    for beginning in documented.OTHER_BLOCKS:
        assert any(beginning in text for text in rest), f"{beginning}: no longer in the documentation"


def test_commands_are_found_and_those_that_are_not_run_are_still_there() -> None:
    lines = [" ".join(line.split()) for page in PAGES for line in commands(page)]
    assert sum(len(to_run(page)) for page in PAGES) > 50
    for beginning in documented.NOT_RUN:
        assert any(line.startswith(beginning) for line in [*lines, *EXAMPLES.values()]), beginning
