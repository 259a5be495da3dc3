"""A psychometric function of one's own numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from study.errors import AnalysisError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from study.analysis.psychometric.posterior import PsychometricFit


def fit(
    levels: ArrayLike, yes: ArrayLike, shown: ArrayLike, *, task: str = "2afc", confidence: float = 0.95, **model: Any
) -> PsychometricFit:
    """Fit a psychometric function by a grid posterior, as `segue fit --task 2afc` (or `yes-no`) does.

    Parameters
    ----------
    levels : (blocks,)
        Stimulus levels.
    yes, shown : (blocks,)
        Answers "yes" (right answers in 2AFC), and all answers.
    model
        What `make_model` takes: `sigmoid` (`normal`, `logistic`, `gumbel`, `weibull`), `choices`, `guess`, `lapse`.

    Raises
    ------
    AnalysisError
        Where nothing can be fitted; it says why.
    """
    from study.analysis.psychometric.model import make_model
    from study.analysis.psychometric.posterior import fit_psychometric

    found = fit_psychometric(levels, yes, shown, make_model(task, **model), confidence=confidence)
    if isinstance(found, str):
        raise AnalysisError(found)
    return found
