"""The table that a runtime looks up: for every triggered frame four integers, in memory and in two kinds of file.

An entry is (hop clip, temporal alignment offset of the hop, stay in the source, stay in the hop), Koyama & Goto 2019,
Eq. 1; the hop is -1 where no transition fits in the clips. 50 transitions of 1,000 frames are 800,000 bytes.

Files: `NAME.npz` (arrays for NumPy, costs too) and `NAME.bin` with `NAME.json` (little-endian 32-bit integers that a
game engine reads without us, every entry or as `runs`); `docs/one_hop.md` describes them.
"""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.arrays import CountArray, FloatArray
from study.errors import TransitionError
from study.files import whole_file, write_whole
from study.transitions.one_hop.problem import FORBIDDEN, Alignment, Problem, Switch
from study.transitions.one_hop.runs import KINDS, from_runs, to_runs
from study.transitions.one_hop.search import Best

FORMAT, VERSION = "segue one-hop table", 1
VERSION_OF_RUNS = 2
_ROWS_AT_ONCE = 2**20
COLUMNS = ("hop", "offset", "stay_source", "stay_hop")
# Two more where each transition has blend lengths of its own.
BLEND_COLUMNS = ("blend_first", "blend_second")


@dataclass(frozen=True)
class Entry:
    """One transition (2019, Eq. 1); frames."""

    hop: int
    """The hop clip's number."""
    offset: int
    """The source's frame that coincides with the hop's frame 0."""
    stay_source: int
    stay_hop: int
    """Frames to wait before the first and before the second blend."""
    blend_first: int | None = None
    blend_second: int | None = None
    """Frames of both blends, where the table has them for each entry; None where it has one length for all."""


@dataclass(frozen=True)
class Row:
    """One transition of the state machine in the table."""

    source: int
    destination: int
    """Clip numbers."""
    alignment: Alignment
    """Where the destination stands on the source's timeline."""
    first_trigger: int
    triggers: int
    """The first triggered frame, and how many there are."""
    first_entry: int
    """Where its entries start."""


@dataclass(frozen=True, eq=False)
class OneHopTable:
    """Optimal one-hop transitions."""

    clips: tuple[str, ...]
    frames: tuple[int, ...]
    """Name and number of frames of each clip, in the order of their numbers."""
    fps: float
    """Frame rate of all clips."""
    blend_frames: int
    """Frames of each blend; where entries have their own, those of a direct transition."""
    rows: tuple[Row, ...]
    """The transitions."""
    entries: CountArray
    """`(n, 4) or (n, 6) int32`: all entries, row after row; see `COLUMNS` and `BLEND_COLUMNS`."""
    costs: FloatArray
    direct_costs: FloatArray
    """`(n,)`: eq. 2 for each entry, and the distance of the direct transition; infinite where there is none."""
    weight: float
    """`w` of Eq. 2, cost a frame of stay."""
    words: str
    """What the cost is, with its unit."""

    @property
    def columns(self) -> tuple[str, ...]:
        """What the integers of an entry are."""
        return (*COLUMNS, *BLEND_COLUMNS) if self.entries.shape[1] > len(COLUMNS) else COLUMNS

    def row(self, source: int, destination: int) -> Row:
        """The transition between two clips; `TransitionError` where the table has none."""
        for row in self.rows:
            if (row.source, row.destination) == (source, destination):
                return row
        known = ", ".join(f"{self.clips[row.source]} to {self.clips[row.destination]}" for row in self.rows[:8])
        raise TransitionError(
            f"Expected a transition of the table, which has {known}{', ...' if len(self.rows) > 8 else ''}; got "
            f"{self._name(source)} to {self._name(destination)}."
        )

    def position(self, source: int, destination: int, trigger: int) -> int:
        """The index of a triggered frame's entry in `entries`."""
        row = self.row(source, destination)
        last = row.first_trigger + row.triggers - 1
        if not row.first_trigger <= trigger <= last:
            raise TransitionError(
                f"Expected a triggered frame from {row.first_trigger} to {last} of {self._name(source)}, got {trigger}."
            )
        return row.first_entry + trigger - row.first_trigger

    def look_up(self, source: int, destination: int, trigger: int) -> Entry | None:
        """The transition for a triggered frame, None where none fits in the clips."""
        hop, *rest = (int(number) for number in self.entries[self.position(source, destination, trigger)])
        return None if hop < 0 else Entry(hop, *rest)

    def number(self, name: str) -> int:
        """A clip's number by its name."""
        if name not in self.clips:
            raise TransitionError(f"Expected a clip of the table ({', '.join(self.clips)}), got {name!r}.")
        return self.clips.index(name)

    def _name(self, number: int) -> str:
        return self.clips[number] if 0 <= number < len(self.clips) else f"clip {number}"


def kind_of(problem: Problem) -> np.dtype[Any]:
    """How a triggered frame is held while a table is built: its entry and both costs."""
    integers = len(COLUMNS) + (len(BLEND_COLUMNS) if problem.settings.lengths else 0)
    return np.dtype([("entry", np.int32, (integers,)), ("cost", np.float64), ("direct_cost", np.float64)])


def filled(problem: Problem, switch: Switch, found: Best, direct: CountArray) -> NDArray[Any]:
    """The triggered frames of a transition, `(n,)` of `kind_of`, from what a search found."""
    triggers, out = problem.triggers(switch), np.empty(len(found.hop), dtype=kind_of(problem))
    offset = np.arange(triggers.start, triggers.stop) + found.stay_source - found.frame
    columns = [found.hop, offset, found.stay_source, found.stay_hop]
    if problem.settings.lengths:
        columns += [found.blend_first, found.blend_second]
    entry = out["entry"]
    entry[:] = np.stack(columns, axis=1)
    entry[found.hop < 0] = (-1, *(0,) * (len(columns) - 1))
    out["cost"] = _in_units(found.cost, problem.distance.unit)
    out["direct_cost"] = _in_units(direct, problem.distance.unit)
    return out


def table_of(problem: Problem, found: NDArray[Any]) -> OneHopTable:
    """The table of all transitions, one after another, `(n,)` of `kind_of`."""
    rows, first_entry = [], 0
    for switch in problem.switches:
        triggers = problem.triggers(switch)
        rows.append(
            Row(switch.source, switch.destination, switch.alignment, triggers.start, len(triggers), first_entry)
        )
        first_entry += len(triggers)
    return OneHopTable(
        tuple(clip.name or f"clip {k}" for k, clip in enumerate(problem.clips)),
        tuple(clip.frames for clip in problem.clips),
        problem.clips[0].fps,
        problem.settings.blend_frames,
        tuple(rows),
        found["entry"],
        found["cost"],
        found["direct_cost"],
        problem.weight * problem.distance.unit,
        problem.distance.words,
    )


def _in_units(counts: CountArray, unit: float) -> FloatArray:
    return np.where(counts >= FORBIDDEN, np.inf, counts * unit)


def header(table: OneHopTable) -> dict[str, Any]:
    """What a file says besides its integers."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "columns": list(table.columns),
        "type": "little-endian 32-bit signed integers",
        "bytes": int(table.entries.size * 4),
        "entries": len(table.entries),
        "fps": table.fps,
        "blend_frames": table.blend_frames,
        "weight": table.weight,
        "cost": table.words,
        "clips": [{"name": name, "frames": frames} for name, frames in zip(table.clips, table.frames, strict=True)],
        "transitions": [asdict(row) for row in table.rows],
    }


def write_table(table: OneHopTable, path: Path, *, as_runs: bool = False) -> tuple[Path, ...]:
    """Writes `path` by its suffix: `.npz`, or `.bin` (or `.json`) for the flat file and its header; all at once.

    With `as_runs` the flat file holds neighbouring entries together (`runs`).

    Returns
    -------
    The files written.
    """
    text = json.dumps(header(table), indent=2)
    if path.suffix == ".npz":
        arrays: dict[str, Any] = {"entries": table.entries, "costs": table.costs, "direct_costs": table.direct_costs}
        with whole_file(path) as unfinished, unfinished.open("wb") as file:
            np.savez(file, header=np.array(text), **arrays)
        return (path,)
    if path.suffix not in (".bin", ".json"):
        raise TransitionError(f"Expected a file name that ends in .npz, .bin or .json, got {path.name!r}.")
    flat, words = path.with_suffix(".bin"), path.with_suffix(".json")
    content = table.entries
    if as_runs:
        content = to_runs(table.entries)
        own = {"version": VERSION_OF_RUNS, "runs": len(content), "bytes": int(content.size * 4), "kinds": KINDS}
        text = json.dumps({**header(table), **own}, indent=2)
    with whole_file(flat) as unfinished, unfinished.open("wb") as file:
        for at in range(0, len(content), _ROWS_AT_ONCE):
            file.write(content[at : at + _ROWS_AT_ONCE].astype("<i4").tobytes())
    write_whole(words, text)
    return flat, words


def read_table(path: Path) -> OneHopTable:
    """A table from a file; costs come only with `.npz` and are infinite otherwise.

    Raises
    ------
    TransitionError
        For a file that is not such a table, of another version, cut short or damaged.
    """
    try:
        return _read_table(path)
    except (ValueError, KeyError, TypeError, EOFError, IndexError, zipfile.BadZipFile, zlib.error) as error:
        raise TransitionError(
            f"{path}: expected a {FORMAT}, found a damaged file ({error}). Build it again."
        ) from error


def _read_table(path: Path) -> OneHopTable:
    if path.suffix == ".npz":
        with np.load(path) as arrays:
            if "header" not in arrays:
                raise TransitionError(f"{path}: expected a one-hop table, found arrays {', '.join(arrays)}.")
            return _table(
                json.loads(str(arrays["header"])), arrays["entries"], path, arrays["costs"], arrays["direct_costs"]
            )
    flat, words = path.with_suffix(".bin"), path.with_suffix(".json")
    for needed in (flat, words):
        if not needed.exists():
            raise TransitionError(
                f"{path}: expected {flat.name} and {words.name} side by side; {needed.name} is missing."
            )
    content = flat.read_bytes()
    said = json.loads(words.read_text(encoding="utf-8"))
    if len(content) != said.get("bytes", -1):
        raise TransitionError(
            f"{flat}: expected {said.get('bytes', 'no')} bytes, as {words.name} says, found {len(content)}. "
            "Build it again."
        )
    width, numbers = len(said.get("columns", COLUMNS)), np.frombuffer(content, dtype="<i4").astype(np.int32)
    if said.get("version") == VERSION_OF_RUNS:
        count = sum(row["triggers"] for row in said["transitions"])
        if count != said["entries"] or (len(numbers) == 0) != (count == 0):
            raise TransitionError(f"{words}: expected {count} entries, its triggered frames, found another number.")
        entries = from_runs(numbers.reshape(-1, 1 + width), range(count))
        return _table({**said, "version": VERSION}, entries, path)
    return _table(said, numbers.reshape(-1, width), path)


def _table(
    said: Mapping[str, Any],
    entries: CountArray,
    path: Path,
    costs: FloatArray | None = None,
    direct_costs: FloatArray | None = None,
) -> OneHopTable:
    known = (COLUMNS, (*COLUMNS, *BLEND_COLUMNS))
    if said.get("format") != FORMAT or said.get("version") != VERSION or tuple(said["columns"]) not in known:
        raise TransitionError(
            f"{path}: expected a {FORMAT} of version {VERSION} with columns {', '.join(COLUMNS)}, found "
            f"{said.get('format')} {said.get('version')} {said.get('columns')}. Build it again."
        )
    unknown = np.full(len(entries), np.inf)
    return OneHopTable(
        tuple(clip["name"] for clip in said["clips"]),
        tuple(clip["frames"] for clip in said["clips"]),
        said["fps"],
        said["blend_frames"],
        tuple(Row(**{**row, "alignment": Alignment(**row["alignment"])}) for row in said["transitions"]),
        entries,
        unknown if costs is None else costs,
        unknown if direct_costs is None else direct_costs,
        said["weight"],
        said["cost"],
    )
