"""Given transitions: the researcher's own, each read from a motion file, to stand beside those that are made here.

A file holds a whole transition, with the source before the blend and the destination after it. It is shown as it is:
only its rig, its frame rate and its place on the floor are brought to those of the transitions beside it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

from annotated_types import Ge, Le

from study.counting import counted
from study.errors import TransitionError
from study.settings import required
from study.transitions.methods.method import Made, Make, Place, Way

if TYPE_CHECKING:
    from study.motion.clip import Clip

_SAME_POSE = 0.035
"""Mean angle of the joints, radians, up to which two poses count as one and the same (2 degrees)."""


@dataclass(frozen=True)
class GivenFile:
    """A motion file with a whole transition, and the frames of its blend."""

    file: str = required(
        "Motion file (BVH, or AMC beside its ASF) with the whole transition; a path from the folder of the protocol."
    )
    start_frame: Annotated[int, Ge(0), Le(20_736_000)] = required(
        "First frame of the blend, as the file counts them, from 0 and at its own frame rate. [frames]"
    )
    end_frame: Annotated[int, Ge(0), Le(20_736_000)] = required("Last frame of the blend in the file. [frames]")


@dataclass(frozen=True)
class Read(Way):
    """A transition out of a file: `start` and `stop` bound its blend at the study's frame rate, as a slice counts.

    `available` are its frames in all; `told` says what was found and done.
    """

    file: str
    start: int
    stop: int
    available: int
    told: str

    @property
    def frames(self) -> int:
        """Frames of the blend."""
        return self.stop - self.start

    @property
    def note(self) -> str:
        """What was found and done."""
        return self.told

    def lacking(self, entry: int, after: int) -> str:
        """What the file lacks of entry and exit."""
        sides = ((entry, self.start, "before its blend"), (after, self.available - self.stop, "after its blend"))
        return "; ".join(
            f"expected {counted(wanted, 'frame')} {where} in {self.file}, found {there}: lower entry_s or exit_s, or "
            "give a longer file"
            for wanted, there, where in sides
            if there < wanted
        )

    def made(self, place: Place) -> Made:
        """The file's frames, turned and moved so that its blend starts where the source stands, facing the same way.

        The height is the source's where the poses before the blend are one; else the file's floor is put at 0.
        """
        import numpy as np

        from study.motion.clip import moved, trim
        from study.motion.feet import grounded
        from study.transitions.blending import facing

        clip, source = _clip(self.file, place), place.source
        own, there = _before(self.start, place.start_frame)
        same = _apart(clip, own, source, there) <= _SAME_POSE
        turn = facing(trim(source, there, there + 1))[0] - facing(trim(clip, own, own + 1))[0]
        turned = moved(clip if same else grounded(clip), float(turn), np.zeros(3))
        by = (source.root_positions[there] - turned.root_positions[own]) * [1.0, float(same), 1.0]
        return Made(moved(turned, 0.0, by), self.start, self.stop, self.told)


@dataclass(frozen=True)
class Given(Make):
    """Transitions that the researcher made."""

    name = "given"
    words = "the researchers’ own transitions"
    how = "were read from motion files"
    windows = 0

    files: Mapping[str, GivenFile] = field(
        default_factory=dict, metadata={"words": "Make `given`: a file for each transition, by the transition's name."}
    )

    def way(self, place: Place, windows: tuple[int, int]) -> Way:
        """The transition in the file that is given for it."""
        del windows
        given = self.files[place.transition]
        captured, clip = _captured(given.file, place), _clip(given.file, place)
        if given.end_frame >= captured.frames:
            raise TransitionError(
                f"Expected end_frame from {given.start_frame} to {captured.frames - 1}, the frames of {given.file}, "
                f"found {given.end_frame}; change it."
            )
        # The poses next to the blend stay at their moments, as where a transition is made at another rate.
        ratio = clip.fps / captured.fps
        start = max(0, round((given.start_frame - 1) * ratio) + 1)
        stop = min(clip.frames, max(start + 1, round((given.end_frame + 1) * ratio)))
        told = f"{given.file}, blend from its frame {given.start_frame} to {given.end_frame} at {captured.fps:g} fps"
        notes = (told, _next_to(clip, start, stop, place), *clip.history[len(captured.history) :])
        return Read(given.file, start, stop, clip.frames, "; ".join(notes))

    def files_read(self) -> tuple[str, ...]:
        """The given files."""
        return tuple(given.file for given in self.files.values())

    def transitions(self) -> tuple[str, ...]:
        """Those that there are files for."""
        return tuple(self.files)

    def lacks(self, transition: str) -> str:
        """A file for the transition, or frames in their order."""
        if transition not in self.files:
            there = ", ".join(self.files) or "none"
            return f"expected a file for the transition {transition!r} in its files, found {there}; give one"
        given = self.files[transition]
        if given.start_frame > given.end_frame:
            return (
                f"expected start_frame <= end_frame for the transition {transition!r}, found {given.start_frame} and "
                f"{given.end_frame}; exchange them"
            )
        return ""


def _captured(file: str, place: Place) -> Clip:
    """The file as it is: nothing is mended, since a jump may be what is to be judged."""
    from study.motion.entries import entry_of_file, prepared

    path = place.motions.path(file)
    return place.motions.once(("given", path), lambda: prepared(entry_of_file(path), as_is=True))


def _clip(file: str, place: Place) -> Clip:
    """The file's frames on the rig and at the frame rate of the transition's source."""
    from study.motion.clip import resample, retarget

    captured, source = _captured(file, place), place.source
    return place.motions.once(
        ("given", place.motions.path(file), source), lambda: resample(retarget(captured, source.skeleton), source.fps)
    )


def _before(start: int, start_frame: int) -> tuple[int, int]:
    """The frames before the blend in the file and in the source; the first blended ones where there are none."""
    back = min(1, start, start_frame)
    return start - back, start_frame - back


def _apart(clip: Clip, frame: int, other: Clip, there: int) -> float:
    """Mean angle between the joints of two poses, the root apart, radians."""
    from study.motion.quaternions import half_angle_between

    return float(2.0 * half_angle_between(clip.rotations[frame, 1:], other.rotations[there, 1:]).mean())


def _next_to(clip: Clip, start: int, stop: int, place: Place) -> str:
    """How far the poses next to the blend are from those of the two motions at the transition points."""
    from math import degrees

    own, there = _before(start, place.start_frame)
    after = min(stop, clip.frames - 1), min(place.end_frame + 1, place.destination.frames - 1)
    before_deg = degrees(_apart(clip, own, place.source, there))
    after_deg = degrees(_apart(clip, after[0], place.destination, after[1]))
    return (
        f"joints {before_deg:.1f} degrees from the source's before the blend and {after_deg:.1f} degrees from the "
        "destination's after it"
    )
