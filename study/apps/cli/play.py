"""The verb `segue play`: a participant's session in a window on this machine."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from study.apps.cli.console import READABLE, database_option, emit, json_option, library_option, say
from study.apps.cli.shared import OUT, check_database, load_for_people, prepare_stimuli, results_folder
from study.counting import counted

if TYPE_CHECKING:
    from renderer.window import Window
    from study.apps.player.loop import Outcome, Setting
    from study.apps.player.pages import Look
    from study.apps.player.store import ResponsesStore
    from study.experiment.plan import Plan
    from study.experiment.protocol.whole import Protocol
    from study.experiment.session import Session
    from study.experiment.stimuli.stimulus import StimulusSet
    from study.experiment.store.responses import Responses


CENTIMETRES = click.FloatRange(1, 1000)


@click.command()
@click.argument("protocol")
@click.option(
    "--participant",
    required=True,
    metavar="ID",
    help="Identifier of the participant, such as p01; the same one resumes.",
)
@click.option("--group", type=click.IntRange(min=0),
              help="Number of the group, for orders by group and sets of pairs (default: the smallest).")  # fmt: skip
@click.option(
    "--seed", type=click.IntRange(min=0), help="Seed of the order of trials, a whole number (default: the protocol's)."
)
@library_option
@OUT
@database_option
@click.option("--monitor", type=click.IntRange(min=0), default=0, show_default=True, help="Number of the monitor.")
@click.option("--windowed", is_flag=True, help="Use a window instead of the full screen.")
@click.option(
    "--size",
    default="1280x800",
    show_default=True,
    metavar="WIDTHxHEIGHT",
    help="Width and height of the window, pixels.",
)
@click.option("--actual-size", is_flag=True, help="Show stimuli in their own pixels instead of as `[screen]` states.")
@click.option(
    "--screen-cm", type=CENTIMETRES, help="Width of the screen, centimetres, measured (default: as it reports)."
)
@click.option("--distance-cm", type=CENTIMETRES, help="Viewing distance, centimetres (default: the protocol's).")
@click.option(
    "--font", type=READABLE, help="Font file for other scripts (default: DejaVu Sans, then the system's fonts)."
)
@json_option
def play(
    protocol: str,
    participant: str,
    group: int | None,
    seed: int | None,
    library: str | None,
    out: Path | None,
    database: str | None,
    monitor: int,
    windowed: bool,
    size: str,
    actual_size: bool,
    screen_cm: float | None,
    distance_cm: float | None,
    font: Path | None,
) -> None:
    """A session in a window: stimuli drawn live, every flip timed, every response stored before the next trial.

    If it was stopped or killed, the same command resumes it. Escape asks whether to stop.
    """
    from renderer.window import check_display
    from study.apps.player.loop import Setting
    from study.experiment.stimuli.manifest import record
    from study.experiment.store.responses import open_responses

    pixels = _size(size)
    check_display(monitor)
    loaded = load_for_people(protocol)
    stimuli = prepare_stimuli(loaded, library)
    folder = results_folder(loaded, out)
    check_database(database, stimuli)
    record(stimuli, folder)
    with open_responses(database or folder) as responses:
        plan = the_plan(responses, loaded, stimuli, participant, seed, group)
        setting = Setting(actual_size, screen_cm, distance_cm)
        place = Place(pixels if windowed else None, monitor, setting, font)
        outcome, window = _sit(responses, loaded, stimuli, plan, place)
    where = {"folder": str(folder), "database": responses.place}
    result = {**asdict(outcome), "participant": participant, **where, "window": window}
    emit(result, f"{participant}: {outcome.end}; {counted(outcome.answers, 'answer')} stored now, in {responses.place}")


def _size(text: str) -> tuple[int, int]:
    wide, _, high = text.partition("x")
    if not (wide.isdigit() and high.isdigit() and int(wide) >= 320 and int(high) >= 240):
        raise click.UsageError(f"expected --size as WIDTHxHEIGHT of at least 320x240 pixels, found {text!r}.")
    return int(wide), int(high)


def the_plan(
    responses: Responses,
    protocol: Protocol,
    stimuli: StimulusSet,
    participant: str,
    seed: int | None,
    group: int | None,
) -> Plan:
    """The stored plan of a returning participant, else a new one: the same as `simulate` draws."""
    from study.experiment.plan import draw_plan, groups_of
    from study.experiment.store.sessions import all_sessions, find_session

    known = find_session(responses, participant)
    if known is None:
        groups = groups_of(protocol, stimuli.pairs)
        if group is None and groups > 1:
            taken = [session.plan.group % groups for session in all_sessions(responses)]
            group = min(range(groups), key=taken.count)
        group = group or 0
        return draw_plan(protocol, stimuli.pairs, participant, seed, group=group)
    if seed is not None and seed != known.plan.seed:
        raise click.UsageError(
            f"expected --seed {known.plan.seed}, under which {participant!r} began, found {seed}; leave it out."
        )
    return known.plan


@dataclass(frozen=True)
class Place:
    """Where a session is shown: a window's size, or None for the full screen of a monitor; how large pictures are."""

    window_size: tuple[int, int] | None
    monitor: int
    setting: Setting
    font: Path | None


def _sit(
    responses: Responses, protocol: Protocol, stimuli: StimulusSet, plan: Plan, place: Place
) -> tuple[Outcome, dict[str, Any]]:
    """Open the window and walk the session."""
    from renderer.window import open_window
    from study.apps.player.calm import take_precedence
    from study.apps.player.loop import Outcome, play
    from study.apps.player.store import ResponsesStore
    from study.experiment.session import open_session

    store = ResponsesStore(responses, protocol, plan, stimuli.library, stimuli.synthetic)
    answers, passed, finished = store.before()
    if finished:
        say(f"{plan.participant} has already finished; there is nothing left to do.")
        return Outcome("finished", 0, 0, 0), {}
    session = open_session(
        protocol, plan, answers, passed=passed, frames={record.id: record.frames for record in stimuli.records}
    )
    if answers:
        say(f"{plan.participant} resumes after {counted(len(answers), 'answer')}.")
    look, size = page_look(stimuli, session, place.font), place.window_size
    take_precedence()
    with open_window(
        protocol.texts.title, full_screen=size is None, size=size or (1280, 800), monitor=place.monitor
    ) as window:
        _tell_of_timing(window)
        window.when_lost(lambda: _leave_a_lost_display(store))
        return play(window, session, stimuli.stimulus, store, look, setting=place.setting, say=say), window.describe()


def _leave_a_lost_display(store: ResponsesStore) -> None:
    """Nothing can be shown or asked any more: say so, and end at once."""
    with suppress(Exception):  # what can be written down is
        store.event("display lost")
    say("segue: The display is gone. Every response is stored; the same command resumes.")
    os._exit(2)


def page_look(stimuli: StimulusSet, session: Session, font: Path | None) -> Look:
    """Pages in the colours of the stimuli's background, in fonts that have all letters of the session's texts."""
    from study.apps.player.lettering import fonts_for
    from study.apps.player.pages import Look

    protocol = session.protocol
    parts = [protocol.consent, protocol.form, protocol.texts, protocol.studies]
    texts = [*_strings(parts), *(step.text for step in session.steps)]
    return Look(stimuli.stimuli[0].figure.background, fonts_for(texts, font))


def _strings(data: Any) -> Iterator[str]:
    """All texts in lists and in the parts of a protocol."""
    from study.experiment.protocol.texts import Part

    if isinstance(data, str):
        yield data
    elif isinstance(data, Part | list | tuple):
        for one in dict(data).values() if isinstance(data, Part) else data:
            yield from _strings(one)


def _tell_of_timing(window: Window) -> None:
    pacing = window.pacing
    if pacing.measured:
        say(f"display: {pacing.refresh_hz:.2f} Hz; swaps wait for it")
    else:
        why = "reports no refresh rate" if pacing.reported_hz == 0 else "does not make swaps wait"
        say(
            f"display: it {why} (a virtual one?), so frames follow a clock of {pacing.refresh_hz:g} Hz. "
            "TIMING WAS NOT MEASURED in this session; its record says so."
        )
