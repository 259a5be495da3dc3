"""What every column of exported data means: its description, type, unit and levels, declared once for all formats."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from study.experiment.protocol.texts import FormField
from study.tasks.registry import NAMES, TASKS
from study.tasks.trial import PLACES


@dataclass(frozen=True)
class Variable:
    """A column: what it means, what kind of value it holds, its unit, and its values where they are few."""

    description: str
    kind: Literal["text", "number", "boolean", "time"] = "text"
    unit: str = ""
    levels: Mapping[str, str] = field(default_factory=dict)

    def entry(self) -> dict[str, Any]:
        """What a data dictionary says of it, in BIDS's words."""
        found = {"Description": self.description, "Units": self.unit, "Levels": dict(self.levels)}
        return {key: value for key, value in found.items() if value}

    def property(self, name: str) -> dict[str, Any]:
        """What a data dictionary says of it, in schema.org's words."""
        found: dict[str, Any] = {"@type": "PropertyValue", "name": name, "description": self.description}
        if self.unit:
            found["unitText"] = self.unit
        if self.levels:
            levels = self.levels.items()
            found["valueReference"] = [
                {"@type": "DefinedTerm", "name": one, "description": text} for one, text in levels
            ]
        return found

    def line(self, name: str) -> str:
        """What `docs/exporting.md` says of it, a row of its table."""
        kind = f"{self.kind}, {self.unit}" if self.unit else self.kind
        levels = "; ".join(f"`{value}`: {meaning}" for value, meaning in self.levels.items())
        return f"| `{name}` | {kind} | {self.description}{f' {levels}.' if levels else ''} |"


ANSWERS: Mapping[str, Variable] = {
    "participant": Variable("Who answered."),
    "simulated": Variable("Whether a simulated observer answered, not a person.", "boolean"),
    "study": Variable("Name of the study in the protocol."),
    "task": Variable(
        "What was decided.",
        levels={name: ", or ".join(task.decides for task in TASKS.values() if task.asked_as == name) for name in NAMES},
    ),
    "trial": Variable("Number of the trial in the participant's plan, from 1.", "number"),
    "attempt": Variable("Which showing of the trial it was, from 1; faulty ones are shown again.", "number"),
    "item": Variable("Which question of a rating; empty for other tasks."),
    "repeat": Variable("Which repetition of the pair, from 1.", "number"),
    "pair": Variable("Name of the pair, or of the transition that was rated by itself."),
    "motion": Variable("Name of the transition in the protocol."),
    "category": Variable("Type of motion."),
    "first": Variable("Stimulus shown first: the SHA-256 of its content."),
    "second": Variable("Stimulus shown second; empty where one was rated by itself."),
    "third": Variable("Stimulus shown third; empty where fewer were shown."),
    "slot": Variable("Parallel rating, a row a film: its place on the page, from 1, row by row.", "number"),
    "difference_frames": Variable("Blend length of the comparison minus that of the reference.", "number", "frames"),
    "reference_first": Variable("Whether the reference was shown first (same-different).", "boolean"),
    "method_a": Variable("Method of the reference, or of what was rated by itself."),
    "method_b": Variable("Method of the comparison; empty where one was rated by itself."),
    "a_first": Variable(
        "Whether the transition of method_a was shown first (preference, rating of a pair).", "boolean"
    ),
    "answer": Variable(
        "The answer: same, different, yes, no, first, second, third, equal, or a point of the scale; "
        "empty where missed."
    ),
    "confidence": Variable("How sure the participant was of the answer, from 0; empty where not asked.", "number"),
    "missed": Variable("Whether the time to answer ended without an answer.", "boolean"),
    "correct": Variable("Whether the answer was right, where one is.", "boolean"),
    "chose_a": Variable("Whether the transition of method_a was favoured (preference); empty for equal.", "boolean"),
    "response_s": Variable(
        "Time from the end of the last stimulus to the answer; to a further question, from when it was asked.",
        "number",
        "s",
    ),
    "shown_well": Variable("Whether the stimuli were shown without a fault.", "boolean"),
    "answered_at": Variable("When the answer was given, with its time zone.", "time"),
    "role": Variable(
        "What the trial was for.",
        levels={
            "trial": "counts in the analysis",
            "practice": "practice, counts for nothing",
            "check": "attention check, asks for a stated answer",
        },
    ),
    "expected": Variable("The answer that an attention check asked for."),
}
"""What the analysis reads."""

BLENDS: Mapping[str, Variable] = {
    f"{place}_blend_{unit}": Variable(f"Blend length of the stimulus shown {place}; 0 for a cut.", "number", unit)
    for place in PLACES[:3]
    for unit in ("frames", "s")
}
"""How long the blends of each answer's stimuli were."""

EXPORTED: Mapping[str, Variable] = {**ANSWERS, **BLENDS}
"""A table of answers for other programs."""

AFTER = Variable("Time since the session began.", "number", "s")

SHARED: Mapping[str, Variable] = {
    {"answered_at": "answered_after_s"}.get(name, name): AFTER if name == "answered_at" else variable
    for name, variable in EXPORTED.items()
}
"""The same for archives, which hold no dates."""

STIMULI: Mapping[str, Variable] = {
    "participant": ANSWERS["participant"],
    "trial": ANSWERS["trial"],
    "item": ANSWERS["item"],
    "attempt": ANSWERS["attempt"],
    "slot": Variable("Which stimulus of the trial, from 1, in the order in which they were shown.", "number"),
    "stimulus": Variable("The stimulus: the SHA-256 of its content."),
    "member": Variable("Which of its pair's stimuli it was: 0 for the reference or method_a, else 1.", "number"),
    "method": Variable("Method by which its transition was made."),
    "blend_frames": Variable("Blend length; 0 for a cut.", "number", "frames"),
    "blend_s": Variable("Blend length; 0 for a cut.", "number", "s"),
}

SIZE_SHOWN: Mapping[str, Variable] = {
    "width_px": Variable("Width of the picture on the screen.", "number", "pixels of the screen"),
    "height_px": Variable("Height of the picture on the screen.", "number", "pixels of the screen"),
    "width_css": Variable("Width of the picture in a browser's page.", "number", "CSS pixels"),
    "height_css": Variable("Height of the picture in a browser's page.", "number", "CSS pixels"),
    "height_degrees": Variable("Height of the picture as it was seen; empty where not known.", "number", "degrees"),
    "screen_height_px": Variable("Height of the whole screen.", "number", "pixels of the screen"),
    "px_per_cm": Variable("Pixels of the screen in a centimetre; empty where not known.", "number", "1/cm"),
    "distance_cm": Variable("Viewing distance, measured or stated; empty where not known.", "number", "cm"),
}
"""How large a presentation was; kept in its details."""


def form_columns(form: Mapping[str, FormField], note: str = "") -> dict[str, Variable]:
    """The columns of a form's questions; `note` says more of all."""
    return {
        f"form_{name}": Variable(
            f"Asked in the form: {field.label}{note}",
            "number" if field.kind == "number" else "text",
            levels={choice: choice for choice in field.choices},
        )
        for name, field in form.items()
    }


PRESENTATIONS: Mapping[str, Variable] = {
    "participant": ANSWERS["participant"],
    "trial": ANSWERS["trial"],
    "attempt": ANSWERS["attempt"],
    "place": Variable("Which stimulus of the trial: first, second, ..., in the order of the slots."),
    "stimulus": Variable("The stimulus: the SHA-256 of its content."),
    "method": Variable("What timed its frames: a browser's requestVideoFrameCallback, a window's swap, or a fallback."),
    "frames_expected": Variable("Frames of the stimulus.", "number", "frames"),
    "frames_presented": Variable("Frames that were seen to be presented.", "number", "frames"),
    "longest_gap_frames": Variable("Longest time between two frames; 1 is perfect.", "number", "frames"),
    "play": Variable("Films shown at once: which playing of them, from 1.", "number"),
    "apart_frames": Variable("How far it ran behind the first of the films shown at once.", "number", "frames"),
    "shown_well": Variable("Whether no gap was too long and no frame was missing.", "boolean"),
    **SIZE_SHOWN,
    "after_s": AFTER,
}

PARTICIPANTS: Mapping[str, Variable] = {
    "participant": ANSWERS["participant"],
    "simulated": ANSWERS["simulated"],
    "segue_version": Variable("Version of Segue that ran the session."),
    "library": Variable("Library of motions that was shown."),
    "library_synthetic": Variable("Whether its motions are synthetic, not captured.", "boolean"),
}

SHOWN_TO: Mapping[str, Variable] = {
    f"shown_{name}": replace(SIZE_SHOWN[name], description=f"Median over presentations. {SIZE_SHOWN[name].description}")
    for name in ("height_px", "height_degrees")
}
"""What the table of participants says of the size of the pictures that each of them saw."""
