"""Videos: NV12 frames in, one H.264 file in an mp4 out, whole or not at all.

The file plays in every browser: yuv420p, High profile, the index at the front (faststart), a key frame every
second, constant frame rate, BT.709 tags. It is written under a temporary name in the same folder and renamed when
it is complete, so an interruption leaves nothing under the final name.

`frames_sha256` is a hash of the raw frames: what participants see, whatever the encoder's version. mp4 bytes repeat
for one build of the encoder only; they have their own `file_sha256`.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.camera import Camera, check_size
from renderer.capsules import Figure
from renderer.colour import to_ycbcr
from renderer.context import Context
from renderer.digest import Box, FramesHash
from renderer.errors import RendererError
from renderer.files import whole_file
from renderer.offscreen import BATCH, paste_frames
from renderer.segments import Segment

PRESETS = ("ultrafast", "superfast", "veryfast", "faster", "fast", "medium", "slow", "slower", "veryslow")

# Measured on a walking stick figure of 130 frames at 640x480, all at crf 18: ultrafast keeps the figure best (47.6 dB,
# 46.3 superfast, 45.0 veryfast) in the least time (1.0, 1.6 and 1.9), and takes 456 kB instead of 356 or 286.
PRESET, CRF = "ultrafast", 18

# ISO/IEC 23091-2: 1 is BT.709 for primaries, transfer and matrix; 1 in FFmpeg's range enumeration is limited.
_BT709, _LIMITED = 1, 1

# libx264 saves bits on what moves fast and on what stands out from its surroundings, which here are the limbs that
# participants judge: without its macroblock tree and adaptive quantisation the figure's error is 8 dB lower (37 against
# 45 dB at 640x480, crf 16 and 18). Its search for scene cuts, fades and where to put B-frames finds nothing in a
# figure before a still background, and takes a third of the time.
_X264 = "mbtree=0:aq-mode=0:b-adapt=0:scenecut=0:weightp=0:rc-lookahead=0:force-cfr=1:open-gop=0"


@dataclass(frozen=True)
class VideoInfo:
    """A finished video.

    Parameters
    ----------
    path
        The file.
    frames, fps, seconds
        How many, how fast (exactly, as a fraction in words: `30`, `30000/1001`), how long.
    width, height
        Pixels.
    frames_sha256
        Hash of all raw NV12 frames, as `renderer.digest` takes it, in hexadecimal.
    file_sha256
        SHA-256 of the file.
    bytes
        Size of the file.
    """

    path: Path
    frames: int
    fps: str
    seconds: float
    width: int
    height: int
    frames_sha256: str
    file_sha256: str
    bytes: int


def frame_rate(fps: float | Fraction) -> Fraction:
    """Frames per second as an exact fraction: 30 for 30.0, 30000/1001 for 29.97, 60 for 1 / 0.016667."""
    try:
        rate = fps if isinstance(fps, Fraction) else Fraction(float(fps))
    except (TypeError, ValueError, OverflowError):
        raise RendererError(f"Expected a frame rate from 1 to 1000, got {fps!r}.") from None
    if not 1 <= rate <= 1000:
        raise RendererError(f"Expected a frame rate from 1 to 1000, got {fps!r}.")
    # Broadcast rates and whole ones, within what files round to; any other number as it is.
    whole = Fraction(round(rate))
    broadcast = Fraction(round(rate) * 1000, 1001)
    for nice, tolerance in ((whole, 1e-4), (broadcast, 2e-4)):
        if abs(nice - rate) <= tolerance * rate:
            return nice
    return rate.limit_denominator(60_000)


def render_video(
    path: Path | str,
    positions: ArrayLike,
    figure: Figure,
    camera: Camera,
    *,
    size: tuple[int, int] | None = None,
    fps: float | Fraction = 30,
    preset: str = PRESET,
    crf: int = CRF,
    batch: int = BATCH,
    context: Context | None = None,
    segments: Sequence[Segment] = (),
) -> VideoInfo:
    """Draw a motion and encode it.

    Parameters
    ----------
    path
        The mp4 to write; its folder is made where it is missing. A file that is there is replaced in one step.
    positions : (frames, points, 3)
        Metres, Y up.
    figure, camera
        What to draw, and from where; the camera has the frame's size.
    size
        Only to check: must be the camera's.
    fps
        Frames per second.
    preset, crf
        Of libx264: how long it searches, and how much it may lose (0 nothing, 18 nothing that is seen).
    batch, context
        As for `render_frames`; neither changes a pixel.
    segments
        Stretches of frames with colours of their own.

    Raises
    ------
    RendererError
        For input that can't be drawn, a folder that can't be written, a full disk, a missing encoder. Nothing is then
        left under `path`, except for what was there before.
    """
    frames = paste_frames(
        positions, figure, camera, size, batch, context, fps=float(frame_rate(fps)), segments=segments
    )
    luma, blue, red = (round(value) for value in to_ycbcr(figure.background))
    return _write(path, frames, (luma, blue, red), size=camera.size, fps=fps, preset=preset, crf=crf)


def write_video(
    path: Path | str,
    frames: Iterable[NDArray[np.uint8]],
    *,
    size: tuple[int, int],
    fps: float | Fraction = 30,
    preset: str = PRESET,
    crf: int = CRF,
) -> VideoInfo:
    """Encode NV12 frames `(height * 3 / 2, width)`; each array may be reused once the next is asked for.

    The other arguments, and what is raised and returned: as for `render_video`.
    """
    return _write(path, ((frame, None) for frame in frames), None, size=size, fps=fps, preset=preset, crf=crf)


def _write(
    path: Path | str,
    frames: Iterable[tuple[NDArray[np.uint8], Box | None]],
    ground: tuple[int, int, int] | None,
    *,
    size: tuple[int, int],
    fps: float | Fraction,
    preset: str,
    crf: int,
) -> VideoInfo:
    """Encode frames that come with the box outside which they are ground."""
    width, height = check_size(size)
    rate = frame_rate(fps)
    if preset not in PRESETS:
        raise RendererError(f"Expected a preset of {', '.join(PRESETS)}, got {preset!r}.")
    if crf not in range(52):
        raise RendererError(f"Expected crf as a whole number from 0 to 51, got {crf!r}.")
    target = Path(path)
    if target.suffix.lower() != ".mp4":
        raise RendererError(f"Expected a video's name to end in .mp4, got {target.name!r}.")
    digest = FramesHash((width, height))
    with whole_file(target) as unfinished, open_encoder(unfinished, (width, height), rate, preset, crf) as encode:
        for frame, touched in frames:
            if frame.shape != (height * 3 // 2, width) or frame.dtype != np.uint8:
                raise RendererError(
                    f"Expected NV12 frames of uint8 {(height * 3 // 2, width)}, got {frame.dtype} {frame.shape}."
                )
            digest.update(frame, touched, ground)
            encode(frame)
        if digest.frames == 0:
            raise RendererError(f"Expected at least one frame for {target.name}, got none.")
    return VideoInfo(
        target,
        digest.frames,
        str(rate),
        float(digest.frames / rate),
        width,
        height,
        digest.hexdigest(),
        hashlib.sha256(target.read_bytes()).hexdigest(),
        target.stat().st_size,
    )


@contextmanager
def open_encoder(path: Path, size: tuple[int, int], rate: Fraction, preset: str, crf: int) -> Iterator[Any]:
    """A function that takes the next frame; the file is complete when the block ends without an error."""
    import av

    try:
        av.codec.Codec("libx264", "w")
    except (av.error.FFmpegError, ValueError) as error:
        raise RendererError(
            "The H.264 encoder libx264 is missing from PyAV; install the wheel from PyPI: "
            "pip install --force-reinstall --only-binary=:all: av"
        ) from error
    try:
        with av.open(str(path), "w", format="mp4", options={"movflags": "+faststart", "fflags": "+bitexact"}) as out:
            stream = _stream(out, size, rate, preset, crf)
            yield _feeder(out, stream)
            out.mux(stream.encode())
    except av.error.FFmpegError as error:
        # FFmpeg's errors are OSErrors where the system gave them: a full disk, a name that can't be opened.
        number = error.errno if isinstance(error, OSError) else 0
        if number:
            raise OSError(number, os.strerror(number) if number > 0 else str(error)) from error
        raise RendererError(f"The encoder failed: {error}.") from error


def _stream(out: Any, size: tuple[int, int], rate: Fraction, preset: str, crf: int) -> Any:
    options = {"preset": preset, "crf": str(crf), "x264-params": _X264}
    stream = out.add_stream("libx264", rate=rate, options=options)
    stream.width, stream.height = size
    codec = stream.codec_context
    # libx264 takes NV12 and writes 4:2:0 as ever: a decoder gives yuv420p.
    codec.pix_fmt = "nv12"
    codec.profile = "High"
    # One thread: with one process a core it is the fastest, and the bytes repeat.
    codec.thread_count = 1
    codec.gop_size = max(1, round(rate))
    codec.time_base = 1 / rate
    codec.colorspace = codec.color_primaries = codec.color_trc = _BT709
    codec.color_range = _LIMITED
    return stream


def _feeder(out: Any, stream: Any) -> Any:
    import av

    known: dict[int, Any] = {}
    number = 0

    def encode(frame: NDArray[np.uint8]) -> None:
        nonlocal number
        # The encoder copies what it is given before it returns, so one wrapper serves an array that is used again.
        key = id(frame)
        if key not in known:
            known.clear()
            picture = av.VideoFrame.from_numpy_buffer(np.ascontiguousarray(frame), format="nv12")
            picture.colorspace, picture.color_range = _BT709, _LIMITED
            known[key] = (picture, frame)
        picture = known[key][0]
        picture.pts = number
        picture.time_base = stream.codec_context.time_base
        number += 1
        for packet in stream.encode(picture):
            out.mux(packet)

    return encode
