from __future__ import annotations

import errno
import hashlib
import os
import struct
import subprocess
import sys
from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from renderer import files
from renderer.digest import FramesHash, hash_frames
from renderer.errors import RendererError
from renderer.figure import make_figure
from renderer.framing import frame_group
from renderer.offscreen import plain_frame, render_frames
from renderer.video import VideoInfo, frame_rate, render_video
from renderer.video import write_video as write_pasted

ROOT = Path(__file__).parents[2]
SIZE = (160, 120)


def moving_bars(count: int = 12, size: tuple[int, int] = SIZE) -> Iterator[np.ndarray]:
    for i in range(count):
        frame = plain_frame(size, (200, 200, 200))
        frame[20:60, 10 + 4 * i : 20 + 4 * i] = 40
        yield frame


def write_video(path: Path, frames: Iterable[np.ndarray], *, size: tuple[int, int] = SIZE, **more: Any) -> VideoInfo:
    """Of frames that may differ from their background anywhere."""
    return write_pasted(path, ((frame, (0, 0, *size)) for frame in frames), size=size, ground=(0, 0, 0), **more)


def decoded(path: Path) -> tuple[Any, list[Any]]:
    import av

    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        facts = {
            "rate": stream.average_rate,
            "base_rate": stream.base_rate,
            "pix_fmt": stream.codec_context.pix_fmt,
            "codec": stream.codec_context.name,
            "profile": stream.codec_context.profile,
            "primaries": stream.codec_context.color_primaries,
            "transfer": stream.codec_context.color_trc,
            "matrix": stream.codec_context.colorspace,
            "range": stream.codec_context.color_range,
        }
        return facts, list(container.decode(stream))


def test_what_is_in_the_file(tmp_path: Path) -> None:
    video = write_video(tmp_path / "a.mp4", moving_bars(75), size=SIZE, fps=30)
    facts, frames = decoded(video.path)
    assert facts["rate"] == facts["base_rate"] == 30
    assert facts["pix_fmt"] == "yuv420p"
    assert facts["profile"] == "Constrained Baseline"
    assert facts["codec"] == "h264"
    # BT.709 and limited range, as ISO/IEC 23091-2 and FFmpeg number them.
    assert (facts["primaries"], facts["transfer"], facts["matrix"], facts["range"]) == (1, 1, 1, 1)
    assert len(frames) == video.frames == 75
    times = [Fraction(frame.pts) * frame.time_base for frame in frames]
    assert times == [Fraction(i, 30) for i in range(75)]
    assert [i for i, frame in enumerate(frames) if frame.key_frame] == [0, 30, 60]
    assert video.seconds == 2.5
    assert (video.width, video.height, video.fps) == (160, 120, "30")


@pytest.mark.parametrize(
    "colour", [(222, 223, 225), (24, 25, 28), (230, 152, 40), (0, 98, 168), (255, 255, 255), (0, 0, 0)]
)
def test_a_decoded_background_is_the_asked_colour(tmp_path: Path, colour: tuple[int, int, int]) -> None:
    video = write_video(tmp_path / "a.mp4", [plain_frame(SIZE, colour)] * 3, size=SIZE)
    _, frames = decoded(video.path)
    for frame in frames:
        pixel = frame.to_ndarray(format="rgb24")[60, 80].astype(int)
        assert np.abs(pixel - colour).max() <= 2, pixel


def boxes(data: bytes) -> list[str]:
    names, at = [], 0
    while at < len(data):
        length, name = struct.unpack(">I4s", data[at : at + 8])
        names.append(name.decode())
        at += length
    return names


def test_the_index_stands_before_the_pictures(tmp_path: Path) -> None:
    video = write_video(tmp_path / "a.mp4", moving_bars(), size=SIZE)
    names = boxes(video.path.read_bytes())
    assert names.index("moov") < names.index("mdat")


@pytest.mark.parametrize(
    ("fps", "exact"),
    [
        (30, "30"),
        (30.0, "30"),
        (29.97, "30000/1001"),
        (30000 / 1001, "30000/1001"),
        (23.976, "24000/1001"),
        (1 / 0.0333333, "30"),
        (1 / 0.008333, "120"),
        (59.94, "60000/1001"),
        (12.5, "25/2"),
        (Fraction(50, 3), "50/3"),
    ],
)
def test_frame_rates_are_exact(fps: Any, exact: str) -> None:
    assert str(frame_rate(fps)) == exact


def test_an_odd_rate_is_constant_in_the_file(tmp_path: Path) -> None:
    video = write_video(tmp_path / "a.mp4", moving_bars(40), size=SIZE, fps=29.97)
    facts, frames = decoded(video.path)
    assert facts["rate"] == Fraction(30000, 1001)
    assert [Fraction(f.pts) * f.time_base for f in frames] == [Fraction(1001 * i, 30000) for i in range(40)]


def test_the_same_frames_give_the_same_hashes_and_bytes(tmp_path: Path) -> None:
    one = write_video(tmp_path / "a.mp4", moving_bars(), size=SIZE)
    two = write_video(tmp_path / "b.mp4", moving_bars(), size=SIZE)
    assert one.frames_sha256 == two.frames_sha256 == hash_frames(moving_bars(), SIZE)
    assert one.file_sha256 == two.file_sha256
    assert one.file_sha256 == hashlib.sha256(one.path.read_bytes()).hexdigest()
    assert one.bytes == one.path.stat().st_size


def test_a_video_gives_the_frames_back(tmp_path: Path) -> None:
    frames = list(moving_bars())
    video = write_video(tmp_path / "a.mp4", frames)
    _, back = decoded(video.path)
    for frame, got in zip(frames, back, strict=True):
        luma = got.to_ndarray(format="yuv420p")[:120]
        assert np.abs(luma.astype(int) - frame[:120]).max() <= 3


# ---- nothing half done ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, RendererError, ValueError])
def test_an_interruption_leaves_nothing(tmp_path: Path, interruption: type[BaseException]) -> None:
    def frames() -> Iterator[np.ndarray]:
        yield from moving_bars(5)
        raise interruption("now")

    with pytest.raises(interruption, match="now"):
        write_video(tmp_path / "a.mp4", frames(), size=SIZE)
    assert list(tmp_path.iterdir()) == []


def test_an_interruption_keeps_the_video_that_was_there(tmp_path: Path) -> None:
    before = write_video(tmp_path / "a.mp4", moving_bars(), size=SIZE)

    def frames() -> Iterator[np.ndarray]:
        yield from moving_bars(5)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_video(tmp_path / "a.mp4", frames(), size=SIZE)
    assert [p.name for p in tmp_path.iterdir()] == ["a.mp4"]
    assert hashlib.sha256((tmp_path / "a.mp4").read_bytes()).hexdigest() == before.file_sha256


def test_what_a_killed_process_left_is_cleared_away(tmp_path: Path) -> None:
    left = tmp_path / ".a.mp4.999999999.part"
    left.write_bytes(b"half")
    mine = tmp_path / ".b.mp4.999999999.part"
    mine.write_bytes(b"half")
    others = tmp_path / f".a.mp4.{os.getppid()}.part"
    others.write_bytes(b"being written")
    write_video(tmp_path / "a.mp4", moving_bars(), size=SIZE)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([mine.name, others.name, "a.mp4"])


def test_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(RendererError, match=r"file/a\.mp4: can't be written: part of the path is a file"):
        write_video(tmp_path / "file" / "a.mp4", moving_bars(), size=SIZE)


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_may_not_be_written_to(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(RendererError, match="may not be written to"):
            write_video(tmp_path / "a.mp4", moving_bars(), size=SIZE)
    finally:
        tmp_path.chmod(0o700)


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (errno.ENOSPC, "no space is left on the disk"),
        (errno.EACCES, "may not be written to"),
        (errno.EROFS, "read-only"),
        (errno.EIO, "Input/output error"),
    ],
)
def test_why_a_file_cannot_be_written(number: int, words: str) -> None:
    message = str(files.cannot_write(Path("x.mp4"), OSError(number, os.strerror(number))))
    assert message.startswith("x.mp4: can't be written")
    assert words in message


FULL = """
import resource, sys, numpy as np
from pathlib import Path
from renderer.errors import RendererError
from renderer.video import write_video
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
random = np.random.default_rng(1)
frames = ((random.integers(16, 235, (180, 160), dtype=np.uint8), (0, 0, 160, 120)) for _ in range(30))
try:
    write_video(Path(sys.argv[1]) / "a.mp4", frames, size=(160, 120), ground=(0, 0, 0))
except RendererError as error:
    print(error)
"""


@pytest.mark.skipif(os.name != "posix", reason="limits on file sizes are POSIX")
def test_a_file_that_finds_no_room_is_not_there(tmp_path: Path) -> None:
    """A limit on the size of files stands for a full disk: the system refuses the write in the same place."""
    done = subprocess.run(
        [sys.executable, "-c", FULL, str(tmp_path)], cwd=ROOT, capture_output=True, text=True, timeout=60, check=True
    )
    assert "a.mp4: can't be written" in done.stdout
    assert list(tmp_path.iterdir()) == []


def test_a_missing_encoder_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import av

    def missing(name: str, mode: str) -> None:
        raise av.codec.codec.UnknownCodecError(f"{name} {mode}")

    monkeypatch.setattr(av.codec, "Codec", missing)
    with pytest.raises(RendererError, match=r"libx264 is missing from PyAV; install"):
        write_video(tmp_path / "a.mp4", moving_bars(), size=SIZE)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"fps": 0}, "frame rate from 1 to 1000, got 0"),
        ({"fps": float("nan")}, "frame rate from 1"),
        ({"fps": "fast"}, "frame rate from 1"),
        ({"size": (161, 120)}, "even whole numbers"),
        ({"size": (320, 240)}, r"NV12 frames of uint8 \(360, 320\)"),
        ({"frames": []}, "at least one frame for a.mp4"),
        ({"path": "a.avi"}, "end in .mp4"),
    ],
)
def test_what_makes_no_video(tmp_path: Path, change: dict[str, Any], match: str) -> None:
    arguments: dict[str, Any] = {"size": SIZE, **change}
    frames = arguments.pop("frames", None)
    name = arguments.pop("path", "a.mp4")
    with pytest.raises(RendererError, match=match):
        write_video(tmp_path / name, moving_bars() if frames is None else frames, **arguments)
    assert list(tmp_path.iterdir()) == []


# ---- drawn and encoded ------------------------------------------------------------------------------------------


@pytest.mark.gl
@pytest.mark.usefixtures("context")
def test_a_motion_becomes_the_video_of_its_frames(tmp_path: Path, puppet: Any) -> None:
    figure = make_figure(puppet.bones, puppet.sides, puppet.parts)
    clip = puppet.walk(20)
    camera = frame_group([clip], size=(320, 240))
    video = render_video(tmp_path / "new" / "a.mp4", clip, figure, camera, fps=30)
    assert video.frames_sha256 == hash_frames(render_frames(clip, figure, camera, batch=3), camera.size)
    _, frames = decoded(video.path)
    assert len(frames) == 20
    for frame, drawn in zip(frames, render_frames(clip, figure, camera), strict=True):
        luma = frame.to_ndarray(format="yuv420p")[:240].astype(int)
        foreground = drawn[:240] != drawn[0, 0]
        assert np.abs(luma - drawn[:240])[foreground].mean() < 4.0
        assert np.abs(luma - drawn[:240])[~foreground].mean() < 0.6
        assert np.abs(frame.to_ndarray(format="rgb24")[4, 4].astype(int) - figure.background).max() <= 2


@pytest.mark.gl
@pytest.mark.usefixtures("context")
@pytest.mark.parametrize("style", ["stick", "points", "mannequin"])
def test_hashes_do_not_depend_on_the_batch(tmp_path: Path, puppet: Any, style: str) -> None:
    clip = puppet.walk(10)
    camera = frame_group([clip], size=(160, 120))
    for floor in (None, 0.0):
        figure = make_figure(puppet.bones, puppet.sides, puppet.parts, style=style, floor_m=floor)
        one, two = (render_video(tmp_path / f"{name}.mp4", clip, figure, camera) for name in "ab")
        assert one.file_sha256 == two.file_sha256
        drawn = {hash_frames(render_frames(clip, figure, camera, batch=b), camera.size) for b in (1, 4, 16)}
        assert drawn == {one.frames_sha256} == {two.frames_sha256}


@pytest.mark.gl
@pytest.mark.usefixtures("context")
def test_a_nan_in_the_positions_leaves_no_file(tmp_path: Path, puppet: Any) -> None:
    clip = puppet.walk(10)
    figure = make_figure(puppet.bones, puppet.sides, puppet.parts)
    camera = frame_group([clip], size=SIZE)
    clip[7, 3] = np.nan
    with pytest.raises(RendererError, match="frame 7, point 3"):
        render_video(tmp_path / "a.mp4", clip, figure, camera)
    with pytest.raises(RendererError, match="at least one frame"):
        render_video(tmp_path / "a.mp4", clip[:0], figure, camera)
    assert list(tmp_path.iterdir()) == []


# ---- the hash of frames -----------------------------------------------------------------------------------------


def test_the_hash_finds_one_changed_byte_anywhere() -> None:
    frames = list(moving_bars(4))
    whole = hash_frames(frames, SIZE)
    assert hash_frames([frame.copy() for frame in frames], SIZE) == whole
    seen = {whole}
    for row, column in ((0, 0), (30, 12), (119, 159), (120, 0), (121, 1), (179, 159)):
        for number in (0, 3):
            changed = [frame.copy() for frame in frames]
            changed[number][row, column] += 1
            seen.add(hash_frames(changed, SIZE))
    assert len(seen) == 13
    assert hash_frames(frames[:3], SIZE) != whole
    assert hash_frames(frames[::-1], SIZE) != whole


def test_the_shortcut_gives_the_same_hash() -> None:
    frames = list(moving_bars(4))
    ground = tuple(int(v) for v in (frames[0][0, 0], *frames[0][120, :2]))
    digest = FramesHash(SIZE)
    for i, frame in enumerate(frames):
        digest.update(frame, (8 + 4 * i, 18, 24 + 4 * i, 62), ground)
    assert digest.hexdigest() == hash_frames(frames, SIZE)
    assert digest.frames == 4
    empty = FramesHash(SIZE)
    empty.update(plain_frame(SIZE, (9, 9, 9)), (0, 0, 0, 0), (24, 128, 128))
    assert empty.hexdigest() == hash_frames([plain_frame(SIZE, (9, 9, 9))], SIZE)
