"""Outlook: what a protocol will show, before any of it is made: points, lengths, trials, films, and how long it takes.

A protocol and a library come in; an `Outlook` goes out, for a person to look at before the films are rendered.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from study.counting import counted
from study.errors import StimulusError
from study.experiment.protocol.whole import Protocol, StudySpec
from study.experiment.stimuli.audit import PairAudit
from study.experiment.stimuli.films import Film, Planned, Showing, plan_all
from study.experiment.stimuli.flawed import flaw_notes
from study.experiment.stimuli.kept import kept
from study.experiment.stimuli.making import made_of
from study.experiment.stimuli.shortcuts import ShortcutShare, shortcuts_of, told_away
from study.experiment.stimuli.stimulus import StimulusSet
from study.experiment.stimuli.supply import Supply
from study.experiment.stimuli.ways import Ways
from study.experiment.wording import Films, FilmTimes, duration_s, minutes
from study.motion.clip import file_frame
from study.tasks.registry import orders_of
from study.transitions.advice import JND_LONGER_S, JND_SHORTER_S, just_noticeable

if TYPE_CHECKING:
    from study.motion.library import Library


@dataclass(frozen=True)
class Place:
    """A transition point: a frame of a motion at the protocol's rate, its time, and the frame of the motion's file."""

    motion: str
    frame: int
    s: float
    file_frame: float
    file: str


@dataclass(frozen=True)
class Row:
    """One transition of one study.

    Parameters
    ----------
    study, transition, role
        `role` is `trial`, or `practice` for what practice alone shows.
    source, destination
        Where the blend starts and where it ends.
    k_frames, k_s
        The length that the reference method gives.
    lengths
        The blend lengths that are shown, in frames, by method; of a hop, from the first blended frame to the last.
    lengths_s
        The same in seconds.
    trials
        Of a participant at most, practice and attention checks apart; None for practice.
    films, film_s
        How many different films, and the shortest and the longest of them in seconds.
    notes
        What the methods gave up, and by which hop a film goes.
    """

    study: str
    transition: str
    role: str
    source: Place
    destination: Place
    k_frames: int
    k_s: float
    lengths: Mapping[str, tuple[int, ...]]
    lengths_s: Mapping[str, tuple[float, ...]]
    trials: int | None
    films: int
    film_s: tuple[float, float]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Outlook:
    """What will be shown: rows, what can't be shown, what to think about, and totals of one participant.

    `films` are different films of the whole protocol; `minutes` count films, gaps, answers, pauses, breaks, practice,
    attention checks, the form and reading; `minutes_at_most` with every answer and every film at its longest.
    `trials` are the most that there may be, `fewest_trials` the fewest. `film_times` are what they rest on, for the
    texts that speak of minutes. `stimuli` are all that is shown, None where not all can be; `audits` say how the films
    of each pair differ in what is not judged, and `shortcuts` what that alone could explain.
    """

    rows: tuple[Row, ...]
    problems: tuple[str, ...]
    notes: tuple[str, ...]
    fewest_trials: int
    trials: int
    films: int
    minutes: int
    minutes_at_most: int
    film_times: Films
    stimuli: StimulusSet | None = None
    shortcuts: tuple[ShortcutShare, ...] = ()

    @property
    def audits(self) -> tuple[PairAudit, ...]:
        """How the films of each pair differ in what is not judged."""
        return self.stimuli.audits if self.stimuli else ()


def look_ahead(protocol: Protocol, library: Library, progress: Callable[[int, int], None] | None = None) -> Outlook:
    """Plan and make all films of a protocol and describe them, or take what an earlier call kept.

    `progress` is called with transitions that are planned and the number of them, after each.
    """
    found = kept(protocol, library, lambda: _looked_ahead(protocol, library, progress), lambda made: not made.problems)
    return replace(found, stimuli=replace(found.stimuli, protocol=protocol)) if found.stimuli else found


def _looked_ahead(protocol: Protocol, library: Library, progress: Callable[[int, int], None] | None) -> Outlook:
    ways = Ways(protocol, library)
    planned, problems = plan_all(protocol, library, ways, progress)
    made: StimulusSet | None = None
    shortcuts: tuple[ShortcutShare, ...] = ()
    flaws: tuple[str, ...] = ()
    if not problems:
        try:
            made = made_of(protocol, library, planned, ways)
            shortcuts = shortcuts_of(protocol, made.pairs, made.audits)
            flaws = tuple(flaw_notes(made.records))
        except StimulusError as error:
            problems = [str(error)]
    times = {study.name: found for study in protocol.studies if (found := _times(study, protocol, planned))}
    films = {film for each in planned for showing in each.showings for film in showing.films}
    usual, longest = (minutes(duration_s(protocol, at_most=most, films=times)) for most in (False, True))
    return Outlook(
        tuple(_row(protocol, each) for each in planned),
        tuple(problems),
        (*_too_alike(protocol, planned), *told_away(protocol, shortcuts), *flaws),
        sum(protocol.fewest_trials_of(study) for study in protocol.studies),
        sum(protocol.trials_of(study) for study in protocol.studies),
        len(films),
        usual,
        longest,
        times,
        made,
        shortcuts,
    )


def _row(protocol: Protocol, planned: Planned) -> Row:
    study, settled, fps = planned.study, planned.settled, protocol.fps
    films = {film for showing in planned.showings for film in showing.films}
    seconds = [film.frames(protocol) / fps for film in films]
    lengths: dict[str, tuple[int, ...]] = {method: _lengths(planned.showings, method) for method in study.methods}
    made = dict.fromkeys(f"{by}: {film.way.note}" for film, by in _seen(planned.showings) if film.way.note)
    gave_up = [f"{method}: {settled.lengths[method].note}" for method in study.methods if settled.lengths[method].note]
    k_frames = planned.showings[0].films[0].way.blend_frames
    return Row(
        study.name,
        settled.transition.name,
        "practice" if planned.for_practice else "trial",
        place_of(settled.source, settled.start_frame),
        place_of(settled.destination, settled.end_frame),
        k_frames,
        k_frames / fps,
        lengths,
        {method: tuple(round(frames / fps, 6) for frames in own_lengths) for method, own_lengths in lengths.items()},
        None if planned.for_practice else protocol.trials_of(study) // len(protocol.transitions_of(study)),
        len(films),
        (min(seconds), max(seconds)),
        (*gave_up, *made),
    )


def place_of(supply: Supply, frame: int) -> Place:
    """Where a frame lies in the motion that the library supplied."""
    at = frame - supply.first
    s = at / supply.clip.fps
    return Place(supply.name, at, round(s, 6), round(file_frame(supply.clip, at), 3), supply.file)


def _lengths(showings: Sequence[Showing], method: str) -> tuple[int, ...]:
    """The lengths by one method, each once, the shortest first."""
    return tuple(sorted({film.way.frames for film, by in _seen(showings) if by == method}))


def _seen(showings: Sequence[Showing]) -> Iterator[tuple[Film, str]]:
    """Each film with its method."""
    for each in showings:
        yield from zip(each.films, each.condition.methods, strict=True)


def _times(study: StudySpec, protocol: Protocol, planned: Sequence[Planned]) -> FilmTimes | None:
    """Seconds of film in a trial and in a practice trial of a study; None where its films are not known."""
    trials: list[float] = []
    practice: list[float] = []
    for each in planned:
        if each.study is study:
            own = practice if each.for_practice else trials
            shown = orders_of(study)[0]
            own += [sum(one.films[i].frames(protocol) for i in shown) / protocol.fps for one in each.showings]
    if not trials:
        return None
    mean = sum(trials) / len(trials)
    return FilmTimes(mean, sum(practice) / len(practice) if practice else mean)


def _too_alike(protocol: Protocol, planned: Sequence[Planned]) -> Iterator[str]:
    """Studies whose two methods differ by less than people notice (2004 section 5.1), one sentence each."""
    for study in protocol.studies:
        own = [each for each in planned if each.study is study and not each.for_practice]
        apart = {each.settled.transition.name: frames for each in own if (frames := _longer(each)) is not None}
        named = [f"{name} {frames:+d}" for name, frames in apart.items() if just_noticeable(frames / protocol.fps) < 1]
        if named:
            longer, shorter = (round(s * protocol.fps) for s in (JND_LONGER_S, JND_SHORTER_S))
            yield (
                f"{study.name}: in {len(named)} of {counted(len(own), 'transition')} {study.reference} and "
                f"{study.comparison} differ by less than the just noticeable "
                f"difference, {longer} frames longer or {shorter} shorter: {', '.join(named)} frames. People may see "
                "no difference there; shortest_frames, avoid_frames and avoid_within_frames choose other points."
            )


def _longer(planned: Planned) -> int | None:
    """Frames by which the comparison is longer than the reference, where they differ in length alone."""
    films = {by: film for film, by in _seen(planned.showings)}
    a, b = (films.get(name or "") for name in (planned.study.reference, planned.study.comparison))
    if a is None or b is None or planned.settled.optima:
        return None
    return b.way.longer_than(a.way)
