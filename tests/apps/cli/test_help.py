"""What `--help` says: every option with unit and default, every choice and argument, an example that can be typed."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator

import click
import pytest

from study.apps.cli import segue
from study.apps.cli.examples import ARGUMENTS, EXAMPLES, arguments

# What a number is of: a unit, a count, or a quantity without unit.
UNITS = (
    "frame|second|metre|pixel|gigabyte|degree|point|log-odds|logarithm|share|from 0 to 1|probability|power|factor|"
    "correlation|seed|number|most|cost|port"
)


def verbs(command: click.Command, context: click.Context, path: str = "") -> Iterator[tuple[str, click.Command]]:
    if not isinstance(command, click.Group):
        yield path, command
        return
    for name in command.list_commands(context):
        found = command.get_command(context, name)
        assert found is not None
        yield from verbs(found, click.Context(command), f"{path} {name}".strip())


VERBS = dict(verbs(segue, click.Context(segue)))
OPTIONS = [(verb, one) for verb, command in VERBS.items() for one in command.params if isinstance(one, click.Option)]


@pytest.mark.parametrize(("verb", "option"), OPTIONS, ids=lambda one: one if isinstance(one, str) else one.opts[0])
def test_every_option_is_explained_with_unit_choices_and_default(verb: str, option: click.Option) -> None:
    said = option.help or ""
    assert len(said) > 10, f"{verb}: no explanation"
    if not option.is_flag and not option.required and not option.multiple:
        assert option.show_default or "default" in said or "olumn" in said, f"{said}: what holds without it?"
    for one in option.type.types if isinstance(option.type, click.Tuple) else [option.type]:
        if isinstance(one, click.Choice):
            assert not [choice for choice in one.choices if not re.search(rf"\b{re.escape(choice)}\b", said)], said
        if isinstance(one, click.types.IntRange | click.types.FloatRange) or one.name in ("float", "integer"):
            assert re.search(UNITS, said, re.IGNORECASE), f"{said}: in what unit?"


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_an_example_of_itself_and_says_what_its_arguments_may_be(
    verb: str, capsys: pytest.CaptureFixture[str]
) -> None:
    segue.main([*verb.split(), "--help"], prog_name="segue", standalone_mode=False)
    printed = capsys.readouterr().out
    assert f"Example: {EXAMPLES[verb]}" in printed
    assert EXAMPLES[verb].startswith(f"segue {verb} ") or EXAMPLES[verb] == f"segue {verb}"
    words = shlex.split(EXAMPLES[verb])[1 + len(verb.split()) :]
    VERBS[verb].make_context(verb, words, resilient_parsing=True)
    for argument in arguments(VERBS[verb]):
        assert f"  {argument} is " in printed


def test_no_example_and_no_argument_is_left_over() -> None:
    assert set(EXAMPLES) == set(VERBS)
    assert {word for command in VERBS.values() for word in arguments(command)} == set(ARGUMENTS)


def test_protocols_that_come_with_segue_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    segue.main(["check", "--help"], prog_name="segue", standalone_mode=False)
    assert "wang2004_session" in capsys.readouterr().out
