"""Writes docs/api.md, the reference of the package `segue`, from its docstrings; with --check only compares.

.venv/bin/python scripts/api.py [--check]
"""

from __future__ import annotations

import inspect
import re
import sys
from pathlib import Path

import segue

PAGE = Path(__file__).parents[1] / "docs" / "api.md"
ORDER = (
    *("read", "write", "motions", "trim", "blend", "blend_length", "costs", "strip", "film", "View"),
    *("Study", "Results", "analyse", "fit", "one_hop", "play", "Clip", "SegueError"),
)
INTRO = """# Segue in Python

`import segue` gives the functions behind the command line by short names, for scripts and notebooks. The folder
`examples` has four notebooks. This page is written from their docstrings by `scripts/api.py`.

"""


def reference() -> str:
    """The page."""
    return INTRO + "\n".join(section(name, getattr(segue, name)) for name in ORDER)


def section(name: str, thing: object) -> str:
    """A name's heading, its docstring, and for a class of ours those of its methods."""
    text = f"## `segue.{name}{signature(thing)}`\n\n{words(thing)}\n"
    own = inspect.isclass(thing) and thing.__module__.startswith("segue")
    for inner, method in vars(thing).items() if own else ():
        if not inner.startswith("_") and (callable(method) or isinstance(method, property)):
            shown = method.fget if isinstance(method, property) else method
            text += f"\n**`.{inner}{'' if isinstance(method, property) else signature(shown)}`** {words(shown)}\n"
    return text


def signature(thing: object) -> str:
    """The parameters without their types, which the docstring explains."""
    if inspect.isclass(thing) and not thing.__module__.startswith("segue"):
        return ""
    parameters = list(inspect.signature(thing).parameters.values())  # type: ignore[arg-type]
    plain = [p.replace(annotation=inspect.Parameter.empty) for p in parameters if p.name != "self"]
    return str(inspect.Signature(plain))


def words(thing: object) -> str:
    """A docstring as Markdown: the headings of numpy's style become bold, what is explained a list."""
    lines, inside = [], False
    for line in (inspect.getdoc(thing) or "").splitlines():
        if re.fullmatch("-{3,}", line):
            lines[-1] = f"**{lines[-1].removeprefix('- ').strip('`')}**\n"
            inside = True
        elif inside and line and not line.startswith(" "):
            lines.append(f"- `{line}`" if not lines[-1].startswith("**Notes") else line)
        else:
            lines.append(line.replace("    ", "  ", 1) if inside else line)
    return "\n".join(lines).strip()


def main() -> int:
    """0 where the page is as it should be."""
    page = reference()
    if "--check" in sys.argv:
        return int(PAGE.read_text(encoding="utf-8") != page)
    PAGE.write_text(page, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
