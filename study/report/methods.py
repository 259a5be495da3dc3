"""The methods of a report, ready for a paper: protocol, manifest, presentations and analysis in, paragraphs out.

Each sentence follows from what was run; methods that were not used are neither described nor cited.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import study
from study.analysis.analyse import Analysis
from study.counting import counted
from study.experiment.protocol.whole import Protocol, StudySpec
from study.experiment.stimuli.manifest import Manifest
from study.experiment.wording import question_text
from study.report import words
from study.report.demographics import demographics_sentence
from study.report.sections.registry import SECTIONS
from study.tasks.registry import task_of
from study.transitions.methods.makes.blends import Blending
from study.transitions.methods.method import Method
from study.transitions.methods.registry import METHODS

if TYPE_CHECKING:
    import pandas as pd


ORDERS = {
    "both": "Each pair was shown in both orders",
    "random": "The order within each pair was drawn at random",
    "balanced": "Half of the pairs were shown in each order",
    "by-group": "The participant’s group determined the order",
}


ORDERS_OF_SEVERAL = {
    "both": "Each set was shown in every order",
    "random": "The order within each set was drawn at random",
    "balanced": "Each order was used for an equal share of the sets",
    "by-group": "The participant’s group determined the order",
}
SINGLE_ORDERS = {
    **dict.fromkeys(("both", "random", "balanced"), "Transitions were shown one at a time, in random order"),
    "by-group": "Transitions were shown one at a time; the participant’s group determined which method came first",
}


def methods_paragraphs(
    protocol: Protocol,
    manifest: Manifest,
    analysis: Analysis,
    presentations: pd.DataFrame,
    who: str,
    people: Sequence[Mapping[str, Any]] = (),
) -> list[tuple[str, str]]:
    """Return the methods as headed paragraphs: participants and design, stimuli, apparatus, analysis, software.

    Parameters
    ----------
    protocol, manifest
        Of the results folder.
    analysis
        From `analyse`.
    presentations
        How stimuli were shown: `method`, `shown_well`.
    who
        Who answered, in words.
    people
        What they filled in, from `demographics_rows`.
    """
    return [
        ("Participants and design", _design(protocol, analysis, who, people)),
        ("Stimuli", _stimuli(protocol, manifest)),
        ("Apparatus and procedure", _procedure(protocol, analysis, presentations)),
        ("Analysis", _analysis(analysis)),
        ("Exclusions", _excluded(analysis)),
        ("Software", _software(protocol, analysis, presentations)),
    ]


def references(protocol: Protocol, analysis: Analysis) -> list[str]:
    """Return the works that the methods rest on, by author; only those whose methods were used."""
    used = {work for method in _methods(protocol).values() for work in method.sources}
    used |= {work for study in protocol.studies for work in study.procedure.sources}
    for kind, shown in SECTIONS.items():
        if found := analysis.of(kind):
            used |= shown.references(found.values())
    return sorted(used)


def _methods(protocol: Protocol) -> dict[str, Method]:
    """The methods that the protocol's studies show, by name."""
    return {name: method for study in protocol.studies for name, method in protocol.methods_of(study).items()}


def _design(protocol: Protocol, analysis: Analysis, who: str, people: Sequence[Mapping[str, Any]]) -> str:
    studies = counted(len(protocol.studies), "study", "studies")
    each = analysis.quality.trials / max(analysis.quality.participants, 1)
    within = " and repetition" if any(study.repeats > 1 for study in protocol.studies) else ""
    return (
        f"{words.sentence(who)} took part in one session of {studies}. {demographics_sentence(people)}"
        f"{' '.join(_study(protocol, study) for study in protocol.studies)} The order of trials was drawn separately "
        f"for every participant{within} (seed {protocol.seed}); a participant was asked "
        f"{counted(round(each), 'question')} on average."
    )


def _study(protocol: Protocol, study: StudySpec) -> str:
    title = words.readable(study.title or study.name)
    what = task_of(study).in_words(study, lambda method: _blends(protocol, study, method))
    repeated = f", {study.repeats} times" if study.repeats > 1 else ""
    order = {1: SINGLE_ORDERS, 2: ORDERS}.get(task_of(study).slots, ORDERS_OF_SEVERAL)[study.order]
    chosen = f" Trials were chosen by {by}." if (by := study.procedure.in_words()) else ""
    asked = "; ".join([item.question for item in study.items] or [question_text(protocol, study)])
    tried = f" {counted(study.practice, 'practice trial')} came first." if study.practice else ""
    sure = (
        f" After each answer they said how sure they were, on {points} points."
        if (points := study.confidence_points)
        else ""
    )
    return f"In “{title}”, participants {what}. {order}{repeated}.{chosen} They were asked: “{asked}”{sure}{tried}"


def _blends(protocol: Protocol, study: StudySpec, method: str) -> str:
    used = protocol.methods_of(study)[method]
    said = used.in_words(protocol.fps)
    if method in METHODS:
        return said
    details = used.make.details()
    return f"“{words.readable(method)}” ({said}{f'; {details}' if details else ''})"


def _stimuli(protocol: Protocol, manifest: Manifest) -> str:
    shown = protocol.stimuli
    motions = "synthetic motions" if manifest.synthetic else f"motions of the library {words.library(manifest.library)}"
    camera = {
        "fixed": "a fixed camera",
        "pan": "a camera that stood still and turned by a path quadratic in time, the same for all stimuli of a group,",
        "track": f"a camera following it (smoothed over {shown.smoothing_s:g} s)",
    }[shown.camera]
    ground = "above a ground plane" if shown.floor else "without a ground plane"
    how, joint = _made(protocol, manifest)
    shown_of = {record.transition for record in manifest.records}
    made = f"{counted(len(manifest.records), 'stimulus', 'stimuli')} of {counted(len(shown_of), 'transition')}"
    return (
        f"{made} between {motions} {how} Each was rendered as a "
        f"{shown.style} figure of {shown.width} × {shown.height} pixels at {protocol.fps:g} frames per second, seen by "
        f"{camera} {ground}, with {shown.entry_s:g} s before and {shown.exit_s:g} s after the {joint}."
        f"{''.join(f' {one}' for one in _even_stimuli(protocol))}"
    )


def _even_stimuli(protocol: Protocol) -> Iterator[str]:
    """What was done so that the stimuli of a pair differ in little but the transition, and how large they were."""
    shown, screen = protocol.stimuli, protocol.screen
    if shown.view == "least-cue":
        yield "The camera looked from the side from which the stimuli of a pair began and ended most alike."
    if shown.match == "duration":
        yield (
            "Stimuli of a pair took equally long, with their blends around the same moment: entry and exit of the "
            "comparison were each shorter or longer by half of the difference in blend length."
        )
    if shown.jitter_s:
        yield f"Each stimulus ended earlier by a time drawn at random, of at most {shown.jitter_s:g} s."
    if shown.ending != "cut":
        how = "faded into the background" if shown.ending == "fade" else "was hidden"
        yield f"The figure {how} in the last {shown.ending_s:g} s."
    if screen.height_degrees is not None:
        yield f"The picture was {screen.height_degrees:g} degrees of visual angle high."
    else:
        yield f"The picture took {100 * screen.height_share:g}% of the screen's height."


def _made(protocol: Protocol, manifest: Manifest) -> tuple[str, str]:
    """How the transitions were made, as the end of a sentence and further ones, and what they are called."""
    methods = _methods(protocol)
    others = [f" Those by “{words.readable(name)}” {one.make.how}." for name, one in methods.items() if one.make.how]
    plain = [record for record in manifest.records if not methods[record.method].make.how]
    lengths = sorted(record.blend_frames for record in plain if record.blend_frames)
    blended, cuts = len(lengths), len(plain) - len(lengths)
    if not plain:
        return f"were shown.{''.join(others)}", "transition"
    if not blended:
        return f"were cuts from a frame of the source to a frame of the destination.{''.join(others)}", "cut"
    makes = [method.make for method in methods.values() if isinstance(method.make, Blending)]
    weights, feet = sorted({make.weight for make in makes}), {make.clean_feet for make in makes}
    how = (
        f"were blended by spherical linear interpolation under a {' or '.join(weights)} weight, between a start frame "
        f"in the source and an end frame in the destination{' (cuts were not blended)' if cuts else ''}. "
        f"Blends were {' to '.join(str(one) for one in sorted({lengths[0], lengths[-1]}))} frames long."
    )
    if True in feet:
        where = ", if the method includes this" if False in feet else ""
        how += f" After blending, root and legs were moved so that feet that bear weight stand{where}."
    return how + "".join(others), "blend or the cut" if cuts else "blend"


def _procedure(protocol: Protocol, analysis: Analysis, presentations: pd.DataFrame) -> str:
    timing = protocol.timing
    most = max(task_of(study).slots for study in protocol.studies)
    those = "two stimuli of a pair" if most == 2 else "stimuli of a trial"
    pair = f"The {those} followed each other after {timing.gap_s:g} s. " if most > 1 else ""
    rest = f" A break was offered after every {counted(timing.break_after, 'trial')}." if timing.break_after else ""
    limit = (
        f"Participants had {timing.answer_s:g} s to answer; a later answer was recorded as no response. "
        if any(task_of(study).timed for study in protocol.studies)
        else ""
    )
    free = "Ratings had no time limit. " if any(not task_of(study).timed for study in protocol.studies) else ""
    return f"{pair}{limit}{free}A pause of {timing.pause_s:g} s followed.{rest} {_shown(analysis, presentations)}"


def _shown(analysis: Analysis, presentations: pd.DataFrame) -> str:
    if not len(presentations):
        nobody = "No stimulus was shown: observers were simulated." if analysis.data == "simulated" else ""
        return nobody or "How stimuli were shown was not recorded."
    timers = {
        "requestVideoFrameCallback": "a web browser, with every presented frame logged",
        "swap": "a window, with every buffer swap timed",
    }
    parts = [
        f"{counted(len(part), 'presentation')} in {timers.get(str(method), f'a way timed by {method} only')}"
        for method, part in presentations.groupby("method", sort=True)
    ]
    badly = int((~presentations["shown_well"].astype(bool)).sum())
    return (
        f"Stimuli were presented in {words.joined(parts)}; {badly:,} of {len(presentations):,} presentations stalled, "
        "lost frames or were hidden."
    )


def _analysis(analysis: Analysis) -> str:
    parts = [
        "The participant was the unit of analysis; published statistics, which pool all responses, are given alongside."
    ]
    for kind, shown in SECTIONS.items():
        if found := analysis.of(kind):
            parts.append(shown.methods(found.values(), analysis))
    parts.append(
        f"Confidence intervals are {100 * analysis.confidence:g}%, the significance level is {analysis.alpha:g}. "
        "Trials without a response were excluded and counted."
    )
    return " ".join(parts)


def _excluded(analysis: Analysis) -> str:
    found = analysis.exclusions
    if not found.rules:
        return "No rule of exclusion was preregistered; no participant and no response was excluded."
    rules = words.joined([rule.rule for rule in found.rules])
    wholly = counted(len(found.participants), "participant")
    return (
        f"By preregistered rules, these were excluded: {rules}; "
        f"{counted(found.answers_left_out, 'answer')} of {analysis.quality.trials:,} in all, among them "
        f"those of {wholly} excluded entirely. Results for all responses are given alongside."
    )


def _software(protocol: Protocol, analysis: Analysis, presentations: pd.DataFrame) -> str:
    # Segue's own sessions with people always record how stimuli were shown; those of other programs can't.
    own = len(presentations) > 0 or analysis.data == "simulated"
    made = "sessions" if own else "trials"
    return (
        f"Stimuli, {made} and analysis were made with Segue {study.__version__}, under the protocol {protocol.name} "
        f"(sha256 {protocol.sha256[:12]}).{'' if own else ' The sessions were run in another program.'}"
    )
