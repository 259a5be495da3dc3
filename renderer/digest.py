"""A hash of raw frames: NV12 frames in, one SHA-256 out, the same for any encoder.

Hashing every byte would cost as much as drawing, and most bytes are background. So the hash covers a shorter form
that says as much: the frame's size, the ground (the colours of the first frame's top left corner), and for each plane
of each frame the smallest box outside which everything is ground, with its place and its bytes. Frames that are equal
give equal forms, and frames that differ in one byte give different ones.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Box = tuple[int, int, int, int]

FORM = b"segue frames 1"


class FramesHash:
    """SHA-256 over frames that arrive one after the other."""

    def __init__(self, size: tuple[int, int]) -> None:
        self._width, self._height = size
        self._sha = hashlib.sha256(FORM + np.array(size, dtype="<i8").tobytes())
        self._ground: tuple[int, int] | None = None
        self.frames = 0

    def update(self, frame: Bytes, touched: Box | None = None, ground: tuple[int, int, int] | None = None) -> None:
        """Take the next frame.

        Parameters
        ----------
        frame : (height * 3 / 2, width)
            NV12.
        touched, ground
            A shortcut, which does not change the hash: left, top, right and bottom (even numbers) of a box outside
            which the frame is known to be of this luma and chroma.
        """
        luma, chroma = frame[: self._height], frame[self._height :].view("<u2")
        if self._ground is None:
            self._ground = (int(luma[0, 0]), int(chroma[0, 0]))
            self._sha.update(np.array(self._ground, dtype="<i8").tobytes())
        if touched is None or ground is None or (ground[0], ground[1] + 256 * ground[2]) != self._ground:
            touched = (0, 0, self._width, self._height)
        left, top, right, bottom = touched
        self._plane(luma, self._ground[0], (left, top, right, bottom))
        self._plane(chroma, self._ground[1], (left // 2, top // 2, right // 2, bottom // 2))
        self.frames += 1

    def _plane(self, plane: NDArray[np.unsignedinteger], ground: int, within: Box) -> None:
        box = _drawn(plane, ground, within)
        self._sha.update(np.array(box, dtype="<i8").tobytes())
        self._sha.update(np.ascontiguousarray(plane[box[1] : box[3], box[0] : box[2]]).view(np.uint8).data)

    def hexdigest(self) -> str:
        """The hash of the frames so far."""
        return self._sha.hexdigest()


def _drawn(plane: NDArray[np.unsignedinteger], ground: int, within: Box) -> Box:
    """The smallest box outside which all is ground, sought from the edges; zeros where there is nothing else."""
    left, top, right, bottom = within
    while top < bottom and (plane[top, left:right] == ground).all():
        top += 1
    if top == bottom:
        return 0, 0, 0, 0
    while (plane[bottom - 1, left:right] == ground).all():
        bottom -= 1
    while (plane[top:bottom, left] == ground).all():
        left += 1
    while (plane[top:bottom, right - 1] == ground).all():
        right -= 1
    return left, top, right, bottom


def hash_frames(frames: Iterable[Bytes], size: tuple[int, int]) -> str:
    """The hash of NV12 frames, as `VideoInfo.frames_sha256` has it."""
    digest = FramesHash(size)
    for frame in frames:
        digest.update(frame)
    return digest.hexdigest()
