"""What a protocol will show, as a table for a terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from study.apps.cli.console import columns
from study.counting import counted

if TYPE_CHECKING:
    from study.experiment.protocol.whole import Protocol, StudySpec
    from study.experiment.stimuli.outlook import Outlook, Place, Row

HEADINGS = (
    *("transition", "source", "frame", "s", "in file", "destination", "frame", "s", "in file"),
    *("k", "s", "blends", "trials", "films", "seconds"),
)

MOST_LEVELS = 12
"""Of more levels than these, every other one is shown, or fewer; of lengths in equal steps, their ends."""


def table_of(protocol: Protocol, outlook: Outlook) -> Iterator[str]:
    """The rows of each study under its name, and a blank line at the end of each."""
    for study in protocol.studies:
        rows = [row for row in outlook.rows if row.study == study.name]
        if rows:
            yield _heading(protocol, study)
            yield from columns([HEADINGS, *map(_cells, rows)], left=(0, 1, 5, 11))
            yield from (f"  {row.transition}: {note}" for row in rows for note in row.notes)
            yield ""


def shortcut_lines(protocol: Protocol, outlook: Outlook) -> Iterator[str]:
    """For each study what observers would answer who see one property of the stimuli alone."""
    from study.experiment.stimuli.shortcuts import needed_share, shares_in_words

    for study in protocol.studies:
        own = [share for share in outlook.shortcuts if share.study == study.name]
        if not own:
            continue
        yield f"{study.name}: {shares_in_words(study, needed_share(protocol, study))}"
        rows: list[tuple[str, ...]]
        if study.others or own[0].level is not None:
            heads = list(dict.fromkeys((share.level, share.method) for share in own))
            shown = heads if len(heads) <= MOST_LEVELS else heads[:: -(-len(heads) // MOST_LEVELS)]
            cells = {(one.cue, one.level, one.method): one.share if one.method else one.furthest for one in own}
            rows = [("seen alone", *(method or f"{level:+d}" for level, method in shown))]
            rows += [
                (cue, *(f"{100 * cells[cue, *head]:.0f}" for head in shown))
                for cue in dict.fromkeys(share.cue for share in own)
            ]
            yield from columns(rows, left=(0,))
        else:
            rows = [("seen alone", "all", "furthest", "at")]
            rows += [(one.cue, f"{100 * one.share:.0f}", f"{100 * one.furthest:.0f}", one.motion) for one in own]
            yield from columns(rows, left=(0, 3))
        yield ""


def trials_between(fewest: int, most: int) -> str:
    """How many trials there are; a range where it depends on the responses."""
    return counted(most, "trial") if fewest == most else f"{fewest} to {counted(most, 'trial')}"


def _heading(protocol: Protocol, study: StudySpec) -> str:
    besides = [counted(study.practice, "practice trial")] if study.practice else []
    besides += [counted(study.attention_checks, "attention check")] if study.attention_checks else []
    trials = ", ".join([trials_between(protocol.fewest_trials_of(study), protocol.trials_of(study)), *besides])
    chosen = f"{words}; " if (words := study.procedure.in_words()) else ""
    *others, last = study.methods
    methods = f"{', '.join(others)} and {last}" if others else last
    return f"{study.name}: {study.task}, {methods}; {chosen}{trials}; frames at {protocol.fps:g} fps"


def _cells(row: Row) -> tuple[str, ...]:
    shortest, longest = (f"{seconds:.2f}" for seconds in row.film_s)
    return (
        row.transition,
        *_point(row.source),
        *_point(row.destination),
        str(row.k_frames),
        f"{row.k_s:.2f}",
        "; ".join(f"{method} {_listed(lengths)}" for method, lengths in row.lengths.items() if lengths),
        "practice" if row.trials is None else str(row.trials),
        str(row.films),
        shortest if shortest == longest else f"{shortest}-{longest}",
    )


def _listed(lengths: Sequence[int]) -> str:
    """Lengths, each by itself; many in equal steps as a range: `8 to 38 by 2`."""
    steps = {after - before for before, after in pairwise(lengths)}
    if len(lengths) <= MOST_LEVELS or len(steps) > 1:
        return " ".join(map(str, lengths))
    return f"{lengths[0]} to {lengths[-1]} by {steps.pop()}"


def _point(place: Place) -> tuple[str, str, str, str]:
    return place.motion, str(place.frame), f"{place.s:.2f}", f"{place.file_frame:.5g}"
