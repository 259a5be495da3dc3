"""Numbers and sentences of the report: results of the analysis in, plain prose out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from study.report.tables import p_value

Result = Mapping[str, Any]

PEOPLE = {
    "collected": "participants",
    "simulated": "simulated observers",
    "mixed": "participants and simulated observers",
    "none": "participants",
}


def readable(name: str) -> str:
    """Return a name of a protocol as words."""
    return name.replace("_", " ")


def library(name: str) -> str:
    """Return a motion library's name; of a folder its last part, as no page should tell of the machine's disk."""
    return name.replace("\\", "/").rstrip("/").rsplit("/", 1)[-1]


def sentence(text: str) -> str:
    """Return a text with its first letter as a capital."""
    return text[:1].upper() + text[1:]


def joined(parts: Sequence[str]) -> str:
    """Return a list in words: a, b and c."""
    if len(parts) < 2:
        return "".join(parts)
    return ", ".join(parts[:-1]) + " and " + parts[-1]


def number(count: int, singular: str, plural: str | None = None) -> str:
    """Return a count with its noun."""
    return f"{count:,} {singular if count == 1 else plural or singular + 's'}"


def mark_of(data: str, synthetic: bool) -> str:
    """Return what stands at the foot of every figure whose data are not people's answers to captured motion."""
    parts = []
    if data == "simulated":
        parts.append("simulated answers, no people")
    elif data == "mixed":
        parts.append("people’s and simulated answers mixed")
    if synthetic:
        parts.append("synthetic motions, none captured")
    return " · ".join(parts)


def warnings_of(data: str, synthetic: bool, simulated: int, participants: int) -> list[str]:
    """Return the sentences that stand at the top of the page, before any result."""
    found = []
    if data == "simulated":
        found.append(
            "These answers are simulated. They were drawn by a program from observers with known sensitivity; nobody "
            "was asked, and nothing here says how people see motion."
        )
    elif data == "mixed":
        found.append(
            f"Simulated and collected answers are mixed here: {simulated} of {participants} participants are simulated "
            "observers. Results describe neither people nor the simulation."
        )
    if synthetic:
        found.append(
            "The motions are synthetic: a program made them up from published kinematics. None of them was captured "
            "from a person."
        )
    return found


def interval(low: float | None, high: float | None, places: int = 1, unit: str = "") -> str:
    """Return an interval in words, open ends included."""
    if low is None and high is None:
        return "no interval"
    if high is None:
        return f"{low:.{places}f}{unit} or more"
    if low is None:
        return f"{high:.{places}f}{unit} or less"
    return f"{low:.{places}f} to {high:.{places}f}{unit}"


def jnd_headline(result: Result, fps: float, data: str) -> tuple[str, str]:
    """Return the just noticeable difference as a short statement and a line of detail."""
    model = result["model"]
    chosen = model["jnd"] if model else result["published"]
    statement = ", or ".join(_side_in_words(chosen.get(side), side, fps) for side in ("longer", "shorter"))
    percent = f"{100 * result['level']:.0f}%"
    subject = {"collected": "People", "simulated": "Simulated observers", "mixed": "The observers", "none": "Nobody"}
    lead = f"{subject[data]} called {percent} of pairs different where the blend was {statement}."
    if not model:
        return lead, f"Straight lines between the levels. No model was fitted: {result['model_note']}."
    published = [f"k {sign} {_frames(result['published'][side])}" for side, sign in (("longer", "+"), ("shorter", "−"))]
    intervals = [_interval_of(chosen.get(side)) for side in ("longer", "shorter")]
    detail = (
        f"Differencing model, {intervals[0]} longer and {intervals[1]} shorter (95% intervals over participants). "
        f"Straight lines between the levels, as published in 2004: {joined(published)} frames."
    )
    return lead, detail


def _side_in_words(threshold: Result | None, side: str, fps: float) -> str:
    if threshold is None:
        return f"not shown {side}"
    if threshold["frames"] is None:
        return f"{side} by no difference shown ({threshold['note']})"
    return f"{threshold['frames']:.1f} frames ({threshold['frames'] / fps:.2f} s) {side}"


def _frames(threshold: Result) -> str:
    return f"{threshold['frames']:.1f}" if threshold["frames"] is not None else f"({threshold['note']})"


def _interval_of(threshold: Result | None) -> str:
    if threshold is None:
        return "none"
    return interval(threshold["interval"]["low"], threshold["interval"]["high"])


def jnd_notes(result: Result) -> list[str]:
    """Return what the thresholds rest on, and the tests beside them, one sentence each."""
    notes = []
    model, motions = result["model"], result["across_motions"]
    if model:
        fit = model["fit_p_value"]
        notes.append(
            f"Pairs without any difference were called different in {100 * model['false_alarms']:.1f}% (model). The "
            f"criterion is {model['criterion']:.2f} standard deviations of one impression, the lapse rate "
            f"{100 * model['lapse']:.1f}%."
        )
        if fit is not None:
            says = "the curve follows the data" if fit >= 0.05 else "the curve does not follow the data closely"
            notes.append(
                f"Deviance from free percentages {model['fit_deviance']:.1f} on {model['fit_degrees_of_freedom']} "
                f"degrees of freedom, p {_p(fit)}: {says}."
            )
        if model["equal_slopes"]:
            notes.append(_equal_slopes(model["equal_slopes"]))
        if model["note"]:
            notes.append(f"Caution: {model['note']}.")
    if result.get("rules", {}).get("independent"):
        notes.append(result["rules"]["answer"])
    order = result.get("order_test") or {}
    if order.get("p_value") is not None:
        gap = f"{order['difference_percent']:+.1f}".replace("-", "−")
        notes.append(
            f"By order: {gap} percentage points more “different” where the reference came first, p "
            f"{_p(order['p_value'])} over participants; neither rule expects the order to matter."
        )
    if motions["chi_square_p_value"] is not None:
        notes.append(_across_motions(motions))
    effect = result["clustering"]["design_effect"]
    if effect is not None:
        correlation = f"{result['clustering']['intraclass_correlation']:.3f}".replace("-", "−")
        notes.append(
            f"Answers of one participant to pairs with a difference correlate by {correlation} (design effect "
            f"{effect:.2f})."
        )
    return notes


def _p(value: float) -> str:
    text = p_value(value)
    return text if text.startswith("<") else f"= {text}"


def _equal_slopes(test: Result) -> str:
    people = test["p_value_participants_independent"]
    text = (
        f"One frame longer is seen {test['slope_ratio_longer_to_shorter']:.2f} times as well as one frame shorter; "
        f"likelihood ratio {test['likelihood_ratio']:.2f} on 1 degree of freedom, p "
        f"{_p(test['p_value_answers_independent'])}"
    )
    return text + (f"; over participants p {_p(people)}." if people is not None else ".")


def _across_motions(test: Result) -> str:
    text = (
        f"Correct answers across motions: chi-square({test['chi_square_degrees_of_freedom']}) = "
        f"{test['chi_square']:.2f}, p {_p(test['chi_square_p_value'])} with answers as independent"
    )
    if test["f_p_value"] is None:
        return f"{text}; {test['note']}."
    first, second = test["f_degrees_of_freedom"]
    return f"{text}; over participants F({first}, {second}) = {test['f']:.2f}, p {_p(test['f_p_value'])} (Hotelling)."


def preference_headline(comparison: Result) -> tuple[str, str]:
    """Return a preference as a short statement and a line of detail."""
    published, people = comparison["published"], comparison["participants"]
    detail = f"95% interval over participants {interval(people['low'], people['high'], unit='%')}. "
    if people["low"] is None:
        detail = f"{sentence(people['note'])}. " if people["note"] else ""
    if published["chi_square"] is not None:
        detail += (
            f"As published: chi-square(1, N = {published['answers']}) = {published['chi_square']:.2f}, p "
            f"{_p(published['p_value'])}."
        )
    return readable(comparison["answer"]), detail


def preference_notes(comparison: Result) -> list[str]:
    """Return what the preference rests on, one sentence each."""
    people, order, clusters = comparison["participants"], comparison["order"], comparison["clustering"]
    notes = [
        f"{number(people['for_a'], 'participant')} leant towards {readable(comparison['method_a'])}, {people['for_b']} "
        f"towards {readable(comparison['method_b'])}, {people['undecided']} towards neither."
    ]
    if clusters["design_effect"] is not None:
        correlation = f"{clusters['intraclass_correlation']:.3f}".replace("-", "−")
        notes.append(
            f"Answers of one participant correlate by {correlation}: the pooled test counts "
            f"{comparison['published']['answers']} answers that are worth {clusters['effective_answers'] or 0:.0f} "
            f"independent ones (design effect {clusters['design_effect']:.2f})."
        )
    if order["first_percent"] is not None:
        test = f", p {_p(order['p_value'])} over participants" if order["p_value"] is not None else ""
        notes.append(f"The transition shown first was favoured in {order['first_percent']:.1f}% of the answers{test}.")
    notes += _no_preference(comparison.get("no_preference"))
    if (comparison.get("models") or {}).get("differ"):
        notes.append(comparison["models"]["differ"])
    return notes


def _no_preference(found: Result | None) -> list[str]:
    """The evidence for no preference, where it could be weighed."""
    if not found or found["equivalence_p_value"] is None:
        return []
    margin, factor = 100 * found["margin"], found["bayes_factor_null"]
    text = (
        f"Evidence for no preference: the share lies within {50 - margin:g} to {50 + margin:g}% with p "
        f"{_p(found['equivalence_p_value'])} (two one-sided tests over participants)"
    )
    if factor is None:
        return [f"{text}."]
    weight, side = (factor, "without") if factor >= 1 else (1 / factor, "with")
    times = f"{weight:.1f}" if weight < 1000 else "over 1,000"
    return [f"{text}; the data are {times} times likelier {side} a preference (Bayes factor, Cauchy prior of 0.71)."]


def methods_paragraph(protocol: Any, manifest: Any, analysis: Result, participants: str) -> list[str]:
    """Return the methods, ready for a paper: one paragraph on what was shown, one on what was computed.

    Parameters
    ----------
    protocol, manifest
        Of the results folder.
    analysis
        From `analyse`.
    participants
        Who answered, in words.
    """
    shown = protocol.stimuli
    kinds = joined([f"{readable(study.title or study.name)} ({_task(study)})" for study in protocol.studies])
    motions = "synthetic motions" if manifest.synthetic else f"motions of the library {library(manifest.library)}"
    first = (
        f"{sentence(participants)} took part in {number(len(protocol.studies), 'study', 'studies')}: {kinds}. "
        f"Transitions between {motions} were blended by spherical linear interpolation under a {shown.weight} weight "
        f"between a start frame in the source and an end frame in the destination, and shown as a {shown.style} figure "
        f"of {shown.width} × {shown.height} pixels at {protocol.fps:g} frames per second from a fixed camera, without "
        f"a ground plane, with {shown.entry_s:g} s before and {shown.exit_s:g} s after the blend. The stimuli of a "
        f"pair followed each other after {protocol.timing.gap_s:g} s; {protocol.timing.answer_s:g} s were given to "
        "answer. Pairs and their order were drawn at random for every participant."
    )
    second = (
        "Percentages are means over participants with standard errors of these means. Thresholds as published are "
        f"where straight lines between percentages cross {100 * protocol.analysis.threshold:.0f}%, with Fieller "
        "intervals over participants. The differencing same-different model (one criterion, a slope for shorter and "
        "one for longer blends, a lapse rate of at most 10%) was fitted by maximum likelihood to all answers; its "
        "intervals are Student’s, on the logarithm, from a jackknife over participants. Preferences were tested as "
        "published (chi-square over all answers) and with one share a participant (Student’s t). The level of "
        f"significance is {protocol.analysis.alpha:g}, intervals are of {100 * analysis['confidence']:g}%. Missed "
        "answers were left out and counted. " + _excluded(analysis)
    )
    return [first, second]


def _excluded(analysis: Result) -> str:
    found = analysis["exclusions"]
    if not found["rules"]:
        return "No participant was excluded."
    rules = joined([rule["rule"] for rule in found["rules"]])
    people = number(len(found["participants"]), "participant")
    return f"Left out, as stated beforehand, were {rules}: {found['answers_left_out']} answers in all, {people} wholly."


def _task(study: Any) -> str:
    orders = {
        "both": "each pair in both orders",
        "random": "order at random",
        "balanced": "orders balanced",
        "by-group": "order by group",
    }
    return f"{study.task}, {orders[study.order]}" + (f", {study.repeats} times" if study.repeats > 1 else "")
