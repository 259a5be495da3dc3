"""A same-different study as a whole: its answers in, the just noticeable difference as published and corrected out.

2004 section 5.1: percentages and 75% crossings for all motions together, and the statement that performance did not
differ across motions. Beside it the differencing model, d-prime at each level, and both per motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from study.analysis import estimates
from study.analysis.same_different import fits as differencing
from study.analysis.same_different.independent import compare_rules, fit_independent, order_test, profile_intervals
from study.analysis.same_different.interpolation import (
    Counts,
    Threshold,
    count_answers,
    crossings,
    percent_different,
    same_different_answers,
)
from study.analysis.same_different.mixed import MixedThresholds, fit_mixed_thresholds
from study.analysis.same_different.model import ModelFit, fit_model
from study.counting import counted
from study.errors import AnalysisError
from study.models.differencing import ROOT_TWO, detected

if TYPE_CHECKING:
    import pandas as pd

FloatArray = NDArray[np.float64]


def analyse_jnd(
    answers: pd.DataFrame, *, level: float = 0.75, confidence: float = 0.95, resamples: int = 1000, seed: int = 0
) -> dict[str, Any]:
    """Analyse one same-different study.

    Parameters
    ----------
    answers
        Of one study.
    level
        Share of "different" at threshold.
    confidence, resamples, seed
        Of the intervals, and of the bootstrap behind the standard errors.

    Returns
    -------
    dict
        JSON-able: `participants`, `answers`, `missed`, `level`, `percent_different` (rows of Figure 6), `published`
        (crossings by side), `model` (`ModelFit` as a dict, or None: the group's curve), `model_note`, `mixed`
        (`MixedThresholds` as a dict, or None: the median observer, and the group), `mixed_note`, `d_prime` (rows by
        level), `clustering` (answers at the pairs with a difference), `motions` (the same per motion), `across_motions`
        (tests), `order` (share of "different" by which came first), `order_test` (`decision_rules.order_test`), `rules`
        (differencing against independent observations), `profile` (intervals by profile likelihood, by side),
        `answer` (a sentence).

    Raises
    ------
    AnalysisError
        When a column is missing or can't be read, or confidence or level is none.
    """
    estimates.check_share(confidence, "confidence")
    estimates.check_share(level, "level")
    rng = np.random.default_rng(seed)
    counts = count_answers(answers)
    published = crossings(counts, level=level, confidence=confidence, resamples=resamples, rng=rng)
    fitted = fit_model(counts, level=level, confidence=confidence)
    mixed = fit_mixed_thresholds(counts, level=level, confidence=confidence)
    moved = counts.differences != 0
    given = same_different_answers(answers)
    chosen = answers[answers["task"] == "same-different"] if "task" in answers.columns else answers
    result = {
        "participants": len(counts.participants),
        "answers": int(counts.shown.sum()),
        "missed": int(len(chosen) - len(given)),
        "level": level,
        "percent_different": percent_different(answers, confidence).to_dict("records"),
        "published": published,
        "model": fitted if isinstance(fitted, ModelFit) else None,
        "model_note": fitted.note if isinstance(fitted, ModelFit) else fitted,
        "mixed": mixed if isinstance(mixed, MixedThresholds) else None,
        "mixed_note": mixed.note if isinstance(mixed, MixedThresholds) else mixed,
        "d_prime": d_prime_table(counts, confidence),
        "clustering": estimates.clustering(counts.different[:, moved].sum(axis=1), counts.shown[:, moved].sum(axis=1)),
        "motions": _by_motion(given, level, confidence, resamples, rng),
        "across_motions": across_motions(given),
        "order": _by_order(given),
        "order_test": order_test(given),
        "rules": compare_rules(
            fit_independent(counts, level), fitted.log_likelihood if isinstance(fitted, ModelFit) else None
        ),
        "profile": profile_intervals(counts, level, confidence),
    }
    return {**dict(estimates.plain(result)), "answer": in_words(published, fitted, mixed, level)}


def in_words(
    published: Mapping[str, Threshold], fitted: ModelFit | str, mixed: MixedThresholds | str, level: float
) -> str:
    """Return the thresholds in sentences: as published, corrected, and those of the median observer."""
    first = f"Read off straight lines, as published, {100 * level:.0f}% of the answers are “different” at "
    first += _sides_in_words(published)
    if isinstance(fitted, str):
        return f"{first}. No model was fitted: {fitted}."
    text = f"{first}. By the differencing model the just noticeable difference is {_sides_in_words(fitted.jnd)}."
    if isinstance(mixed, str):
        return text
    return f"{text} That is the group's; the median observer's is {_sides_in_words(mixed.typical)}."


def _sides_in_words(thresholds: Mapping[str, Threshold]) -> str:
    parts = []
    for side, sign in (("longer", "+"), ("shorter", "−")):
        found = thresholds.get(side)
        if found is None:
            continue
        if found.frames is None:
            parts.append(f"nothing where the blend is {side} ({found.note})")
            continue
        error = f" ± {found.standard_error:.1f}" if found.standard_error is not None else ""
        parts.append(f"k {sign} {found.frames:.1f}{error} frames")
    return " and ".join(parts)


def _by_motion(
    given: pd.DataFrame, level: float, confidence: float, resamples: int, rng: np.random.Generator
) -> list[dict[str, Any]]:
    if "motion" not in given.columns:
        return []
    rows = []
    for motion, part in given.groupby(given["motion"].astype(str), sort=False):
        counts = count_answers(part)
        fitted = fit_model(counts, level=level, confidence=confidence)
        moved = counts.differences != 0
        shown, different = counts.shown[:, moved].sum(), counts.different[:, moved].sum()
        rows.append(
            {
                "motion": str(motion),
                "answers": int(counts.shown.sum()),
                "percent_where_different": 100 * different / shown if shown else None,
                "percent_where_same": _share(counts, ~moved),
                "note": "" if moved.any() and not moved.all() else "pairs with a difference only, or without one",
                "published": crossings(counts, level=level, confidence=confidence, resamples=resamples, rng=rng),
                "model": fitted if isinstance(fitted, ModelFit) else None,
                "model_note": fitted.note if isinstance(fitted, ModelFit) else fitted,
                "percent_different": percent_different(part, confidence).to_dict("records"),
            }
        )
    return rows


def _share(counts: Counts, levels: NDArray[np.bool_]) -> float | None:
    shown = float(counts.shown[:, levels].sum())
    return 100 * float(counts.different[:, levels].sum()) / shown if shown else None


def across_motions(given: pd.DataFrame) -> dict[str, Any]:
    """Test that performance is the same across motions (2004 section 5.1).

    Returns
    -------
    dict
        `chi_square`, `chi_square_degrees_of_freedom`, `chi_square_p_value`: correct and wrong answers by motion, every
        answer taken as independent. `f`, `f_degrees_of_freedom` (two), `f_p_value`: Hotelling's test on the
        participants' own percentages correct, which asks neither independence nor equal variances. `note`.
    """
    result: dict[str, Any] = dict.fromkeys(("chi_square", "chi_square_degrees_of_freedom", "chi_square_p_value"))
    result |= dict.fromkeys(("f", "f_degrees_of_freedom", "f_p_value"))
    if "motion" not in given.columns or given["motion"].nunique() < 2:
        return {**result, "note": "fewer than two motions"}
    correct = ((given["answer"] == "different") == (given["difference_frames"] != 0)).astype(float)
    motion = given["motion"].astype(str)
    result |= _pooled_chi_square(correct.groupby(motion).sum(), correct.groupby(motion).size())
    shares = correct.groupby([given["participant"].astype(str), motion]).mean().unstack().dropna()
    return result | _hotelling(shares.to_numpy(dtype=np.float64))


def _pooled_chi_square(right: pd.Series[float], shown: pd.Series[int]) -> dict[str, Any]:
    yes, total = right.to_numpy(dtype=np.float64), shown.to_numpy(dtype=np.float64)
    share, freedom = yes.sum() / total.sum(), len(yes) - 1
    if share in (0.0, 1.0):
        return {}
    statistic = float(((yes - total * share) ** 2 / (total * share * (1 - share))).sum())
    return {
        "chi_square": statistic,
        "chi_square_degrees_of_freedom": freedom,
        "chi_square_p_value": estimates.chi_square_probability(statistic, freedom),
    }


def _hotelling(shares: FloatArray) -> dict[str, Any]:
    """Hotelling's one-sample test that all columns have one mean; rows are participants."""
    count, motions = shares.shape
    contrasts = shares[:, 1:] - shares[:, :1]
    size = motions - 1
    if count <= size + 1:
        return {
            "note": f"{counted(count, 'participant is', 'participants are')} too few for a test across "
            f"{counted(motions, 'motion')}"
        }
    spread = np.atleast_2d(np.cov(contrasts, rowvar=False))
    if np.linalg.matrix_rank(spread, tol=1e-9) < size:
        return {"note": "participants' differences between motions do not vary enough for a test"}
    mean = contrasts.mean(axis=0)
    squared = count * float(mean @ np.linalg.solve(spread, mean))
    statistic = squared * (count - size) / (size * (count - 1))
    probability = estimates.f_probability(statistic, size, count - size)
    return {"f": statistic, "f_degrees_of_freedom": [size, count - size], "f_p_value": probability, "note": ""}


def _by_order(given: pd.DataFrame) -> list[dict[str, Any]]:
    """Share of "different" where the reference came first and where it came second.

    Under the differencing rule the order does not matter; a gap points to a drift between first and second, or to
    another rule.
    """
    if "reference_first" not in given.columns or given["reference_first"].isna().all():
        return []
    known = given[given["reference_first"].notna() & (given["difference_frames"] != 0)]
    rows = []
    for first, part in known.groupby(known["reference_first"].astype(bool), sort=True):
        different = int((part["answer"] == "different").sum())
        rows.append({"reference_first": bool(first), "answers": len(part), "percent": 100 * different / len(part)})
    return rows


# d-prime


def d_prime(
    hits: float, different_pairs: float, alarms: float, same_pairs: float, confidence: float = 0.95
) -> dict[str, float | None]:
    """Return d-prime and criterion under the differencing rule, for a table of hits and false alarms.

    Parameters
    ----------
    hits, different_pairs
        Answers "different" of all answers where there was a difference.
    alarms, same_pairs
        The same where there was none.
    confidence
        Of the interval.

    Returns
    -------
    dict
        `d_prime`, `criterion` (standard deviations of one impression), `standard_error` (of d-prime, by the delta
        method), `low`, `high` (profile likelihood); answers are taken as independent. None where there are no pairs of
        a kind, and `high` where the answers set no upper end. d-prime is 0 where hits do not exceed false alarms.

    Raises
    ------
    AnalysisError
        For counts that can't be.

    Notes
    -----
    One half is added to each count of answers, one to each count of pairs (Hautus 1995), so that 0 and 100% stay
    finite; this pulls d-prime towards 0 where there are few answers. The interval is that of the counts as they are.
    """
    from scipy.optimize import brentq
    from scipy.special import ndtri

    for yes, pairs in ((hits, different_pairs), (alarms, same_pairs)):
        if not 0 <= yes <= pairs < np.inf:
            raise AnalysisError(
                f"expected counts with 0 <= different <= pairs, found {yes} of {counted(pairs, 'pair')}; count again"
            )
    if different_pairs == 0 or same_pairs == 0:
        return dict.fromkeys(("d_prime", "criterion", "standard_error", "low", "high"))
    hit, alarm = (hits + 0.5) / (different_pairs + 1), (alarms + 0.5) / (same_pairs + 1)

    def solve(hit: float, alarm: float) -> float:
        criterion = np.full(1, -ROOT_TWO * ndtri(alarm / 2))
        if hit <= alarm:
            return 0.0
        found = brentq(lambda delta: float(detected(np.full(1, delta), criterion)[0]) - hit, 0.0, 40.0)
        return float(found)

    value, step = solve(hit, alarm), 1e-5
    error = None
    if value > 0:
        by_hit = (solve(hit + step, alarm) - solve(hit - step, alarm)) / (2 * step)
        by_alarm = (solve(hit, alarm + step) - solve(hit, alarm - step)) / (2 * step)
        variance = by_hit**2 * hit * (1 - hit) / different_pairs + by_alarm**2 * alarm * (1 - alarm) / same_pairs
        error = float(np.sqrt(variance))
    low, high = differencing.d_prime_interval(hits, different_pairs, alarms, same_pairs, confidence)
    criterion = float(-ROOT_TWO * ndtri(alarm / 2))
    return {"d_prime": value, "criterion": criterion, "standard_error": error, "low": low, "high": high}


OPEN = "no more “different” than without a difference, or no end above: what is missing can't be told"


def d_prime_table(counts: Counts, confidence: float = 0.95) -> list[dict[str, Any]]:
    """Return d-prime at every level against the pairs with no difference, answers pooled over participants."""
    same = counts.differences == 0
    alarms, same_pairs = float(counts.different[:, same].sum()), float(counts.shown[:, same].sum())
    rows: list[dict[str, Any]] = []
    for level in np.flatnonzero(~same):
        hits, pairs = float(counts.different[:, level].sum()), float(counts.shown[:, level].sum())
        found = d_prime(hits, pairs, alarms, same_pairs, confidence)
        note = "" if None not in found.values() else "no pairs to tell it by" if found["d_prime"] is None else OPEN
        rows.append({"difference_frames": float(counts.differences[level]), **found, "note": note})
    return rows
