"""Commands and programs in the documentation: verbs, options and values exist, scripts are there, Python compiles."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from study.apps.cli import segue

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"`((?:segue|python) [^`]+)`")
# What stands for something in a synopsis, and what comes after a command on its line.
AFTER = re.compile(r"\s(?:#|>|\||&&|;|   ).*$")


def commands(page: Path) -> Iterator[tuple[str, str]]:
    """Every command of a page, and where it stands."""
    text = page.read_text(encoding="utf-8")
    for language, block in BLOCK.findall(text):
        if language in ("", "sh", "bash", "console"):
            for line in block.replace("\\\n", " ").splitlines():
                yield line.strip().removeprefix("$ "), page.name
    for found in INLINE.findall(text):
        yield found.replace("\n", " "), page.name


def program(line: str) -> list[str]:
    """The words of a command without what is optional; `I` and `J` stand for numbers, `...` for any text."""
    line = AFTER.sub("", line).replace("...", "x").replace("…", "x")
    line = re.sub(r"(?<= )[A-Z](?= |$)", "1", line)
    return shlex.split(re.sub(r"\[[^]]*\]", "", line))


SEGUE = sorted({(line, page) for path in PAGES for line, page in commands(path) if line.startswith("segue ")})
SCRIPTS = sorted({(line, page) for path in PAGES for line, page in commands(path) if line.startswith("python ")})


@pytest.mark.parametrize(("line", "page"), SEGUE)
def test_segue_knows_every_command_of_the_documentation(line: str, page: str) -> None:
    words = program(line)[1:]
    found: click.Command = segue
    context = click.Context(segue)
    while isinstance(found, click.Group) and words and not words[0].startswith("-"):
        inner = found.get_command(context, words[0])
        assert inner is not None, f"{page}: {line}: no verb {words[0]}"
        found, words = inner, words[1:]
        context = click.Context(found, parent=context)
    values, _, _ = found.make_parser(context).parse_args(words)
    for parameter in found.params:
        value = values.get(parameter.name)
        if isinstance(parameter.type, click.Choice | click.types.IntRange | click.types.FloatRange) and value:
            assert value is not None
            parameter.type_cast_value(context, value)


@pytest.mark.parametrize(("line", "page"), SCRIPTS)
def test_every_script_of_the_documentation_exists(line: str, page: str) -> None:
    words = program(line)[1:]
    if words[0].endswith(".py"):
        text = (ROOT / words[0]).read_text(encoding="utf-8")
        for option in words[1:]:
            assert not option.startswith("--") or f'"{option.split("=")[0]}"' in text, f"{page}: {line}: {option}"


def test_python_in_the_documentation_compiles() -> None:
    blocks = [(path.name, text) for path in PAGES for language, text in BLOCK.findall(path.read_text(encoding="utf-8"))
              if language == "python"]  # fmt: skip
    assert len(blocks) > 5
    for name, text in blocks:
        compile(text, name, "exec")


def test_commands_are_found() -> None:
    assert len(SEGUE) > 60
    assert len(SCRIPTS) > 10
