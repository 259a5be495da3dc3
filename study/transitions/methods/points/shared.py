"""Points that all methods of a study share: given by the protocol, or drawn at random from its seed (2004 section 4.3).

The conditions under which they are drawn are the protocol's, `[points]`; see `study.experiment.stimuli.points`.
"""

from __future__ import annotations

from study.transitions.methods.method import Points


class Shared(Points):
    """The points of `[points]`, whatever the method."""

    name = "shared"
    words = ""
