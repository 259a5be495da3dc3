"""Views: what a page may know of a step. The state of a session comes in, JSON goes out.

A page learns which films to play and what to ask, and nothing of what an answer means: films have an address of their
own in every trial (a keyed hash) and all one size, so that even two showings of one stimulus can't be determined before
they are loaded.
"""

from __future__ import annotations

import hmac
from collections.abc import Callable
from functools import lru_cache
from typing import Any

from study.experiment.protocol.whole import Protocol
from study.experiment.session import Session, advanced, current, near, progress
from study.experiment.steps import Step, answer_options
from study.experiment.store.participants import Participant
from study.tasks.registry import layout_of, task_of

FILMS = "films"
"""Relative to the page, which a proxy may show under any path."""


def session_name(participant: Participant) -> str:
    """What a page keeps unsent answers under, so that on a shared computer nobody's are sent as another's."""
    return hmac.digest(participant.secret.encode(), b"session", "sha256").hex()[:16]


def film_name(participant: Participant, step: Step) -> str:
    """The name of a film in one showing: unguessable, and different for every slot, trial and attempt."""
    place = f"{step.kind}/{step.study}/{step.trial}/{step.attempt}/{step.slot}/{step.stimulus}"
    return _film_name(participant.secret, place)


@lru_cache(maxsize=4096)
def _film_name(secret: str, place: str) -> str:
    return hmac.digest(secret.encode(), place.encode(), "sha256").hex()[:40]


def step_key(session: Session) -> str:
    """The name of a step that is read, the same after a restart of the server."""
    step = current(session)
    trial = next((other.trial for other in near(session)[0]), 0)
    return f"{step.kind}/{step.study}/{trial}"


def films_due(session: Session) -> list[Step]:
    """The steps whose films a participant may load now: those of this trial and of what may follow, or the example."""
    step = current(session)
    due = [step] if step.kind == "instructions" and step.stimulus else []
    own, ahead = near(session)
    return due + [other for other in own if other.slot] + ahead


def to_view(session: Session) -> Session:
    """Past what a page does by itself: the pause, which belongs to the trial before it."""
    while current(session).kind == "pause":
        session = advanced(session)
    return session


def ahead(session: Session, fits: Callable[[Session], bool]) -> Session | None:
    """The session at the first step that fits, past what a page shows by itself; None where something is due before."""
    while not fits(session):
        if current(session).kind in ("answer", "done", "form", "consent"):
            return None
        session = advanced(session)
    return session


def view(session: Session, participant: Participant, film_bytes: int) -> dict[str, Any]:
    """What the page shows now; `film_bytes` is the size at which all films are sent."""
    step, protocol = current(session), session.protocol
    done, total = progress(session)
    shown: dict[str, Any] = {"kind": step.kind, "text": step.text, "progress": [done, total]}
    if step.slot == 1:
        return {**shown, **_trial(session, participant, film_bytes), "kind": "trial"}
    if step.kind == "answer":
        # The films of this trial were shown; further questions about them follow.
        return {**shown, **_asking(session, step), "films": [], "gap_s": 0, "ahead": [], "kind": "trial"}
    shown["step"] = step_key(session)
    if step.kind == "consent":
        shown |= {"agree": protocol.consent.agree, "decline": protocol.consent.decline}
    if step.kind == "form":
        shown["fields"] = [field.model_dump() for field in protocol.form_of(step.study)]
    if step.kind == "instructions":
        study = protocol.study(step.study) if step.study else None
        shown["fps"] = protocol.fps
        shown["example"] = _film(step, participant, film_bytes) if step.stimulus else None
        words = study is not None and task_of(study).kind == "word"
        shown["keys"] = answer_options(protocol, task_of(study).legal(study), study) if study and words else []
    return shown


def _trial(session: Session, participant: Participant, film_bytes: int) -> dict[str, Any]:
    own, ahead = near(session)
    question = next(other for other in own if other.kind == "answer")
    return {
        **_asking(session, question),
        "films": [_film(other, participant, film_bytes) for other in own if other.slot],
        "layout": layout_of(session.protocol.study(question.study)),
        "gap_s": next((other.duration_s for other in own if other.kind == "gap"), 0),
        "ahead": list({(film := _film(other, participant, film_bytes))["url"]: film for other in ahead}.values()),
    }


def _asking(session: Session, step: Step) -> dict[str, Any]:
    protocol = session.protocol
    return {
        "trial": step.trial,
        "attempt": step.attempt,
        "label": protocol.texts.practice if step.role == "practice" else "",
        "fps": protocol.fps,
        "pause_s": protocol.timing.pause_s,
        "question": _question(protocol, step),
    }


def _film(step: Step, participant: Participant, film_bytes: int) -> dict[str, Any]:
    return {"slot": step.slot, "url": f"{FILMS}/{film_name(participant, step)}.mp4", "bytes": film_bytes}


def _question(protocol: Protocol, step: Step) -> dict[str, Any]:
    study = protocol.study(step.study)
    return {
        "item": step.item,
        "text": step.text,
        "low": step.low,
        "middle": step.middle,
        "high": step.high,
        "window_s": step.duration_s,
        "options": [] if step.sliders else answer_options(protocol, step.legal, study),
        "slider": study.slider,
        "replays": study.replays,
        "kind": step.answered_by,
    }
