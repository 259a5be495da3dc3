"""Protocol: a study as one TOML file, checked key by key.

A TOML file comes in; a frozen `Protocol` goes out, with the exact text and its SHA-256, so that every record can
say under which protocol it was made. A protocol names motions, never files: a library supplies them. The keys
cover the four studies of 2004 (section 4, one sitting) and the rating study of 2003 (section 4.2).

What a key means stands in its `description`; `docs/protocols.md` is written from these (`protocol_keys`).
"""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import Field, PrivateAttr, ValidationError, model_validator

from study.errors import ProtocolError
from study.experiment.languages import with_words
from study.experiment.protocol_errors import KeyMismatchError, explain, full_location, line_of
from study.experiment.protocol_parts import Consent, FormField, Keys, Slug, Texts, known_slots
from study.experiment.protocol_parts import Part as _Part

Method = Literal[
    "fixed", "geodesic", "velocity", "timewarp", "cut", "cut-lee2002", "cut-wang2003", "cut-pointcloud", "one-hop"
]
Task = Literal["same-different", "preference", "rating"]
Order = Literal["both", "random", "balanced", "by-group"]

OPTIMUM_CUTS = {"cut-lee2002": "lee2002", "cut-wang2003": "wang2003", "cut-pointcloud": "pointcloud"}
"""Methods that cut where a metric is least over both motions, and the metric of each (2003 section 4.2)."""

Colour = Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$")]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]


class Colours(_Part):
    """Colours of the picture; a key that is left out keeps the renderer's own."""

    background: Colour | None = Field(default=None, description="Behind the figure, as #rrggbb.")
    left: Colour | None = Field(default=None, description="Left limbs, as #rrggbb.")
    right: Colour | None = Field(default=None, description="Right limbs, as #rrggbb.")
    centre: Colour | None = Field(default=None, description="Head and trunk, as #rrggbb.")


class StimulusSettings(_Part):
    """How every stimulus of the protocol is built and drawn."""

    width: int = Field(default=640, ge=64, le=3840, multiple_of=2, description="Width of the video; even. [pixels]")
    height: int = Field(default=480, ge=64, le=2160, multiple_of=2, description="Height of the video; even. [pixels]")
    view: Literal["clearest", "front", "side", "three-quarter"] = Field(
        default="clearest",
        description="From where the fixed camera looks at the group's common heading; `clearest` is the view in which "
        "the group's figures are large and their limbs move most in the picture.",
    )
    track_s: float | None = Field(
        default=None,
        gt=0,
        le=60,
        description="Let the camera travel with the figure, smoothed over so long, instead of staying fixed. [seconds]",
    )
    style: Literal["stick", "points", "mannequin"] = Field(default="stick", description="How the figure is drawn.")
    floor: bool = Field(
        default=False, description="Whether a ground plane with contact shadows is drawn (2004 section 4.1: none)."
    )
    camera_group: Literal["transition", "category", "study"] = Field(
        default="transition",
        description="Which stimuli share one camera (2004: groups of motions share a camera position).",
    )
    entry_s: float = Field(
        default=2.0, ge=0, le=60, description="Source motion shown before the blend starts. [seconds]"
    )
    exit_s: float = Field(default=2.0, ge=0, le=60, description="Destination motion shown after the blend. [seconds]")
    weight: Literal["linear", "sigmoid"] = Field(default="linear", description="How the blend weight runs from 0 to 1.")
    specification: Literal["start-end"] = Field(
        default="start-end",
        description="What transition points mean: the first and last blended frame (2004 section 3).",
    )
    clean_feet: bool = Field(default=True, description="Whether sliding of planted feet is removed after blending.")
    colours: Colours = Field(default=Colours(), description="Colours of the picture.")


class Timing(_Part):
    """What a participant's time is spent on."""

    gap_s: float = Field(default=1.0, ge=0, le=60, description="Blank between the two stimuli of a pair. [seconds]")
    answer_s: float = Field(
        default=5.0, gt=0, le=600, description="Time to answer; after it the answer is missed. [seconds]"
    )
    pause_s: float = Field(default=1.0, ge=0, le=60, description="Enforced pause after each answer. [seconds]")
    break_after: int = Field(default=0, ge=0, description="A break after so many trials; 0 for none. [trials]")


class Points(_Part):
    """How transition points are chosen: given, or drawn at random from the protocol's seed under conditions.

    Every key may stand in `[points]`, in a study's `points` and in a transition's `points`; the nearer one wins.
    """

    choose: Literal["random", "given"] | None = Field(
        default=None, description="`random` draws from the seed (2004 section 4.3); `given` takes the four keys below."
    )
    source_s: float | None = Field(
        default=None, ge=0, description="Start of the blend in the source, if given. [seconds]"
    )
    destination_s: float | None = Field(
        default=None, ge=0, description="End of the blend in the destination. [seconds]"
    )
    source_frame: int | None = Field(
        default=None, ge=0, description="The same as a frame at the protocol's fps. [frames]"
    )
    destination_frame: int | None = Field(default=None, ge=0, description="The same as a frame. [frames]")
    shortest_frames: int | None = Field(
        default=None, ge=1, le=600, description="Shortest optimal blend to accept. [frames]"
    )
    longest_frames: int | None = Field(
        default=None, ge=1, le=600, description="Longest optimal blend to accept. [frames]"
    )
    avoid_frames: int | None = Field(default=None, ge=1, description="A blend length to stay away from. [frames]")
    avoid_within_frames: int | None = Field(
        default=None, ge=0, description="No optimal blend this near to `avoid_frames` is accepted. [frames]"
    )
    least_warp_frames: int | None = Field(
        default=None,
        ge=0,
        description="A time-warped blend is accepted if its two windows differ by so much at least. [frames]",
    )
    source_within: Annotated[tuple[Fraction, Fraction], Field(strict=False)] | None = Field(
        default=None, description="Part of the source clip in which its point is drawn, as two fractions of its length."
    )
    destination_within: Annotated[tuple[Fraction, Fraction], Field(strict=False)] | None = Field(
        default=None,
        description="The same for the destination; [0.0, 0.4] of a turning motion leaves the turn to be seen.",
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


class TransitionSpec(_Part):
    """One transition: from a motion of the library to another."""

    name: Slug = Field(description="What studies, plans and reports call it; unique.")
    category: str = Field(min_length=1, description="Type of motion, such as walking; answers are grouped by it.")
    source: str = Field(min_length=1, description="Motion of the library that it starts from.")
    destination: str = Field(min_length=1, description="Motion of the library that it leads to.")
    points: Points = Field(default=Points(), description="Conditions for this transition alone.")


class Item(_Part):
    """One question of a rating study, answered on a scale."""

    name: Slug = Field(description="What the answers call it; unique in its study.")
    question: str = Field(min_length=1, description="What the participant reads.")
    low: str = Field(default="", description="Words at the lowest point of the scale.")
    high: str = Field(default="", description="Words at the highest point of the scale.")


class OneHop(_Part):
    """How the method `one-hop` finds its hops (Koyama and Goto 2019)."""

    hops: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        default=(), description="Motions that may be hops; those of the study's transitions where it is left out."
    )
    stay_s: float = Field(
        default=1.0, ge=0, le=10, description="Longest stay in the source and in the hop; 0 for none. [seconds]"
    )
    weight: float | None = Field(
        default=None, ge=0, le=0.01, description="Cost of a frame of stay, square metres; that of Eq. 5 if left out."
    )
    weight_times: float = Field(default=1.0, ge=0, le=100, description="What the weight is multiplied by (Figure 11).")
    conditions: int = Field(default=100, ge=1, le=10000, description="Transitions drawn for the weight of Eq. 5.")


class StudySpec(_Part):
    """One study of the sitting: a task over transitions."""

    name: Slug = Field(description="What plans, answers and reports call it; unique.")
    title: str = Field(default="", description="Heading for reports; the name where it is left out.")
    task: Task = Field(description="What the participant decides.")
    transitions: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        default=(), description="Names of the transitions shown; all of them where it is left out."
    )
    reference: Method = Field(
        default="geodesic",
        description="Method behind the reference (same-different), method a (preference), or what is rated.",
    )
    comparison: Method | None = Field(
        default=None, description="Method b of a preference study; a second one to rate in a rating study."
    )
    differences_frames: Annotated[tuple[int, ...], Field(strict=False)] = Field(
        default=(),
        description="Same-different: comparison minus reference blend length, a pair each; 0 shows one twice. [frames]",
    )
    fixed_frames: int = Field(
        default=10,
        ge=1,
        le=600,
        description="Blend length of the method `fixed`, and of both blends of `one-hop`. [frames]",
    )
    one_hop: OneHop = Field(default=OneHop(), description="How the method `one-hop` finds its hops.")
    order: Order = Field(
        default="random",
        description="Order within pairs: `both` shows each pair in both, `random` draws, `balanced` draws half each "
        "way, `by-group` rotates by the participant's group (2003).",
    )
    repeats: int = Field(default=1, ge=1, le=1000, description="How often the whole set is shown.")
    question: str = Field(
        default="{standard}", description="What the participant is asked after each pair or stimulus."
    )
    instructions: str = Field(
        default="", description="What the participant reads before the study; `{standard}` is the built-in text."
    )
    example: bool = Field(default=True, description="Whether the instructions can show one stimulus as an example.")
    practice: int = Field(
        default=0, ge=0, le=100, description="Trials with feedback before the study; they count for nothing. [trials]"
    )
    practice_transitions: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        default=(),
        description="Transitions for practice and the example alone, so that neither shows what the study shows; the "
        "study's own where it is left out.",
    )
    attention_checks: int = Field(
        default=0, ge=0, le=100, description="Trials that ask for a stated answer, at random places. [trials]"
    )
    scale_points: int = Field(default=5, ge=2, le=11, description="Points of the rating scale, counted from 0.")
    items: Annotated[tuple[Item, ...], Field(strict=False)] = Field(
        default=(), description="Questions of a rating study."
    )
    points: Points = Field(default=Points(), description="Conditions for this study's transition points.")

    @model_validator(mode="after")
    def _fits_task(self) -> Self:
        _check_task(self)
        for key in ("question", "instructions"):
            known_slots(getattr(self, key), key)
        return self

    @property
    def methods(self) -> tuple[Method, ...]:
        """The methods whose blend lengths this study shows."""
        return (self.reference,) if self.comparison is None else (self.reference, self.comparison)

    def levels_of(self, transition: str) -> tuple[int, ...]:
        """The differences that are shown of a transition: all in trials, the plainest where it is for practice alone."""
        levels = self.differences_frames
        if transition not in self.practice_transitions:
            return levels
        return tuple(level for level in levels if level in (0, min(levels), max(levels)))


class Exclusions(_Part):
    """What the analysis leaves out, stated before there is data; nothing where nothing is stated."""

    fastest_s: float | None = Field(
        default=None, gt=0, le=10, description="Leave out answers sooner than this. [seconds]"
    )
    badly_shown: bool = Field(
        default=False, description="Leave out answers after a stimulus that stalled or was hidden."
    )
    most_missed: float | None = Field(
        default=None, ge=0, lt=1, description="Leave out participants who missed a larger share of their trials."
    )
    most_failed_checks: float | None = Field(
        default=None, ge=0, lt=1, description="Leave out participants who failed more of the attention checks."
    )
    most_too_fast: float | None = Field(
        default=None,
        ge=0,
        lt=1,
        description="Leave out participants with a larger share of answers sooner than `fastest_s`, or 0.2 s.",
    )


class AnalysisSettings(_Part):
    """What was decided about the analysis before there was data."""

    threshold: float = Field(
        default=0.75, gt=0, lt=1, description="Proportion that defines the just noticeable difference."
    )
    alpha: float = Field(default=0.01, gt=0, lt=1, description="Level of significance (2004 section 5.2).")
    equivalence_points: float = Field(
        default=10.0,
        gt=0,
        lt=50,
        description="How far from an even split a preference may lie and count as none; 10 is 40 to 60%. [points]",
    )
    confirmatory: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        default=(),
        description="Studies whose tests are adjusted together (Holm) and decide; those with a preference where it is "
        "left out. Tests of the others explore.",
    )
    exclusions: Exclusions = Field(default=Exclusions(), description="Who and what is left out.")


class Protocol(_Part):
    """A whole sitting."""

    name: Slug = Field(description="Name of the protocol and of its results folder.")
    title: str = Field(min_length=1, description="Heading for people.")
    source: str = Field(default="", description="Paper and section that it follows.")
    fps: float = Field(default=30.0, ge=1, le=240, description="Frame rate of every stimulus. [frames per second]")
    seed: int = Field(ge=0, description="Where all of the protocol's randomness comes from.")
    participants: int | None = Field(
        default=None, ge=1, le=100_000, description="How many people are to take part, fixed before there is data."
    )
    study_order: Literal["as-listed", "random"] = Field(
        default="as-listed", description="Order of the studies in a sitting."
    )
    stimuli: StimulusSettings = Field(default=StimulusSettings(), description="How stimuli are built and drawn.")
    timing: Timing = Field(default=Timing(), description="Times of a trial.")
    points: Points = Field(default=Points(), description="How transition points are chosen.")
    language: Annotated[str, Field(pattern=r"^[A-Za-z]{2,3}(-[A-Za-z0-9]{2,8})*$")] = Field(
        default="en",
        description="Language of the built-in words (en, de, fr, ja) and, for screen readers, of all texts.",
    )
    touch: bool = Field(default=True, description="Whether tablets and telephones may take part.")
    consent: Consent = Field(default=Consent(), description="What participants agree to.")
    form: Annotated[tuple[FormField, ...], Field(strict=False)] = Field(
        default=(), description="Questions about the participant, one `[[form]]` each."
    )
    keys: Keys = Field(default=Keys(), description="Keys that answer.")
    texts: Texts = Field(default=Texts(), description="What participants read.")
    analysis: AnalysisSettings = Field(default=AnalysisSettings(), description="Decisions about the analysis.")
    transitions: Annotated[tuple[TransitionSpec, ...], Field(strict=False, min_length=1)] = Field(
        description="The transitions, one `[[transitions]]` each."
    )
    studies: Annotated[tuple[StudySpec, ...], Field(strict=False, min_length=1)] = Field(
        description="The studies of the sitting, one `[[studies]]` each, in order."
    )

    _text: str = PrivateAttr(default="")
    _path: Path | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        _check_names(self)
        for study in self.studies:
            for transition in (*self.transitions_of(study), *self.practice_of(study)):
                _check_points(self, study, transition)
        _check_analysis(self)
        return self

    @property
    def text(self) -> str:
        """The file's exact text."""
        return self._text

    @property
    def sha256(self) -> str:
        """SHA-256 of the text in UTF-8, hexadecimal."""
        return hashlib.sha256(self._text.encode()).hexdigest()

    @property
    def path(self) -> Path | None:
        """The file, where there is one."""
        return self._path

    def study(self, name: str) -> StudySpec:
        """A study by name."""
        return _named(self.studies, name, "study")

    def transition(self, name: str) -> TransitionSpec:
        """A transition by name."""
        return _named(self.transitions, name, "transition")

    def transitions_of(self, study: StudySpec) -> tuple[TransitionSpec, ...]:
        """The transitions that a study's trials show, in its order: without those for practice alone."""
        if study.transitions:
            return tuple(self.transition(name) for name in study.transitions)
        for_practice = {name for other in self.studies for name in other.practice_transitions}
        return tuple(transition for transition in self.transitions if transition.name not in for_practice)

    def trials_of(self, study: StudySpec) -> int:
        """How many trials of a study a participant sees, practice and attention checks apart."""
        shown = len(self.transitions_of(study))
        if study.task == "same-different":
            shown *= len(study.differences_frames)
        if study.task == "rating":
            return shown * len(study.methods) * study.repeats
        return shown * study.repeats * (2 if study.order == "both" else 1)

    def practice_of(self, study: StudySpec) -> tuple[TransitionSpec, ...]:
        """The transitions that a study's practice alone shows."""
        return tuple(self.transition(name) for name in study.practice_transitions)

    def points_for(self, study: StudySpec, transition: TransitionSpec) -> Points:
        """The conditions for one transition in one study: the protocol's, the study's and the transition's own."""
        merged: dict[str, Any] = {"choose": "random"}
        for part in (self.points, study.points, transition.points):
            merged |= part.model_dump(exclude_none=True)
        return Points.model_validate(merged)


Named = TypeVar("Named", StudySpec, TransitionSpec)


def _named(parts: Iterable[Named], name: str, kind: str) -> Named:
    found = {part.name: part for part in parts}
    if name not in found:
        raise ProtocolError(f"Expected the name of a {kind}, found {name!r}; there are {', '.join(found)}.")
    return found[name]


def _check_task(study: StudySpec) -> None:
    """Refuse what doesn't fit between the task and the other keys of a study."""
    who = f"the {study.task} study {study.name!r}"
    if study.task == "same-different":
        if not study.differences_frames:
            raise KeyMismatchError(f"expected differences_frames in {who}, found none; write for example [-5, 0, 5]")
        _check_once(study.differences_frames, "difference", "differences_frames")
        if study.comparison is not None:
            raise KeyMismatchError(
                f"expected no comparison in {who}: differences_frames says it; remove it", "comparison"
            )
        if study.reference.startswith("cut") or study.reference in ("one-hop", "timewarp"):
            raise KeyMismatchError(
                f"expected a reference with one blend length in {who}, found {study.reference!r}; change it",
                "reference",
            )
    elif study.differences_frames:
        raise KeyMismatchError(
            f"expected this key in same-different studies only; remove it from {who}", "differences_frames"
        )
    if len({method in OPTIMUM_CUTS for method in study.methods}) > 1:
        raise KeyMismatchError(
            f"expected in {who} either cuts where a metric is least or methods at common points, found "
            f"{study.reference!r} and {study.comparison!r}; change one",
            "comparison",
        )
    if study.task == "preference" and study.comparison in (None, study.reference):
        raise KeyMismatchError(f"expected a comparison other than {study.reference!r} in {who}; name one", "comparison")
    if study.task == "rating":
        if not study.items:
            raise KeyMismatchError(f"expected at least one [[studies.items]] in {who}, found none; add one")
        _check_once([item.name for item in study.items], "item's name", "items")
        if study.order in ("both", "balanced"):
            raise KeyMismatchError(
                f"expected 'random' or 'by-group' in {who}, where stimuli are shown singly, found {study.order!r}; "
                "change it",
                "order",
            )
    elif study.items:
        raise KeyMismatchError(f"expected items in rating studies only; remove them from {who}", "items")


def _check_once(values: Sequence[object], what: str, *location: int | str) -> None:
    """Refuse what stands twice in a list."""
    for index, value in enumerate(values):
        if value in values[:index]:
            raise KeyMismatchError(f"expected each {what} once, found {value!r} twice; change or remove one", *location)


def _check_names(protocol: Protocol) -> None:
    """Refuse names that stand twice, and studies that name transitions that there are not."""
    for kind in ("transitions", "studies", "form"):
        names = [part.name for part in getattr(protocol, kind)]
        for index, name in enumerate(names):
            if name in names[:index]:
                message = f"expected each name in {kind} once, found {name!r} twice; rename one"
                raise KeyMismatchError(message, kind, index, "name")
    known = [transition.name for transition in protocol.transitions]
    for index, study in enumerate(protocol.studies):
        for key in ("transitions", "practice_transitions"):
            names = getattr(study, key)
            _check_known(names, known, "transitions", "studies", index, key)
            _check_once(names, "transition", "studies", index, key)
        _check_practice(protocol, study, index)
        _check_lengths(protocol, study, index)


def _check_known(names: Sequence[str], known: Sequence[str], what: str, *location: int | str) -> None:
    """Refuse names of what there is not, with the nearest one."""
    for name in names:
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(known)}"
            raise KeyMismatchError(f"expected names of {what}, found {name!r}; {hint}", *location)


def _check_analysis(protocol: Protocol) -> None:
    """Refuse decisions about the analysis that the studies can't carry out."""
    preferences = [study.name for study in protocol.studies if study.task == "preference"]
    names = protocol.analysis.confirmatory
    _check_known(names, preferences, "preference studies", "analysis", "confirmatory")
    _check_once(names, "study", "analysis", "confirmatory")
    rules, where = protocol.analysis.exclusions, ("analysis", "exclusions")
    if rules.most_failed_checks is not None and not any(study.attention_checks for study in protocol.studies):
        raise KeyMismatchError(
            "expected attention_checks in a study with this rule, found none; add some, or remove the rule",
            *where,
            "most_failed_checks",
        )
    timed = any(study.task != "rating" for study in protocol.studies)
    if timed and rules.fastest_s is not None and rules.fastest_s >= protocol.timing.answer_s:
        raise KeyMismatchError(
            f"expected less than timing.answer_s, {protocol.timing.answer_s:g} s, found {rules.fastest_s:g}, which "
            "leaves no answer; lower it",
            *where,
            "fastest_s",
        )


def _check_lengths(protocol: Protocol, study: StudySpec, index: int) -> None:
    """Refuse more practice, or more attention checks, than a study has trials."""
    trials = protocol.trials_of(study)
    for key in ("practice", "attention_checks"):
        found = getattr(study, key)
        if found > trials:
            raise KeyMismatchError(
                f"expected no more than the {trials} trials of {study.name!r}, found {found}; lower it",
                "studies",
                index,
                key,
            )


def _check_practice(protocol: Protocol, study: StudySpec, index: int) -> None:
    """Refuse practice that shows what the study shows, and transitions for a practice that there is not."""
    where = ("studies", index, "practice_transitions")
    if study.practice_transitions and not study.practice:
        raise KeyMismatchError("expected practice of one trial or more with them, found none; set practice", *where)
    shown = protocol.transitions_of(study)
    if not shown:
        raise KeyMismatchError(f"expected a transition for the trials of {study.name!r}, found none but these", *where)
    for transition in shown:
        if transition.name in study.practice_transitions:
            raise KeyMismatchError(
                f"expected transitions that the trials do not show, found {transition.name!r}; name another", *where
            )


def _check_points(protocol: Protocol, study: StudySpec, transition: TransitionSpec) -> None:
    """Refuse merged conditions that leave nothing to choose."""
    where = ("transitions", protocol.transitions.index(transition))
    who = f"for the transition {transition.name!r} in the study {study.name!r}"
    try:
        points = protocol.points_for(study, transition)
    except ValidationError as error:
        raise KeyMismatchError(f"contradicting conditions {who}: {error.errors()[0]['ctx']['error']}", *where) from None
    if points.choose == "given" and study.reference in OPTIMUM_CUTS:
        raise KeyMismatchError(
            f"expected no given points {who}: {study.reference!r} finds its own; remove choose or change the method",
            *where,
        )
    if points.choose == "given":
        for end in ("source", "destination"):
            given = [key for key in (f"{end}_s", f"{end}_frame") if getattr(points, key) is not None]
            if len(given) != 1:
                found = " and ".join(given) or "neither"
                raise KeyMismatchError(
                    f"expected one of {end}_s and {end}_frame {who}, found {found}; give one", *where
                )
    least = 1 - min((0, *study.differences_frames))
    if points.longest_frames is not None and points.longest_frames < least:
        raise KeyMismatchError(
            f"a level below one frame {who}: at longest_frames = {points.longest_frames} the difference "
            f"{min(study.differences_frames)} leaves no blend; expected longest_frames of {least} or more",
            *where,
        )


def load_protocol(path: str | Path) -> Protocol:
    """Read and check a protocol.

    Raises
    ------
    ProtocolError
        For a file that can't be read, TOML that doesn't parse (with its line), and every key that is unknown (with
        the nearest valid one), missing, of the wrong type or out of range (with its line and key path). All such
        problems are named at once.
    """
    path = Path(path)
    try:
        text = path.read_bytes().decode("utf-8")
    except OSError as error:
        raise ProtocolError(
            f"{path}: expected a protocol file, found none ({error.strerror}); check the path."
        ) from error
    except UnicodeDecodeError as error:
        raise ProtocolError(
            f"{path}: expected UTF-8 text, found byte {error.start} that is not; save it again."
        ) from error
    return parse_protocol(text, path)


def parse_protocol(text: str, path: Path | None = None) -> Protocol:
    """Check a protocol's text; `path` is for messages."""
    where = str(path) if path else "protocol"
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ProtocolError(f"{where}: expected TOML, found a mistake: {error}. Mend that line.") from error
    try:
        protocol = Protocol.model_validate(with_words(data))
    except ValidationError as error:
        lines = []
        for detail in error.errors():
            location = full_location(detail)
            line = line_of(text, location)
            lines.append(f"{where}{f':{line}' if line else ''}: {explain(Protocol, detail)}")
        raise ProtocolError("\n".join(lines)) from None
    protocol._text, protocol._path = text, path
    return protocol


def protocols_folder() -> Path:
    """The folder of published protocols: the repository's, or the one that the installed package carries."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "protocols", package.parent / "protocols"):
        if any(folder.glob("*.toml")):
            return folder
    raise ProtocolError(
        f"Expected the protocols that come with Segue in {package / 'protocols'} or {package.parent / 'protocols'}, "
        "found neither; install the package again, or name a protocol file."
    )


def find_protocol(name_or_path: str | Path) -> Path:
    """The file of a protocol, named by path or by the name of one that comes with Segue."""
    path = Path(name_or_path)
    if path.is_file():
        return path
    folder = protocols_folder()
    known = sorted(p.stem for p in folder.glob("*.toml"))
    if path.parent == Path() and path.stem in known and path.suffix in ("", ".toml"):
        return folder / f"{path.stem}.toml"
    near = get_close_matches(path.stem, known, n=1)
    hint = f"did you mean {near[0]!r}?" if near else "write a path, or one of these names."
    raise ProtocolError(
        f"Expected a protocol file or the name of one that comes with Segue ({', '.join(known)}), "
        f"found {str(name_or_path)!r}; {hint}"
    )
