"""Starting: a first protocol, as a commented text to edit, for a task and motions of a library.

A task, motions and their library come in; the text goes out, with entry, exit and blends as long as the motions can
supply. What is tried is what Wang and Bodenheimer 2004 showed (section 4), and then less and less of it.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from study.counting import counted
from study.errors import StimulusError
from study.experiment.protocol.proofreading import TO_FILL_IN
from study.experiment.protocol.whole import parse_protocol
from study.experiment.stimuli.outlook import look_ahead
from study.toml_text import quoted

if TYPE_CHECKING:
    from study.motion.library import Library


class Room(NamedTuple):
    """What is asked of motions: seconds around blends; in frames, the longest blend and steps of its change."""

    around_s: float
    longest_frames: int
    step_frames: int


_TRIED = (2.0, 35, 5), (1.5, 35, 5), (1.0, 35, 5), (1.0, 30, 3), (0.75, 25, 3), (0.5, 20, 2), (0.2, 12, 2)
ROOMS = tuple(Room(*tried) for tried in _TRIED)
"""The first that the motions supply is taken."""

_LEVELS = """reference = "geodesic"  # the blend of the length k that the geodesic distance method finds (2004, 3.1)
# Frames by which the compared blend is shorter or longer than k. People notice 7 to 8 frames (2004, 5.1).
differences_frames = {differences}
order = "both"  # each pair in every order
"""
_SINGLE = """reference = "geodesic"  # the blend of the length k that the geodesic distance method finds (2004, 3.1)
# Frames by which the blend that is shown is shorter or longer than k; "yes" at 0 is a false alarm.
differences_frames = {differences}
repeats = 4
"""
_METHODS = """# Two ways to make a transition; docs/transitions.md lists more, such as "inertialize" or "cut".
reference = "geodesic"
comparison = "fixed"
fixed_frames = 10
repeats = {repeats}
"""
_ITEMS = """
[[studies.items]]  # asked after every film; write as many as you need
name = "natural"
question = "How natural was the motion?"
low = "very unnatural"
high = "very natural"
"""


class Study(NamedTuple):
    """What the study of a task is about, and what it has of its own."""

    title: str
    keys: str
    steps: tuple[int, ...] = ()
    """Differences of blend length to be told apart, in steps of the room; none where methods are compared."""
    tables: str = ""
    """What follows its keys."""


OF_TASK: Mapping[str, Study] = {
    "same-different": Study("How noticeable is the length of a blend?", _LEVELS, (-3, -2, -1, 0, 1, 2, 4)),
    "oddity": Study("Which of three blends has another length?", _LEVELS, (-3, -2, -1, 1, 2, 4)),
    "2afc": Study("Which of two blends is longer?", _LEVELS, (-3, -2, -1, 1, 2, 4)),
    "yes-no": Study("At which lengths does a blend look wrong?", _SINGLE, (-3, -2, -1, 0, 1, 2, 4)),
    "preference": Study(
        "Does a blend of the geodesic length look more natural than one of ten frames?",
        _METHODS + 'order = "balanced"  # half of the pairs in each order\n',
    ),
    "rating": Study("How natural do blends of the geodesic length look, and of ten frames?", _METHODS, tables=_ITEMS),
    "parallel-rating": Study(
        "How natural do three transitions look beside each other?",
        _METHODS
        + 'others = ["cut"]  # shown at once with the two\nreplays = 5  # times that all may be played again\n',
        tables=_ITEMS,
    ),
}
_MATCH = """# Both films of a pair take equally long, so that only the blend tells them apart.
match = "duration"
"""
_APART = """# Optimal blends of 5 frames or more (2004, section 4.3), and none near ten, the fixed one.
shortest_frames = 5
avoid_frames = 10
avoid_within_frames = 4
"""
_TEXT = """# A first protocol, written by `segue new` for you to edit. docs/protocol_keys.md explains every key;
# `segue check` says what will be shown, and everything that is wrong, before anything is rendered.

name = "{name}"
title = "{title}"  # participants read texts.title
fps = 30           # of every film; frames below are counted at this rate
seed = 1           # of all that is drawn at random
participants = 24  # planned, before there is data; `segue power` says how many a study needs
# Questions about the participant: age, gender, vision and animation are built in, others need a label.
form = [{{ name = "age", required = true }}, {{ name = "vision" }}]

[stimuli]
{match}style = "mannequin"
view = "least-cue"  # from where the films of a pair begin and end most alike
# Seconds of motion before and after a blend, as far as the clips supply them; 2 are usual.
entry_s = {room.around_s}
exit_s = {room.around_s}

[timing]
answer_s = 5.0
break_after = 20  # trials

[points]
choose = "random"  # where to blend: drawn from the seed, under the conditions below
# The longest optimal blend, as far as the clips supply it; 35 frames are usual.
longest_frames = {room.longest_frames}
{apart}
[consent]
text = "{{standard}}"  # the built-in text
contact = "{to_fill_in}: who runs this study, at which institution, how to be reached, and who approved it"

[texts]
welcome = "{{standard}}"
debrief = "{{standard}}"

# What the analysis leaves out, stated before there is data.
[analysis.exclusions]
badly_shown = true
most_missed = 0.25
most_failed_checks = 0.5

# Each clip leads to the next, and the last one to the first. Results are grouped by category, the type of motion.
{transitions}
# For practice and the example alone.
[[transitions]]
name = "practice"
category = "practice"
source = {practice}
destination = {practice}

[[studies]]
name = "main"
task = "{task}"
{study}practice = 2  # trials with feedback, which are not analysed
practice_transitions = ["practice"]
attention_checks = 2  # trials that ask for a stated answer
instructions = "{{standard}}"
"""


def start_protocol(name: str, task: str, motions: Sequence[str], library: Library) -> tuple[str, list[str]]:
    """Write a first protocol for a task and two or more of a library's motions: its text, and notes on it.

    Raises
    ------
    MotionError
        For a motion that can't be read.
    StimulusError
        Where the motions can't supply even the last of `ROOMS`, with what is missing.
    """
    seconds = {motion: library.clip(motion, fps=30).seconds for motion in motions}
    shortest, longest = (pick(seconds, key=seconds.__getitem__) for pick in (min, max))
    for room in ROOMS:
        protocol = parse_protocol(_written(name, task, motions, library, longest, room))
        outlook = look_ahead(protocol, library)
        if not outlook.problems:
            seen = f"{counted(outlook.trials, 'trial')} in about {counted(outlook.minutes, 'minute')}"
            fitted = (
                f"Fitted to the clips, of which {shortest} is the shortest ({seconds[shortest]:.2f} s): "
                f"{room.around_s:g} s before and after blends of up to {room.longest_frames} frames at 30 fps; usual "
                f"are {ROOMS[0].around_s:g} s and {ROOMS[0].longest_frames} frames."
            )
            return protocol.text, [*([fitted] if room != ROOMS[0] else []), f"A participant will see {seen}."]
    raise StimulusError(
        f"Expected motions that supply {room.around_s:g} s before and after blends of up to {room.longest_frames} "
        f"frames, found too little ({shortest!r} takes {seconds[shortest]:.2f} s). {outlook.problems[0]} Choose other "
        "motions; a gait that can go on may have cyclic = true in library.toml."
    )


def _written(name: str, task: str, motions: Sequence[str], library: Library, longest: str, room: Room) -> str:
    study = OF_TASK[task]
    differences = [step * room.step_frames for step in study.steps]
    text = _TEXT.format(
        name=name,
        title=study.title,
        room=room,
        match=_MATCH if differences else "",
        apart="" if differences or room == ROOMS[-1] else _APART,
        to_fill_in=TO_FILL_IN,
        transitions="".join(_transitions(motions, library)),
        practice=quoted(longest),
        task=task,
        study=study.keys.format(differences=differences, repeats=max(2, 16 // len(motions) // 2 * 2)),
    )
    return text + study.tables


def _transitions(motions: Sequence[str], library: Library) -> Iterator[str]:
    """A table for each motion and the next one."""
    slugs: dict[str, str] = {}
    for motion in motions:
        slug = _slug(motion)
        slugs[motion] = f"{slug}_{len(slugs) + 1}" if slug in slugs.values() else slug
    for pair in zip(motions, (*motions[1:], motions[0]), strict=True):
        kinds = dict.fromkeys(library.entry(motion).kind or motion for motion in pair)
        yield (
            f"\n[[transitions]]\nname = {quoted('_to_'.join(slugs[motion] for motion in pair))}\n"
            f"category = {quoted(' to '.join(kinds))}\nsource = {quoted(pair[0])}\ndestination = {quoted(pair[1])}\n"
        )


def _slug(motion: str) -> str:
    """A motion's name as names in protocols are written."""
    plain = unicodedata.normalize("NFKD", motion).encode("ascii", "ignore").decode().lower()
    return re.sub(r"[^a-z0-9]+", "_", plain).strip("_")[:40] or "clip"
