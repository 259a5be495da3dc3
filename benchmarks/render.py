"""How fast frames become videos: ours beside the encoder alone, and beside other ways to draw a skeleton.

    python benchmarks/render.py                  the whole table
    python benchmarks/render.py --json           one JSON object
    python benchmarks/render.py --only encoder   parts: encoder, study, peers
    python benchmarks/render.py --style mannequin --camera pan

What is compared runs in turns, so that a busy machine disturbs all alike; medians are printed. `encoder` sets our time
for drawing and encoding against x264 alone on the same NV12 frames, with as many workers each. `study` makes the
21 videos of a just-noticeable-difference study, and again when all are there. `peers` draws the same clip with whatever
of matplotlib, pyvista and pyrender can be imported; it installs nothing.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from renderer.camera import CAMERAS, Camera
from renderer.context import open_context
from renderer.figure import STYLES, Figure, make_figure
from renderer.framing import frame_group
from renderer.jobs import RenderJob, render_many
from renderer.offscreen import paste_frames, render_frames
from renderer.video import frame_rate, open_encoder, render_video
from renderer.workers import cores

SIZES = ((640, 480), (1280, 720))
GOALS = {(640, 480): 0.85, (1280, 720): 0.95}
FPS = 30
PEERS = {"matplotlib": 10, "pyvista": 15, "pyrender": 25}
HOW_TO_GET = {
    "matplotlib": "python -m pip install matplotlib",
    "pyvista": "python -m pip install pyvista  (needs libGL and libXrender, or vtk-osmesa)",
    "pyrender": "python -m pip install pyrender 'PyOpenGL>=3.1.7'  (apart: pyrender 0.1.45 asks for an older PyOpenGL)",
}


@dataclass(frozen=True)
class Clip:
    """A motion and how it is drawn."""

    positions: np.ndarray
    figure: Figure
    bones: np.ndarray
    kind: str = "fixed"
    """What its camera does."""

    def camera(self, size: tuple[int, int]) -> Camera:
        """The camera that frames it."""
        return frame_group([self.positions], size=size, view="three-quarter", camera=self.kind, fps=FPS)


def read_clip(path: str | None, style: str, camera: str) -> Clip:
    """A motion file, or the synthetic library's walk: 4.33 seconds, as a stimulus of 2004 takes with its blend."""
    from study.motion.clip import joint_positions, resample, trim

    if path:
        from study.motion.readers.registry import read_clip as read

        clip = resample(read(path), FPS)
        clip = trim(clip, 0, min(clip.frames, 130))
    else:
        from study.motion.synthetic import synthesize

        clip = trim(synthesize("walk", seconds=4.4, fps=FPS, seed=1), 0, 130)
    skeleton = clip.skeleton
    figure = make_figure(skeleton.bones, skeleton.sides, dict(skeleton.roles), style)
    return Clip(joint_positions(clip, ends=True), figure, skeleton.bones, camera)


# ---- ours beside the encoder alone ------------------------------------------------------------------------------

_worker: dict[str, Any] = {}


def _start(clip: Clip, barrier: Any) -> None:
    _worker.update(clip=clip, barrier=barrier, frames={}, folder=tempfile.mkdtemp())


def _prepare(size: tuple[int, int]) -> int:
    clip: Clip = _worker["clip"]
    _worker["frames"] = {size: list(render_frames(clip.positions, clip.figure, clip.camera(size)))}
    _worker["barrier"].wait()
    return os.getpid()


def _run(what: str, size: tuple[int, int], repeats: int) -> tuple[float, float]:
    """Seconds by the clock and of the processor."""
    clip: Clip = _worker["clip"]
    target = Path(_worker["folder"]) / "x.mp4"
    camera = clip.camera(size)
    _worker["barrier"].wait()
    start, busy = time.perf_counter(), time.process_time()
    for _ in range(repeats):
        if what == "ours":
            render_video(target, clip.positions, clip.figure, camera, fps=FPS)
        else:
            with open_encoder(target, size, frame_rate(FPS)) as encode:
                for frame in _worker["frames"][size]:
                    encode(frame)
    busy = time.process_time() - busy
    _worker["barrier"].wait()
    return time.perf_counter() - start, busy


def encoder(clip: Clip, workers: int, turns: int, repeats: int) -> list[dict[str, Any]]:
    spawn = get_context("spawn")
    rows = []
    with spawn.Pool(workers, _start, (clip, spawn.Barrier(workers))) as pool:
        for size in SIZES:
            pool.map(_prepare, [size] * workers, chunksize=1)
            rows.append(_compare(pool, size, workers, turns, repeats * len(clip.positions), repeats))
    return rows


def _compare(pool: Any, size: tuple[int, int], workers: int, turns: int, frames: int, repeats: int) -> dict[str, Any]:
    """Ours and x264 alone in turns; the first turn warms up shaders, files and the processor's clock."""
    clock: dict[str, list[float]] = {"ours": [], "x264": []}
    busy: dict[str, list[float]] = {"ours": [], "x264": []}
    for _ in range(turns + 1):
        for what in clock:
            took = pool.starmap(_run, [(what, size, repeats)] * workers, chunksize=1)
            clock[what].append(max(wall for wall, _ in took))
            busy[what].append(sum(used for _, used in took))
    ours, alone = (statistics.median(clock[what][1:]) for what in ("ours", "x264"))
    return {
        "size": f"{size[0]}x{size[1]}",
        "workers": workers,
        "ours_fps": round(workers * frames / ours, 1),
        "x264_fps": round(workers * frames / alone, 1),
        "ratio": round(alone / ours, 3),
        "cpu_ratio": round(statistics.median(busy["x264"][1:]) / statistics.median(busy["ours"][1:]), 3),
        "goal": GOALS[size],
    }


# ---- a study ----------------------------------------------------------------------------------------------------


def study(clip: Clip, workers: int) -> dict[str, Any]:
    """21 videos of 130 frames at 640x480, from nothing, the pool's start included."""
    camera = clip.camera((640, 480))
    with tempfile.TemporaryDirectory() as folder:
        jobs = [RenderJob(Path(folder) / f"{i}.mp4", clip.positions, clip.figure, camera, FPS) for i in range(21)]
        start = time.perf_counter()
        done = render_many(jobs, workers)
        seconds = time.perf_counter() - start
    return {
        "videos": len(done),
        "frames": sum(v.frames for v in done),
        "workers": workers,
        "seconds": round(seconds, 2),
        "goal_s": 10.0,
    }


# ---- peers ------------------------------------------------------------------------------------------------------


def draw_ours(clip: Clip, size: tuple[int, int], target: Path | None, frames: int) -> None:
    if target is None:
        for _ in paste_frames(clip.positions[:frames], clip.figure, clip.camera(size)):
            pass
    else:
        render_video(target, clip.positions[:frames], clip.figure, clip.camera(size), fps=FPS)


def _write_rgb(target: Path | None, size: tuple[int, int], pictures: Any) -> None:
    if target is None:
        for _ in pictures:
            pass
        return
    import av

    with av.open(str(target), "w") as out:
        stream = out.add_stream("libx264", rate=FPS, options={"preset": "ultrafast", "crf": "18"})
        stream.width, stream.height = size
        stream.pix_fmt = "yuv420p"
        stream.codec_context.thread_count = 1
        for picture in pictures:
            for packet in stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")):
                out.mux(packet)
        out.mux(stream.encode())


def draw_matplotlib(clip: Clip, size: tuple[int, int], target: Path | None, frames: int) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(size[0] / 100, size[1] / 100), dpi=100)
    axes = figure.add_subplot(projection="3d")
    points = clip.positions[:, :, [2, 0, 1]]
    low, high = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low)
    axes.set_axis_off()
    lines = [axes.plot(*points[0][bone].T, linewidth=5, solid_capstyle="round")[0] for bone in clip.bones]

    def pictures() -> Any:
        for pose in points[:frames]:
            for line, bone in zip(lines, clip.bones, strict=True):
                line.set_data_3d(*pose[bone].T)
            figure.canvas.draw()
            yield np.ascontiguousarray(np.asarray(figure.canvas.buffer_rgba())[..., :3])

    _write_rgb(target, size, pictures())
    plt.close(figure)


def draw_pyvista(clip: Clip, size: tuple[int, int], target: Path | None, frames: int) -> None:
    import pyvista

    plotter = pyvista.Plotter(off_screen=True, window_size=list(size))
    plotter.enable_anti_aliasing("msaa", multi_samples=4)
    mesh = pyvista.PolyData(clip.positions[0], lines=np.insert(clip.bones, 0, 2, axis=1).ravel())
    plotter.add_mesh(mesh, render_lines_as_tubes=True, line_width=10)
    plotter.show(auto_close=False, interactive=False)

    def pictures() -> Any:
        for pose in clip.positions[:frames]:
            mesh.points = pose
            plotter.render()
            yield np.ascontiguousarray(plotter.screenshot(return_img=True)[: size[1], : size[0], :3])

    _write_rgb(target, size, pictures())
    plotter.close()


def draw_pyrender(clip: Clip, size: tuple[int, int], target: Path | None, frames: int) -> None:
    os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
    import pyrender
    import trimesh

    scene = pyrender.Scene(bg_color=(222, 222, 222))
    camera = clip.camera(size)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = camera.axes.T, camera.eye
    angle = 2 * np.arctan(0.5 * size[1] / camera.focal_pixels)
    scene.add(pyrender.PerspectiveCamera(angle, aspectRatio=size[0] / size[1]), pose=pose)
    scene.add(pyrender.DirectionalLight(intensity=3.0), pose=pose)
    first = clip.positions[0]
    nodes = []
    for start, end in clip.bones:
        length = max(float(np.linalg.norm(first[end] - first[start])), 1e-3)
        shape = trimesh.creation.capsule(height=length, radius=0.035, count=[12, 8])
        nodes.append(scene.add(pyrender.Mesh.from_trimesh(shape)))
    renderer = pyrender.OffscreenRenderer(*size)

    def pictures() -> Any:
        for points in clip.positions[:frames]:
            for node, (start, end) in zip(nodes, clip.bones, strict=True):
                scene.set_pose(node, _along(points[start], points[end]))
            yield np.ascontiguousarray(renderer.render(scene)[0])

    _write_rgb(target, size, pictures())
    renderer.delete()


def _along(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """A pose at `start` whose z axis points to `end`."""
    pose = np.eye(4)
    way = end - start
    length = np.linalg.norm(way)
    z = way / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = x, np.cross(z, x), z, start
    return pose


DRAW: dict[str, Callable[[Clip, tuple[int, int], Path | None, int], None]] = {
    "ours": draw_ours,
    "matplotlib": draw_matplotlib,
    "pyvista": draw_pyvista,
    "pyrender": draw_pyrender,
}


def _time_peer(name: str, size: tuple[int, int], encode: bool) -> tuple[float, float]:
    """Seconds a frame by the clock and of the processor, in a process of its own: two GL libraries in one disturb."""
    clip: Clip = _worker["clip"]
    target = Path(_worker["folder"]) / "x.mp4" if encode else None
    start, busy = time.perf_counter(), time.process_time()
    DRAW[name](clip, size, target, len(clip.positions))
    frames = len(clip.positions)
    return (time.perf_counter() - start) / frames, (time.process_time() - busy) / frames


def peers(clip: Clip, turns: int) -> list[dict[str, Any]]:
    """The clip at 640x480 to an mp4, and to pictures alone: one process each, ours and theirs in turns."""
    rows: list[dict[str, Any]] = []
    spawn = get_context("spawn")
    with spawn.Pool(1, _start, (clip, None)) as own:
        for name, goal in PEERS.items():
            if importlib.util.find_spec(name) is None:
                rows.append({"peer": name, "missing": HOW_TO_GET[name]})
                continue
            with spawn.Pool(1, _start, (clip, None)) as other:
                try:
                    rows += [_beside(own, other, name, goal, turns, encode) for encode in (True, False)]
                except Exception as error:  # a peer that can't draw here is reported, not a failure of the benchmark
                    why = f"found, but it fails here: {type(error).__name__}: {error}"
                    rows.append({"peer": name, "missing": why})
    return rows


def _beside(own: Any, other: Any, name: str, goal: int, turns: int, encode: bool) -> dict[str, Any]:
    ours, theirs = [], []
    for _ in range(turns + 1):
        ours.append(own.apply(_time_peer, ("ours", SIZES[0], encode)))
        theirs.append(other.apply_async(_time_peer, (name, SIZES[0], encode)).get(timeout=300))
    (mine, mine_cpu), (peer, peer_cpu) = (np.median(times[1:], axis=0).tolist() for times in (ours, theirs))
    return {
        "peer": name,
        "to": "mp4" if encode else "pictures",
        "ours_ms": round(1e3 * mine, 2),
        "peer_ms": round(1e3 * peer, 2),
        "times_faster": round(peer / mine, 1),
        "times_less_cpu": round(peer_cpu / mine_cpu, 1),
        "goal": goal,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--only", choices=("encoder", "study", "peers"), help="one part")
    parser.add_argument("--clip", help="a .bvh or .amc instead of the synthetic walk")
    parser.add_argument("--style", choices=STYLES, default="stick")
    parser.add_argument("--camera", choices=CAMERAS, default="fixed")
    parser.add_argument("--workers", type=int, default=cores())
    parser.add_argument("--turns", type=int, default=5, help="how often each is timed, after one turn to warm up")
    parser.add_argument("--repeats", type=int, default=2, help="clips a worker makes in one turn")
    chosen = parser.parse_args()
    clip = read_clip(chosen.clip, chosen.style, chosen.camera)
    context = open_context()
    result: dict[str, Any] = {
        "context": context.kind,
        "gl_renderer": context.renderer,
        "gl_version": context.version,
        "clip": f"{chosen.clip or 'synthetic walk'}, {chosen.style}, {chosen.camera} camera",
        "frames": len(clip.positions),
    }
    context.release()
    if chosen.only in (None, "encoder"):
        result["encoder"] = encoder(clip, chosen.workers, chosen.turns, chosen.repeats)
    if chosen.only in (None, "study"):
        result["study"] = study(clip, chosen.workers)
    if chosen.only in (None, "peers"):
        result["peers"] = peers(clip, chosen.turns)
    if chosen.json:
        print(json.dumps(result, indent=1))
        return
    print(f"{result['clip']}, {result['frames']} frames; {result['context']}: {result['gl_renderer']}")
    for row in result.get("encoder", []):
        speeds = "{size} ours {ours_fps:7} frames/s, x264 alone {x264_fps:7}".format(**row)
        print(speeds + ": {ratio} (goal {goal}; by processor time {cpu_ratio})".format(**row))
    if "study" in result:
        print(
            "{videos} videos, {frames} frames, {workers} workers: {seconds} s (goal {goal_s})".format(**result["study"])
        )
    for row in result.get("peers", []):
        if "missing" in row:
            print("{peer}: {missing}".format(**row))
        else:
            times = "{peer} to {to}: {peer_ms} ms a frame, ours {ours_ms}: {times_faster} times".format(**row)
            print(times + " (goal {goal}; by processor time {times_less_cpu})".format(**row))


if __name__ == "__main__":
    main()
