"""2,000 cases of `benchmarks/fuzz.py` each time: damaged files and messages end in an answer or a refusal."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from programs import program

CASES, SEED, CHUNKS = 2000, 1, 16
# Rare ones that were found among many more: models of preferences that overflowed or divided by zero.
FOUND_ONCE = {"table": (2603, 6312, 7638)}


@pytest.fixture(scope="module")
def fuzz() -> Iterator[ModuleType]:
    logs = {name: logging.getLogger(name) for name in ("segue.serve", "uvicorn.error")}
    before = {name: (log.level, log.propagate, [*log.handlers]) for name, log in logs.items()}
    yield program("benchmarks/fuzz")
    for name, log in logs.items():  # its server silences them
        log.setLevel(before[name][0])
        log.propagate, log.handlers = before[name][1:]


@pytest.mark.parametrize("chunk", range(CHUNKS))
def test_damaged_input_ends_in_an_answer_or_a_refusal(fuzz: ModuleType, chunk: int) -> None:
    chosen = fuzz.cases(CASES, list(fuzz.KINDS))[chunk::CHUNKS]
    outcomes = [fuzz.run_case(kind, SEED, number) for kind, number in chosen]
    finds = [f"{o.name}: {o.fault}\n{o.details[-1500:]}" for o in outcomes if o.result == "fault"]
    assert not finds, "\n\n".join(finds)
    assert {o.result for o in outcomes} == {"accepted", "refused"}


@pytest.mark.parametrize(("kind", "number"), [(kind, n) for kind, numbers in FOUND_ONCE.items() for n in numbers])
def test_what_was_found_once_stays_mended(fuzz: ModuleType, kind: str, number: int) -> None:
    outcome = fuzz.run_case(kind, SEED, number)
    assert outcome.result != "fault", outcome.details


def test_a_case_is_the_same_each_time(fuzz: ModuleType, tmp_path: Path) -> None:
    for kind in ("bvh", "acclaim", "library", "protocol", "table", "gltf"):
        contents = []
        for name in ("one", "two"):
            folder = tmp_path / f"{kind}-{name}"
            folder.mkdir()
            fuzz.KINDS[kind][0](fuzz.np.random.default_rng([7, 3]), folder)
            contents.append([file.read_bytes() for file in sorted(folder.iterdir())])
        assert contents[0] == contents[1], kind


def test_what_a_verb_may_not_do_is_found(fuzz: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    """A traceback, silence, endless work, too much memory and a missing number: each is a find, and says where."""
    from study.apps.cli import motions as motion_commands

    def ends(fault: Any) -> Any:
        def inspect(*_: object, **__: object) -> None:
            fault()

        monkeypatch.setattr(motion_commands.inspect, "callback", inspect)
        return fuzz.run_case("bvh", 1, 0)

    monkeypatch.setattr(fuzz, "SECONDS", 0.3)
    assert "ZeroDivisionError" in ends(lambda: 1 // 0).fault
    assert "over 0.3 s of processor time" in ends(lambda: [None for _ in iter(int, 1)]).fault
    with monkeypatch.context() as slow:
        slow.setattr(fuzz, "_some_work", lambda: 3 * fuzz.ORDINARY)
        assert ends(lambda: [None for _ in iter(int, 1)]).seconds >= 0.9, "a slow machine gets more time"
    assert "MemoryError" in ends(lambda: fuzz.np.ones(2**40)).fault
    assert "Warning" in ends(lambda: fuzz.warnings.warn("overflow encountered in exp", stacklevel=1)).fault
    with pytest.raises(fuzz.FaultError, match=r"\.low says 'from nan to 3'"):
        fuzz._look_for_missing_numbers({"low": "from nan to 3"})
    with pytest.raises(fuzz.FaultError, match="percent is null, and nothing says why"):
        fuzz._look_for_missing_numbers({"of": [{"percent": None, "note": ""}]})
    fuzz._look_for_missing_numbers({"percent": None, "note": "nobody answered that question"})


def test_the_disk_of_a_case_can_be_full(fuzz: ModuleType, tmp_path: Path) -> None:
    with fuzz.disk_full_after(1000), pytest.raises(OSError, match="File too large"):
        (tmp_path / "large").write_bytes(b"x" * 2000)
    (tmp_path / "large").write_bytes(b"x" * 2000)
