"""Every procedure by name, and courses as plans store them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from study.experiment.procedures.constant_stimuli import Constant
from study.experiment.procedures.procedure import Course, Settings
from study.experiment.procedures.quest_plus import Quest
from study.experiment.procedures.staircase import Staircase
from study.tasks.trial import Pair

PROCEDURES: Mapping[str, type[Settings]] = {member.name: member for member in (Constant, Staircase, Quest)}


def course_to_json(course: Course) -> dict[str, Any]:
    """A course as plans store it."""
    return {**asdict(course), "settings": {"name": course.settings.name, **asdict(course.settings)}}


def course_from_json(data: Mapping[str, Any]) -> Course:
    """A course of a stored plan."""
    own = dict(data)
    pairs = tuple(
        Pair(**{**pair, "stimuli": tuple(pair["stimuli"]), "methods": tuple(pair["methods"])}) for pair in own["pairs"]
    )
    arrangements = tuple(tuple(members) for members in own["arrangements"])
    settings: dict[str, Any] = {
        key: tuple(value) if isinstance(value, list) else value for key, value in own["settings"].items()
    }
    procedure = PROCEDURES[settings.pop("name")](**settings)
    return Course(**{**own, "settings": procedure, "pairs": pairs, "arrangements": arrangements})
