"""Frames as people look them up: the number at the working rate, the seconds, and the frame of the clip's own file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from study.motion.clip import Clip


def moment(clip: Clip, frame: int, prefix: str) -> dict[str, Any]:
    """A frame for `--json`: `<prefix>_frame` at the clip's rate, `<prefix>_s`, and `<prefix>_file_frame`."""
    from study.motion.clip import file_frame

    return {
        f"{prefix}_frame": frame,
        f"{prefix}_s": round(frame / clip.fps, 6),
        f"{prefix}_file_frame": round(file_frame(clip, frame), 3),
    }


def in_words(clip: Clip, frame: int, name: str) -> str:
    """A frame in a sentence: `run frame 44 (1.467 s; frame 176 of its file)`."""
    from study.motion.clip import file_frame

    own = file_frame(clip, frame)
    file = "" if abs(own - frame) < 1e-6 else f"; frame {own:.5g} of its file"
    return f"{name} frame {frame} ({frame / clip.fps:.3f} s{file})"
