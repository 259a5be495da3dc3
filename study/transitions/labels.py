"""Labelled transitions as a CSV file: read, and appended to one at a time.

In: a CSV file with a header, one transition a row. Out: `Label`s. What was written is never lost: a new row goes into a
copy of the file, which then takes the file's place. The training set of Wang & Bodenheimer 2003, section 3.
"""

from __future__ import annotations

import csv
import io
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from study.errors import TransitionError
from study.files import read_text, write_whole

LABELS = ("good", "bad", "skip")


@dataclass(frozen=True)
class Label:
    """What a person said of a cut."""

    source: str
    destination: str
    """Names of the motions."""
    source_frame: int
    destination_frame: int
    """The frames that the cut joins, at `fps`."""
    label: str
    """`"good"`, `"bad"`, or `"skip"` where the person would not say."""
    fps: float = 30.0
    """Frame rate that the frames count at."""
    library: str = ""
    """Where the motions come from; empty where that was not kept."""
    found: str = ""
    """How the candidate was found, such as `best lee2002`; empty for those that a person chose."""

    @property
    def cut(self) -> tuple[str, str, int, int]:
        """What was labelled."""
        return self.source, self.destination, self.source_frame, self.destination_frame


COLUMNS = tuple(field.name for field in fields(Label))
_REQUIRED = COLUMNS[:5]


def read_labels(path: Path) -> tuple[Label, ...]:
    """The labels of a file, in order; of a cut that was labelled twice, the last one.

    Raises
    ------
    TransitionError
        With file and line, for missing columns, frames that are no numbers, and unknown labels.
    """
    text = read_text(path, "a CSV file of labelled transitions")
    reader = csv.DictReader(io.StringIO(text))
    missing = [name for name in _REQUIRED if name not in (reader.fieldnames or ())]
    if missing:
        raise TransitionError(
            f"{path}:1: expected the columns {', '.join(_REQUIRED)}, found {', '.join(reader.fieldnames or ['none'])}; "
            f"add {', '.join(missing)}."
        )
    found: dict[tuple[str, str, int, int], Label] = {}
    for row in reader:
        label = _label(row, f"{path}:{reader.line_num}")
        found.pop(label.cut, None)
        found[label.cut] = label
    return tuple(found.values())


def _label(row: dict[str, str], place: str) -> Label:
    said = (row["label"] or "").strip().lower()
    if said not in LABELS:
        raise TransitionError(f"{place}: expected a label of {', '.join(LABELS)}, found {said!r}.")
    frames = []
    for name in ("source_frame", "destination_frame"):
        value = (row[name] or "").strip()
        if not value.isdigit():
            raise TransitionError(f"{place}: expected a frame number from 0 as {name}, found {value!r}.")
        frames.append(int(value))
    rate = (row.get("fps") or "30").strip()
    try:
        fps = float(rate)
    except ValueError:
        raise TransitionError(f"{place}: expected a number as fps, found {rate!r}.") from None
    source, destination = (row["source"] or "").strip(), (row["destination"] or "").strip()
    library, how = row.get("library") or "", row.get("found") or ""
    return Label(source, destination, frames[0], frames[1], said, fps, library, how)


def append_label(path: Path, label: Label) -> None:
    """Write one more label; the file is whole before and after, whatever happens between."""
    before = read_text(path, "a CSV file of labelled transitions") if path.exists() else ""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    if before:
        own = next(csv.reader(io.StringIO(before)))
        writer = csv.DictWriter(text, own, lineterminator="\n", extrasaction="ignore")
    else:
        writer.writeheader()
    writer.writerow(asdict(label))
    if before and not before.endswith("\n"):
        before += "\n"
    write_whole(path, before + text.getvalue())
