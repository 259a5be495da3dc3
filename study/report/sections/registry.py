"""How each kind of result is shown, by the class of the result."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from study.analysis.oddity.analyse import Oddity, TwoAlternatives
from study.analysis.preference.analyse import Preference
from study.analysis.ratings.analyse import PairRatings, ParallelRatings, Ratings
from study.analysis.same_different.analyse import SameDifferent
from study.analysis.study_result import StudyResult
from study.analysis.yes_no.analyse import YesNo
from study.report.sections.oddity import section as oddity
from study.report.sections.pair_ratings import section as pair_ratings
from study.report.sections.preference import section as preference
from study.report.sections.ratings import section as ratings
from study.report.sections.same_different import section as same_different
from study.report.sections.section import SectionKind
from study.report.sections.yes_no import section as yes_no

SECTIONS: Mapping[type[StudyResult], SectionKind[Any]] = {
    SameDifferent: same_different.KIND,
    Preference: preference.KIND,
    Ratings: ratings.KIND,
    ParallelRatings: ratings.PARALLEL,
    PairRatings: pair_ratings.KIND,
    Oddity: oddity.KIND,
    TwoAlternatives: oddity.KIND,
    YesNo: yes_no.KIND,
}
