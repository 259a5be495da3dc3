"""What a protocol holds: its keys, and what follows from them.

Pydantic models of the parts come in; `whole.Protocol` is this with the file's text, checked as a whole by `checks`.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, Literal, TypeVar

from pydantic import Field

from study.errors import ProtocolError
from study.experiment.protocol.methods import OwnMethod
from study.experiment.protocol.stimuli import FailedChecks, Points, Screen, StimulusSettings, Timing, TransitionSpec
from study.experiment.protocol.studies import AnalysisSettings, StudySpec
from study.experiment.protocol.texts import MOST_PARTS, Consent, FormField, Keys, Listed, Part, Slug, Texts
from study.models.tracks import Rule
from study.tasks.registry import kind_of, orders_of, task_of
from study.transitions.methods.method import Method
from study.transitions.methods.registry import METHODS


class Content(Part):
    """A whole session."""

    name: Slug = Field(description="Name of the protocol and of its results folder.")
    title: str = Field(min_length=1, description="Heading for researchers; participants read `texts.title`.")
    source: str = Field(default="", description="Paper and section on which it is based.")
    fps: float = Field(default=30.0, ge=1, le=240, description="Frame rate of every stimulus. [frames per second]")
    seed: int = Field(ge=0, description="Seed of all of the protocol's randomness.")
    participants: int | None = Field(
        default=None, ge=1, le=100_000, description="Planned number of participants, fixed before there is data."
    )
    study_order: Literal["as-listed", "random", "latin-square"] = Field(
        default="as-listed",
        description="Order of the studies in a session; `latin-square` goes by the participant's group, so that each "
        "study stands at each place, and follows each other one, equally often.",
    )
    failed_checks: FailedChecks = Field(
        default=FailedChecks(), description="What failed attention checks lead to while the session runs."
    )
    stimuli: StimulusSettings = Field(default=StimulusSettings(), description="How stimuli are built and drawn.")
    screen: Screen = Field(default=Screen(), description="How large stimuli are shown.")
    timing: Timing = Field(default=Timing(), description="Times of a trial.")
    points: Points = Field(default=Points(), description="How transition points are chosen.")
    language: Annotated[str, Field(pattern=r"^[A-Za-z]{2,3}(-[A-Za-z0-9]{2,8})*$")] = Field(
        default="en",
        description="Language of the built-in words (en, de, fr, ja) and, for screen readers, of all texts.",
    )
    touch: bool = Field(default=True, description="Whether tablets and telephones are admitted.")
    consent: Consent = Field(default=Consent(), description="What participants agree to.")
    form: Listed[FormField] = Field(default=(), description="Questions about the participant, one `[[form]]` each.")
    keys: Keys = Field(default=Keys(), description="Keys that answer.")
    texts: Texts = Field(default=Texts(), description="What participants read.")
    analysis: AnalysisSettings = Field(default=AnalysisSettings(), description="Decisions about the analysis.")
    transitions: Annotated[tuple[TransitionSpec, ...], Field(strict=False, min_length=1, max_length=MOST_PARTS)] = (
        Field(description="The transitions, one `[[transitions]]` each.")
    )
    studies: Annotated[tuple[StudySpec, ...], Field(strict=False, min_length=1, max_length=100)] = Field(
        description="The studies of the session, one `[[studies]]` each, in order."
    )
    methods: Listed[OwnMethod] = Field(default=(), description="Your own methods, one `[[methods]]` each.")

    def study(self, name: str) -> StudySpec:
        """A study by name."""
        return _named(self.studies, (name,), "study")[0]

    def transition(self, name: str) -> TransitionSpec:
        """A transition by name."""
        return _named(self.transitions, (name,), "transition")[0]

    def transitions_of(self, study: StudySpec) -> tuple[TransitionSpec, ...]:
        """The transitions that a study's trials show, in its order: without those for practice alone."""
        if study.transitions:
            return _named(self.transitions, study.transitions, "transition")
        for_practice = {name for other in self.studies for name in other.practice_transitions}
        return tuple(transition for transition in self.transitions if transition.name not in for_practice)

    def trials_of(self, study: StudySpec) -> int:
        """How many trials of a study a participant sees at most, practice and attention checks apart."""
        task, shown = task_of(study), len(self.transitions_of(study))
        if (own := study.procedure.trials(shown, study.repeats)) is not None:
            return own[1]
        orders = len(orders_of(study)) if study.order == "both" else 1
        return shown * len(task.conditions(study, False)) // (study.sets or 1) * study.repeats * orders

    def fewest_trials_of(self, study: StudySpec) -> int:
        """How many trials of a study a participant sees at least."""
        own = study.procedure.trials(len(self.transitions_of(study)), study.repeats)
        return self.trials_of(study) if own is None else own[0]

    @property
    def method_names(self) -> tuple[str, ...]:
        """The methods that studies can name: those built in, and the protocol's own."""
        return (*METHODS, *(own.name for own in self.methods))

    def methods_of(self, study: StudySpec) -> dict[str, Method]:
        """The methods of a study by name, with their settings: the method's own, the study's, those of `[stimuli]`."""
        hop = study.one_hop.model_dump()
        settings = {key: getattr(self.stimuli, key) for key in ("weight", "clean_feet")}
        settings |= {"hop_weight": hop.pop("weight"), **hop, "fixed_frames": study.fixed_frames}
        own = {one.name: one for one in self.methods}
        return {
            name: own[name].method(settings) if name in own else METHODS[name].with_settings(settings)
            for name in study.methods
        }

    @property
    def entry_frames(self) -> int:
        """Frames of the source that are shown before a transition."""
        return round(self.stimuli.entry_s * self.fps)

    @property
    def exit_frames(self) -> int:
        """Frames of the destination that are shown after a transition."""
        return round(self.stimuli.exit_s * self.fps)

    @property
    def tracks(self) -> dict[str, Rule]:
        """The rule of each study whose procedure has tracks, by its name."""
        rules = {study.name: study.procedure.rule_of(study.task) for study in self.studies}
        return {name: rule for name, rule in rules.items() if rule is not None}

    def form_of(self, study: str) -> tuple[FormField, ...]:
        """The form at the start of the session, where the name is empty, or the one after a study."""
        return self.study(study).form if study else self.form

    @property
    def scale_points(self) -> dict[str, int]:
        """Points of the scale of each rating study, by its name."""
        return {study.name: len(task_of(study).legal(study)) for study in self.studies if kind_of(study) != "word"}

    def practice_of(self, study: StudySpec) -> tuple[TransitionSpec, ...]:
        """The transitions that a study's practice alone shows."""
        return _named(self.transitions, study.practice_transitions, "transition")

    def points_for(self, study: StudySpec, transition: TransitionSpec) -> Points:
        """The conditions for one transition in one study: the protocol's, the study's and the transition's own."""
        merged: dict[str, Any] = {"choose": "random"}
        for part in (self.points, study.points, transition.points):
            merged |= part.model_dump(exclude_none=True)
        return Points.model_validate(merged)


Named = TypeVar("Named", StudySpec, TransitionSpec)


def _named(parts: Iterable[Named], names: Iterable[str], kind: str) -> tuple[Named, ...]:
    found = {part.name: part for part in parts}
    for name in names:
        if name not in found:
            raise ProtocolError(f"Expected the name of a {kind}, found {name!r}; there are {', '.join(found)}.")
    return tuple(found[name] for name in names)
