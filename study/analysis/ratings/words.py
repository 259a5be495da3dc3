"""Comparisons of rated methods in words: typed results in, sentences out."""

from __future__ import annotations

from collections.abc import Sequence

from study.analysis.ratings.comparisons import MethodDifference, Question


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
            found.append(f"{name}: {omnibus_in_words(question, alpha)}")
        found += [f"{name}: {difference_in_words(row, alpha)}" for row in question.differences if row.participants]
    return found


def _verdict(p_value: float, alpha: float, name: str = "p") -> str:
    return f"{name} = {p_value:.3g} ({'' if p_value < alpha else 'not '}significant at {alpha:g})"


def omnibus_in_words(question: Question, alpha: float) -> str:
    """Return whether more than two methods differ at all over participants: by their means, and by ranks."""
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


def difference_in_words(row: MethodDifference, alpha: float) -> str:
    """Return the difference of two methods over participants, with its test or why there is none."""
    said = f"{row.of} over participants {row.mean:.2f}"
    if row.p_value is None or row.holm_p_value is None:
        return f"{said}; {row.note}"
    if row.t is None:
        return f"{said}, the same for all {row.participants}, {row.test} {_verdict(row.p_value, alpha)}"
    verdict = _verdict(row.holm_p_value, alpha, "p adjusted by Holm" if row.holm_p_value > row.p_value else "p")
    return f"{said} ({row.low:.2f} to {row.high:.2f}), t({row.degrees_of_freedom}) = {row.t:.2f}, {verdict}"
