"""Protocol: a study as one TOML file, checked key by key.

A TOML file comes in; a frozen `Protocol` goes out, with the exact text and its SHA-256, so that every record can
say under which protocol it was made. A protocol names motions, never files: a library supplies them. The keys
cover the four studies of 2004 (section 4, one sitting) and the rating study of 2003 (section 4.2).

The meaning of a key is its `description`; `docs/protocols.md` is written from these (`keys`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import Field, PrivateAttr, ValidationError, model_validator

from study.counting import counted
from study.errors import FileError, ProtocolError
from study.experiment.protocol.checks import check_whole
from study.experiment.protocol.errors import explain, full_location, key_lines, line_of, telling
from study.experiment.protocol.languages import with_words
from study.experiment.protocol.methods import OwnMethod
from study.experiment.protocol.stimuli import Points, StimulusSettings, Timing, TransitionSpec
from study.experiment.protocol.studies import AnalysisSettings, StudySpec
from study.experiment.protocol.texts import MOST_PARTS, Consent, FormField, Keys, Part, Slug, Texts
from study.files import read_text
from study.models.up_down import UpDown
from study.tasks.registry import task_of
from study.toml_text import LARGEST_TEXT, parse_toml
from study.transitions.methods.method import Method
from study.transitions.methods.registry import METHODS

__all__ = [
    "Points",
    "Protocol",
    "StimulusSettings",
    "StudySpec",
    "TransitionSpec",
    "find_protocol",
    "load_protocol",
    "parse_protocol",
    "protocols_folder",
]

MOST_PROBLEMS = 50
"""So many are told at once."""


class Protocol(Part):
    """A whole session."""

    name: Slug = Field(description="Name of the protocol and of its results folder.")
    title: str = Field(min_length=1, description="Heading for researchers; participants read `texts.title`.")
    source: str = Field(default="", description="Paper and section on which it is based.")
    fps: float = Field(default=30.0, ge=1, le=240, description="Frame rate of every stimulus. [frames per second]")
    seed: int = Field(ge=0, description="Seed of all of the protocol's randomness.")
    participants: int | None = Field(
        default=None, ge=1, le=100_000, description="Planned number of participants, fixed before there is data."
    )
    study_order: Literal["as-listed", "random"] = Field(
        default="as-listed", description="Order of the studies in a session."
    )
    stimuli: StimulusSettings = Field(default=StimulusSettings(), description="How stimuli are built and drawn.")
    timing: Timing = Field(default=Timing(), description="Times of a trial.")
    points: Points = Field(default=Points(), description="How transition points are chosen.")
    language: Annotated[str, Field(pattern=r"^[A-Za-z]{2,3}(-[A-Za-z0-9]{2,8})*$")] = Field(
        default="en",
        description="Language of the built-in words (en, de, fr, ja) and, for screen readers, of all texts.",
    )
    touch: bool = Field(default=True, description="Whether tablets and telephones are admitted.")
    consent: Consent = Field(default=Consent(), description="What participants agree to.")
    form: Annotated[tuple[FormField, ...], Field(strict=False, max_length=MOST_PARTS)] = Field(
        default=(), description="Questions about the participant, one `[[form]]` each."
    )
    keys: Keys = Field(default=Keys(), description="Keys that answer.")
    texts: Texts = Field(default=Texts(), description="What participants read.")
    analysis: AnalysisSettings = Field(default=AnalysisSettings(), description="Decisions about the analysis.")
    transitions: Annotated[tuple[TransitionSpec, ...], Field(strict=False, min_length=1, max_length=MOST_PARTS)] = (
        Field(description="The transitions, one `[[transitions]]` each.")
    )
    studies: Annotated[tuple[StudySpec, ...], Field(strict=False, min_length=1, max_length=100)] = Field(
        description="The studies of the session, one `[[studies]]` each, in order."
    )
    methods: Annotated[tuple[OwnMethod, ...], Field(strict=False, max_length=MOST_PARTS)] = Field(
        default=(), description="Your own methods, one `[[methods]]` each."
    )

    _text: str = PrivateAttr(default="")
    _path: Path | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        check_whole(self)
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
        orders = len(task.orders) if study.order == "both" else 1
        return shown * len(task.conditions(study, False)) * study.repeats * orders

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

    def files_read(self) -> tuple[Path, ...]:
        """The files that the protocol's own methods read, from the folder of the protocol's own file."""
        return tuple(self.path_of(file) for own in self.methods for file in own.method({}).make.files_read())

    def path_of(self, file: str) -> Path:
        """A file that the protocol names, from the folder of the protocol's own file."""
        return (self._path.parent if self._path else Path()) / file

    @property
    def staircases(self) -> dict[str, UpDown]:
        """The rule of each study whose procedure goes up and down, by its name."""
        return {study.name: rule for study in self.studies if (rule := study.procedure.rule) is not None}

    @property
    def scale_points(self) -> dict[str, int]:
        """Points of the scale of each rating study, by its name."""
        return {study.name: study.scale_points for study in self.studies if task_of(study).kind == "point"}

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


def load_protocol(path: str | Path) -> Protocol:
    """Read and check a protocol.

    Raises
    ------
    ProtocolError
        For a file that can't be read, TOML that doesn't parse (with its line), and every key that is unknown (with
        the nearest valid one), missing, of the wrong type or out of range (with its line and key path). All such
        problems are named at once, up to 50.
    """
    try:
        text = read_text(path, "a protocol file", LARGEST_TEXT + 1)
    except FileError as error:
        raise ProtocolError(str(error)) from error
    return parse_protocol(text, Path(path))


def parse_protocol(text: str, path: Path | None = None) -> Protocol:
    """Check a protocol's text; `path` is for messages."""
    where = str(path) if path else "protocol"
    try:
        data = parse_toml(text, where)
    except FileError as error:
        raise ProtocolError(str(error)) from error
    try:
        protocol = Protocol.model_validate(with_words(data))
    except ValidationError as error:
        found, lines = list(telling(Protocol, error.errors())), dict(key_lines(text))
        sentences = []
        for detail in found[:MOST_PROBLEMS]:
            line = line_of(lines, full_location(detail))
            sentences.append(f"{where}{f':{line}' if line else ''}: {explain(Protocol, detail)}")
        if more := len(found[MOST_PROBLEMS:]):
            sentences.append(f"{where}: {counted(more, 'more problem')}; mend these first.")
        raise ProtocolError("\n".join(sentences)) from None
    protocol._text, protocol._path = text, path
    return protocol


def protocols_folder() -> Path:
    """The folder of published protocols: the repository's, or the one that the installed package carries."""
    import study

    package = Path(str(study.__file__)).resolve().parent
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
