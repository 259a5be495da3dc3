"""What the analysis of one study gives, and what it takes beside the answers: the shapes that all tasks share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Protocol

from study.analysis.preference.no_effect import MARGIN
from study.models.tracks import Rule

if TYPE_CHECKING:
    import pandas as pd

    from study.analysis.headline import Headline


class StudyResult(Protocol):
    """The result of one study: a frozen dataclass of its task.

    Attributes
    ----------
    keys
        Where JSON holds it: a key of the whole analysis, and the attribute that stands there under the study's name;
        the result itself where that is empty.
    """

    keys: ClassVar[Mapping[str, str]]

    def sentences(self, alpha: float) -> list[str]:
        """Return the answers of the study in words, at a level of significance."""

    def headlines(self, study: str, alpha: float, confidence: float) -> list[Headline]:
        """Return what the study of this name found, one for each question that it asks."""


@dataclass(frozen=True)
class Settings:
    """Preregistered settings of the analysis."""

    threshold: float = 0.75
    """Share of "different" that defines the just noticeable difference; above one half."""
    confidence: float = 0.95
    """Of all intervals."""
    alpha: float = 0.05
    """Level of significance that sentences speak of."""
    resamples: int = 1000
    seed: int = 0
    """`resamples`, `seed`: of the bootstrap over participants behind the standard errors; the same seed gives the
    same numbers."""
    margin: float = MARGIN
    """How far from an even split a preference may lie and count as none; 0.1 is 40 to 60%."""
    scale_points: Mapping[str, int] = field(default_factory=dict)
    """Points of the scale of each rating study, by its name; needed where pairs were rated."""
    tracks: Mapping[str, Rule] = field(default_factory=dict)
    """The rule of each study whose trials were chosen in tracks, by its name."""


@dataclass(frozen=True)
class TaskAnalysis:
    """How the answers to a task are analysed: a table of one study and its name in, a result of one of `kinds` out."""

    analyse: Callable[[pd.DataFrame, str, Settings], StudyResult]
    kinds: tuple[type[StudyResult], ...]
