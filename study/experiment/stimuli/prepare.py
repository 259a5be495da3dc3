"""Stimuli: from a protocol and a library to all that participants see, as a `StimulusSet`."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from study.errors import StimulusError
from study.experiment.protocol.whole import Protocol
from study.experiment.stimuli.outlook import look_ahead
from study.experiment.stimuli.stimulus import StimulusSet

if TYPE_CHECKING:
    from study.motion.library import Library


def prepare(protocol: Protocol, library: Library, progress: Callable[[int, int], None] | None = None) -> StimulusSet:
    """All stimuli of a protocol.

    Parameters
    ----------
    protocol, library
        What to show, and the motions to show it with.
    progress
        Called with transitions that are done and the number of them, after each.

    Raises
    ------
    StimulusError
        With everything that can't be shown, one problem a line.
    """
    found = look_ahead(protocol, library, progress)
    if found.stimuli is None:
        raise StimulusError("\n".join(found.problems))
    return found.stimuli


def check(protocol: Protocol, library: Library) -> list[str]:
    """Everything that can't be shown, one sentence each; empty where all can."""
    return list(look_ahead(protocol, library).problems)
