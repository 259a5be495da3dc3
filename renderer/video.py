"""Videos: NV12 frames in, one H.264 file in an mp4 out, whole or not at all.

The file plays in every browser: yuv420p, Constrained Baseline profile, the index at the front (faststart), a key frame
every second, constant frame rate, BT.709 tags. It is written under a temporary name in the same folder and renamed when
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
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.camera import Camera, check_size
from renderer.capsules import Figure
from renderer.colour import to_ycbcr
from renderer.digest import Box, FramesHash
from renderer.errors import RendererError
from renderer.files import whole_file
from renderer.offscreen import paste_frames
from renderer.segments import Segment

# ISO/IEC 23091-2: 1 is BT.709 for primaries, transfer and matrix; 1 in FFmpeg's range enumeration is limited.
_BT709, _LIMITED = 1, 1

# One quantiser for all P-frames: how finely a figure is drawn must not depend on how it moves, as it does by libx264's
# own choice (crf). That also saves bits on what moves fast and on what stands out from its surroundings, which here are
# the limbs that participants judge: its macroblock tree and adaptive quantisation are off, as are its searches for
# scene cuts, fades and B-frames, which find nothing in a figure before a still background.
_OPTIONS = {
    "preset": "ultrafast",
    "qp": "13",
    "x264-params": "mbtree=0:aq-mode=0:b-adapt=0:scenecut=0:weightp=0:rc-lookahead=0:force-cfr=1:open-gop=0",
}


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
    fps: float | Fraction = 30,
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
    fps
        Frames per second.
    segments
        Stretches of frames with colours of their own.

    Raises
    ------
    RendererError
        For input that can't be drawn, a folder that can't be written, a full disk, a missing encoder. Nothing is then
        left under `path`, except for what was there before.
    """
    frames = paste_frames(positions, figure, camera, fps=float(frame_rate(fps)), segments=segments)
    luma, blue, red = (round(value) for value in to_ycbcr(figure.background))
    return write_video(path, frames, size=camera.size, fps=fps, ground=(luma, blue, red))


def write_video(
    path: Path | str,
    frames: Iterable[tuple[NDArray[np.uint8], Box]],
    *,
    size: tuple[int, int],
    ground: tuple[int, int, int],
    fps: float | Fraction = 30,
) -> VideoInfo:
    """Encode NV12 frames `(height * 3 / 2, width)`; each array may be reused once the next is asked for.

    With each comes the box (left, top, right, bottom) outside which it is `ground`: luma, blue and red chroma. What is
    raised and returned: as for `render_video`.
    """
    width, height = check_size(size)
    rate = frame_rate(fps)
    target = Path(path)
    if target.suffix.lower() != ".mp4":
        raise RendererError(f"Expected a video's name to end in .mp4, got {target.name!r}.")
    digest = FramesHash((width, height))
    with whole_file(target) as unfinished, open_encoder(unfinished, (width, height), rate) as encode:
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
def open_encoder(path: Path, size: tuple[int, int], rate: Fraction) -> Iterator[Any]:
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
            stream = _stream(out, size, rate)
            yield _feeder(out, stream)
            out.mux(stream.encode())
    except av.error.FFmpegError as error:
        # FFmpeg's errors are OSErrors where the system gave them: a full disk, a name that can't be opened.
        number = error.errno if isinstance(error, OSError) else 0
        if number:
            raise OSError(number, os.strerror(number) if number > 0 else str(error)) from error
        raise RendererError(f"The encoder failed: {error}.") from error


def _stream(out: Any, size: tuple[int, int], rate: Fraction) -> Any:
    stream = out.add_stream("libx264", rate=rate, options=_OPTIONS)
    stream.width, stream.height = size
    codec = stream.codec_context
    # libx264 takes NV12 and writes 4:2:0 as ever: a decoder gives yuv420p.
    codec.pix_fmt = "nv12"
    # One thread: with one process a core it is the fastest, and the bytes repeat.
    codec.thread_count = 1
    codec.gop_size = max(1, round(rate))
    codec.time_base = 1 / rate
    codec.colorspace = codec.color_primaries = codec.color_trc = _BT709
    codec.color_range = _LIMITED
    return stream


def _feeder(out: Any, stream: Any) -> Any:
    import av

    numbers = count()
    # The encoder copies what it is given before it returns, so one wrapper serves an array that is used again.
    known: tuple[Any, Any] = (None, None)

    def encode(frame: NDArray[np.uint8]) -> None:
        nonlocal known
        if known[0] is not frame:
            picture = av.VideoFrame.from_numpy_buffer(np.ascontiguousarray(frame), format="nv12")
            picture.colorspace, picture.color_range = _BT709, _LIMITED
            known = frame, picture
        known[1].pts = next(numbers)
        known[1].time_base = stream.codec_context.time_base
        for packet in stream.encode(known[1]):
            out.mux(packet)

    return encode
