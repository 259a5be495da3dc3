"""The parts of a protocol that participants meet: consent, form, keys and texts, all of which can be translated.

Pydantic models only; `protocol.Protocol` holds them. What is left out has an English default, so that a protocol in
another language replaces every word that a participant reads.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from study.experiment.protocol_errors import KeyMismatchError

Slug = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*$")]
Key = Annotated[str, Field(pattern=r"^[a-z0-9]$")]


class Part(BaseModel):
    """What all parts of a protocol share: no unknown keys, no silent conversions, nothing changes later."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Consent(Part):
    """What a participant agrees to before anything else; without text nobody is asked."""

    text: str = Field(default="", description="What is asked of participants, what is stored, whom to ask.")
    agree: str = Field(default="I agree and take part", min_length=1, description="Button that agrees.")
    decline: str = Field(default="I do not take part", min_length=1, description="Button that declines.")
    declined: str = Field(
        default="You have not taken part, and nothing about you was stored. You can close this page.",
        description="Read after declining.",
    )


class FormField(Part):
    """One question of the form about the participant."""

    name: Slug = Field(description="What tables call it; unique in the form.")
    label: str = Field(min_length=1, description="What the participant reads.")
    kind: Literal["text", "number", "choice"] = Field(default="text", description="What is filled in.")
    choices: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        default=(), description="What can be chosen; for `choice` only."
    )
    least: float | None = Field(default=None, description="Smallest number that is taken; for `number` only.")
    most: float | None = Field(default=None, description="Largest number that is taken; for `number` only.")
    required: bool = Field(default=False, description="Whether it has to be filled in.")

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

    same: Key = Field(default="s", description="Answers that both are the same.")
    different: Key = Field(default="d", description="Answers that they differ.")
    first: Key = Field(default="1", description="Answers with the first of a pair.")
    second: Key = Field(default="2", description="Answers with the second of a pair.")

    @model_validator(mode="after")
    def _differ(self) -> Self:
        for one, other in (("same", "different"), ("first", "second")):
            if getattr(self, one) == getattr(self, other):
                raise KeyMismatchError(f"expected two keys for {one} and {other}, found one; change it", other)
        return self


class Texts(Part):
    """What participants read besides questions and instructions."""

    welcome: str = Field(default="", description="Read before the first study.")
    break_text: str = Field(default="You can rest now. Go on when you are ready.", description="Read at a break.")
    debrief: str = Field(default="", description="Read at the end.")
    go_on: str = Field(default="Continue", min_length=1, description="Button that goes on.")
    example: str = Field(default="Show an example", min_length=1, description="Button that plays the example.")
    same: str = Field(default="Same", min_length=1, description="The answer `same`.")
    different: str = Field(default="Different", min_length=1, description="The answer `different`.")
    first: str = Field(default="First", min_length=1, description="The answer `first`.")
    second: str = Field(default="Second", min_length=1, description="The answer `second`.")
    practice: str = Field(default="Practice", description="Shown above practice trials.")
    practice_right: str = Field(default="That was right.", description="After a right answer in practice.")
    practice_wrong: str = Field(
        default="That was not right: they were {answer}.",
        description="After a wrong answer in practice; {answer} is the right one.",
    )
    practice_noted: str = Field(
        default="Your answer was noted. There is no right or wrong here.",
        description="After an answer in practice where none is right.",
    )
    missed: str = Field(default="The time to answer was over.", description="After a missed answer.")
    attention_check: str = Field(
        default="This one checks the controls. Please answer: {answer}",
        description="The question of an attention check; {answer} is what to answer.",
    )
    form: str = Field(default="A few questions about you", description="Heading of the form.")
    finished: str = Field(default="That was all. Your answers are stored.", description="Read when all is done.")

    @model_validator(mode="after")
    def _check_has_answer(self) -> Self:
        if "{answer}" not in self.attention_check:
            raise KeyMismatchError("expected {answer} in it, which says what to answer; add it", "attention_check")
        return self
