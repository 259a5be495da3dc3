"""The parts of a protocol that say what is asked and how it is analysed: studies with their tasks, and decisions made
before there is data.

Pydantic models and what keeps one study consistent; `protocol_checks` looks at the whole protocol.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import Field, PlainValidator, model_validator

from study.experiment.procedures.constant_stimuli import Constant
from study.experiment.procedures.procedure import Settings
from study.experiment.procedures.registry import PROCEDURES
from study.experiment.protocol.errors import KeyMismatchError, refuse_all
from study.experiment.protocol.settings import member_of, settings_in
from study.experiment.protocol.stimuli import Points
from study.experiment.protocol.texts import FormField, Listed, Part, Slug, known_slots
from study.tasks.registry import DECIDES, NAMES, kind_of, problems_of
from study.tasks.task import Order, Show, Slider
from study.transitions.methods.registry import METHODS

if TYPE_CHECKING:
    TaskName = str
else:
    TaskName = Literal[NAMES]
Difference = Annotated[int, Field(ge=-600, le=600)]


class Item(Part):
    """One question of a rating study, answered on a scale."""

    name: Slug = Field(description="Name in the responses; unique in its study.")
    question: str = Field(min_length=1, description="What the participant reads.")
    low: str = Field(default="", description="Words at the lowest point of the scale.")
    middle: str = Field(default="", description="Words at the middle of a scale with an odd number of points.")
    high: str = Field(default="", description="Words at the highest point of the scale.")


class OneHop(Part):
    """How the method `one-hop` finds its hops (Koyama and Goto 2019)."""

    hops: Listed[str] = Field(
        default=(), description="Motions that may be hops; by default those of the study's transitions."
    )
    stay_s: float = Field(
        default=1.0, ge=0, le=10, description="Longest stay in the source and in the hop; 0 for none. [seconds]"
    )
    weight: float | None = Field(
        default=None, ge=0, le=0.01, description="Cost of a frame of stay, square metres; by default that of Eq. 5."
    )
    weight_times: float = Field(default=1.0, ge=0, le=100, description="Factor of the weight (Figure 11).")
    conditions: int = Field(default=100, ge=1, le=10000, description="Transitions drawn for the weight of Eq. 5.")


def procedure_of(table: object) -> Settings:
    """The settings of a procedure; what is wrong with them is told at their key."""
    if isinstance(table, Settings):
        return table
    if not isinstance(table, Mapping):
        raise KeyMismatchError(f"expected a table of keys, found {table!r}; write [studies.procedure] and its keys")
    own = dict(table)
    return settings_in(member_of(own.pop("name", Constant.name), PROCEDURES, "name"), own)


class StudySpec(Part):
    """One study of the session: a task over transitions."""

    name: Slug = Field(description="Name in plans, responses and reports; unique.")
    title: str = Field(default="", description="Heading for reports; by default the name.")
    task: TaskName = Field(
        description="What the participant decides: "
        f"{'; '.join(f'`{name}`, {words}' for name, words in DECIDES.items())}."
    )
    transitions: Listed[str] = Field(default=(), description="Names of the transitions shown; by default all.")
    reference: str = Field(
        default="geodesic",
        description="Method behind the reference (same-different), method a (preference), or what is rated: "
        f"{', '.join(f'`{name}`' for name in METHODS)}, or one of `[[methods]]`.",
    )
    comparison: str | None = Field(
        default=None, description="Method b of a preference study; a second one to rate in a rating study."
    )
    others: Listed[str] = Field(
        default=(),
        description="Preference: further methods; every pair of `reference`, `comparison` and these is compared. "
        "Parallel rating: further methods that are shown beside them.",
    )
    sets: int | None = Field(
        default=None,
        ge=2,
        le=1000,
        description="Preference: into how many balanced sets the pairs are divided, of which a participant sees one; "
        "by default everybody sees all.",
    )
    ties: bool = Field(
        default=False, description="Preference: whether participants may also answer that neither is better."
    )
    confidence_points: int | None = Field(
        default=None,
        ge=2,
        le=11,
        description="After each choice participants also say how sure they are, on a scale of so many points.",
    )
    slider: Slider | None = Field(
        default=None,
        description="Rating: a slider from 0 to 100 in place of the points of a scale, `plain` or with `ticks` at "
        "every tenth.",
    )
    side_by_side: bool = Field(
        default=False, description="Preference: whether both films are shown at once, one beside the other."
    )
    replays: int = Field(
        default=0,
        ge=0,
        le=20,
        description="Films shown at once: how often participants may play those of a trial again.",
    )
    hidden_reference: str | None = Field(
        default=None,
        description="Parallel rating: a further method, shown among the others, that a report compares them with.",
    )
    show: Show | None = Field(
        default=None,
        description="Rating: each transition by itself (`single`, the default), or both methods' "
        "transitions as a `pair`, with items that compare the second with the first.",
    )
    differences_frames: Listed[Difference] = Field(
        default=(),
        description="Same-different, oddity, 2AFC, yes-no: comparison minus reference blend length, a pair each; 0 "
        "shows one twice in same-different studies, the reference in yes-no studies. [frames]",
    )
    fixed_frames: int | None = Field(
        default=None,
        ge=1,
        le=600,
        description="Blend length of the method `fixed`, and of both blends of `one-hop`; by default 0.33 s, "
        "which are 10 frames at 30 fps. [frames]",
    )
    one_hop: OneHop = Field(default=OneHop(), description="How the method `one-hop` finds its hops.")
    procedure: Annotated[Settings, PlainValidator(procedure_of)] = Field(
        default=Constant(),
        description="How the trials are chosen: "
        f"{', '.join(f'`{name}` ({member.title})' for name, member in PROCEDURES.items())}.",
    )
    order: Order = Field(
        default="random",
        description="Order within pairs: `both` shows each pair in both, `random` draws, `balanced` draws half each "
        "way, `by-group` rotates by the participant's group (2003).",
    )
    blocks: bool = Field(
        default=False,
        description="Whether all trials with one transition follow each other, block after block in random order; with "
        "constant stimuli.",
    )
    repeats: int = Field(default=1, ge=1, le=1000, description="How often the whole set is shown.")
    question: str = Field(
        default="{standard}", description="What the participant is asked after each pair or stimulus."
    )
    instructions: str = Field(
        default="{standard}",
        description="What the participant reads before the study; `{standard}` is the built-in text.",
    )
    example: bool = Field(default=True, description="Whether the instructions can show one stimulus as an example.")
    practice: int = Field(
        default=0, ge=0, le=100, description="Trials with feedback before the study, which are not analysed. [trials]"
    )
    practice_until: float | None = Field(
        default=None,
        gt=0,
        le=1,
        description="Share of right responses at which practice is over; until then it comes again. For tasks with "
        "right answers.",
    )
    practice_most: int = Field(
        default=3, ge=1, le=20, description="How often practice comes with `practice_until`, whatever the responses."
    )
    practice_transitions: Listed[str] = Field(
        default=(),
        description="Transitions for practice and the example only, so that neither shows the study's stimuli; "
        "by default the study's own.",
    )
    example_transition: str | None = Field(
        default=None,
        description="One of `practice_transitions` that the instructions show as the example, and that is not "
        "practised; by default the example is the first stimulus. With methods that cut, a transition from a motion to "
        "itself shows that motion, uncut.",
    )
    attention_checks: int = Field(
        default=0, ge=0, le=100, description="Trials that ask for a stated answer, at random places. [trials]"
    )
    scale_points: int = Field(
        default=5, ge=2, le=11, description="Points of the rating scale, counted from 0; a slider has its own."
    )
    items: Listed[Item] = Field(default=(), description="Questions of a rating study.")
    form: Listed[FormField] = Field(
        default=(), description="Questions after the study, such as a free text; keys as those of `[[form]]`."
    )
    points: Points = Field(default=Points(), description="Conditions for this study's transition points.")

    @model_validator(mode="before")
    @classmethod
    def _with_differences(cls, table: Any) -> Any:
        """A procedure that finds its differences says which ones may come."""
        if not isinstance(table, Mapping) or not isinstance(table.get("procedure"), Mapping):
            return table
        try:
            settings = procedure_of(table["procedure"])
        except KeyMismatchError:  # told where the key itself is checked
            return table
        if (own := settings.differences()) is None:
            return table
        if "differences_frames" in table:
            raise KeyMismatchError(
                f"expected no differences_frames with {settings.name!r}, which finds its own; remove it",
                "differences_frames",
            )
        return {**table, "procedure": settings, "differences_frames": own}

    @model_validator(mode="after")
    def _fits_task(self) -> Self:
        _check_task(self)
        if kind_of(self) == "slider" and "scale_points" in self.model_fields_set:
            message = "expected no scale_points where sliders go from 0 to 100; remove it"
            raise KeyMismatchError(message, "scale_points")
        for key in ("question", "instructions"):
            known_slots(getattr(self, key), key)
        return self

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of the methods that this study shows."""
        return (self.reference, *filter(None, (self.comparison, *self.others, self.hidden_reference)))


def _check_task(study: StudySpec) -> None:
    """Refuse what doesn't fit between the task and the other keys of a study."""
    # What a procedure does not fit makes keys that the task would refuse.
    for problems in (study.procedure.problems(study), problems_of(study)):
        refuse_all(KeyMismatchError(problem, *filter(None, (key,))) for key, problem in problems)
    check_once(study.differences_frames, "difference", "differences_frames")
    for key, part in (("items", "item"), ("form", "question")):
        check_once([one.name for one in getattr(study, key)], f"{part}'s name", key)


def check_once(values: Sequence[object], what: str, *location: int | str) -> None:
    """Refuse duplicates in a list."""
    if (index := repeated(values)) is not None:
        found = f"found {values[index]!r} twice"
        raise KeyMismatchError(f"expected each {what} once, {found}; change or remove one", *location)


def repeated(values: Sequence[object]) -> int | None:
    """The index of the first duplicate in a list; None if all differ."""
    seen: set[object] = set()
    for index, value in enumerate(values):
        if value in seen:
            return index
        seen.add(value)
    return None


class Exclusions(Part):
    """The analysis' exclusions, stated before there is data; by default none."""

    fastest_s: float | None = Field(
        default=None, gt=0, le=10, description="Exclude responses faster than this. [seconds]"
    )
    badly_shown: bool = Field(default=False, description="Exclude responses after a display failure.")
    most_missed: float | None = Field(
        default=None, ge=0, lt=1, description="Exclude participants with a larger share of trials without a response."
    )
    most_failed_checks: float | None = Field(
        default=None, ge=0, lt=1, description="Exclude participants who failed a larger share of the attention checks."
    )
    most_too_fast: float | None = Field(
        default=None,
        ge=0,
        lt=1,
        description="Exclude participants with a larger share of responses faster than `fastest_s`, or 0.2 s.",
    )


class AnalysisSettings(Part):
    """Preregistered settings of the analysis."""

    threshold: float = Field(
        default=0.75, gt=0, lt=1, description="Proportion that defines the just noticeable difference."
    )
    alpha: float = Field(
        default=0.01, gt=0, lt=1, description="Significance level (2004 section 5.2); intervals are of 1 - alpha."
    )
    equivalence_points: float = Field(
        default=10.0,
        gt=0,
        lt=50,
        description="Equivalence margin of a preference around 50%; 10 is 40 to 60%. [points]",
    )
    confirmatory: Listed[str] = Field(
        default=(),
        description="Studies whose tests are adjusted together (Holm) and decide; by default those with a "
        "preference. Tests of the others explore.",
    )
    exclusions: Exclusions = Field(default=Exclusions(), description="Preregistered exclusions.")
