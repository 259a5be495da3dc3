"""Protocols with every task, and with every procedure for each task that takes it, built from the registries; and what
a walk through one must leave behind.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator

import pandas as pd
import sqlalchemy as sa
from serving import PROTOCOL

from study.experiment.procedures.registry import PROCEDURES
from study.experiment.protocol.whole import Protocol
from study.experiment.session import open_session, walk
from study.experiment.starting import OF_TASK
from study.experiment.steps import Step
from study.experiment.store.answers import record_answer, stored_answers
from study.experiment.store.frames import ROLES, answers_frame
from study.experiment.store.responses import Responses, open_responses
from study.experiment.store.sessions import all_sessions, begin_session
from study.experiment.store.tables import presentations
from study.tasks.registry import TASKS
from study.tasks.trial import PLACES, Trial

HEAD = """\
name = "every"
title = "One of each"
fps = 30
seed = 3

[stimuli]
width = 160
height = 120
entry_s = 0.2
exit_s = 0.2

[timing]
gap_s = 0.1
pause_s = 0.1
answer_s = 30.0
show_again = 0

[points]
shortest_frames = 4
longest_frames = 12

[texts]
debrief = "That was about passages."

[[transitions]]
name = "walk_run"
category = "walking"
source = "walk"
destination = "jog"
"""

MORE = {
    "same-different": "confidence_points = 4\npractice = 1\nattention_checks = 1",
    "preference": 'ties = true\nconfidence_points = 5\nform = [{ name = "why", label = "Why?", kind = "free-text" }]',
    "rating": 'slider = "ticks"',
    "pair-rating": 'show = "pair"\norder = "by-group"',
    "parallel-rating": 'hidden_reference = "inertialize"\npractice = 1\nattention_checks = 1\nreplays = 1',
}
"""What tasks are asked for besides, so that every kind of answer, of trial and of order comes."""

BESIDE = """
[[studies]]
name = "beside"
task = "preference"
instructions = ""
reference = "geodesic"
comparison = "fixed"
side_by_side = true
replays = 1
"""

ADAPTIVE = {
    "staircase": """
start_frames = 3
most_frames = 9
steps_frames = [2, 1]
reversals = 4
averaged = 2
""",
    "quest-plus": """
most_frames = 9
threshold_frames = 3.0
narrow = 2.5
least_trials = 6
""",
}
"""Keys of each procedure that chooses trials by the answers."""

LEVELLED = tuple(task.name for task in TASKS.values() if "differences_frames" in task.keys)
"""Tasks that take them."""


def study_of(name: str) -> str:
    """The study of a task as `segue new` writes it, as short as it can be."""
    task = TASKS[name]
    first = OF_TASK[task.asked_as]
    keys = first.keys.format(differences=[-2, 0] if 0 in first.steps else [-2], repeats=2)
    keys = re.sub(r"repeats = \d+\n", "", keys) if "balanced" not in keys else keys
    keys = re.sub(r"(?m) *#.*$|^replays.*$", "", keys.replace('order = "both"', 'order = "random"'))
    head = f'\n[[studies]]\nname = "each_{name}"\ntask = "{task.asked_as}"\ninstructions = ""\n'
    return f"{head}{keys}\n{MORE.get(name, '')}\n{first.tables}"


def every_study() -> str:
    """Studies of all tasks; two films stand beside each other, too."""
    return "".join(map(study_of, TASKS)) + BESIDE


def every_page() -> str:
    """The same in a session with everything else that a page can be: consent, form, breaks, debriefing."""
    head = PROTOCOL[: PROTOCOL.index("[[studies]]")].replace("answer_s = 3.0", "answer_s = 30.0\nshow_again = 0")
    return head + every_study()


def track(name: str, procedure: str, most_trials: int = 8) -> str:
    """A study whose task's levels are chosen by a procedure."""
    catch = 4 if 0 in OF_TASK[name].steps else 0
    study = re.sub(r"(?m)^(differences_frames|order|practice|attention_checks).*\n", "", study_of(name))
    study = study.replace(f'name = "each_{name}"', f'name = "{name}_{procedure}"')
    more = f'side = "longer"\nmost_trials = {most_trials}\ncatch_every = {catch}\n'
    return f'{study}\n[studies.procedure]\nname = "{procedure}"{ADAPTIVE[procedure]}{more}'


def all_tracks() -> Iterator[tuple[str, str]]:
    """Each task with each of the procedures that choose its levels."""
    assert set(ADAPTIVE) == set(PROCEDURES) - {"constant"}
    return ((task, procedure) for procedure in ADAPTIVE for task in LEVELLED)


def table(responses: Responses) -> pd.DataFrame:
    """All answers, without when they were given."""
    return answers_frame(responses, all_attempts=True, roles=ROLES).drop(columns="answered_at")


def check_walked(responses: Responses, protocol: Protocol) -> pd.DataFrame:
    """Whether one participant's table is that of a simulation with the same answers, and what was shown belongs to it.

    A walk that was reloaded or killed leaves nothing else; returns the table.
    """
    (record,) = all_sessions(responses)
    given = iter(stored_answers(responses, record.id))

    def respond(trial: Trial, step: Step) -> tuple[str | None, float | None]:
        nonlocal answer
        answer = next(given)
        assert (answer.trial, answer.attempt, answer.item) == (trial.trial, step.attempt, step.item)
        return answer.value, answer.response_s

    answer = None
    forms = {"consent", "form", *(f"form/{study.name}" for study in protocol.studies)}
    stimuli = {}
    with open_responses("sqlite://") as simulated:
        own = begin_session(simulated, protocol, record.plan)
        session = open_session(protocol, record.plan, passed=forms)
        for trial, again in walk(session, respond, lambda _trial, _step: answer.shown_well):
            record_answer(simulated, own, trial, again)
            stimuli[trial.trial] = dict(zip(PLACES, trial.stimuli, strict=False))
        assert next(given, None) is None
        found = table(responses)
        pd.testing.assert_frame_equal(found, table(simulated))
    with responses.engine.connect() as connection:
        shown = connection.execute(sa.select(presentations)).mappings().all()
    assert {row["trial"] for row in shown} == set(stimuli)
    assert all(row["stimulus"] == stimuli[row["trial"]][row["place"]] for row in shown)
    assert all("apart_frames" in json.loads(row["detail_json"]) for row in shown if row["place"] in PLACES[3:])
    return found
