"""A task is whole: words, simulated observer, columns, analysis, section, power effect, page parts, documentation."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from study.analysis.registry import ANALYSES, analysis_of
from study.apps.player.loop import LAYOUTS
from study.apps.player.screens import ANSWERS
from study.errors import AnalysisError
from study.experiment.observers import person
from study.experiment.procedures.constant_stimuli import Constant
from study.experiment.procedures.registry import PROCEDURES
from study.experiment.protocol.languages import languages, words
from study.experiment.protocol.texts import Keys, Texts
from study.power.registry import EFFECTS, OF_PROCEDURES
from study.report.sections.registry import SECTIONS
from study.tasks.answer import Answer
from study.tasks.observer import default_observer
from study.tasks.registry import NAMES, TASKS, answer_columns, orders_of, task_of, task_of_trial
from study.tasks.task import Item, Kind, Task
from study.tasks.trial import PLACES, Pair, trial_of

ROOT = Path(__file__).parents[1]
KINDS = [kind for analysis in ANALYSES.values() for kind in analysis.kinds]


@dataclass(frozen=True)
class Study:
    """A study that has what any task may ask of it."""

    task: str
    show: str | None = None
    name: str = "asked"
    reference: str = "geodesic"
    comparison: str | None = "fixed"
    differences_frames: tuple[int, ...] = (-6, 6, 12)
    order: str = "random"
    repeats: int = 1
    scale_points: int = 5
    items: tuple[Item, ...] = ()
    others: tuple[str, ...] = ()
    sets: int | None = None
    ties: bool = False
    confidence_points: int | None = None
    slider: str | None = None
    side_by_side: bool = False
    replays: int = 0
    hidden_reference: str | None = None

    @property
    def methods(self) -> tuple[str, ...]:
        return (self.reference, *filter(None, (self.comparison, *self.others)))


def study_of(task: Task) -> Study:
    """A study with this task."""
    others = () if task.slots else ("cut",)  # with three methods, where the study decides how many there are
    show = task.name.removesuffix(f"-{task.asked_as}") if task.name != task.asked_as else None
    return Study(task.asked_as, show, others=others)


every_task = pytest.mark.parametrize("task", TASKS.values(), ids=list(TASKS))


def test_every_task_has_an_analysis_and_an_effect() -> None:
    assert set(ANALYSES) == set(EFFECTS) == set(NAMES)


def test_every_procedure_that_waits_for_answers_has_an_effect() -> None:
    assert set(OF_PROCEDURES) == set(PROCEDURES) - {Constant.name}


def test_every_kind_of_result_has_a_section_and_keys_of_its_own() -> None:
    assert set(SECTIONS) == set(KINDS)
    keys = [key for kind in KINDS for key in kind.keys]
    assert len(set(keys)) == len(keys)
    for kind in KINDS:
        assert set(kind.keys.values()) <= {"", *kind.__dataclass_fields__}  # type: ignore[attr-defined]


def test_an_unknown_task_is_refused() -> None:
    with pytest.raises(AnalysisError, match=r"expected one of the tasks .*, found 'guessing'"):
        analysis_of("guessing")


@every_task
def test_a_task_is_found_by_its_study_and_by_its_trials(task: Task) -> None:
    study = study_of(task)
    assert task_of(study) is task
    for condition in task.conditions(study, False):
        stimuli = tuple(f"stimulus-{place}" for place, _ in enumerate(condition.methods))
        pair = Pair("p", "asked", task.asked_as, "m", "c", stimuli, condition.methods, condition.difference_frames)
        for members in orders_of(study):
            assert task_of_trial(trial_of(pair, members, 1)) is task
            assert set(members) == set(range(len(stimuli)))


@every_task
@pytest.mark.parametrize("language", languages())
def test_a_task_has_words_in_every_language(task: Task, language: str) -> None:
    table = words(language)
    needed = {task.instructions, task.welcome, *filter(None, (task.question,))}
    assert {name for name in needed if not table["standard"].get(name, "").strip()} == set()
    if task.kind == "word":
        own = (
            table["texts"] if language != "en" else {name: field.default for name, field in Texts.model_fields.items()}
        )
        assert set(task.legal(study_of(task))) <= set(own)


@every_task
def test_words_have_keys_that_differ_and_slots_have_names(task: Task) -> None:
    assert task.slots <= len(PLACES)
    if task.kind == "word":
        keys = [Keys.model_fields[value].default for value in task.legal(study_of(task))]
        assert len(set(keys)) == len(keys)


@every_task
def test_a_simulated_person_gives_answers_that_count_and_mean_something(task: Task) -> None:
    study = study_of(task)
    who = person(default_observer(), "sim-001", 3)
    legal, rng = task.legal(study), np.random.default_rng(1)
    (condition, *_), members = task.conditions(study, False), orders_of(study)[-1]
    stimuli = tuple(f"stimulus-{place}" for place, _ in enumerate(condition.methods))
    pair = Pair("p", "asked", task.asked_as, "m", "c", stimuli, condition.methods, condition.difference_frames)
    trial = replace(trial_of(pair, members, 1), trial=1)
    given = [task.judge(who, trial, legal, rng) for _ in range(200)]
    assert {part for value, _ in given for part in value.split(" ")} <= set(legal)
    assert all(0 <= ease <= 1 for _, ease in given)
    right = task.right(trial)
    assert right is None or right in legal
    row = answer_columns(trial, Answer(1, "", 1, given[0][0], 1.0))
    assert row["correct"] == (None if right is None else given[0][0] == right)
    task.truth(default_observer(), study, 0.75, [1.0])
    assert task.in_words(study, lambda method: method)


@every_task
def test_a_task_that_compares_says_how_one_property_alone_would_be_answered(task: Task) -> None:
    if task.slots in (0, 1):
        assert task.shortcut is None
        return
    assert task.shortcut is not None
    nothing = np.zeros(1)
    assert task.shortcut.share(nothing, nothing) == pytest.approx(task.shortcut.chance, abs=1e-6)
    assert task.shortcut.share(np.array([1.0]), nothing) > task.shortcut.chance + 0.02
    assert task.shortcut.share(np.array([9.0]), nothing) > 0.99


@every_task
def test_the_page_has_a_part_for_the_layout_and_for_the_kind_of_answer(task: Task) -> None:
    script = (ROOT / "study/apps/pages/trial.js").read_text(encoding="utf-8")
    layouts = re.search(r"const LAYOUTS = \{(.*?)\};", script, re.DOTALL)
    answers = re.search(r"const ANSWERS = \{(.*?)\};", script, re.DOTALL)
    assert layouts is not None
    assert answers is not None
    assert f'"{task.layout}":' in layouts[1]
    assert set(get_args(Kind)) == {part.split(":")[0].strip() for part in answers[1].split(",")}


@every_task
def test_the_window_has_a_part_for_the_layout_and_for_the_kind_of_answer(task: Task) -> None:
    assert task.layout in LAYOUTS
    assert set(get_args(Kind)) == set(ANSWERS)


@every_task
def test_a_task_is_documented(task: Task) -> None:
    for page in ("protocols", "analysis"):
        text = (ROOT / f"docs/{page}.md").read_text(encoding="utf-8")
        assert re.search(rf"\b{task.asked_as}\b", text, re.IGNORECASE), page
