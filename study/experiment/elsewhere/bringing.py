"""Bringing back: answers that were given in another program, as sessions of the results folder that was sent.

Rows with the columns of `sending.KEY` come in, all cells as text; sessions go out, stored answer by answer like those
of Segue's own participants, and checked against the plan that was sent. Brought again with more rows, a session resumes
where the earlier ones ended.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from study.errors import SessionError
from study.experiment.elsewhere.sending import FORM, KEY, sent_plan
from study.experiment.protocol.whole import Protocol
from study.experiment.session import Session, advanced, answered, current, filled, missed, open_session
from study.experiment.steps import Step, answer_keys, form_event
from study.experiment.stimuli.manifest import Manifest
from study.experiment.store.answers import event_counts, record_answer, record_event, record_form, stored_answers
from study.experiment.store.responses import Responses
from study.experiment.store.sessions import SessionRecord, begin_session, find_session

ANSWERS, TIMES = ("answer", r".+\.keys", r".+\.response", "response"), ("response_s", r".+\.rt", "rt")
"""Columns of answers, and of response times in seconds, in the order in which they are looked for; PsychoPy names them
after a component: `key_resp.keys`, `key_resp.rt`."""

_NOTHING = ("", "none", "null", "nan")

Rows = Sequence[tuple[int, Mapping[str, str]]]
"""Rows with their numbers, for messages."""


@dataclass(frozen=True)
class Brought:
    """Participants in the rows, how many of them have all answers, answers stored now, and late ones among them.

    A late answer counts as missed, as in Segue's own sessions.
    """

    participants: int
    finished: int
    answers: int
    late: int


@dataclass
class _Story:
    """What the rows say of one participant, by trial and question and by study, and what of it is to be stored."""

    given: dict[tuple[int, str], tuple[int, str, str]] = field(default_factory=dict)
    forms: dict[str, dict[str, str]] = field(default_factory=dict)
    writes: list[Callable[[Responses, SessionRecord], Any]] = field(default_factory=list)
    answers: int = 0
    late: int = 0
    ended: bool = False


def bring(
    protocol: Protocol,
    manifest: Manifest,
    responses: Responses,
    rows: Rows,
    source: str,
    columns: tuple[str | None, str | None] = (None, None),
) -> Brought:
    """Store what the rows say: all of it, or nothing where a row is refused.

    Parameters
    ----------
    rows
        Those without a participant are passed over.
    source
        What the events of the sessions name as their origin.
    columns
        Those of answers and of response times; found by `ANSWERS` and `TIMES` unless given.

    Raises
    ------
    SessionError
        For rows that don't belong to what was sent, contradict each other, or lack a trial before others, and for
        answers and times that are none.
    """
    stories = _read(rows, columns)
    for name, story in stories.items():
        _follow(protocol, manifest, responses, name, story)
    for name, story in stories.items():
        plan = sent_plan(protocol, manifest, name)
        record = begin_session(
            responses, protocol, plan, library=manifest.library, library_synthetic=manifest.synthetic
        )
        record_event(responses, record, "imported", {"from": source})
        for write in story.writes:
            write(responses, record)
    told = stories.values()
    return Brought(len(told), *(sum(getattr(one, name) for one in told) for name in ("ended", "answers", "late")))


def _read(rows: Rows, columns: tuple[str | None, str | None]) -> dict[str, _Story]:
    """The rows by participant."""
    own = [(number, row) for number, row in rows if row.get(KEY[0], "").strip()]
    if not own:
        raise SessionError(
            f"Expected rows with the columns {', '.join(KEY)}, as `segue export-stimuli` wrote them, found none. Let "
            "the program save them with its data."
        )
    names = list(dict.fromkeys(name for _, row in own for name in row))
    answer, seconds = (_column(names, given, known) for given, known in zip(columns, (ANSWERS, TIMES), strict=True))
    found: dict[str, _Story] = {}
    for number, row in own:
        story = found.setdefault(row[KEY[0]].strip(), _Story())
        if filled_in := row.get(FORM, "").strip():
            story.forms[row.get(KEY[2], "").strip()] = _form(number, filled_in)
            continue
        try:
            which = int(float(row.get(KEY[1], ""))), row.get(KEY[2], "").strip()
        except ValueError:
            raise SessionError(f"row {number}: expected the number of a trial in {KEY[1]}, found none.") from None
        said = row.get(answer, "").strip(), row.get(seconds, "").strip()
        if story.given.setdefault(which, (number, *said))[1:] != said:
            raise SessionError(
                f"row {number}: expected one answer of {row[KEY[0]]} to trial {which[0]}, found another one in row "
                f"{story.given[which][0]}. Delete the one that does not count."
            )
    return found


def _column(names: Sequence[str], given: str | None, known: Sequence[str]) -> str:
    """The column of the name that is given, or else the first that is known."""
    if given is not None:
        fitting = [name for name in names if name == given]
    else:
        fitting = next((f for one in known if (f := [name for name in names if re.fullmatch(one, name)])), [])
    if len(fitting) != 1:
        wanted = repr(given) if given else " or ".join(one.replace(r".+\.", "NAME.") for one in known)
        raise SessionError(
            f"Expected one column {wanted}, found {', '.join(fitting) or 'none'} among {', '.join(names)}; name it "
            "with --answer or --time."
        )
    return fitting[0]


def _form(number: int, text: str) -> dict[str, str]:
    try:
        return {name: str(value) for name, value in dict(json.loads(text)).items()}
    except (ValueError, TypeError) as error:
        raise SessionError(f"row {number}: expected a form as JSON in {FORM}, found {text[:40]!r} ({error}).") from None


def _follow(protocol: Protocol, manifest: Manifest, responses: Responses, name: str, story: _Story) -> None:
    """Go through a session as the rows say, up to the first trial that they lack."""
    stored = find_session(responses, name)
    before = stored_answers(responses, stored.id) if stored is not None else ()
    events = event_counts(responses, stored) if stored is not None else {}
    studies = ("", *(study.name for study in protocol.studies))
    absent = {form_event(study) for study in studies if study not in story.forms}
    state = open_session(protocol, sent_plan(protocol, manifest, name), before, passed={"consent", *events, *absent})
    for answer in before:
        story.given.pop((answer.trial, answer.item), None)
    while (step := current(state)).kind != "done":
        if step.kind == "form":
            state, values = filled(state, story.forms[step.study])
            story.writes.append(partial(record_form, values=values, study=step.study))
        elif step.kind != "answer":
            state = advanced(state)
        elif (cells := story.given.pop((step.trial, step.item), None)) is None:
            break
        else:
            state = _answer(state, step, *cells, story)
    if story.given:
        (trial, item), (number, *_) = next(iter(story.given.items()))
        due = f"none of trial {step.trial}, which comes before it" if step.kind == "answer" else "no such trial"
        raise SessionError(
            f"row {number}: expected answers of {name} from the first trial on, found one to trial {trial}"
            f"{f', {item}' if item else ''}, but {due}. Add what is missing: an empty answer is a missed one."
        )
    story.ended = current(state).kind == "done"
    if story.ended and "finished" not in events:
        story.writes.append(partial(record_event, kind="finished"))


def _answer(state: Session, step: Step, number: int, answer: str, seconds: str, story: _Story) -> Session:
    keys = {key: value for value, key in answer_keys(state.protocol, step.legal).items()}
    value = answer if answer in step.legal else keys.get(answer.lower(), answer)
    if step.answered_by == "slider" and re.fullmatch(r"\d+\.\d*", value):
        value = str(round(float(value)))
    trial = state.trial(step.trial)
    try:
        if answer.lower() in _NOTHING:
            state, said = missed(state)
        elif step.duration_s is not None and float(seconds) > step.duration_s:
            state, said = missed(state)
            story.late += 1
        else:
            state, said = answered(state, value, float(seconds))
    except ValueError:
        raise SessionError(f"row {number}: expected a response time in seconds, found {seconds!r}.") from None
    except SessionError as refusal:
        raise SessionError(f"row {number}: {refusal}") from None
    story.writes.append(partial(record_answer, trial=trial, answer=said))
    story.answers += 1
    return state
