"""Sending: the sessions of a protocol as other programs play them.

The results folder of rendered stimuli and a number of participants come in; each participant's trials go out beside the
films, in a program's own form. Plans are drawn as for Segue's own sessions, so that answers can be brought back
(`bringing`).
"""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from study.errors import SessionError, StimulusError
from study.experiment.plan import Plan, draw_plan
from study.experiment.procedures.procedure import Adaptive
from study.experiment.protocol.whole import Protocol
from study.experiment.session import Session, open_session
from study.experiment.steps import Step, answer_options, feedback_text
from study.experiment.stimuli.manifest import Manifest
from study.files import write_whole
from study.tasks.answer import Answer
from study.tasks.registry import layout_of, right_answer

KEY = ("segue_participant", "segue_trial", "segue_item")
"""The columns by which an answer is known again: whose, to which trial, and to which of its questions."""

FORM = "segue_form"
"""The column of a filled form, which is JSON, field by field; `KEY` says whose, its item after which study."""


def send(folder: Path, protocol: Protocol, manifest: Manifest, tool: str, participants: int) -> list[str]:
    """Write what a program of `TOOLS` needs to play the sessions of so many participants.

    Parameters
    ----------
    folder
        The results folder of the manifest, whose films are shown.

    Returns
    -------
    list of str
        The participants' names.

    Raises
    ------
    StimulusError
        For a protocol whose trials depend on the answers.
    """
    for study in protocol.studies:
        if isinstance(study.procedure, Adaptive):
            raise StimulusError(
                f"study {study.name!r}: expected trials that are known beforehand, found the procedure "
                f"{study.procedure.name!r}, whose trials depend on the answers; use `segue serve` or `segue play`."
            )
    frames = {record.id: record.frames for record in manifest.records}
    names = [f"p{number:03d}" for number in range(1, participants + 1)]
    sessions = [open_session(protocol, sent_plan(protocol, manifest, name), frames=frames) for name in names]
    for name, content in TOOLS[tool](manifest, sessions).items():
        write_whole(folder / name, content)
    for file in sorted((Path(__file__).parent / tool).iterdir()):
        write_whole(folder / file.name, file.read_bytes())
    return names


def sent_plan(protocol: Protocol, manifest: Manifest, participant: str) -> Plan:
    """The plan of a participant who was sent: `p001`, `p002`, ...

    Raises
    ------
    SessionError
        For another name.
    """
    if at_once := [study.name for study in protocol.studies if layout_of(study) == "side by side"]:
        raise SessionError(
            f"Expected studies whose films are shown one after another, as other programs get them, found "
            f"{', '.join(map(repr, at_once))} with films at once; run it with `segue serve` or `segue play`."
        )
    if not re.fullmatch(r"p\d{3,}", participant) or int(participant[1:]) < 1:
        raise SessionError(
            f"Expected a participant as `segue export-stimuli` names them (p001, p002, ...), found {participant!r}."
        )
    return draw_plan(protocol, manifest.pairs, participant, group=int(participant[1:]) - 1)


def _one_table(manifest: Manifest, sessions: Sequence[Session]) -> dict[str, str]:
    return {"trials.csv": _csv([row for session in sessions for row in _rows(manifest, session)], " ".join)}


def _conditions(manifest: Manifest, sessions: Sequence[Session]) -> dict[str, str]:
    """A table for each participant, whose cells with several keys PsychoPy reads as lists."""
    return {
        f"conditions_{session.plan.participant}.csv": _csv([*_rows(manifest, session)], repr) for session in sessions
    }


def _timelines(manifest: Manifest, sessions: Sequence[Session]) -> dict[str, str]:
    protocol = sessions[0].protocol
    told = {
        "title": protocol.texts.title or protocol.title,
        "language": protocol.language,
        "texts": protocol.texts.model_dump(mode="json") | protocol.consent.model_dump(mode="json"),
        "sessions": {
            session.plan.participant: [_shown(manifest, session, step) for step in session.steps if step.kind != "done"]
            for session in sessions
        },
    }
    return {"sessions.js": f"const SEGUE = {json.dumps(told, ensure_ascii=False, indent=1)};\n"}


Writer = Callable[[Manifest, Sequence[Session]], Mapping[str, str]]
TOOLS: dict[str, Writer] = {"csv": _one_table, "jspsych": _timelines, "psychopy": _conditions}
"""What each program is given: files by name. The folder of the same name holds what does not depend on the study."""


def _rows(manifest: Manifest, session: Session) -> Iterator[dict[str, Any]]:
    """A row a question, in the order in which they are asked; further ones about the same films have no films."""
    films: list[str] = []
    timing = session.protocol.timing
    for step in session.steps:
        if step.kind == "stimulus":
            films.append(_film(manifest, step))
        elif step.kind == "answer":
            options = _options(session, step)
            yield {
                **_key(session, step),
                "study": step.study,
                "role": step.role,
                **{f"film_{slot}": name for slot, name in enumerate(films, start=1)},
                "question": step.text,
                "answered_by": step.answered_by,
                "answers": [one["value"] for one in options],
                "keys": [one["key"] for one in options if one["key"]],
                **{name: getattr(step, name) for name in ("low", "middle", "high")},
                "right": right_answer(session.trial(step.trial)) or "",
                "gap_s": timing.gap_s,
                "answer_s": step.duration_s,
                "pause_s": timing.pause_s,
            }
            films = []


def _csv(rows: Sequence[Mapping[str, Any]], listed: Callable[[list[str]], str]) -> str:
    text = io.StringIO()
    columns = dict.fromkeys(name for row in rows for name in row)
    table = csv.DictWriter(text, [*columns], restval="", lineterminator="\n")
    table.writeheader()
    for row in rows:
        table.writerow({name: listed(cell) if isinstance(cell, list) else cell for name, cell in row.items()})
    return text.getvalue()


def _shown(manifest: Manifest, session: Session, step: Step) -> dict[str, Any]:
    """What a page needs to know of a step."""
    said: dict[str, Any] = {"kind": step.kind, "study": step.study, "role": step.role, "text": step.text}
    if step.stimulus:
        said["film"] = _film(manifest, step)
    if step.duration_s is not None:
        said["ms"] = round(1000 * step.duration_s)
    if step.kind == "form":
        said["key"] = dict(zip(KEY, (session.plan.participant, 0, step.study), strict=True))
        said["fields"] = [field.model_dump(mode="json") for field in session.protocol.form_of(step.study)]
    if step.kind == "answer":
        said |= {name: getattr(step, name) for name in ("answered_by", "low", "middle", "high")}
        said |= {"key": _key(session, step), "options": _options(session, step)}
        if step.role == "practice":
            trial = session.trial(step.trial)
            given = [Answer(step.trial, step.item, 1, value, 0.0, True) for value in step.legal]
            said["feedback"] = {str(one.value): feedback_text(session.protocol, trial, one) for one in given}
    return said


def _key(session: Session, step: Step) -> dict[str, Any]:
    return dict(zip(KEY, (session.plan.participant, step.trial, step.item), strict=True))


def _options(session: Session, step: Step) -> list[dict[str, str]]:
    return [] if step.answered_by == "slider" else answer_options(session.protocol, step.legal)


def _film(manifest: Manifest, step: Step) -> str:
    return str(manifest.videos[step.stimulus]["file"])
