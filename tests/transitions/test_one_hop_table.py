"""The table: look-up, both kinds of file, and a reader that knows only what the header says."""

from __future__ import annotations

import json
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.errors import TransitionError
from study.transitions.one_hop.problem import Alignment
from study.transitions.one_hop.table import Entry, OneHopTable, Row, read_table, write_table


def some_table(transitions: int = 3, triggers: int = 7) -> OneHopTable:
    rng = np.random.default_rng(5)
    count = transitions * triggers
    entries = rng.integers(-500, 500, (count, 4)).astype(np.int32)
    entries[:, 0] = rng.integers(0, transitions + 1, count)
    entries[4] = (-1, 0, 0, 0)
    rows = tuple(Row(k, k + 1, Alignment(offset=k), 2, triggers, k * triggers) for k in range(transitions))
    names = tuple(f"clip{k}" for k in range(transitions + 1))
    costs = rng.random(count)
    return OneHopTable(
        names, (triggers + 2,) * len(names), 60.0, 30, rows, entries, costs, 2.0 * costs, 2.5e-4, "square metres"
    )


@pytest.mark.parametrize("suffix", [".npz", ".bin", ".json"])
def test_a_file_gives_back_the_table(tmp_path: Path, suffix: str) -> None:
    table = some_table()
    files = write_table(table, tmp_path / f"dance{suffix}")
    assert all(file.exists() for file in files)
    assert not list(tmp_path.glob("*.part"))
    again = read_table(tmp_path / f"dance{suffix}")
    assert np.array_equal(again.entries, table.entries)
    assert again.entries.dtype == np.int32
    for name in ("clips", "frames", "fps", "blend_frames", "rows", "weight", "words"):
        assert getattr(again, name) == getattr(table, name)
    if suffix == ".npz":
        assert np.array_equal(again.costs, table.costs)
        assert np.array_equal(again.direct_costs, table.direct_costs)


def test_a_reader_that_knows_only_the_header_finds_the_same_entry(tmp_path: Path) -> None:
    table = some_table()
    flat, words = write_table(table, tmp_path / "dance.bin")
    header = json.loads(words.read_text())
    row = next(r for r in header["transitions"] if (r["source"], r["destination"]) == (1, 2))
    position = row["first_entry"] + 5 - row["first_trigger"]
    found = dict(zip(header["columns"], struct.unpack_from("<4i", flat.read_bytes(), 16 * position), strict=True))
    assert table.look_up(1, 2, 5) == Entry(**found)


def test_look_up() -> None:
    table = some_table()
    assert table.look_up(0, 1, 6) is None
    assert table.number("clip2") == 2
    with pytest.raises(TransitionError, match="triggered frame from 2 to 8 of clip0, got 9"):
        table.look_up(0, 1, 9)
    with pytest.raises(TransitionError, match=r"table, which has clip0 to clip1, .* got clip2 to clip1"):
        table.look_up(2, 1, 3)
    with pytest.raises(TransitionError, match=r"clip of the table .* got 'waltz'"):
        table.number("waltz")


def test_refusals(tmp_path: Path) -> None:
    table = some_table()
    with pytest.raises(TransitionError, match=r"ends in \.npz, \.bin or \.json, got 'dance\.txt'"):
        write_table(table, tmp_path / "dance.txt")
    flat, words = write_table(table, tmp_path / "dance.bin")
    content = flat.read_bytes()
    flat.write_bytes(content[:-4])
    with pytest.raises(TransitionError, match=r"expected 336 bytes, as dance\.json says, found 332"):
        read_table(flat)
    flat.write_bytes(content)
    header = json.loads(words.read_text())
    words.write_text(json.dumps({**header, "version": 99}))
    with pytest.raises(TransitionError, match=r"version 1 .* found segue one-hop table 99"):
        read_table(flat)
    words.unlink()
    with pytest.raises(TransitionError, match=r"dance\.json is missing"):
        read_table(flat)
    np.savez(tmp_path / "other.npz", costs=np.zeros(3))
    with pytest.raises(TransitionError, match="one-hop table, found arrays costs"):
        read_table(tmp_path / "other.npz")


def test_costs_that_are_infinite_survive(tmp_path: Path) -> None:
    table = replace(some_table(), costs=np.full(21, np.inf))
    write_table(table, tmp_path / "t.npz")
    assert np.isinf(read_table(tmp_path / "t.npz").costs).all()
