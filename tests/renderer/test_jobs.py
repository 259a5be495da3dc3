from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from renderer.errors import RendererError
from renderer.figure import make_figure
from renderer.framing import frame_group
from renderer.jobs import Progress, RenderJob, render_many
from renderer.workers import cores

ROOT = Path(__file__).parents[2]

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("context")]


def jobs_in(folder: Path, puppet: Any, count: int = 5, frames: int = 12) -> list[RenderJob]:
    figure = make_figure(puppet.bones, puppet.sides, puppet.parts)
    clips = [puppet.walk(frames + i, start=0.1 * i) for i in range(count)]
    camera = frame_group(clips, size=(160, 120))
    return [RenderJob(folder / f"{i}.mp4", clip, figure, camera) for i, clip in enumerate(clips)]


def test_workers_change_nothing_but_the_time(tmp_path: Path, puppet: Any) -> None:
    seen: list[Progress] = []
    alone = render_many(jobs_in(tmp_path / "one", puppet), 1, seen.append)
    together = render_many(jobs_in(tmp_path / "two", puppet), 2, seen.append)
    assert [v.path.name for v in together] == [f"{i}.mp4" for i in range(5)]
    assert [v.frames_sha256 for v in together] == [v.frames_sha256 for v in alone]
    assert [v.file_sha256 for v in together] == [v.file_sha256 for v in alone]
    assert len({v.frames_sha256 for v in alone}) == 5
    assert [p.videos for p in seen] == [1, 2, 3, 4, 5] * 2
    assert seen[-1].frames == seen[-1].frames_total == sum(v.frames for v in alone)
    assert seen[-1].seconds_left == 0.0
    assert "5/5 videos" in str(seen[-1])


def test_nothing_to_do_is_done_at_once() -> None:
    assert render_many([]) == []


def test_progress_foretells_the_end() -> None:
    half = Progress(2, 4, 100, 200, 5.0)
    assert half.frames_per_second == 20.0
    assert half.seconds_left == 5.0
    assert str(half) == "2/4 videos, 20 frames/s, 5 s left"
    assert Progress(0, 4, 0, 200, 0.0).seconds_left is None


@pytest.mark.parametrize("workers", [1, 2])
def test_a_job_that_fails_stops_the_work_and_leaves_nothing_half(tmp_path: Path, puppet: Any, workers: int) -> None:
    jobs = jobs_in(tmp_path, puppet)
    broken = jobs[2].positions.copy()
    broken[1, 0, 0] = np.nan
    jobs[2] = replace(jobs[2], positions=broken)
    with pytest.raises(RendererError, match="frame 1, point 0"):
        render_many(jobs, workers)
    left = [p.name for p in tmp_path.iterdir()]
    assert "2.mp4" not in left
    assert not [name for name in left if name.endswith(".part")]


def test_two_jobs_for_one_file_are_refused(tmp_path: Path, puppet: Any) -> None:
    jobs = jobs_in(tmp_path, puppet, count=2)
    with pytest.raises(RendererError, match=r"a file of its own; .*0\.mp4 is there twice"):
        render_many([jobs[0], replace(jobs[1], path=jobs[0].path)])


def test_no_workers_are_refused(tmp_path: Path, puppet: Any) -> None:
    with pytest.raises(RendererError, match="at least one worker, got 0"):
        render_many(jobs_in(tmp_path, puppet), 0)
    assert cores() >= 1


LONG = """
import sys
import numpy as np
from pathlib import Path
from renderer.framing import frame_group
from renderer.figure import make_figure
from renderer.jobs import RenderJob, render_many

if __name__ == "__main__":
    bones = np.array([[i, i + 1] for i in range(11)])
    figure = make_figure(bones, ["centre"] * 12)
    clip = np.cumsum(np.random.default_rng(1).normal(0, 0.01, (900, 12, 3)), axis=0)
    camera = frame_group([clip], size=(640, 480))
    jobs = [RenderJob(Path(sys.argv[1]) / f"{i}.mp4", clip, figure, camera) for i in range(20)]
    render_many(jobs, 2, lambda p: print(p, flush=True))
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals are POSIX")
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_an_interruption_leaves_whole_videos_only(tmp_path: Path, how: signal.Signals) -> None:
    import av

    script = tmp_path / "long.py"
    script.write_text(LONG)
    out = tmp_path / "out"
    with subprocess.Popen(
        [sys.executable, str(script), str(out)],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()  # the first video is done, others are under way
        time.sleep(0.2)
        process.send_signal(how)
        assert process.wait(timeout=30) != 0
    time.sleep(1.0)  # workers notice that their parent is gone
    done = sorted(out.glob("*.mp4"))
    assert 1 <= len(done) < 20
    for path in done:
        with av.open(str(path)) as container:
            assert sum(1 for _ in container.decode(video=0)) == 900
    if how == signal.SIGINT:
        assert list(out.glob(".*.part")) == []


NO_GL = """
import os, sys
import numpy as np
from pathlib import Path
from renderer.framing import frame_group
from renderer.figure import make_figure
from renderer.jobs import RenderJob, render_many

if __name__ == "__main__":
    bones = np.array([[i, i + 1] for i in range(11)])
    clip = np.cumsum(np.random.default_rng(1).normal(0, 0.01, (4000, 12, 3)), axis=0)
    camera = frame_group([clip], size=(64, 64))
    figure = make_figure(bones, ["centre"] * 12)
    os.environ["SEGUE_GL"] = "nosuch"
    render_many([RenderJob(Path(sys.argv[1]) / f"{i}.mp4", clip, figure, camera) for i in range(8)], 2)
"""


def test_workers_that_all_fail_are_not_waited_for(tmp_path: Path) -> None:
    """Jobs larger than a pipe's buffer once left the interpreter waiting for ever at its exit."""
    script = tmp_path / "no_gl.py"
    script.write_text(NO_GL, encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    ended = subprocess.run(
        [sys.executable, script, tmp_path], env=environment, capture_output=True, text=True, timeout=60, check=False
    )
    assert ended.returncode == 1
    assert "RendererError" in ended.stderr
    assert "nosuch" in ended.stderr
    assert not list(tmp_path.glob("*.mp4"))


def test_where_no_pool_can_be_made_one_process_does_it_all(
    tmp_path: Path, puppet: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("renderer.workers.get_context", refuse)
    made = render_many(jobs_in(tmp_path, puppet, count=2), 2)
    assert [video.path.name for video in made] == ["0.mp4", "1.mp4"]
    assert all(video.path.is_file() for video in made)
