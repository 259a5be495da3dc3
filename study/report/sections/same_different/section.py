"""A same-different study on the page: the analysis of `analyse_jnd` in, headline, figures, tables and notes out.

2004 section 5.1 and Figure 6; every threshold is given as published (linear interpolation) and corrected (model).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from study.analysis.analyse import Analysis
from study.analysis.same_different.analyse import SameDifferent
from study.analysis.same_different.counts import PRINTED, Side, Threshold
from study.analysis.same_different.mixed import MixedThresholds
from study.analysis.same_different.model import ModelFit
from study.analysis.same_different.staircases import Staircases
from study.counting import counted
from study.report import words
from study.report.references import (
    AS_SAMPLES,
    CLARK_1973,
    FIELLER_1954,
    MACMILLAN_2005,
    SATTERTHWAITE_1946,
    WILSON_1927,
)
from study.report.sections.same_different import figures
from study.report.sections.same_different.tables import (
    d_prime_table,
    motion_table,
    own_table,
    percent_table,
    threshold_tables,
)
from study.report.sections.section import About, Drawing, Headline, Section, SectionKind
from study.report.sections.staircases import staircase_table, tracks_drawing
from study.transitions.methods.method import WANG_2004

if TYPE_CHECKING:
    pass


SUBJECTS: Mapping[str, Callable[[int], str]] = {
    "collected": lambda count: counted(count, "person", "people"),
    "simulated": lambda count: counted(count, "simulated observer"),
    "mixed": lambda count: f"{counted(count, 'participant')}, people and simulated observers together,",
}
"""Who answered, as the subject of a sentence."""


def same_different_section(result: SameDifferent, about: About) -> Section:
    """Return the section of a same-different study."""
    motions = sorted(result.motions, key=lambda row: about.place(row.motion))
    result, name = replace(result, motions=tuple(motions)), about.name
    several = len(result.motions) > 1
    used, others = threshold_tables(name, result, about.fps)
    return Section(
        anchor=f"study-{name}",
        title=about.title,
        headlines=(headline(result, about),),
        drawings=tuple(_drawings(result, about)),
        tables=(used,),
        notes=(*_notes(result), *_weber(result, about.lengths)),
        folded=(
            *([others] if others.rows else []),
            percent_table(name, result),
            *([motion_table(name, result, about)] if several else []),
            d_prime_table(name, result),
            *([own_table(name, result)] if len(result.own) > 1 else []),
            *([staircase_table(name, result.staircases)] if result.staircases else []),
        ),
    )


def _drawings(result: SameDifferent, about: About) -> Iterator[Drawing]:
    name, mark = about.name, about.mark
    yield Drawing(
        f"{name}_curve",
        figures.same_different_figure(result, f"study-{name}-curve", mark),
        "Answers “different” by the difference in blend length from k, the length that the reference method gives. "
        "Points: means over participants ± one standard error, interpolated linearly as in 2004. Blue "
        "curve: the median observer by the mixed model (without one, the differencing model of all answers); its drop "
        "lines are the just noticeable differences, the bars at their feet confidence intervals.",
    )
    yield Drawing(
        f"{name}_thresholds",
        figures.thresholds_figure(result, f"study-{name}-thresholds", mark),
        "The just noticeable difference with confidence intervals. All motions: of the median observer, as in the "
        "headline, and by linear interpolation (Fieller’s, over participants); each motion: one model of all answers "
        "(jackknife over participants). Without a bar, the interval reaches beyond the levels shown.",
    )
    if len(result.motions) > 1:
        svg = figures.motions_figure(result, f"study-{name}-motions", mark)
        yield Drawing(
            f"{name}_motions", svg, "The same for every motion by itself: means ± one standard error, and the model."
        )
    if result.staircases:
        yield tracks_drawing(name, result.staircases, mark)


# In words


def headline(result: SameDifferent, about: About) -> Headline:
    """Return the just noticeable difference as a statement and what it rests on."""
    if not result.answers:
        missed = result.missed
        why = f"all {counted(missed, 'question')} had no response" if missed else "there are no answers"
        return Headline(f"No just noticeable difference can be given: {why}.", "")
    who, fps = SUBJECTS[about.data](result.participants), about.fps
    found = result.believed
    places = _places(result, found.jnd if found else result.published, fps)
    if not places:
        return Headline(
            f"No just noticeable difference can be given from the answers of {who}.", _detail(result, about)
        )
    of = f"the median of {who}" if result.mixed else who
    statement = f"The just noticeable difference of {of} is estimated at {places} ({_percent(result)} “different”)"
    if found and (free := _places(result, found.criterion_free, fps, told_beyond=False)):
        statement += f"; whatever the criterion, at {free}"
    return Headline(f"{statement}.", _detail(result, about))


def _percent(result: SameDifferent) -> str:
    return f"{100 * result.level:.0f}%"


def _places(result: SameDifferent, chosen: Mapping[Side, Threshold], fps: float, *, told_beyond: bool = True) -> str:
    """Where the thresholds are; those beyond the levels shown only if asked."""
    places = [_place(result, chosen.get(side), side, fps, told_beyond) for side in PRINTED]
    return words.joined([place for place in places if place])


def _place(result: SameDifferent, found: Threshold | None, side: Side, fps: float, told_beyond: bool) -> str:
    """Where the threshold is, or beyond which level it lies; empty where neither can be told."""
    if found is not None and found.frames is not None:
        return f"{found.frames:.1f} frames ({found.frames / fps:.2f} s) {side}"
    sign = 1 if side == "longer" else -1
    levels = sorted(
        (row for row in result.percent_different if told_beyond and sign * row.difference_frames > 0),
        key=lambda row: abs(row.difference_frames),
    )
    # Wilson's interval has to agree: a single answer is no evidence.
    if levels and levels[0].low is not None and levels[0].low > 100 * result.level:
        return f"less than {counted(abs(levels[0].difference_frames), 'frame')} {side}"
    if levels and all(row.high is not None and row.high < 100 * result.level for row in levels):
        return f"more than {counted(abs(levels[-1].difference_frames), 'frame')} {side}"
    return ""


def _detail(result: SameDifferent, about: About) -> str:
    size = f"{counted(result.answers, 'answer')} of {counted(result.participants, 'participant')}"
    found, parts = result.believed, []
    if found:
        model = "Mixed differencing model" if result.mixed else "Differencing model"
        ends = [f"{_ends(one)} {side}" for side in PRINTED if (one := found.jnd.get(side)) and _closed(one)]
        over = f"; {about.interval}s across {found.generalises_to}: {words.joined(ends)}" if ends else ""
        parts.append(
            f"{model}, {size}{over}. {_percent(result)} “different” moves with how readily participants say so; the "
            f"second threshold is where {_percent(result)} would be right by the best criterion, and rests on "
            "sensitivity alone."
        )
    else:
        parts.append(f"Linear interpolation, {size}. No model was fitted: {result.model_note}.")
    chosen = found.jnd if found else result.published
    absent = [side for side in PRINTED if side in chosen and chosen[side].frames is None]
    parts += [f"Where the blend was {side}: {chosen[side].note}." for side in absent]
    if found:
        published = result.published
        places = [f"k {sign} {_frames(published[side])}" for side, sign in PRINTED.items() if side in published]
        parts.append(f"Linear interpolation, as published in 2004: {words.joined(places)} frames.")
    return " ".join(parts)


def _closed(threshold: Threshold) -> bool:
    return threshold.interval.low is not None or threshold.interval.high is not None


def _ends(threshold: Threshold) -> str:
    return words.interval(threshold.interval.low, threshold.interval.high, unit=" frames")


def _frames(threshold: Threshold) -> str:
    return f"{threshold.frames:.1f}" if threshold.frames is not None else f"({threshold.note})"


def _staircase_note(found: Staircases) -> str:
    spreads = [f"{spread:.1f} frames {side}" for side, spread in found.spread.items()]
    spread = f"; within a {found.title} it is uncertain by {words.joined(spreads)} (standard deviation)"
    return (
        f"Trials were chosen by {found.title}s. Their threshold is where {found.meaning}: the {found.estimate} of "
        f"each, averaged over the {found.title}s of a participant and then over participants"
        f"{spread if spreads else ''}. "
        "The differencing model is fitted to all trials; linear interpolation between rarely shown levels means little "
        "here."
    )


def _notes(result: SameDifferent) -> list[str]:
    """What the thresholds rest on, and the tests beside them, one sentence each."""
    notes = [_staircase_note(result.staircases)] if result.staircases else []
    if result.model:
        notes += _model_notes(result.model)
    if result.mixed:
        notes.append(_mixed_note(result.mixed))
    elif result.mixed_note:
        notes.append(f"No mixed model was fitted: {result.mixed_note}.")
    order = result.order_test
    if order.p_value is not None and order.difference_percent is not None:
        notes.append(
            f"By order: {words.signed(order.difference_percent)} percentage points more “different” if the "
            f"reference came first, {words.p(order.p_value)} over participants; differencing predicts none."
        )
    effect, likeness = result.clustering.design_effect, result.clustering.intraclass_correlation
    if effect is not None and likeness is not None:
        correlation = words.signed(likeness, 3, plus=False)
        notes.append(
            f"Answers of one participant to pairs with a difference correlate by {correlation} (design effect "
            f"{effect:.2f})."
        )
    return notes


def _weber(result: SameDifferent, lengths: Mapping[str, int]) -> Iterator[str]:
    """Thresholds as shares of the length that they are differences from, over all transitions."""
    known = [length for length in lengths.values() if length]
    found = result.believed
    if not known or found is None:
        return
    mean = sum(known) / len(known)
    shares = [
        f"{100 * threshold.frames / mean:.0f}% of it {side}"
        for side in PRINTED
        if (threshold := found.jnd.get(side)) and threshold.frames is not None
    ]
    if shares:
        several = (
            f"{min(known)} to {max(known)} frames, {mean:.1f} on average" if len(known) > 1 else f"{mean:g} frames"
        )
        yield f"k was {several}; the thresholds are {words.joined(shares)} (Weber fractions)."


def _model_notes(model: ModelFit) -> list[str]:
    notes = [
        f"Identical pairs were called different in {100 * model.false_alarms:.1f}% (model). The "
        f"criterion is {model.criterion:.2f} standard deviations of an impression, the lapse rate "
        f"{100 * model.lapse:.1f}%."
    ]
    if model.note:
        notes.append(f"Caution: {model.note}.")
    return notes


def _mixed_note(mixed: MixedThresholds) -> str:
    """How people differ, by the mixed model."""
    text = (
        "By the mixed model, participants’ logarithms of sensitivity and criterion have standard deviations of "
        f"{mixed.sensitivity_spread:.2f} and {mixed.criterion_spread:.2f}; the test that they are equal gives "
        f"{words.p(mixed.alike_p_value)} (likelihood ratio)."
    )
    if mixed.motion_spread:
        spreads = [f"{spread:.2f} {side}" for side, spread in mixed.motion_spread.items()]
        text += f" Thresholds’ logarithms differ across motions by a standard deviation of {words.joined(spreads)}."
    return f"{text} Caution: {mixed.note}." if mixed.note else text


# Beside the section


def _methods(found: Collection[SameDifferent], analysis: Analysis) -> str:
    del analysis
    first = next(iter(found))
    sampled = any(one.mixed and one.mixed.motion_spread for one in found)
    motions = f" (one for each motion), {AS_SAMPLES}" if sampled else ""
    return (
        "Just noticeable differences are those of the median observer, at which "
        f"{_percent(first)} of the answers are “different”, by a mixed differencing model of the same-different task "
        "(Macmillan & Creelman 2005): sensitivities and criteria are log-normal across participants, with a slope each "
        f"for shorter and longer blends{motions}, and a lapse rate of at most 10%; maximum likelihood, intervals by "
        "Student’s t of the logarithm. Beside them are the differences at which the best criterion would be right in "
        f"{_percent(first)} of pairs, half of them same, which no participant’s own criterion moves. One differencing "
        "model of all answers (jackknife over participants) and linear interpolation between the percentages as in "
        "2004 (means over participants ± standard errors; Fieller’s intervals) are given alongside."
    )


KIND = SectionKind(
    same_different_section,
    _methods,
    lambda _: {WANG_2004, FIELLER_1954, MACMILLAN_2005, WILSON_1927, CLARK_1973, SATTERTHWAITE_1946},
)
