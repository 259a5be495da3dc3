"""The rules of Psych-DS 1 for a data set, from its public specification; its own validator is on no registry."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

KEYWORDS = {"study", "site", "subject", "session", "task", "condition", "trial", "stimulus", "description"}
NAME = re.compile(r"[a-z]+-[a-zA-Z0-9]+(_[a-z]+-[a-zA-Z0-9]+)*_data\.(csv|tsv)")
CONTEXT = re.compile(r"https?://(www\.)?schema\.org/?")


def problems(folder: Path) -> list[str]:
    """All that is wrong with a data set, and what is recommended by name and missing."""
    return [*_problems(folder)]


def _problems(folder: Path) -> Iterator[str]:
    described = folder / "dataset_description.json"
    if not described.is_file():
        yield "no dataset_description.json"
        return
    about = json.loads(described.read_text(encoding="utf-8"))
    yield from (f"no {key}" for key in ("name", "description", "variableMeasured") if not about.get(key))
    if about.get("@type") != "Dataset":
        yield "@type is not Dataset"
    if not CONTEXT.fullmatch(about.get("@context", "")):
        yield "@context is not schema.org"
    if not [*folder.glob("README.*")]:
        yield "no README"
    yield from _untyped(about)
    used: set[str] = set()
    files = [path for path in (folder / "data").rglob("*") if path.suffix in (".csv", ".tsv")]
    if not files:
        yield "no table under data"
    for path in files:
        if not NAME.fullmatch(path.name):
            yield f"{path.name}: its name"
        elif odd := {part.partition("-")[0] for part in path.stem.split("_")[:-1]} - KEYWORDS:
            yield f"{path.name}: unofficial keywords {sorted(odd)}"
        with path.open(encoding="utf-8", newline="") as file:
            header, *table = csv.reader(file, delimiter="\t" if path.suffix == ".tsv" else ",", strict=True)
        if len(set(header)) < len(header) or "" in header:
            yield f"{path.name}: its header"
        if any(len(row) != len(header) for row in table):
            yield f"{path.name}: rows of another length"
        ids = [row[header.index("row_id")] for row in table] if "row_id" in header else []
        if len(set(ids)) < len(ids):
            yield f"{path.name}: row_id repeats"
        own = path.with_suffix(".json")
        beside = json.loads(own.read_text(encoding="utf-8")) if own.is_file() else {}
        yield from _untyped(beside)
        names = _variables({**about, **beside})
        yield from (f"{path.name}: {name} is not described" for name in header if name not in names)
        yield from (f"{path.name}: {name} is not in its table" for name in _variables(beside) if name not in header)
        used |= set(header)
    yield from (f"{name} is in no table" for name in _variables(about) if name not in used)


def _variables(about: dict[str, Any]) -> list[str]:
    return [one["name"] if isinstance(one, dict) else one for one in about.get("variableMeasured", [])]


def _untyped(value: Any, inside: str = "") -> Iterator[str]:
    """Objects within metadata that do not say what they are."""
    if isinstance(value, dict):
        if inside and "@type" not in value:
            yield f"an object in {inside} without @type"
        for key, part in value.items():
            yield from _untyped(part, key)
    elif isinstance(value, list):
        for part in value:
            yield from _untyped(part, inside)
