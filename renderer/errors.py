"""The renderer's exceptions: something asked of it that it can't draw, open or write."""

from __future__ import annotations


class RendererError(Exception):
    """The message says what was expected, what was found, and what to do."""


class DiskError(RendererError):
    """What the disk refuses: no room, no rights, a folder in the way."""
