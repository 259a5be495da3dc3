"""Prints the licence of every package that an installation of Segue holds, as a Markdown table.

    .venv/bin/python scripts/licences.py [--extras softgl,postgres]

Taken are Segue's own requirements, those of the extras named, and what all of these require in turn.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import re
from collections.abc import Iterable

from packaging.requirements import Requirement


def normalised(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def installed(name: str, extras: Iterable[str] = ()) -> dict[str, importlib.metadata.Distribution]:
    """The packages that one requires, directly or not, by name; what isn't installed here is left out."""
    found: dict[str, importlib.metadata.Distribution] = {}
    waiting = [(name, tuple(extras))]
    seen = set()
    while waiting:
        asked = waiting.pop()
        if asked in seen:
            continue
        seen.add(asked)
        try:
            package = importlib.metadata.distribution(asked[0])
        except importlib.metadata.PackageNotFoundError:
            continue
        found[normalised(asked[0])] = package
        for line in package.requires or []:
            required = Requirement(line)
            if required.marker is None or any(required.marker.evaluate({"extra": e}) for e in ("", *asked[1])):
                waiting.append((required.name, tuple(sorted(required.extras))))
    return {other: package for other, package in sorted(found.items()) if other != normalised(name)}


def licence(package: importlib.metadata.Distribution) -> str:
    """What its own description says, in a few words."""
    about = package.metadata
    if expression := about.get("License-Expression"):
        return expression
    classified = [c.split("::")[-1].strip() for c in about.get_all("Classifier") or [] if c.startswith("License ::")]
    named = [c for c in classified if c != "OSI Approved"]
    lines = (about.get("License") or "").strip().splitlines()
    return "; ".join(named) or (lines[0][:60] if len(lines) == 1 else "see its own text" if lines else "not stated")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--extras", default="", help="optional parts, such as softgl,postgres")
    extras = [extra for extra in parser.parse_args().extras.split(",") if extra]
    print("| package | version here | licence |\n|---|---|---|")
    for name, package in installed("segue", extras).items():
        print(f"| {name} | {package.version} | {licence(package)} |")


if __name__ == "__main__":
    main()
