"""A study of forced choices on the page: right answers, d' and thresholds in, headline, figure and tables out."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from study.analysis.analyse import Analysis
from study.analysis.oddity.analyse import ForcedChoice, OddityLevel
from study.analysis.psychometric.analyse import BelievedThreshold
from study.analysis.same_different.counts import SIGNS, Side
from study.counting import counted
from study.report import tables
from study.report.drawing import BLUE, INK, SOFT, Picture, new_figure, percent_axis, picture_of
from study.report.references import MACMILLAN_2005
from study.report.sections.section import About, Drawing, Headline, Section, SectionKind
from study.report.sections.staircases import staircase_table, tracks_drawing
from study.report.tables import Table


def oddity_section(result: ForcedChoice, about: About) -> Section | None:
    """Return the section of a study; None where nothing was answered."""
    if not result.levels:
        return None
    name = about.name
    caption = (
        "Right answers by difference in blend length: means over participants with confidence intervals (Student’s t), "
        "and psychometric functions of all answers. The dashed line is chance; the dotted one, at "
        f"{result.forced.halfway:.0%}, defines thresholds."
    )
    curves = {side: found.pooled.curve for side, found in result.functions.items()}
    lines = (100 * result.forced.chance, 100 * result.forced.halfway)
    picture = levels_figure(result.levels, curves, lines, "right answers", f"study-{name}-right", about.mark)
    return Section(
        anchor=f"study-{name}",
        title=about.title,
        headlines=(_headline(result, about.fps),),
        drawings=(
            Drawing(f"{name}_right", picture, caption),
            *([tracks_drawing(name, result.staircases, about.mark)] if result.staircases else []),
        ),
        tables=(_levels_table(name, result), _threshold_table(name, result, about.fps)),
        notes=(
            *([result.staircases.in_words()] if result.staircases else []),
            *(f"Blends that are {side}: {found.answer}" for side, found in result.functions.items()),
        ),
        folded=(staircase_table(name, result.staircases),) if result.staircases else (),
    )


def levels_figure(
    levels: Sequence[OddityLevel],
    curves: Mapping[Side, Sequence[tuple[float, float]]],
    lines: tuple[float | None, float],
    counted: str,
    name: str,
    mark: str,
) -> Picture:
    """Draw the percentage of answers by difference, with the curve of each side, and lines at chance and threshold."""
    with new_figure(7.2, 3.7) as (figure, axes):
        percent_axis(axes)
        for height, dashes in zip(lines, ((4, 2), (1, 2)), strict=True):
            if height is not None:
                axes.axhline(height, color=SOFT, linewidth=0.9, linestyle=(0, dashes), zorder=1)
        for side, curve in curves.items():
            line = [(SIGNS[side] * level, 100 * share) for level, share in curve]
            if line:
                axes.plot(*zip(*line, strict=True), color=BLUE, linewidth=1.8, zorder=3)
        for level in levels:
            if level.low is not None and level.high is not None:
                axes.plot([level.difference_frames] * 2, [level.low, level.high], color=INK, linewidth=1.1, zorder=4)
        ticks = [one.difference_frames for one in levels]
        axes.plot(ticks, [one.percent for one in levels], "o", color=INK, zorder=5)
        axes.set_xticks(ticks, [f"{tick:+d}".replace("-", "−") if tick else "0" for tick in ticks])
        axes.set_xlabel("difference in blend length from k, frames (shorter ← → longer)")
        axes.set_ylabel(counted)
        spoken = "; ".join(f"{one.difference_frames:+d} frames: {one.percent:.0f}%" for one in levels)
        return picture_of(figure, name, f"Percent of {counted} by difference in blend length", spoken, mark)


def frames_in_words(found: BelievedThreshold, fps: float) -> str:
    """Return "is 7.1 frames (0.237 s)", or why it is not known."""
    if found.value is None:
        return f"is not known ({found.note})"
    return f"is {found.value:.1f} frames ({found.value / fps:.3f} s)"


def _headline(result: ForcedChoice, fps: float) -> Headline:
    told = [f"for {side} blends it {frames_in_words(found, fps)}" for side, found in result.thresholds.items()]
    answers, people = sum(one.answers for one in result.levels), max(one.participants for one in result.levels)
    chance, right = f"{result.forced.chance:.0%}", f"{result.forced.halfway:.0%}"
    return Headline(
        f"The threshold for finding {result.found}, {right} right: {'; '.join(told)}.",
        f"{counted(answers, 'answer')} of {counted(people, 'participant')}; chance gives {chance} right.",
    )


def _levels_table(name: str, result: ForcedChoice) -> Table:
    return tables.make(
        f"{name}_right",
        f"Right answers by difference, over participants; p against chance (one in {result.forced.choices}); d-prime "
        f"of an observer of {result.forced.choices} percepts who is right as often (Macmillan & Creelman 2005).",
        "difference_frames participants answers percent low:one high:one p_value d_prime",
        [vars(level) for level in result.levels],
    )


def _threshold_table(name: str, result: ForcedChoice, fps: float) -> Table:
    rows = [
        {"side": side, "frames": found.value, "low": found.low, "high": found.high, "remark": found.note}
        | {"seconds": None if found.value is None else found.value / fps}
        for side, found in result.thresholds.items()
    ]
    right = f"{result.forced.halfway:.0%}"
    caption = f"Thresholds: the difference at which {right} of the answers are right; seconds at {fps:g} fps."
    return tables.make(f"{name}_thresholds", caption, "side frames seconds low high remark", rows)


def _methods(found: Collection[ForcedChoice], analysis: Analysis) -> str:
    del analysis
    named = {3: "three percepts of which the one farthest from the others", 2: "two percepts of which the larger one"}
    (choices,) = {one.forced.choices for one in found}
    return (
        f"Right answers of finding {next(iter(found)).found} are means over participants with Student’s intervals, "
        f"turned into d-prime by a model of {named[choices]} is named (Macmillan & Creelman 2005). Thresholds are "
        f"where a psychometric function with a guess rate of one in {choices} lies halfway between chance and its "
        "upper end, of a typical participant by a mixed model."
    )


KIND = SectionKind(oddity_section, _methods, lambda _: {MACMILLAN_2005})
