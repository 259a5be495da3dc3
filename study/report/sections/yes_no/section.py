"""A yes-no study on the page: answers "yes", d' and thresholds in, headline, figure and tables out."""

from __future__ import annotations

from collections.abc import Collection

from study.analysis.analyse import Analysis
from study.analysis.yes_no.analyse import YesNo
from study.counting import counted
from study.report import tables
from study.report.references import MACMILLAN_2005
from study.report.sections.oddity.section import frames_in_words, levels_figure
from study.report.sections.section import About, Drawing, Headline, Section, SectionKind
from study.report.sections.staircases import staircase_table, tracks_drawing
from study.report.tables import Table


def yes_no_section(result: YesNo, about: About) -> Section | None:
    """Return the section of a study; None where nothing was answered."""
    if not result.levels:
        return None
    name, alarms = about.name, result.false_alarms
    curves = {side: found.curve for side, found in result.sides.items()}
    lines = (alarms, 100 * result.share)
    caption = (
        "Answers “yes” by difference in blend length: means over participants with confidence intervals (Student’s t), "
        "and the curves of a typical participant. The dashed line is the rate of false alarms; the dotted one, at "
        f"{result.share:.0%}, defines thresholds."
    )
    picture = levels_figure(result.levels, curves, lines, "answers “yes”", f"study-{name}-yes", about.mark)
    notes = result.sentences(about.alpha)
    return Section(
        anchor=f"study-{name}",
        title=about.title,
        headlines=(_headline(result, about.fps),),
        drawings=(
            Drawing(f"{name}_yes", picture, caption),
            *([tracks_drawing(name, result.staircases, about.mark)] if result.staircases else []),
        ),
        tables=(_levels_table(name, result), _threshold_table(name, result, about.fps)),
        notes=tuple(notes),
        folded=(staircase_table(name, result.staircases),) if result.staircases else (),
    )


def _headline(result: YesNo, fps: float) -> Headline:
    told = [f"for {side} blends it {frames_in_words(found, fps)}" for side, found in result.thresholds.items()]
    answers, people = sum(one.answers for one in result.levels), max(one.participants for one in result.levels)
    alarms = "unknown" if result.false_alarms is None else f"{result.false_alarms:.0f}%"
    return Headline(
        f"The threshold, {result.share:.0%} “yes”: {'; '.join(told)}.",
        f"{counted(answers, 'answer')} of {counted(people, 'participant')}; false alarms: {alarms}.",
    )


def _levels_table(name: str, result: YesNo) -> Table:
    return tables.make(
        f"{name}_yes",
        "Answers “yes” by difference, over participants; p against the false alarms, paired; d-prime from the "
        "rates here and without a difference (Macmillan & Creelman 2005).",
        "difference_frames participants answers percent low:one high:one p_value d_prime",
        [vars(level) for level in result.levels],
    )


def _threshold_table(name: str, result: YesNo, fps: float) -> Table:
    rows = [
        {"side": side, "frames": own.threshold.value, "low": own.threshold.low, "high": own.threshold.high}
        | {"seconds": None if own.threshold.value is None else own.threshold.value / fps}
        | {"d_prime": own.d_prime, "criterion_free": own.criterion_free, "criterion": own.criterion}
        | {"remark": own.threshold.note}
        for side, own in result.sides.items()
    ]
    return tables.make(
        f"{name}_thresholds",
        f"Thresholds: the difference at which {result.share:.0%} of the answers are “yes”; d-prime a frame; the "
        "difference at which an observer with the best criterion would be right in 75% of the trials; the criterion, "
        f"in standard deviations above what no difference leaves; seconds at {fps:g} fps.",
        "side frames seconds low high d_prime:three criterion_free criterion remark",
        rows,
        headings={"d_prime": "d-prime a frame"},
    )


def _methods(found: Collection[YesNo], analysis: Analysis) -> str:
    del analysis
    share = next(iter(found)).share
    return (
        "Answers “yes” are means over participants with Student’s intervals. By equal-variance signal detection the "
        "percept rises with the difference; trials without a difference tell the criterion (Macmillan & Creelman "
        f"2005). D-prime a frame, and the threshold at which {share:.0%} of the answers are “yes”, are those of a "
        "typical participant by a mixed probit model, each side with the trials without a difference."
    )


KIND = SectionKind(yes_no_section, _methods, lambda _: {MACMILLAN_2005})
