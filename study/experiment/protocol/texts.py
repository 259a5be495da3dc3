"""The parts of a protocol that participants meet: consent, form, keys and texts, all of which can be translated.

Pydantic models only; `protocol.Protocol` holds them. What is left out has the words of the protocol's language
(`languages`), or else the English ones here; a protocol can replace every word that a participant reads.
"""

from __future__ import annotations

import re
from difflib import get_close_matches
from typing import Annotated, Literal, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, model_validator

from study.experiment.protocol.errors import KeyMismatchError

LONGEST_NAME = 100
"""Letters of a name, which also names files."""

Slug = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*$", max_length=LONGEST_NAME)]
Key = Annotated[str, Field(pattern=r"^[a-z0-9]$")]

LONGEST_TEXT = 20_000
"""Letters of one text."""
MOST_PARTS = 1000
"""How long a list may be: of transitions, of a study's names and levels, of questions and choices."""

Each = TypeVar("Each")
Listed = Annotated[tuple[Each, ...], Field(strict=False, max_length=MOST_PARTS)]
"""A list in brackets, or of tables."""


class Part(BaseModel):
    """What all parts of a protocol share: no unknown keys or silent conversions, no infinity, no endless text, and
    nothing changes later.
    """

    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, allow_inf_nan=False, str_max_length=LONGEST_TEXT
    )


SLOTS = ("standard", "minutes", "trials", "studies", "answer_s", "contact")
"""What may be written in braces in the longer texts: the built-in text, minutes and trials of the session, its studies,
seconds to answer, and the protocol's contact. `{minutes:minute|minutes}` are the words that go with one or several."""


def known_slots(text: str, *location: int | str) -> None:
    """Refuse words in braces that mean nothing, and say which do."""
    strange = next((slot for slot in re.findall(r"\{(\w*)(?::[^{}|]*\|[^{}|]*)?\}", text) if slot not in SLOTS), None)
    if strange is not None:
        near = get_close_matches(strange, SLOTS, n=1)
        hint = f"did you mean {{{near[0]}}}?" if near else "leave the braces out"
        known = ", ".join(f"{{{slot}}}" for slot in SLOTS)
        raise KeyMismatchError(f"expected {known} in braces, found {{{strange}}}; {hint}", *location)


class Consent(Part):
    """What a participant agrees to before anything else; without a text there is no consent page."""

    text: str = Field(
        default="",
        description="What is asked of participants, what is stored, whom to ask; `{standard}` is the built-in text.",
    )
    contact: str = Field(
        default="", description="Who runs the study, where, contact details, who approved it; `{contact}` in texts."
    )
    agree: str = Field(default="I agree and take part", min_length=1, description="Button that agrees.")
    decline: str = Field(default="I do not take part", min_length=1, description="Button that declines.")
    declined: str = Field(
        default="You have not taken part, and nothing about you was stored. You can close this page.",
        description="Read after declining.",
    )

    @model_validator(mode="after")
    def _slots(self) -> Self:
        known_slots(self.text, "text")
        return self


class FormField(Part):
    """One question of the form about the participant."""

    name: Slug = Field(description="Name in tables; unique in the form.")
    label: str = Field(
        min_length=1, description="What the participant reads; age, gender, vision and animation have a built-in one."
    )
    kind: Literal["text", "number", "choice", "free-text"] = Field(
        default="text", description="Type of answer; `free-text` is a text of several lines."
    )
    choices: Listed[str] = Field(default=(), description="The choices; for `choice` only.")
    least: float | None = Field(default=None, description="Smallest valid number; for `number` only.")
    most: float | None = Field(default=None, description="Largest valid number; for `number` only.")
    required: bool = Field(default=False, description="Whether an answer is required.")

    @model_validator(mode="after")
    def _fits_kind(self) -> Self:
        if (self.kind == "choice") != bool(self.choices):
            raise KeyMismatchError(
                f"expected choices for a field of kind 'choice', and for no other; found {len(self.choices)} in "
                f"{self.name!r}, a {self.kind}; add or remove them"
            )
        if self.kind != "number" and (self.least is not None or self.most is not None):
            raise KeyMismatchError(f"expected least and most for numbers only; remove them from {self.name!r}")
        return self


class Keys(Part):
    """Keys that answer; on-screen buttons do the same. Ratings are answered with the digits."""

    same: Key = Field(default="s", description="Key for the answer `same`.")
    different: Key = Field(default="d", description="Key for the answer `different`.")
    first: Key = Field(default="1", description="Key for the answer `first`.")
    second: Key = Field(default="2", description="Key for the answer `second`.")
    third: Key = Field(default="3", description="Answers with the third of three.")
    yes: Key = Field(default="y", description="Key for the answer `yes`.")
    no: Key = Field(default="n", description="Key for the answer `no`.")
    equal: Key = Field(default="0", description="Key for the answer `equal`.")

    @model_validator(mode="after")
    def _differ(self) -> Self:
        for one, other in (
            ("same", "different"),
            ("yes", "no"),
            ("first", "second"),
            ("first", "third"),
            ("second", "third"),
            ("equal", "first"),
            ("equal", "second"),
        ):
            if getattr(self, one) == getattr(self, other):
                raise KeyMismatchError(f"expected two keys for {one} and {other}, found one; change it", other)
        return self


class Texts(Part):
    """What participants read besides questions and instructions."""

    title: str = Field(
        default="How do you see movement?",
        min_length=1,
        description="Title on the participants' pages, in place of the protocol's title, which may reveal too much.",
    )
    welcome: str = Field(default="", description="Read before the first study; `{standard}` is the built-in text.")
    break_text: str = Field(default="You can rest now. Go on when you are ready.", description="Read at a break.")
    debrief: str = Field(default="", description="Read at the end; `{standard}` is the built-in text.")
    go_on: str = Field(default="Continue", min_length=1, description="Button that goes on.")
    example: str = Field(default="Show an example", min_length=1, description="Button that plays the example.")
    same: str = Field(default="Same", min_length=1, description="The answer `same`.")
    different: str = Field(default="Different", min_length=1, description="The answer `different`.")
    first: str = Field(default="First", min_length=1, description="The answer `first`.")
    second: str = Field(default="Second", min_length=1, description="The answer `second`.")
    third: str = Field(default="Third", min_length=1, description="The answer `third`.")
    yes: str = Field(default="Yes", min_length=1, description="The answer `yes`.")
    no: str = Field(default="No", min_length=1, description="The answer `no`.")
    left: str = Field(default="Left", min_length=1, description="The answer `first` where films are side by side.")
    right: str = Field(default="Right", min_length=1, description="The answer `second` there.")
    play_again: str = Field(default="Play again", min_length=1, description="Button that plays films again.")
    equal: str = Field(default="No difference", min_length=1, description="The answer `equal`.")
    how_sure: str = Field(default="How sure are you of this answer?", min_length=1, description="Asked after a choice.")
    least_sure: str = Field(default="guessed", description="Words at the lowest point of that scale.")
    most_sure: str = Field(default="certain", description="Words at its highest point.")
    practice: str = Field(default="Practice", description="Shown above practice trials.")
    practice_right: str = Field(default="That was right.", description="After a right answer in practice.")
    practice_wrong: str = Field(
        default="That was not right: the answer is “{answer}”.",
        description="After a wrong answer in practice; {answer} is the right one.",
    )
    practice_noted: str = Field(
        default="Your answer was noted. There is no right or wrong here.",
        description="After an answer in practice, for tasks without a right answer.",
    )
    practice_over: str = Field(
        default="That was the practice. From now on your answers count.",
        description="Read between practice and study; not shown if empty.",
    )
    practice_again: str = Field(
        default="Let us practise once more.",
        min_length=1,
        description="Read before practice that comes again (`practice_until`).",
    )
    missed: str = Field(default="The time to answer was over.", description="After a trial without a response.")
    attention_check: str = Field(
        default="This one checks the controls. Please answer: {answer}",
        description="The question of an attention check; {answer} is the answer to give.",
    )
    checks_failed: str = Field(
        default="The questions that check the controls were not answered as asked, so the study ends here. Thank you.",
        min_length=1,
        description="When a session ends early because of failed attention checks.",
    )
    form: str = Field(default="A few questions about you", description="Heading of the form.")
    study_form: str = Field(default="About this part", description="Heading of the questions after a study.")
    skip: str = Field(default="Skip", min_length=1, description="Button that leaves a question of the form empty.")
    previous: str = Field(default="Back", min_length=1, description="Button that leads to the previous question.")
    not_taken: str = Field(default="Please check this.", description="After an invalid answer in the form.")
    space_key: str = Field(default="Space", description="Name of the space bar, on buttons of the window.")
    enter_key: str = Field(default="Enter", description="Name of the Enter key, on buttons of the window.")
    stop_question: str = Field(default="Do you want to stop?", description="Before the window closes.")
    stop_note: str = Field(
        default="Your answers so far are stored. You can go on later where you stopped.",
        description="Read with that question.",
    )
    stop: str = Field(default="Stop", min_length=1, description="Button that stops and closes the window.")
    stay: str = Field(default="Go on", min_length=1, description="Button that stays.")
    away: str = Field(
        default="The window was left. Click here, then go on when you are ready.",
        description="Read when the window has lost the focus before a trial.",
    )
    close: str = Field(default="Close", min_length=1, description="Button that closes the window at the end.")
    finished: str = Field(default="That was all. Your answers are stored.", description="Read when all is done.")

    progress: str = Field(default="{done} of {total} done", description="How far the participant is.")
    press: str = Field(default="key {key}", description="Beside an answer's button; {key} is its key.")
    wait: str = Field(default="One moment, please.", description="While films are loaded.")
    waiting: str = Field(
        default="The connection is interrupted. Your answer is kept and will be sent; please leave this page open.",
        description="While the server can't be reached.",
    )
    film_fault: str = Field(
        default="A film could not be shown. Nothing of what you did is lost.", description="When a film can't be shown."
    )
    try_again: str = Field(default="Try again", min_length=1, description="Button that loads a film again.")
    pass_over: str = Field(default="Go on without it", min_length=1, description="Button that skips such a trial.")
    elsewhere: str = Field(
        default="This study is open in another tab or window. Please go on there.",
        description="In a second tab of one participant.",
    )
    take_over: str = Field(default="Go on here instead", min_length=1, description="Button of a second tab.")
    full: str = Field(
        default="Thank you for your interest. This study has all the participants that it needs.",
        description="When no more participants are taken.",
    )
    taken: str = Field(
        default="This link was used already. Please go on in the browser in which you began.",
        description="When another browser opens a participant's link.",
    )
    no_touch: str = Field(
        default="Please take part on a computer with a keyboard.", description="On tablets where they are not allowed."
    )
    no_script: str = Field(
        default="This study needs JavaScript. Please switch it on and open the link again.",
        description="When the browser runs no JavaScript.",
    )
    no_film: str = Field(
        default="This browser can't play the films. Please use a current Chrome, Edge, Firefox or Safari.",
        description="When the browser can't play the stimuli at all.",
    )
    reduced_motion: str = Field(
        default="Your device asks for little motion. This study shows short films of a moving figure, and can't do "
        "without.",
        description="When a participant's device asks for reduced motion.",
    )
    card: str = Field(
        default="Hold a bank card against the screen and move the slider until the frame is as large as the card.",
        description="Above the frame with which the size of the screen is measured.",
    )
    distance_keep: str = Field(
        default="Please sit so that your eyes are {cm} cm from the screen, and keep this distance.",
        description="Below that frame, where the protocol states the viewing distance; {cm} is the distance.",
    )
    distance_ask: str = Field(
        default="How far are your eyes from the screen, in centimetres?",
        description="Where browsers ask for the viewing distance.",
    )
    blind_spot: str = Field(
        default="Now we measure how far you sit from the screen. Close your right eye and look only at the square, "
        "with your left eye. A red dot moves away from it. Press the space bar as soon as the dot disappears; it will "
        "come five times.",
        description="Before the viewing distance is found by the blind spot.",
    )
    withdrawal: str = Field(
        default="With this code you can have your answers deleted at any time:",
        description="Above the code, at the end.",
    )
    withdraw: str = Field(default="Delete my answers", min_length=1, description="Button of the withdrawal page.")
    withdraw_code: str = Field(default="Your code", description="Label of the code on the withdrawal page.")
    withdrawn: str = Field(default="Your answers were deleted.", description="After withdrawing.")
    no_code: str = Field(
        default="There is no such code. Please check it; there may be nothing left to delete.",
        description="For a wrong code on the withdrawal page.",
    )
    slow_down: str = Field(
        default="Those were many tries. Please wait a minute, then try again.",
        description="On the withdrawal page, after many wrong codes.",
    )
    wrong_address: str = Field(
        default="There is no study at this address. Please open the link that you were given.",
        description="When a page is requested under another name than the server's (`--public-url`).",
    )
    completion: str = Field(default="Your completion code:", description="Above the completion code.")
    back: str = Field(default="Finish", min_length=1, description="Button that leads back to the recruiting site.")

    @model_validator(mode="after")
    def _slots(self) -> Self:
        for key in ("welcome", "debrief"):
            known_slots(getattr(self, key), key)
        for key, needed in _NEEDED_SLOTS.items():
            found = set(re.findall(r"\{(\w*)\}", getattr(self, key)))
            for slot in needed.keys() - found:
                raise KeyMismatchError(f"expected {{{slot}}} in it, {needed[slot]}; add it", key)
            for slot in found - needed.keys():
                known = ", ".join(f"{{{each}}}" for each in sorted(needed))
                raise KeyMismatchError(f"expected {known} in braces, found {{{slot}}}; change or remove it", key)
        return self


_NEEDED_SLOTS = {
    "attention_check": {"answer": "which says what to answer"},
    "practice_wrong": {"answer": "which says what to answer"},
    "progress": {"done": "the number of trials done", "total": "the number of all trials"},
    "press": {"key": "which key it is"},
    "distance_keep": {"cm": "the viewing distance"},
}
"""What a text has to have in braces, and what that is."""
