"""The renderer's one exception: something asked of it that it can't draw, open or write."""

from __future__ import annotations


class RendererError(Exception):
    """The message says what was expected, what was found, and what to do."""
