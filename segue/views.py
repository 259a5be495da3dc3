"""What a notebook shows of a picture or a film: the file's bytes, inside the page."""

from __future__ import annotations

import base64
import html
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from study.files import write_whole


@dataclass(frozen=True)
class View:
    """A picture (PNG or SVG) or a film (MP4). A notebook displays it; `save` writes it."""

    data: bytes = field(repr=False)
    kind: str
    """`image/png`, `image/svg+xml` or `video/mp4`."""
    words: str
    """What it shows, for those who can't see it."""

    def save(self, path: str | Path) -> Path:
        """Write the file, whole or not at all, and return its path."""
        write_whole(Path(path), self.data)
        return Path(path)

    def _repr_html_(self) -> str:
        source = f"data:{self.kind};base64,{base64.b64encode(self.data).decode('ascii')}"
        words = html.escape(self.words, quote=True)
        if self.kind.startswith("video"):
            return f'<video controls loop width="640" src="{source}" title="{words}"></video>'
        return f'<img style="max-width: 100%; background: white" src="{source}" alt="{words}">'


def drawn(suffix: str, words: str, draw: Callable[[Path], object]) -> View:
    """What a function writes into a file with this ending."""
    kinds = {".png": "image/png", ".mp4": "video/mp4"}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"view{suffix}")
        draw(path)
        return View(path.read_bytes(), kinds[suffix], words)
