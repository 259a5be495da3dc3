"""A Dask cluster of this machine, whose workers see no folder of ours: the same results as one process gives."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from hashlib import sha256
from pathlib import Path

import pytest
from parts import unavailable
from squares import die_once, square

from renderer.errors import RendererError
from renderer.figure import make_figure
from renderer.framing import frame_group
from renderer.jobs import RenderJob, render_many
from renderer.workers import Workers, run_jobs
from study.experiment.protocol.whole import find_protocol, load_protocol
from study.motion.clip import joint_positions
from study.motion.synthetic import synthesize
from study.power.planned import plan_power
from study.tasks.trial import Pair
from study.transitions.one_hop.build import build_table
from study.transitions.one_hop.problem import Alignment, Problem, Settings, Switch

ROOT = Path(__file__).parents[1]
PROGRAM = """
import sys
from distributed import LocalCluster
if __name__ == "__main__":
    with LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a scheduler with two worker processes; one that is killed is replaced."""
    try:
        import distributed  # noqa: F401
    except ImportError:
        unavailable("Dask", "pip install dask distributed")
    folder = tmp_path_factory.mktemp("cluster")
    (folder / "cluster.py").write_text(PROGRAM)
    # By default results of a worker that was killed are asked for during half a minute.
    settings = {"DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "2s", "PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'tests'}"}
    with subprocess.Popen(
        [sys.executable, "cluster.py"],
        cwd=folder,
        env={**os.environ, **settings},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as process:
        assert process.stdout is not None
        yield process.stdout.readline().strip()
        process.communicate(timeout=60)


@pytest.mark.skipif(os.name != "posix", reason="signals are POSIX")
def test_a_lost_worker_costs_its_job_a_second_try(cluster: str, tmp_path: Path) -> None:
    mark = tmp_path / "killed"
    assert sorted(run_jobs(partial(die_once, mark), range(6), cluster)) == [(n, n * n) for n in range(6)]
    assert mark.exists()
    with pytest.raises(RendererError, match="13 is not squared"):
        list(run_jobs(square, range(12, 20), cluster))


@pytest.mark.gl
def test_films_come_back_as_bytes_and_are_those_of_one_process_and_of_two(cluster: str, tmp_path: Path) -> None:
    walk = synthesize("walk", seconds=2, fps=30.0)
    positions = joint_positions(walk, ends=True)
    figure = make_figure(walk.skeleton.bones, walk.skeleton.sides, walk.skeleton.roles, style="mannequin")
    camera = frame_group([positions], figures=[figure], size=(320, 240))
    made = {}
    for name, where in {"one": 1, "two": 2, "dask": cluster}.items():
        jobs = [RenderJob(tmp_path / name / f"{n}.mp4", positions[9 * n :][:20], figure, camera) for n in range(5)]
        videos = render_many(jobs, where)
        assert [video.path for video in videos] == [job.path for job in jobs]
        assert [sha256(job.path.read_bytes()).hexdigest() for job in jobs] == [one.file_sha256 for one in videos]
        made[name] = [(one.frames_sha256, one.file_sha256) for one in videos]
    assert len(set(made["one"])) == 5
    assert made["one"] == made["two"] == made["dask"]


def test_one_hop_tables_are_those_of_one_process(cluster: str) -> None:
    clips = tuple(synthesize(name, seconds=3, fps=30.0) for name in ("walk", "box", "run"))
    switches = tuple(Switch(a, b, Alignment(offset=0)) for a in range(3) for b in range(3) if a != b)
    problem = Problem(clips, switches, Settings.at(30.0), 1000)
    # On a cluster the bound is for each worker, so the products are cut up as for one.
    alone, far = (build_table(problem, workers=where) for where in (1, cluster))
    assert sha256(alone.entries.tobytes()).digest() == sha256(far.entries.tobytes()).digest()
    assert alone.costs.tobytes() == far.costs.tobytes()
    assert (alone.entries[:, 0] >= 0).sum() > 200


def test_power_is_that_of_one_process(cluster: str) -> None:
    protocol = load_protocol(find_protocol("geodesic_vs_fixed"))
    (study,) = protocol.studies
    methods = ("geodesic", "fixed")
    pairs = [
        Pair(f"{study.name}/{name}", study.name, study.task, name, name, (f"{name}-a", f"{name}-b"), methods)
        for name in (one.name for one in protocol.transitions)
    ]
    alone, far = (
        plan_power(protocol, study, pairs, [4, 12], {"studies": 300, "share": 0.7}, workers=where)
        for where in (1, cluster)
    )
    assert alone == far
    assert alone.points[0].found < alone.points[1].found


def test_a_wrong_address_is_refused_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="a cluster of its own says that it is missing")
    monkeypatch.setattr("renderer.workers._CONNECT_S", 0.5)
    for address in ("127.0.0.1", "tcp://127.0.0.1:9", "nosuch://here:1"):
        with pytest.raises(RendererError, match=f"{address}: expected the address of a Dask scheduler"):
            Workers(address)
