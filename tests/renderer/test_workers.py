"""Jobs in this process, in threads, in processes; what is lost is tried again. `tests/test_cluster.py` has Dask's."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from squares import die, die_once, square

from renderer.errors import RendererError
from renderer.workers import Workers, run_jobs

PLACES = {"one": {"where": 1}, "threads": {"where": 2, "threads": True}, "processes": {"where": 2}}


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
def test_every_job_is_done_once_wherever(place: dict[str, Any]) -> None:
    assert sorted(run_jobs(square, range(12), **place)) == [(n, n * n) for n in range(12)]
    assert list(run_jobs(square, [], **place)) == []
    with pytest.raises(RendererError, match="13 is not squared"):
        list(run_jobs(square, range(12, 20), **place))


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
def test_jobs_are_taken_when_they_are_about_to_begin(place: dict[str, Any]) -> None:
    taken: list[int] = []

    def coming() -> Iterator[int]:
        for number in range(40):
            taken.append(number)
            yield number

    work = run_jobs(square, coming(), **place, in_order=True)
    assert [next(work) for _ in range(10)] == [(n, n * n) for n in range(10)]
    assert len(taken) <= 10 + 3
    work.close()  # type: ignore[attr-defined]


@pytest.mark.skipif(os.name != "posix", reason="signals are POSIX")
def test_a_killed_process_costs_its_job_a_second_try(tmp_path: Path) -> None:
    mark = tmp_path / "killed"
    assert sorted(run_jobs(partial(die_once, mark), range(6), 2)) == [(n, n * n) for n in range(6)]
    assert mark.exists()
    with pytest.raises(RendererError, match="again with the same job: killed for memory"):
        list(run_jobs(die, range(4), 2))


def test_a_wrong_address_is_refused_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(RendererError, match=r"expected Dask, found none here; pip install dask distributed"):
        Workers("tcp://127.0.0.1:9")
