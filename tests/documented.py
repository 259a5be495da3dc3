"""The documentation as programs: its commands and blocks, what they need to run, and a folder in which they do."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import click

from study.apps.cli import segue

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"`((?:segue|python) [^`]+)`")
SHELL = ("", "sh", "bash", "console")
# What comes after a command on its line, and what stands for something in a synopsis.
AFTER = re.compile(r"\s+(?:#|>|\||&&|;).*$")
SYNOPSIS = re.compile(r"\.\.\.|…|\[|\b[A-Z]{2,}\b|(?<= )[A-Z](?= |$)")

# Commands that only have to be understood, by how they begin, with the reason.
NOT_RUN = {
    "segue play": "needs a screen, and somebody who answers",
    "segue label": "needs somebody who answers",
    "segue demo": "takes half a minute; tests/apps runs it",
    "segue check transitions_today": "takes half a minute: nine methods with motions of 2019",
    "segue render transitions_today": "takes minutes",
    "segue serve transitions_today": "renders for minutes",
    "segue simulate transitions_today": "takes half a minute",
    "segue report results/transitions_today": "follows the one above",
    "segue export results/transitions_today": "follows the one above",
    "segue power transitions_today": "takes minutes",
    "segue render blend_length_jnd": "takes minutes",
    "segue serve protocols/blend_length_jnd.toml": "renders for minutes",
    "segue import-answers": "needs answers from another program; tests/experiment/test_elsewhere.py has some",
    "segue report results/web": "follows the one above",
    "segue report results/my_study --database URL": "needs another database",
    "segue preview hero.glb/walk": "a game's own file",
    "segue one-hop robustness": "takes half a minute; tests/apps/cli/test_one_hop.py runs it, and the next three",
    "segue one-hop chain": "takes half a minute",
    "segue one-hop reach": "takes half a minute",
    "segue one-hop connect": "takes half a minute",
}
# Blocks of pages that are neither commands nor Python nor TOML, by a line of theirs, with the reason.
OTHER_BLOCKS = {
    "docker compose": "commands of another program, Docker; tests/test_deploy.py reads its file",
    "createuser --pwprompt segue": "commands of another program, PostgreSQL",
    "GRANT SELECT, INSERT, DELETE": "commands of another program, PostgreSQL",
    "scripts/test ": "scripts of the repository, which tests/test_scripts.py reads",
    "renderer/  ": "a drawing of folders",
    "git clone": "needs the network; tests/test_scripts.py reads the scripts",
    "walk.bvh: defects dropped": "what a command prints",
    "13 stimulus videos": "what a command prints",
}


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    page: str
    language: str
    text: str

    @property
    def lines(self) -> list[str]:
        """Its commands, continued lines joined."""
        return [line.strip().removeprefix("$ ") for line in self.text.replace("\\\n", " ").splitlines()]


def blocks() -> Iterator[Block]:
    for path in PAGES:
        for language, text in BLOCK.findall(path.read_text(encoding="utf-8")):
            yield Block(path.name, language, text)


def commands(page: Path) -> Iterator[str]:
    """Every command of a page, in order: those of its blocks, then those in sentences."""
    text = page.read_text(encoding="utf-8")
    for language, block in BLOCK.findall(text):
        if language in SHELL:
            yield from Block(page.name, language, block).lines
    for found in INLINE.findall(BLOCK.sub("", text)):
        yield found.replace("\n", " ")


def to_run(page: Path) -> list[str]:
    """The commands of a page that a test can run: those of its blocks, and what is complete in its sentences."""
    text = page.read_text(encoding="utf-8")
    sentences = {found.replace("\n", " ") for found in INLINE.findall(BLOCK.sub("", text))}
    return [line for line in commands(page) if whole(line) and (line not in sentences or complete(line))]


def program(line: str) -> list[str]:
    """The words of a command without what is optional; `I` and `J` stand for numbers, `...` for any text."""
    line = AFTER.sub("", line).replace("...", "x").replace("…", "x")
    line = re.sub(r"(?<= )[A-Z](?= |$)", "1", line)
    return shlex.split(re.sub(r"\[[^]]*\]", "", line))


def whole(line: str) -> bool:
    """Whether a command is one of Segue's that can be run as it stands: no synopsis, and none of the list above."""
    plain = AFTER.sub("", line)
    if not plain.startswith("segue ") or SYNOPSIS.search(plain):
        return False
    words = shlex.split(plain)
    if len(words) < 3 and words[1] not in ("demo", "doctor"):
        return False
    return not any(" ".join(words).startswith(other) for other in NOT_RUN)


def complete(line: str) -> bool:
    """Whether a command has all that its verb needs; a sentence that only names a verb or an option has not."""
    try:
        verb, words = verb_of(line)
        verb.make_context("segue", words)
    except (click.UsageError, click.exceptions.Exit):
        return False
    return True


def verb_of(line: str) -> tuple[click.Command, list[str]]:
    """The verb of a command of Segue, and its arguments."""
    found: click.Command = segue
    context, words = click.Context(segue), program(line)[1:]
    while isinstance(found, click.Group) and words and not words[0].startswith("-"):
        inner = found.get_command(context, words[0])
        assert inner is not None, f"{line}: no verb {words[0]}"
        found, words = inner, words[1:]
        context = click.Context(found, parent=context)
    return found, words


def furnish(folder: Path) -> None:
    """The files that the pages speak of: motions, a library, labels, data of another program, clips as downloaded."""
    from study.motion.readers.bvh_writing import write_bvh
    from study.motion.synthetic import synthesize

    (folder / "motions").mkdir(exist_ok=True)
    for name, places in (("walk", (".", "motions")), ("run", (".", "motions")), ("box", ("motions",))):
        for place in places:
            write_bvh(synthesize(name, seconds=6), folder / place / f"{name}.bvh")
    cuts = [f"walk,run,{20 + 9 * n},{30 + 7 * n},{('good', 'bad')[n % 2]}" for n in range(8)]
    (folder / "labels.csv").write_text(
        "\n".join(["source,destination,source_frame,destination_frame,label", *cuts]) + "\n", encoding="utf-8"
    )
    rows = [f"p{n % 3},{n % 5 + 1},{int(n * 7 % 10 < 5 + n % 5)}" for n in range(90)]
    (folder / "data.csv").write_text("\n".join(["participant,contrast,correct", *rows]) + "\n", encoding="utf-8")


def small(protocol: Path) -> None:
    """Make a protocol's films small, so that they are rendered in a moment."""
    text = protocol.read_text(encoding="utf-8")
    text = text.replace("[stimuli]\n", "[stimuli]\nwidth = 64\nheight = 64\n", 1).replace(
        "participants = 24", "participants = 4"
    )
    protocol.write_text(text, encoding="utf-8")
