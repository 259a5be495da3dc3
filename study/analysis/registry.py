"""How the answers to each task are analysed, by the task's name."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from study.analysis.oddity.analyse import Oddity, TwoAlternatives, analyse_forced
from study.analysis.preference.analyse import Preference, analyse_preference
from study.analysis.ratings.analyse import PairRatings, ParallelRatings, Ratings, analyse_parallel, analyse_ratings
from study.analysis.same_different.analyse import SameDifferent, analyse_same_different
from study.analysis.study_result import TaskAnalysis
from study.analysis.yes_no.analyse import YesNo, analyse_yes_no
from study.errors import AnalysisError

ANALYSES: Mapping[str, TaskAnalysis] = {
    "same-different": TaskAnalysis(analyse_same_different, (SameDifferent,)),
    "preference": TaskAnalysis(analyse_preference, (Preference,)),
    "rating": TaskAnalysis(analyse_ratings, (Ratings, PairRatings)),
    "parallel-rating": TaskAnalysis(analyse_parallel, (ParallelRatings,)),
    "oddity": TaskAnalysis(partial(analyse_forced, Oddity), (Oddity,)),
    "2afc": TaskAnalysis(partial(analyse_forced, TwoAlternatives), (TwoAlternatives,)),
    "yes-no": TaskAnalysis(analyse_yes_no, (YesNo,)),
}


def analysis_of(task: str) -> TaskAnalysis:
    """Return how a task is analysed.

    Raises
    ------
    AnalysisError
        When there is no task of that name.
    """
    if task not in ANALYSES:
        raise AnalysisError(f"expected one of the tasks {', '.join(ANALYSES)}, found {task!r}")
    return ANALYSES[task]
