"""A rating study as a whole: its answers in; means, comparisons and cells out, or ratings of pairs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from study.analysis.ratings.answers import of_pairs
from study.analysis.ratings.comparisons import Question, rating_anova
from study.analysis.ratings.pairs import PairQuestion, pair_ratings, pair_sentences
from study.analysis.ratings.table import CellRating, MethodRating, rating_cells, rating_table
from study.analysis.ratings.words import anova_sentences
from study.counting import counted
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

    from study.analysis.study_result import Settings


@dataclass(frozen=True)
class Ratings:
    """The result of a study in which transitions were rated by themselves.

    Attributes
    ----------
    table
        How each method was rated in each question.
    questions
        Methods compared, a question each; empty where one method was rated.
    cells
        Means by method and by order of presentation.
    """

    keys: ClassVar[Mapping[str, str]] = {"ratings": "table", "rating_anova": "questions", "rating_cells": "cells"}

    table: tuple[MethodRating, ...]
    questions: tuple[Question, ...]
    cells: tuple[CellRating, ...]

    def sentences(self, alpha: float) -> list[str]:
        """Return the tests of each question in words, and the means."""
        means = [
            f"{': '.join(filter(None, (row.item, row.method)))}: mean {row.mean:.2f} over "
            f"{counted(row.participants, 'participant')}"
            for row in self.table
        ]
        return [*anova_sentences(self.questions, alpha), *means]


@dataclass(frozen=True)
class PairRatings:
    """The result of a study in which one method was rated beside another."""

    keys: ClassVar[Mapping[str, str]] = {"pair_ratings": "questions"}

    questions: tuple[PairQuestion, ...]

    def sentences(self, alpha: float) -> list[str]:
        """Return how the methods compare in each question, in words."""
        return pair_sentences(self.questions, alpha)


def analyse_ratings(answers: pd.DataFrame, name: str, settings: Settings) -> Ratings | PairRatings:
    """Analyse one rating study, by what was rated.

    Raises
    ------
    AnalysisError
        When pairs were rated on a scale of unknown points, or the answers can't be read.
    """
    confidence = settings.confidence
    if not of_pairs(answers):
        return Ratings(
            rating_table(answers, confidence), rating_anova(answers, confidence), rating_cells(answers, confidence)
        )
    if name not in settings.scale_points:
        raise AnalysisError(
            f"expected how many points the scale of {name!r} has, where pairs were rated, found none; name them in "
            "scale_points"
        )
    return PairRatings(pair_ratings(answers, settings.scale_points[name], confidence))
