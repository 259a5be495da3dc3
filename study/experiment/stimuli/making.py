"""Making stimuli: from what a protocol plans to all that participants see.

What is planned comes in (`films.plan_all`); a `StimulusSet` goes out: each stimulus is a transition, cut to entry,
blend and exit, as joint positions with a figure and a camera. What is seen is hashed, and the hash is the stimulus's
name, so a stimulus is rendered once and reused after. Nothing is drawn here; see `rendering`.
"""

from __future__ import annotations

import platform
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from study.errors import StimulusError
from study.experiment.protocol.whole import Protocol, StudySpec
from study.experiment.stimuli.audit import audit
from study.experiment.stimuli.drafts import Draft, add_drafts
from study.experiment.stimuli.films import Film, Planned, Showing
from study.experiment.stimuli.look import LOOK_VERSION, with_cameras
from study.experiment.stimuli.manifest import made_from
from study.experiment.stimuli.stimulus import Stimulus, StimulusSet
from study.experiment.stimuli.ways import Ways
from study.tasks.trial import Pair

if TYPE_CHECKING:
    from study.motion.library import Library


def made_of(protocol: Protocol, library: Library, planned: Sequence[Planned], ways: Ways) -> StimulusSet:
    """Build all that was planned.

    Raises
    ------
    StimulusError
        Where two methods of a pair come to look the same, or a camera can't be found.
    """
    drafts: dict[Film, Draft] = {}
    for each in planned:
        add_drafts(protocol, each, drafts, ways)
    stimuli = with_cameras(protocol, library, planned, drafts)
    pairs = tuple(_pair(each.study, showing, stimuli) for each in planned for showing in each.showings)
    moving = {one.id: (one.positions, one.figure, one.camera) for one in stimuli.values()}
    return StimulusSet(
        protocol,
        library.name,
        library.synthetic,
        library.acknowledgement,
        tuple({stimulus.id: stimulus for stimulus in stimuli.values()}.values()),
        pairs,
        versions(),
        made_from(protocol, library),
        audit(pairs, moving, protocol.fps),
    )


def versions() -> dict[str, str]:
    """What made the stimuli, for manifests."""
    from importlib.metadata import version

    import study

    return {
        "segue": study.__version__,
        "look": str(LOOK_VERSION),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": version("scipy"),
    }


def _pair(study: StudySpec, showing: Showing, stimuli: dict[Film, Stimulus]) -> Pair:
    transition, condition = showing.settled.transition, showing.condition
    shown = tuple(stimuli[film].id for film in showing.films)
    if len(set(shown)) < len(set(condition.methods)):
        one, other = (repr(method) for method in condition.methods[:2])
        raise StimulusError(
            f"transition {transition.name!r}: expected two films by the methods {one} and {other} of the study "
            f"{study.name!r}, found that they look the same; choose other motions, other points, or another method."
        )
    return Pair(
        name="/".join(filter(None, (study.name, transition.name, condition.name))),
        study=study.name,
        task=study.task,
        motion=transition.name,
        category=transition.category,
        stimuli=shown,
        methods=condition.methods,
        difference_frames=condition.difference_frames,
    )
