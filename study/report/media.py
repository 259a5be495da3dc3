"""What participants saw, small enough for the page: videos as data URIs, and strips of their frames.

Strips are cut from the rendered videos themselves, so that they show what was shown.
"""

from __future__ import annotations

import base64
import io
import json
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.counting import counted
from study.errors import StimulusError
from study.experiment.stimuli.manifest import Manifest, read_manifest
from study.experiment.stimuli.stimulus import StimulusRecord

MOST_VIDEO_BYTES = 1_800_000
MOST_STRIPS = 12
POSES = 10
STRIP_HEIGHT = 150
MARGIN = 6
"""About the figure in a strip. [pixels of the video]"""
BLEND_COLOUR = (11, 95, 165)

Bytes = NDArray[np.uint8]


@dataclass(frozen=True)
class Preview:
    """An embedded picture or video with its caption."""

    uri: str
    caption: str
    alt: str = ""


@dataclass(frozen=True)
class Pictures:
    """Strips, and videos two by two."""

    strips: tuple[Preview, ...]
    videos: tuple[tuple[Preview, ...], ...]


def embed(manifest: Manifest) -> Pictures:
    """Return the part of the page that shows what participants saw."""
    return Pictures(tuple(embed_strips(manifest)), tuple(tuple(pair) for pair in embed_videos(manifest)))


@contextmanager
def embedding(manifest: Manifest) -> Iterator[Callable[[], Pictures]]:
    """Start making the images in a separate process; the result waits for them.

    They take as long as a third of all else in a report, and a thread would take turns with the analysis. The process
    is a plain one: those of `multiprocessing` would run a script again that has no guard. Where it can't run, or fails,
    the pictures are made here, and what is wrong is raised here.
    """
    command = [sys.executable, "-c", _BESIDE, json.dumps(sys.path), str(manifest.folder)]
    try:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    except OSError:
        yield lambda: embed(manifest)
        return

    def pictures() -> Pictures:
        told, _ = process.communicate()
        return embed(manifest) if process.returncode else _from_json(told)

    with process:
        try:
            yield pictures
        finally:
            process.kill()


_BESIDE = "import json, sys; sys.path[:] = json.loads(sys.argv[1]); import study.report.media as m; m.tell(sys.argv[2])"


def tell(folder: str) -> None:
    """Print the pictures of a results folder as JSON: what the process of `embedding` does."""
    json.dump(asdict(embed(read_manifest(folder))), sys.stdout)


def _from_json(text: bytes) -> Pictures:
    found = json.loads(text)
    strips = tuple(Preview(**one) for one in found["strips"])
    return Pictures(strips, tuple(tuple(Preview(**one) for one in pair) for pair in found["videos"]))


def data_uri(content: bytes, kind: str) -> str:
    """Return bytes as a data URI."""
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


def shown_pairs(manifest: Manifest) -> list[tuple[Any, Any]]:
    """The pairs of records worth embedding: the widest difference, or both methods, one pair for each transition."""
    best: dict[tuple[str, str], Any] = {}
    rated: dict[tuple[str, str], list[Any]] = {}
    for pair in manifest.pairs:
        key = (pair.study, pair.motion)
        if len(pair.stimuli) == 1:
            rated.setdefault(key, []).append(manifest.record(pair.stimuli[0]))
            continue
        if key not in best or (pair.difference_frames or 0) > (best[key].difference_frames or 0):
            best[key] = pair
    singly = [(records[0], records[1] if len(records) > 1 else None) for records in rated.values()]
    compared = [pair.stimuli[:2] for pair in best.values()]
    return [*((manifest.record(a), manifest.record(b)) for a, b in compared), *singly]


def embed_videos(manifest: Manifest, most_bytes: int = MOST_VIDEO_BYTES) -> list[list[Preview]]:
    """Return pairs of embedded videos, one pair a transition, as many as fit."""
    spent, found = 0, []
    seen: set[str] = set()
    for records in shown_pairs(manifest):
        wanted = [record for record in records if record is not None and record.id in manifest.videos]
        files = [manifest.folder / str(manifest.videos[record.id]["file"]) for record in wanted]
        if not wanted or not all(file.is_file() for file in files) or all(record.id in seen for record in wanted):
            continue
        contents = [file.read_bytes() for file in files]
        if spent + sum(map(len, contents)) > most_bytes:
            continue
        spent += sum(map(len, contents))
        seen |= {record.id for record in wanted}
        found.append([Preview(data_uri(c, "video/mp4"), _caption(r)) for c, r in zip(contents, wanted, strict=True)])
    return found


def _caption(record: StimulusRecord) -> str:
    added = f" {record.difference_frames:+d}".replace("-", "− ").replace("+", "+ ") if record.difference_frames else ""
    how = (
        f"{record.method}{added}: {counted(record.blend_frames, 'frame')}"
        if record.blend_frames
        else f"{record.method}, no blend"
    )
    synthetic = " (synthetic motions)" if record.synthetic else ""
    return f"{record.transition.replace('_', ' ')}, {how}{synthetic}"


def embed_strips(manifest: Manifest, most: int = MOST_STRIPS) -> list[Preview]:
    """Return one strip a transition: evenly spaced frames of its first stimulus, those in the blend underlined."""
    chosen: dict[str, StimulusRecord] = {}
    for record in manifest.records:
        if record.id in manifest.videos and (record.transition not in chosen or record.difference_frames == 0):
            chosen.setdefault(record.transition, record)
            if chosen[record.transition].difference_frames != 0:
                chosen[record.transition] = record
    strips = []
    for record in list(chosen.values())[:most]:
        path = manifest.folder / str(manifest.videos[record.id]["file"])
        if not path.is_file():
            continue
        picture = strip_of_video(path, record.blend_start, record.blend_stop)
        uri = data_uri(picture, "image/png")
        alt = f"{POSES} moments of the transition {record.transition.replace('_', ' ')}, from left to right"
        strips.append(Preview(uri, _caption(record), alt))
    return strips


def strip_of_video(path: Path, blend_start: int, blend_stop: int) -> bytes:
    """Return a PNG of evenly spaced frames, each cropped about the figure, with a line under those of the blend."""
    import av
    from PIL import Image

    try:
        with av.open(str(path)) as container:
            # Decoding is cheap; only what is shown is turned into RGB.
            frames = list(container.decode(video=0))
        places = _moments(len(frames), blend_start, blend_stop)
        shown = [np.asarray(frames[place].to_ndarray(format="rgb24"), dtype=np.uint8) for place in places]
    except (av.error.FFmpegError, IndexError) as error:  # no stream, or no frame in it
        raise StimulusError(
            f"{path}: expected a video, found a damaged file ({error}); render it again, or delete it for a report "
            "without it."
        ) from error
    cells = _cropped(shown)
    blended = [blend_start <= place < blend_stop for place in places]
    picture = np.concatenate([_underlined(cell, inside) for cell, inside in zip(cells, blended, strict=True)], axis=1)
    image = Image.fromarray(picture)
    width = round(image.width * STRIP_HEIGHT / image.height)
    small = image.resize((width, STRIP_HEIGHT), Image.Resampling.LANCZOS).quantize(64, dither=Image.Dither.NONE)
    buffer = io.BytesIO()
    small.save(buffer, format="png", optimize=True)
    return buffer.getvalue()


def _moments(frames: int, blend_start: int, blend_stop: int) -> NDArray[np.intp]:
    """Frames evenly spaced in time; where a short blend would fall between two, the nearer one moves into it."""
    places = np.unique(np.linspace(0, frames - 1, POSES).round().astype(np.intp))
    middle = (blend_start + blend_stop) // 2
    if blend_start < blend_stop <= frames and not ((places >= blend_start) & (places < blend_stop)).any():
        places[np.abs(places - middle).argmin()] = middle
    return places


def _cropped(frames: Sequence[Bytes]) -> list[Bytes]:
    """Crop all frames to one size, each about its own figure."""
    boxes = [_box(frame) for frame in frames]
    top, bottom = min(box[0] for box in boxes) - MARGIN, max(box[1] for box in boxes) + MARGIN
    half = max(box[3] - box[2] for box in boxes) // 2 + MARGIN
    cells = []
    for frame, box in zip(frames, boxes, strict=True):
        middle = (box[2] + box[3]) // 2
        # Beyond the picture its edge goes on.
        rows = np.arange(top, bottom).clip(0, frame.shape[0] - 1)
        columns = np.arange(middle - half, middle + half).clip(0, frame.shape[1] - 1)
        cells.append(frame[np.ix_(rows, columns)])
    return cells


def _box(frame: Bytes) -> tuple[int, int, int, int]:
    """Top, bottom, left and right of the figure: of whatever differs from the corner's colour; else the whole frame.

    Every second pixel is looked at, which is four times faster and off by one at most, well within the margin.
    """
    sampled, ground = frame[::2, ::2], frame[0, 0].astype(int)
    lowest, highest = (ground - 40).clip(0, 255).astype(np.uint8), (ground + 40).clip(0, 255).astype(np.uint8)
    channels = (sampled < lowest) | (sampled > highest)
    figure = channels[..., 0] | channels[..., 1] | channels[..., 2]  # `any` over three values is slow
    rows, columns = np.flatnonzero(figure.any(axis=1)), np.flatnonzero(figure.any(axis=0))
    if not len(rows):
        return 0, frame.shape[0], 0, frame.shape[1]
    return 2 * int(rows[0]), 2 * int(rows[-1]) + 1, 2 * int(columns[0]), 2 * int(columns[-1]) + 1


def _underlined(cell: Bytes, inside: bool) -> Bytes:
    """The cell over a band that is coloured within the blend."""
    band = np.empty((max(cell.shape[0] // 40, 4), cell.shape[1], 3), dtype=np.uint8)
    band[:] = BLEND_COLOUR if inside else cell[0, 0]
    return np.concatenate([cell, band], axis=0)
