"""A toy library, protocol and pairs: a small figure whose motions are simple and as long as a test wants them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from study.errors import MotionError
from study.experiment.protocol.whole import Protocol
from study.experiment.stimuli.stimulus import StimulusRecord
from study.experiment.store.answers import Presentation, record_answer
from study.experiment.store.responses import Responses
from study.experiment.store.sessions import SessionRecord
from study.motion import quaternions as quat
from study.motion.clip import Clip
from study.motion.library import Entry, Library
from study.motion.skeleton import Skeleton
from study.tasks.answer import Answer
from study.tasks.registry import task_of
from study.tasks.trial import Pair

_JOINTS = (
    ("Hips", -1, (0.0, 0.9, 0.0)),
    ("LeftUpLeg", 0, (0.1, 0.0, 0.0)),
    ("LeftLeg", 1, (0.0, -0.42, 0.0)),
    ("LeftFoot", 2, (0.0, -0.42, 0.0)),
    ("RightUpLeg", 0, (-0.1, 0.0, 0.0)),
    ("RightLeg", 4, (0.0, -0.42, 0.0)),
    ("RightFoot", 5, (0.0, -0.42, 0.0)),
    ("Spine", 0, (0.0, 0.2, 0.0)),
    ("Chest", 7, (0.0, 0.2, 0.0)),
    ("LeftArm", 8, (0.2, 0.1, 0.0)),
    ("LeftForeArm", 9, (0.0, -0.28, 0.0)),
    ("LeftHand", 10, (0.0, -0.25, 0.0)),
    ("RightArm", 8, (-0.2, 0.1, 0.0)),
    ("RightForeArm", 12, (0.0, -0.28, 0.0)),
    ("RightHand", 13, (0.0, -0.25, 0.0)),
    ("Neck", 8, (0.0, 0.15, 0.0)),
    ("Head", 15, (0.0, 0.1, 0.0)),
)


def toy_skeleton() -> Skeleton:
    names, parents, offsets = zip(*_JOINTS, strict=True)
    ends = [3, 6, 11, 14, 16]
    tips = [(0.0, -0.04, 0.15), (0.0, -0.04, 0.15), (0.0, -0.1, 0.0), (0.0, -0.1, 0.0), (0.0, 0.2, 0.0)]
    return Skeleton(names, np.array(parents), np.array(offsets), np.array(ends), np.array(tips))


_SKELETON = toy_skeleton()


def toy_clip(name: str, frames: int, fps: float, speed: float, period_s: float) -> Clip:
    """Arms and legs that swing against each other while the hips go along +Z."""
    time = np.arange(frames) / fps
    rotations = np.zeros((frames, len(_JOINTS), 4))
    rotations[..., 0] = 1.0
    swing = np.sin(2 * np.pi * time / period_s)
    for joint, share in ((1, 0.5), (4, -0.5), (9, -0.4), (12, 0.4)):
        rotations[:, joint] = quat.from_axis_angle([1.0, 0.0, 0.0], share * swing)
    bend = 0.4 * (1 - np.cos(2 * np.pi * time / period_s))
    for joint, phase in ((2, bend), (5, bend[::-1])):
        rotations[:, joint] = quat.from_axis_angle([1.0, 0.0, 0.0], phase)
    root = np.stack([0 * time, 0.9 + 0 * time, speed * time], axis=-1)
    return Clip(_SKELETON, root, rotations, fps, name=name, synthetic=True)


@dataclass(frozen=True)
class Toy:
    """A motion of the toy library: hips' speed, period of the swing, and its length where it is limited."""

    speed: float
    period_s: float
    seconds: float | None = None
    end: str = ""


class ToyLibrary(Library):
    name = "toy"
    synthetic = True
    acknowledgement = "made up for tests"

    def __init__(self, motions: dict[str, Toy], synthetic: bool = True) -> None:
        super().__init__()
        self.motions = motions
        self.synthetic = synthetic

    def names(self) -> tuple[str, ...]:
        return tuple(self.motions)

    def entry(self, name: str) -> Entry:
        if name not in self.motions:
            raise MotionError(f"Expected a motion of toy, found {name!r}. It has {', '.join(self.motions)}.")
        return Entry(name, "toy")

    def _make(self, entry: Entry, fps: float | None, min_seconds: float | None) -> Clip:
        toy = self.motions[entry.name]
        seconds = toy.seconds or min_seconds or 8.0
        return toy_clip(entry.name, round(seconds * (fps or 30.0)), fps or 30.0, toy.speed, toy.period_s)


TOY_PROTOCOL = """\
name = "toy"
title = "A toy"
fps = 30
seed = 5

[stimuli]
width = 96
height = 64
entry_s = 0.3
exit_s = 0.3

[points]
shortest_frames = 4
longest_frames = 30

[texts]
welcome = "Welcome."
debrief = "Thank you."

[[transitions]]
name = "slow_quick"
category = "walking"
source = "slow"
destination = "quick"

[[transitions]]
name = "still_slow"
category = "standing"
source = "still"
destination = "slow"

[[studies]]
name = "jnd"
task = "same-different"
transitions = ["slow_quick"]
reference = "geodesic"
differences_frames = [-3, 0, 5]
order = "both"
question = "Same or different?"
instructions = "Some pairs are the same."

[[studies]]
name = "liking"
task = "preference"
reference = "geodesic"
comparison = "fixed"
question = "Which is more natural?"
instructions = ""
"""

TOY_RATING = """
[[studies]]
name = "rating"
task = "rating"
reference = "geodesic"
comparison = "cut"
order = "by-group"
question = "How was it?"
instructions = ""

[[studies.items]]
name = "natural"
question = "How natural was it?"
low = "not at all"
high = "very"

[[studies.items]]
name = "noticeable"
question = "How noticeable was the passage?"
"""


def pairs_of(protocol: Protocol) -> tuple[Pair, ...]:
    """Pairs with made-up stimulus ids, as `prepare` would name and order them."""
    pairs = []
    for study in protocol.studies:
        for transition in (*protocol.transitions_of(study), *protocol.practice_of(study)):
            for condition in task_of(study).conditions(study, transition.name in study.practice_transitions):
                if len(condition.methods) == 1:
                    shown: tuple[str, ...] = (f"{transition.name}-{condition.methods[0]}",)
                elif condition.difference_frames is None:
                    shown = f"{transition.name}-k", f"{transition.name}-fixed"
                else:
                    shown = tuple(
                        f"{transition.name}{d:+d}" if d else f"{transition.name}-k" for d in condition.added_frames
                    )
                name = "/".join(filter(None, (study.name, transition.name, condition.name)))
                meaning = condition.methods, condition.difference_frames
                pairs.append(Pair(name, study.name, study.task, transition.name, transition.category, shown, *meaning))
    return tuple(pairs)


@dataclass(frozen=True)
class FakeStimuli:
    """Pairs without pictures: all that a simulation needs."""

    pairs: tuple[Pair, ...]
    library: str = "toy"
    synthetic: bool = True
    records: tuple[StimulusRecord, ...] = ()


STAIRCASE = """
[studies.procedure]
name = "staircase"
start_frames = 6
most_frames = 8
steps_frames = [2, 1]
reversals = 3
averaged = 2
most_trials = 14
catch_every = 4
"""

QUEST = """
[studies.procedure]
name = "quest-plus"
most_frames = 8
threshold_frames = 4.0
narrow = 2.5
least_trials = 4
most_trials = 9
"""


def with_staircases(text: str = TOY_PROTOCOL, keys: str = "", table: str = STAIRCASE) -> str:
    """A protocol's text with staircases, or another procedure, in place of the differences of its study `jnd`."""
    text = text.replace('differences_frames = [-3, 0, 5]\norder = "both"\n', keys)
    head, study = text.split('name = "jnd"', 1)
    own, *others = study.split("\n[[studies]]")
    return "\n[[studies]]".join([f'{head}name = "jnd"{own}{table}', *others])


TOY_PAIR_RATING = """
[[studies]]
name = "compared"
task = "rating"
show = "pair"
reference = "geodesic"
comparison = "cut"
order = "by-group"
instructions = ""

[[studies.items]]
name = "better"
question = "Compared with the first, the second was:"
low = "much worse"
middle = "the same"
high = "much better"

[[studies.items]]
name = "natural"
question = "Compared with the first, the second looked:"
low = "much less natural"
high = "much more natural"
"""


def keep_answer(
    responses: Responses, record: SessionRecord, answer: Answer, shown: Sequence[Presentation] = ()
) -> bool:
    """Store an answer to a trial that the plan knows beforehand."""
    return record_answer(responses, record, record.plan.trials[answer.trial - 1], answer, shown)
