"""The parts of a protocol that say what is shown and when: stimuli, times, transitions and their points.

Pydantic models only; `protocol.Protocol` holds them.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from study.experiment.protocol.errors import KeyMismatchError
from study.experiment.protocol.texts import Part, Slug

LONGEST_CLIP_S, LONGEST_CLIP_FRAMES = 86_400, 86_400 * 240
"""A day, and a day at the highest frame rate: no point of a motion lies further on."""

Colour = Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$")]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]


class Colours(Part):
    """Colours of the picture; the renderer's defaults where a key is missing."""

    background: Colour | None = Field(default=None, description="Behind the figure, as #rrggbb.")
    left: Colour | None = Field(default=None, description="Left limbs, as #rrggbb.")
    right: Colour | None = Field(default=None, description="Right limbs, as #rrggbb.")
    centre: Colour | None = Field(default=None, description="Head and trunk, as #rrggbb.")


class StimulusSettings(Part):
    """How every stimulus of the protocol is built and drawn."""

    width: int = Field(default=1280, ge=64, le=3840, multiple_of=2, description="Width of the video; even. [pixels]")
    height: int = Field(default=720, ge=64, le=2160, multiple_of=2, description="Height of the video; even. [pixels]")
    camera: Literal["fixed", "pan", "track"] = Field(
        default="pan",
        description="What the camera of a group does: `fixed` nothing; `pan` stands still and turns by one slow path "
        "for all films of the group; `track` follows the figure, which hides part of its motion.",
    )
    view: Literal["clearest", "least-cue", "front", "side", "three-quarter"] = Field(
        default="clearest",
        description="Direction of the camera relative to the group's heading; `clearest` is the view in which "
        "the group's figures are large and their limbs move most in the picture, `least-cue` the one in which the "
        "stimuli of a pair begin and end most alike in place and size.",
    )
    track_s: float | None = Field(
        default=None,
        gt=0,
        le=60,
        description='Smoothing window of `camera = "track"`, 1 where it is missing. [seconds]',
    )
    style: Literal["stick", "points", "mannequin"] = Field(default="stick", description="How the figure is drawn.")
    floor: bool = Field(
        default=False, description="Whether a ground plane with contact shadows is drawn (2004 section 4.1: none)."
    )
    camera_group: Literal["transition", "category", "study"] = Field(
        default="transition",
        description="Which stimuli share one camera (2004: groups of motions share a camera position); those that one "
        "trial compares always do.",
    )
    entry_s: float = Field(
        default=2.0, ge=0, le=60, description="Source motion shown before the blend starts. [seconds]"
    )
    exit_s: float = Field(default=2.0, ge=0, le=60, description="Destination motion shown after the blend. [seconds]")
    match: Literal["none", "duration"] = Field(
        default="none",
        description="`duration`: the stimuli of a pair take equally long and show the same frames of both motions at "
        "the same times, with their blends around the same moment; `none`: each blend starts at the transition point, "
        "so a longer one makes a longer stimulus (2004).",
    )
    jitter_s: float = Field(
        default=0.0,
        ge=0,
        le=10,
        description="Each stimulus of a pair ends earlier by a time of at most so much, drawn from the seed, so that "
        "neither its duration nor its last frame tells how long its blend is. [seconds]",
    )
    ending: Literal["cut", "fade", "cover"] = Field(
        default="cut",
        description="How the exit ends: `cut` in full view, `fade` into the background, or `cover`, which hides it.",
    )
    ending_s: float = Field(
        default=0.5, gt=0, le=10, description="How long the fade or the cover lasts, within `exit_s`. [seconds]"
    )
    weight: Literal["linear", "sigmoid"] = Field(default="linear", description="How the blend weight runs from 0 to 1.")
    clean_feet: bool = Field(default=True, description="Whether sliding of planted feet is removed after blending.")
    colours: Colours = Field(default=Colours(), description="Colours of the picture.")

    @property
    def smoothing_s(self) -> float:
        """Smoothing window of a camera that tracks, seconds."""
        return 1.0 if self.track_s is None else self.track_s

    @model_validator(mode="before")
    @classmethod
    def _tracks(cls, data: Any) -> Any:
        """Protocols that were written before there was a `camera` say by `track_s` that it tracks."""
        if isinstance(data, dict) and data.get("track_s") is not None and "camera" not in data:
            return {**data, "camera": "track"}
        return data

    @model_validator(mode="after")
    def _smoothing(self) -> Self:
        if self.track_s is not None and self.camera != "track":
            raise KeyMismatchError(
                f'expected camera = "track" with track_s, found {self.camera!r}; leave track_s out, or track', "camera"
            )
        return self

    @model_validator(mode="after")
    def _end(self) -> Self:
        hidden = self.ending_s if self.ending != "cut" else 0.0
        if self.jitter_s + hidden > self.exit_s:
            raise KeyMismatchError(
                f"expected an exit that is longer than jitter_s and the ending together, {self.jitter_s + hidden:g} s, "
                f"found {self.exit_s:g}; raise exit_s, or lower them",
                "exit_s",
            )
        return self


class Screen(Part):
    """How large stimuli are shown, in the window and in the browser alike."""

    height_share: float = Field(
        default=0.7, ge=0.05, le=1, description="Height of the picture as a share of the screen's height."
    )
    height_degrees: float | None = Field(
        default=None,
        gt=0,
        le=90,
        description="Height of the picture in degrees of visual angle, in place of `height_share`; browsers then ask "
        "participants to measure their screen with a bank card. [degrees]",
    )
    distance_cm: float | None = Field(
        default=None,
        gt=10,
        le=1000,
        description="Viewing distance, which participants are asked to keep. [centimetres]",
    )
    ask_distance: Literal["no", "typed", "blind-spot"] = Field(
        default="no",
        description="Whether browsers ask for the viewing distance: as a number, or by finding the blind spot.",
    )

    @model_validator(mode="after")
    def _distance(self) -> Self:
        if self.height_degrees is not None and self.distance_cm is None and self.ask_distance == "no":
            raise KeyMismatchError(
                "expected distance_cm or ask_distance with height_degrees, found neither; state the viewing distance",
                "height_degrees",
            )
        return self


class Timing(Part):
    """What a participant's time is spent on."""

    gap_s: float = Field(default=1.0, ge=0, le=60, description="Blank between the two stimuli of a pair. [seconds]")
    answer_s: float = Field(
        default=5.0, gt=0, le=600, description="Response deadline; after it the trial has no response. [seconds]"
    )
    pause_s: float = Field(default=1.0, ge=0, le=60, description="Enforced pause after each response. [seconds]")
    show_again: int = Field(
        default=1,
        ge=0,
        le=3,
        description="How often a trial is repeated after a display failure, at the end of its study.",
    )
    break_after: int = Field(
        default=0, ge=0, le=1_000_000, description="Number of trials between breaks; 0 for none. [trials]"
    )


class FailedChecks(Part):
    """What failed attention checks lead to while the session runs."""

    most: int | None = Field(
        default=None, ge=0, le=100, description="How many may be failed or missed; by default any number. [checks]"
    )
    then: Literal["end", "flag"] = Field(
        default="end",
        description="With one more: `end` the session there, or `flag` it, which ends as usual with the outcome "
        "`failed-checks`.",
    )


class Points(Part):
    """How transition points are chosen: given, or drawn at random from the protocol's seed under conditions.

    Every key may be given in `[points]`, in a study's `points` and in a transition's `points`; the most specific one
    counts.
    """

    choose: Literal["random", "given"] | None = Field(
        default=None, description="`random` draws from the seed (2004 section 4.3); `given` takes the four keys below."
    )
    source_s: float | None = Field(
        default=None, ge=0, le=LONGEST_CLIP_S, description="Start of the blend in the source, if given. [seconds]"
    )
    destination_s: float | None = Field(
        default=None, ge=0, le=LONGEST_CLIP_S, description="End of the blend in the destination. [seconds]"
    )
    source_frame: int | None = Field(
        default=None, ge=0, le=LONGEST_CLIP_FRAMES, description="The same as a frame at the protocol's fps. [frames]"
    )
    destination_frame: int | None = Field(
        default=None, ge=0, le=LONGEST_CLIP_FRAMES, description="The same as a frame. [frames]"
    )
    shortest_frames: int | None = Field(
        default=None, ge=1, le=600, description="Shortest optimal blend to accept. [frames]"
    )
    longest_frames: int | None = Field(
        default=None, ge=1, le=600, description="Longest optimal blend to accept. [frames]"
    )
    avoid_frames: int | None = Field(default=None, ge=1, le=600, description="A blend length to avoid. [frames]")
    avoid_within_frames: int | None = Field(
        default=None, ge=0, le=600, description="Optimal blends this close to `avoid_frames` are rejected. [frames]"
    )
    least_warp_frames: int | None = Field(
        default=None,
        ge=0,
        le=600,
        description="Least difference between the two windows of a time-warped blend. [frames]",
    )
    source_within: Annotated[tuple[Fraction, Fraction], Field(strict=False)] | None = Field(
        default=None,
        description="Part of the source clip from which its point is drawn, as two fractions of its length.",
    )
    destination_within: Annotated[tuple[Fraction, Fraction], Field(strict=False)] | None = Field(
        default=None, description="The same for the destination; [0.0, 0.4] of a turning motion keeps the turn visible."
    )

    @model_validator(mode="after")
    def _ranges(self) -> Self:
        if self.shortest_frames and self.longest_frames and self.shortest_frames > self.longest_frames:
            raise KeyMismatchError(
                f"expected shortest_frames <= longest_frames, found {self.shortest_frames} and {self.longest_frames}; "
                "exchange them",
                "shortest_frames",
            )
        for key in ("source_within", "destination_within"):
            span = getattr(self, key)
            if span is not None and span[0] >= span[1]:
                raise KeyMismatchError(f"expected [from, to] with from < to, found {list(span)}; exchange them", key)
        return self


class TransitionSpec(Part):
    """One transition: from a motion of the library to another."""

    name: Slug = Field(description="Name in studies, plans and reports; unique.")
    category: str = Field(min_length=1, description="Type of motion, such as walking; results are grouped by it.")
    source: str = Field(min_length=1, description="Motion of the library that it starts from.")
    destination: str = Field(min_length=1, description="Motion of the library that it leads to.")
    points: Points = Field(default=Points(), description="Conditions for this transition alone.")
