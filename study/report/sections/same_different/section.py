"""A same-different study on the page: the analysis of `analyse_jnd` in, headline, figures, tables and notes out.

2004 section 5.1 and Figure 6; every threshold stands as published (straight lines) and corrected (model).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from study.counting import counted
from study.report import figures, tables, words
from study.report.sections.section import Drawing, Headline, Section
from study.report.tables import Table

Result = Mapping[str, Any]

SIDES = (("longer", "+"), ("shorter", "−"))
SUBJECTS: Mapping[str, Callable[[int], str]] = {
    "collected": lambda count: counted(count, "person", "people"),
    "simulated": lambda count: counted(count, "simulated observer"),
    "mixed": lambda count: f"{counted(count, 'participant')}, people and simulated observers together,",
}
"""Who answered, as the subject of a sentence."""


def same_different_section(
    name: str, title: str, result: Result, *, fps: float, data: str, mark: str, known: Result | None
) -> Section:
    """Return the section of a same-different study.

    Parameters
    ----------
    name, title
        Of the study.
    result
        From `analyse_jnd`.
    fps
        Frames per second, for seconds beside frames.
    data, mark
        Whose answers they are ("collected", "simulated", "mixed"), and what every figure says about it.
    known
        True thresholds of simulated observers; None otherwise.
    """
    several = len(result["motions"]) > 1
    shown = [threshold_table(name, result, fps)]
    return Section(
        anchor=f"study-{name}",
        title=title,
        headlines=(headline(result, fps, data),),
        drawings=tuple(_drawings(name, result, mark, known)),
        tables=(*shown, *([recovery_table(name, result, known)] if known else [])),
        notes=tuple(_notes(result)),
        folded=(
            percent_table(name, result),
            *([motion_table(name, result, fps)] if several else []),
            d_prime_table(name, result),
        ),
        readings=tuple(_readings(result)),
    )


def _drawings(name: str, result: Result, mark: str, known: Result | None) -> list[Drawing]:
    truth = {
        side: abs(known[f"threshold_{side}_frames"])
        for side, _ in SIDES
        if known and known.get(f"threshold_{side}_frames") is not None
    }
    makers: list[tuple[str, Callable[[str], str], str]] = [
        (
            "curve",
            lambda place: figures.same_different_figure(result, place, mark),
            "Answers “different” by the difference in blend length from k, the length that the reference method "
            "gives. Points: means over participants ± one standard error, joined by straight lines as in 2004. Curve: "
            "the differencing model; its drop lines are the just noticeable differences, the bars at their feet 95% "
            "intervals (jackknife over participants).",
        ),
        (
            "thresholds",
            lambda place: figures.thresholds_figure(result, place, mark, truth),
            "The just noticeable difference with 95% intervals over participants: Fieller’s for straight lines, the "
            "jackknife’s for the model. Without a bar, the interval reaches beyond the levels shown.",
        ),
    ]
    if len(result["motions"]) > 1:
        caption = "The same for every motion by itself: means ± one standard error, and the model."
        makers.append(("motions", lambda place: figures.motions_figure(result, place, mark), caption))
    return [Drawing(f"{name}_{part}", draw(f"study-{name}-{part}"), caption) for part, draw, caption in makers]


# In words


def headline(result: Result, fps: float, data: str) -> Headline:
    """Return the just noticeable difference as a statement and what it rests on."""
    if not result["answers"]:
        missed = result["missed"]
        why = f"all {counted(missed, 'question')} were missed" if missed else "there are no answers"
        return Headline(f"No just noticeable difference can be given: {why}.", "")
    who = SUBJECTS[data](result["participants"])
    percent = f"{100 * result['level']:.0f}% “different”"
    chosen = result["model"]["jnd"] if result["model"] else result["published"]
    places = [place for side, _ in SIDES if (place := _place(result, chosen, side, fps))]
    if not places:
        return Headline(
            f"No just noticeable difference can be given from the answers of {who}.", _detail(result, chosen)
        )
    statement = f"The just noticeable difference of {who} is estimated at {' and '.join(places)} ({percent})."
    return Headline(statement, _detail(result, chosen))


def _place(result: Result, chosen: Result, side: str, fps: float) -> str:
    """Where the threshold is, or beyond which level it lies; empty where neither can be told."""
    found = chosen.get(side)
    if found is not None and found["frames"] is not None:
        return f"{found['frames']:.1f} frames ({found['frames'] / fps:.2f} s) {side}"
    sign = 1 if side == "longer" else -1
    levels = sorted(
        (row for row in result["percent_different"] if sign * row["difference_frames"] > 0),
        key=lambda row: abs(row["difference_frames"]),
    )
    # Wilson's interval has to agree: a single answer is no evidence.
    if levels and levels[0]["low"] is not None and levels[0]["low"] > 100 * result["level"]:
        return f"less than {counted(abs(levels[0]['difference_frames']), 'frame')} {side}"
    if levels and all(row["high"] is not None and row["high"] < 100 * result["level"] for row in levels):
        return f"more than {counted(abs(levels[-1]['difference_frames']), 'frame')} {side}"
    return ""


def _detail(result: Result, chosen: Result) -> str:
    size = f"{counted(result['answers'], 'answer')} of {counted(result['participants'], 'participant')}"
    parts = []
    if result["model"]:
        ends = [f"{_ends(found)} {side}" for side, _ in SIDES if (found := chosen.get(side)) and _closed(found)]
        over = "over participants" if result["participants"] > 1 else "of one participant’s answers as independent"
        parts.append(
            f"Differencing model, {size}" + (f"; 95% intervals {over}: {words.joined(ends)}." if ends else ".")
        )
    else:
        parts.append(f"Straight lines between the levels, {size}. No model was fitted: {result['model_note']}.")
    absent = [side for side, _ in SIDES if chosen.get(side) and chosen[side]["frames"] is None]
    parts += [f"Where the blend was {side}: {chosen[side]['note']}." for side in absent]
    if result["model"]:
        published = result["published"]
        places = [f"k {sign} {_frames(published[side])}" for side, sign in SIDES if side in published]
        parts.append(f"Straight lines between the levels, as published in 2004: {words.joined(places)} frames.")
    return " ".join(parts)


def _closed(threshold: Result) -> bool:
    return any(threshold["interval"][end] is not None for end in ("low", "high"))


def _ends(threshold: Result) -> str:
    return words.interval(threshold["interval"]["low"], threshold["interval"]["high"], unit=" frames")


def _frames(threshold: Result) -> str:
    return f"{threshold['frames']:.1f}" if threshold["frames"] is not None else f"({threshold['note']})"


def _readings(result: Result) -> list[dict[str, Any]]:
    model = result["model"]["jnd"] if result["model"] else {}
    rows = []
    for side, sign in SIDES:
        corrected = _with_interval(model[side], sign) if side in model else "no model was fitted"
        published = result["published"].get(side)
        rows.append(
            {
                "result": f"just noticeable difference, {side}",
                "published": f"{_with_interval(published, sign)}; straight lines" if published else "–",
                "corrected": f"{corrected}; differencing model" if side in model else corrected,
            }
        )
    return rows


def _with_interval(threshold: Result, sign: str) -> str:
    if threshold["frames"] is None:
        return str(threshold["note"])
    return f"k {sign} {threshold['frames']:.2f} frames [{words.bare_interval(threshold['interval'], 2)}]"


def _notes(result: Result) -> list[str]:
    """What the thresholds rest on, and the tests beside them, one sentence each."""
    notes = []
    if result["model"]:
        notes += _model_notes(result["model"])
    if result.get("mixed"):
        notes.append(_mixed_note(result["mixed"]))
    elif result.get("mixed_note"):
        notes.append(f"No mixed model was fitted: {result['mixed_note']}.")
    if result["rules"].get("independent"):
        notes.append(result["rules"]["answer"])
    order = result["order_test"]
    if order.get("p_value") is not None:
        notes.append(
            f"By order: {words.signed(order['difference_percent'])} percentage points more “different” where the "
            f"reference came first, {words.p(order['p_value'])} over participants; neither rule expects the order to "
            "matter."
        )
    if result["across_motions"]["chi_square_p_value"] is not None:
        notes.append(_across_motions(result["across_motions"]))
    effect = result["clustering"]["design_effect"]
    if effect is not None:
        correlation = words.signed(result["clustering"]["intraclass_correlation"], 3, plus=False)
        notes.append(
            f"Answers of one participant to pairs with a difference correlate by {correlation} (design effect "
            f"{effect:.2f})."
        )
    return notes


def _model_notes(model: Result) -> list[str]:
    notes = [
        f"Pairs without any difference were called different in {100 * model['false_alarms']:.1f}% (model). The "
        f"criterion is {model['criterion']:.2f} standard deviations of one impression, the lapse rate "
        f"{100 * model['lapse']:.1f}%."
    ]
    fit = model["fit_p_value"]
    if fit is not None:
        says = "the curve follows the data" if fit >= 0.05 else "the curve does not follow the data closely"
        notes.append(
            f"Deviance from free percentages {model['fit_deviance']:.1f} on "
            f"{counted(model['fit_degrees_of_freedom'], 'degree')} of freedom, {words.p(fit)}: {says}."
        )
    if model["equal_slopes"]:
        notes.append(_equal_slopes(model["equal_slopes"]))
    if model["note"]:
        notes.append(f"Caution: {model['note']}.")
    return notes


def _mixed_note(mixed: Result) -> str:
    """How people differ, by the mixed model."""
    text = (
        "By the mixed model, participants’ logarithms of sensitivity and criterion have standard deviations of "
        f"{mixed['sensitivity_spread']:.2f} and {mixed['criterion_spread']:.2f}; the test that they are alike gives "
        f"{words.p(mixed['alike_p_value'])} (likelihood ratio)."
    )
    return f"{text} Caution: {mixed['note']}." if mixed["note"] else text


def _equal_slopes(test: Result) -> str:
    people = test["p_value_participants_independent"]
    text = (
        f"One frame longer is seen {test['slope_ratio_longer_to_shorter']:.2f} times as well as one frame shorter; "
        f"likelihood ratio {test['likelihood_ratio']:.2f} on 1 degree of freedom, "
        f"{words.p(test['p_value_answers_independent'])}"
    )
    return text + (f"; over participants {words.p(people)}." if people is not None else ".")


def _across_motions(test: Result) -> str:
    text = (
        f"Correct answers across motions: chi-square({test['chi_square_degrees_of_freedom']}) = "
        f"{test['chi_square']:.2f}, {words.p(test['chi_square_p_value'])} with answers as independent"
    )
    if test["f_p_value"] is None:
        return f"{text}; {test['note']}."
    first, second = test["f_degrees_of_freedom"]
    return (
        f"{text}; over participants F({first}, {second}) = {test['f']:.2f}, {words.p(test['f_p_value'])} (Hotelling)."
    )


# Tables


def _threshold_rows(entry: Result, fps: float) -> list[dict[str, Any]]:
    """Every reading of the thresholds of all motions together, or of one."""
    kinds = [("straight lines (as published)", entry["published"])]
    if model := entry["model"]:
        kinds += [("model", model["jnd"]), ("model", _profiled(entry))]
        kinds += [("model, best criterion", model["corrected"])]
        kinds += [("model, Abbott’s correction", model["guess_corrected"])]
    if mixed := entry.get("mixed"):
        kinds += [("mixed model, median observer", mixed["typical"]), ("mixed model, group", mixed["population"])]
    return [
        {
            "estimate": label,
            "interval": _interval_by(found),
            "side": side,
            "frames": found["frames"],
            "seconds": found["frames"] / fps if found["frames"] is not None else None,
            "standard_error": found["standard_error"],
            "low": found["interval"]["low"],
            "high": found["interval"]["high"],
            "remark": found["note"],
        }
        for label, thresholds in kinds
        for side, _ in SIDES
        if (found := thresholds.get(side))
    ]


def _interval_by(threshold: Result) -> str:
    """What made the interval, as far as the method names it."""
    names = {
        "Fieller": "Fieller",
        "jackknife": "jackknife",
        "one participant": "one participant",
        "profile": "profile likelihood",
    }
    return next((name for part, name in names.items() if part in threshold["method"]), "curvature")


def _profiled(entry: Result) -> dict[str, Any]:
    """The model's thresholds with intervals by profile likelihood; none for single motions."""
    return {
        side: {
            **entry["model"]["jnd"][side],
            "interval": found,
            "standard_error": None,
            "note": "",
            "method": "profile",
        }
        for side, found in entry.get("profile", {}).items()
        if side in entry["model"]["jnd"]
    }


_THRESHOLDS = "estimate side frames seconds standard_error low high interval remark"


def threshold_table(name: str, result: Result, fps: float) -> Table:
    """Return the thresholds as published and corrected."""
    percent = f"{100 * result['level']:.0f}%"
    rows = _threshold_rows(result, fps)
    return tables.make(
        f"{name}_thresholds",
        f"The just noticeable difference, as published and corrected. Straight lines: where {percent} of the answers "
        "are “different”, read off between the levels; this moves with the rate of false alarms and cuts the corners "
        f"of the curve. Model: the same {percent} on the fitted curve. Best criterion: the difference at which an "
        f"observer with the best criterion would be right in {percent} of same and different pairs, whatever the "
        "criterion people took. Abbott: after taking false alarms for guesses. Mixed model: participants with "
        "sensitivities and criteria of their own, the median one of them, and the mean of all. Fieller’s and the "
        "jackknife’s intervals are over participants, the curvature’s rest on the mixed model; profile likelihood "
        "takes "
        "all answers for independent and is too narrow where participants differ. A dash where an interval reaches "
        "beyond the levels shown.",
        _THRESHOLDS,
        rows,
        headings={"interval": "interval by"},
        files_only="" if any(row["remark"] for row in rows) else "remark",
    )


def motion_table(name: str, result: Result, fps: float) -> Table:
    """Return the thresholds for every motion."""
    rows = [
        {"motion": words.readable(motion["motion"]), "answers": motion["answers"], **row}
        for motion in result["motions"]
        for row in _threshold_rows(motion, fps)
    ]
    return tables.make(
        f"{name}_thresholds_by_motion",
        "Thresholds for every motion by itself, in frames.",
        f"motion answers {_THRESHOLDS}",
        rows,
        headings={"interval": "interval by"},
        files_only="answers seconds remark",
    )


def percent_table(name: str, result: Result) -> Table:
    """Return the percentages of Figure 6."""
    return tables.make(
        f"{name}_percent_different",
        "Answers “different” by difference in blend length. Mean and standard error over participants; Wilson’s "
        "interval of the answers as if independent.",
        "difference_frames participants answers different percent standard_error:one low:one high:one",
        result["percent_different"],
    )


def d_prime_table(name: str, result: Result) -> Table:
    """Return sensitivity at every level."""
    return tables.make(
        f"{name}_d_prime",
        "Sensitivity at every level. Under the differencing rule, against the pairs without a difference; answers "
        "pooled, taken as independent; one half added to each count.",
        "difference_frames d_prime standard_error low high criterion",
        result["d_prime"],
    )


def recovery_table(name: str, result: Result, known: Result) -> Table:
    """Return the thresholds that the simulated observers had beside those that were found."""
    rows = []
    for side, _ in SIDES:
        for label, thresholds, key in (
            ("differencing model", result["model"]["jnd"] if result["model"] else {}, f"threshold_{side}_frames"),
            ("straight lines", result["published"], f"interpolated_{side}_frames"),
        ):
            truth, found = known.get(key), thresholds.get(side)
            if truth is None or found is None or found["frames"] is None:
                continue
            error, away = found["standard_error"], found["frames"] - abs(truth)
            rows.append(
                {
                    "estimate": label,
                    "side": side,
                    "known": abs(truth),
                    "found": found["frames"],
                    "standard_error": error,
                    "distance": away,
                    "standard_errors": away / error if error else None,
                }
            )
    return tables.make(
        f"{name}_recovery",
        "What the simulated observers had and what was found, in frames. For straight lines the known value is where "
        "they would cross with endless data.",
        "estimate side known found standard_error distance standard_errors",
        rows,
    )
