"""Segments: stretches of a motion with colours of their own, as source, blend and destination have in strips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from renderer.capsules import Figure
from renderer.colour import RGB
from renderer.errors import RendererError

SEGMENT_COLOURS: dict[str, RGB] = {"source": (0, 98, 168), "blend": (158, 58, 128), "destination": (204, 98, 0)}
"""Told apart by people with any colour vision (after Okabe and Ito 2008), and by their place in the row."""


@dataclass(frozen=True)
class Segment:
    """Frames `start .. stop - 1` of a motion, drawn in a colour of their own (by name where None)."""

    name: str
    start: int
    stop: int
    colour: RGB | None = None

    @property
    def paint(self) -> RGB:
        """The colour to draw it in."""
        if self.colour is not None:
            return self.colour
        if self.name not in SEGMENT_COLOURS:
            raise RendererError(
                f"Expected a segment named {', '.join(SEGMENT_COLOURS)}, or one with a colour; got {self.name!r}."
            )
        return SEGMENT_COLOURS[self.name]


def painted(figure: Figure, frame: int, segments: Sequence[Segment]) -> Figure:
    """The figure in the colour of the frame's segment; its own light and dark sides stay apart."""
    for segment in segments:
        if segment.start <= frame < segment.stop:
            lightness = figure.colours.mean(axis=1)
            middle, spread = lightness.mean(), max(float(np.ptp(lightness)), 1.0)
            share = ((lightness - middle) / spread)[:, None]
            paint = np.array(segment.paint, dtype=np.float64)
            colours = np.where(share > 0, paint + (255.0 - paint) * 0.55 * share, paint * (1.0 + 0.45 * share))
            return replace(figure, colours=np.round(np.clip(colours, 0, 255)).astype(np.int64))
    return figure
