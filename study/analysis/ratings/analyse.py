"""A rating study as a whole: its answers in; means and comparisons out, or ratings of pairs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from study.analysis.estimates import Interval
from study.analysis.headline import Headline, headline_of, holds_for
from study.analysis.ratings.answers import of_pairs, rated
from study.analysis.ratings.comparisons import MethodDifference, Question, rating_anova
from study.analysis.ratings.pairs import PairQuestion, pair_ratings, pair_sentences
from study.analysis.ratings.table import MethodRating, rating_table
from study.analysis.study_result import Settings
from study.counting import counted
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Ratings:
    """The result of a study in which transitions were rated by themselves: each method, and methods compared."""

    keys: ClassVar[Mapping[str, str]] = {"ratings": "table", "rating_anova": "questions"}

    table: tuple[MethodRating, ...]
    questions: tuple[Question, ...]

    def sentences(self, alpha: float) -> list[str]:
        """Return the tests of each question in words, and the means."""
        means = [_mean_in_words(row) for row in self.table]
        return [*anova_sentences(self.questions, alpha), *means]

    def headlines(self, study: str, alpha: float, confidence: float) -> list[Headline]:
        """Return each difference of two methods over participants, in each question; the means where there is none."""
        if not self.questions:
            return [
                headline_of(row, study, f"{_mean_in_words(row)}.",
                            f"points of the scale, {_what(row.item, row.method)}", confidence, test="none",
                            generalises_to=holds_for(row.participants),
                            note="; ".join(filter(None, (row.note, "one method: nothing to compare"))))
                for row in self.table
            ]  # fmt: skip
        omnibus = [_omnibus_headline(question, study, alpha, confidence) for question in self.questions]
        return [one for one in omnibus if one] + [
            headline_of(row, study, f"{question.item or 'rating'}: {_difference(row, alpha)}.",
                        f"points of the scale, {_what(question.item, row.of)}", confidence, test=row.test,
                        generalises_to=row.generalises_to, adjusted=row.holm_p_value)
            for question in self.questions for row in question.differences if row.participants
        ]  # fmt: skip


@dataclass(frozen=True)
class OwnRating:
    """How one participant rated a method that was shown among others: the mean value, and the mean rank on its pages.

    Rank 1 is the highest; equal values share the mean of their ranks.
    """

    participant: str
    method: str
    answers: int
    mean: float
    rank: float


@dataclass(frozen=True)
class ParallelRatings(Ratings):
    """The result of a study in which several methods were rated at once: `Ratings`, and those of each participant."""

    keys: ClassVar[Mapping[str, str]] = {"parallel_ratings": "participants"}

    participants: tuple[OwnRating, ...] = ()


@dataclass(frozen=True)
class PairRatings:
    """The result of a study in which one method was rated beside another."""

    keys: ClassVar[Mapping[str, str]] = {"pair_ratings": "questions"}

    questions: tuple[PairQuestion, ...]

    def sentences(self, alpha: float) -> list[str]:
        """Return how the methods compare in each question, in words."""
        return pair_sentences(self.questions, alpha)

    def headlines(self, study: str, alpha: float, confidence: float) -> list[Headline]:
        """Return the mean score of each question over participants."""
        return [
            headline_of(one.participants, study, f"{sentence}.",
                        f"points of the scale, {_what(one.item, one.of)} ({one.middle:g} is the same)", confidence,
                        test=one.participants.test, generalises_to=one.participants.generalises_to)
            for one, sentence in zip(self.questions, pair_sentences(self.questions, alpha), strict=True)
        ]  # fmt: skip


def analyse_parallel(answers: pd.DataFrame, name: str, settings: Settings) -> ParallelRatings:
    """Analyse one parallel rating study: a row a film, with the trial whose page it was on.

    Raises
    ------
    AnalysisError
        When the answers can't be read.
    """
    del name
    part = rated(answers)
    part["rank"] = part["rating"].groupby([part["participant"].astype(str), part["trial"]]).rank(ascending=False)
    own = tuple(
        OwnRating(str(who), str(method), len(rows), float(rows["rating"].mean()), float(rows["rank"].mean()))
        for (who, method), rows in part.groupby([part["participant"].astype(str), "method_a"], sort=True)
    )
    confidence = settings.confidence
    return ParallelRatings(rating_table(answers, confidence), rating_anova(answers, confidence), own)


def analyse_ratings(answers: pd.DataFrame, name: str, settings: Settings) -> Ratings | PairRatings:
    """Analyse one rating study, by what was rated.

    Raises
    ------
    AnalysisError
        When pairs were rated on a scale of unknown points, or the answers can't be read.
    """
    confidence = settings.confidence
    if not of_pairs(answers):
        return Ratings(rating_table(answers, confidence), rating_anova(answers, confidence))
    if name not in settings.scale_points:
        raise AnalysisError(
            f"expected how many points the scale of {name!r} has, where pairs were rated, found none; name them in "
            "scale_points"
        )
    return PairRatings(pair_ratings(answers, settings.scale_points[name], confidence))


def _mean_in_words(row: MethodRating) -> str:
    return f"{_what(row.item, row.method)}: mean {row.mean:.2f} over {counted(row.participants, 'participant')}"


def _what(item: str, of: str) -> str:
    """What a number is of, with the question where there are several."""
    return f"{item}: {of}" if item else of


def anova_sentences(questions: Sequence[Question], alpha: float) -> list[str]:
    """Each effect of each question in words, degrees of freedom always with it, and what holds over participants."""
    found = []
    for question in questions:
        name = question.item or "rating"
        found += [
            f"{name}: {row.source} F({row.degrees_of_freedom}, {row.error_degrees_of_freedom}) = {row.f:.2f}, "
            f"MS = {row.mean_square:.2f}, {_verdict(row.p_value, alpha)}"
            for row in question.anova[:3]
            if row.f is not None and row.p_value is not None
        ]
        if len(question.differences) > 1:
            found.append(f"{name}: {_omnibus(question, alpha)}")
        found += [f"{name}: {_difference(row, alpha)}" for row in question.differences if row.participants]
    return found


def _omnibus_headline(question: Question, study: str, alpha: float, confidence: float) -> Headline | None:
    """Whether several methods differ at all; None with two."""
    if len(question.differences) < 2:
        return None
    design = question.mixed_design
    row = next((effect for effect in design.effects if effect.source == "method"), None)
    p_value = row.corrected_p_value if row else None
    return Headline(
        study=study,
        statement=f"{question.item or 'rating'}: {_omnibus(question, alpha)}.",
        estimate=row.f if row else None,
        unit="F of all methods",
        interval=Interval(None, None, confidence),
        p=p_value,
        p_adjusted=p_value,
        test="analysis of variance within participants, corrected by Greenhouse and Geisser",
        generalises_to=holds_for(design.participants),
        note=design.note,
    )


def _verdict(p_value: float, alpha: float, name: str = "p") -> str:
    return f"{name} = {p_value:.3g} ({'' if p_value < alpha else 'not '}significant at {alpha:g})"


def _omnibus(question: Question, alpha: float) -> str:
    """Whether more than two methods differ at all over participants: by their means, and by ranks."""
    design, ranks = question.mixed_design, question.ranks.participants
    row = next((effect for effect in design.effects if effect.source == "method"), None)
    said = "all methods over participants"
    if row is None or row.f is None or row.corrected_p_value is None:
        said = f"{said}: {design.note}"
    else:
        said += (
            f" F({row.degrees_of_freedom}, {row.error_degrees_of_freedom}) = {row.f:.2f}, corrected by "
            f"Greenhouse and Geisser {_verdict(row.corrected_p_value, alpha)}"
        )
    return said if ranks is None else f"{said}; by ranks (Friedman) {_verdict(ranks.p_value, alpha)}"


def _difference(row: MethodDifference, alpha: float) -> str:
    """The difference of two methods, with what it holds for and its test, or why there is none."""
    said = f"{row.of} over {row.generalises_to} {row.mean:.2f}"
    if row.p_value is None or row.holm_p_value is None:
        return f"{said}; {row.note}"
    if row.t is None:
        return f"{said}, the same for all {row.participants}, {row.test} {_verdict(row.p_value, alpha)}"
    verdict = _verdict(row.holm_p_value, alpha, "p adjusted by Holm" if row.holm_p_value > row.p_value else "p")
    return f"{said} ({row.low:.2f} to {row.high:.2f}), t({row.degrees_of_freedom:.3g}) = {row.t:.2f}, {verdict}"
