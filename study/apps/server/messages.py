"""Messages of the page: what a browser may send, checked key by key. JSON comes in, frozen models go out."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from study.errors import SessionError
from study.experiment.store.answers import Presentation
from study.tasks.trial import PLACES

LONGEST_FILM_FRAMES = 40_000
"""Far above the longest stimulus (120 s at 240 frames a second); a page can't fill the database."""

MOST_SLOTS = 200
"""Above the films of any trial, each time that they are played."""

SHORTEST_PAGE, LONGEST_PAGE = 8, 64
"""Characters of the name that a page gives itself."""

Text = Annotated[str, Field(max_length=400)]
Milliseconds = Annotated[float, Field(ge=0, lt=1e9)]


class RefusedError(Exception):
    """A request that is answered with an error: a status and one sentence."""

    def __init__(self, status: int, why: str) -> None:
        self.status, self.why = status, why
        super().__init__(why)


class Message(BaseModel):
    """What all messages share."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Display(Message):
    """What the page knows about the display that it is shown on."""

    user_agent: Text = ""
    viewport: tuple[int, int] = (0, 0)
    screen: tuple[int, int] = (0, 0)
    pixel_ratio: Annotated[float, Field(ge=0, le=100)] = 1.0
    refresh_hz: Annotated[float, Field(ge=0, le=10_000)] | None = None
    frame_callback: bool = False
    touch: bool = False
    reduced_motion: bool = False


class Begin(Message):
    """A page was opened: by which link, in which tab, on what display."""

    page: Annotated[str, Field(min_length=SHORTEST_PAGE, max_length=LONGEST_PAGE)]
    previous: Annotated[str, Field(max_length=LONGEST_PAGE)] = ""
    force: bool = False
    parameters: Annotated[dict[Annotated[str, Field(max_length=60)], Text], Field(max_length=20)] = {}
    display: Display = Display()


class Done(Message):
    """A page was read, a consent given (or not), a form filled in."""

    step: Text
    declined: bool = False
    values: Annotated[
        dict[Annotated[str, Field(max_length=80)], Annotated[str, Field(max_length=2000)]], Field(max_length=100)
    ] = {}


class Shown(Message):
    """How one film was presented."""

    slot: Annotated[int, Field(ge=1, le=MOST_SLOTS)]
    method: Annotated[str, Field(max_length=40)]
    frames_presented: Annotated[int, Field(ge=0, lt=LONGEST_FILM_FRAMES)] | None = None
    longest_gap_frames: Annotated[float, Field(ge=0, lt=1e9)] | None = None
    shown_well: bool
    play: Annotated[int, Field(ge=1, le=100)] = 1
    apart_frames: Annotated[float, Field(ge=0, lt=1e6)] | None = None
    times_ms: Annotated[tuple[Milliseconds, ...], Field(max_length=LONGEST_FILM_FRAMES)] = ()
    frames: Annotated[tuple[int, ...], Field(max_length=LONGEST_FILM_FRAMES)] = ()


class Answered(Message):
    """An answer, or that none came in time; with how the films were shown."""

    trial: Annotated[int, Field(ge=1, le=1_000_000)]
    attempt: Annotated[int, Field(ge=1, le=100)]
    item: Annotated[str, Field(max_length=80)] = ""
    value: Annotated[str, Field(max_length=40)] | None = None
    response_s: Annotated[float, Field(ge=0, lt=1e6)] | None = None
    shown_well: bool = True
    shown: Annotated[tuple[Shown, ...], Field(max_length=MOST_SLOTS)] = ()
    timing: Annotated[dict[Annotated[str, Field(max_length=40)], float | str | None], Field(max_length=20)] = {}


class Happened(Message):
    """Another event than a response."""

    kind: Literal["focus-lost", "focus-back", "resized", "fault", "interrupted", "waited", "screen-measured"]
    detail: Annotated[dict[Annotated[str, Field(max_length=40)], float | Text | None], Field(max_length=20)] = {}


class Withdrawal(Message):
    """A withdrawal code."""

    code: Annotated[str, Field(max_length=100)]


_NUL = re.compile(rb"(?<!\\)(?:\\\\)*\\u0000")
"""As JSON writes it; after a backslash that stands for itself it is only text."""


def read(model: type[Message], data: bytes) -> Any:
    """A message of a kind, or a `SessionError` that says what is wrong with it."""
    if b"u0000" in data and _NUL.search(data):
        raise SessionError(f"Expected a message {model.__name__} without NUL characters, which databases don't take.")
    try:
        return model.model_validate_json(data)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "the message"
        raise SessionError(
            f"Expected a message {model.__name__}, found a mistake at {where}: {first['msg']}."
        ) from None


def presented(message: Answered, shown: Shown, stimuli: Sequence[str], frames: Mapping[str, int]) -> Presentation:
    """How a film of an answered trial was presented, as it is stored.

    Parameters
    ----------
    stimuli
        Those of the trial, slot by slot.
    frames
        How many each stimulus has.
    """
    if shown.slot > len(stimuli):
        raise SessionError(f"Expected one of the {len(stimuli)} films of trial {message.trial}, found {shown.slot}.")
    stimulus = stimuli[shown.slot - 1]
    return Presentation(
        trial=message.trial,
        attempt=message.attempt,
        place=PLACES[shown.slot - 1],
        stimulus=stimulus,
        method=shown.method,
        frames_expected=frames.get(stimulus),
        frames_presented=shown.frames_presented,
        longest_gap_frames=shown.longest_gap_frames,
        shown_well=shown.shown_well,
        detail={
            "times_ms": shown.times_ms,
            "frames": shown.frames,
            "play": shown.play,
            "apart_frames": shown.apart_frames,
            **message.timing,
        },
    )
