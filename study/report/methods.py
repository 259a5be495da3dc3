"""The methods of a report, ready for a paper: protocol, manifest, presentations and analysis in, paragraphs out.

Each sentence follows from what was run; methods that were not used are neither described nor cited.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from study.counting import counted
from study.report import words
from study.tasks.registry import task_of
from study.transitions.methods.makes.blends import Blending
from study.transitions.methods.method import WANG_2003, WANG_2004
from study.transitions.methods.registry import METHODS

if TYPE_CHECKING:
    import pandas as pd

    from study.experiment.protocol.whole import Protocol, StudySpec
    from study.experiment.stimuli.manifest import Manifest
    from study.transitions.methods.method import Method

Result = Mapping[str, Any]

REFERENCES = {
    "fieller": "Fieller, E. C. (1954). Some problems in interval estimation. Journal of the Royal Statistical "
    "Society B, "
    "16, 175–185.",
    "differencing": "Macmillan, N. A., & Creelman, C. D. (2005). Detection theory: A user’s guide (2nd ed., ch. 9). "
    "Erlbaum.",
    "wilson": "Wilson, E. B. (1927). Probable inference, the law of succession, and statistical inference. Journal "
    "of the "
    "American Statistical Association, 22, 209–212.",
    "holm": "Holm, S. (1979). A simple sequentially rejective multiple test procedure. Scandinavian Journal of "
    "Statistics, 6, 65–70.",
    "gee": "Liang, K.-Y., & Zeger, S. L. (1986). Longitudinal data analysis using generalized linear models. "
    "Biometrika, "
    "73, 13–22.",
    "gee-small": "Mancl, L. A., & DeRouen, T. A. (2001). A covariance estimator for GEE with improved small-sample "
    "properties. Biometrics, 57, 126–134.",
    "equivalence": "Schuirmann, D. J. (1987). A comparison of the two one-sided tests procedure and the power "
    "approach. "
    "Journal of Pharmacokinetics and Biopharmaceutics, 15, 657–680.",
    "bayes": "Rouder, J. N., Speckman, P. L., Sun, D., Morey, R. D., & Iverson, G. (2009). Bayesian t tests for "
    "accepting "
    "and rejecting the null hypothesis. Psychonomic Bulletin & Review, 16, 225–237.",
    "strengths": "Bradley, R. A., & Terry, M. E. (1952). Rank analysis of incomplete block designs. Biometrika, 39, "
    "324–345.",
}

ORDERS = {
    "both": "Each pair was shown in both orders",
    "random": "The order within each pair was drawn at random",
    "balanced": "Half of the pairs were shown in each order",
    "by-group": "The order followed from the participant’s group",
}


SINGLE_ORDERS = {
    **dict.fromkeys(("both", "random", "balanced"), "Transitions were shown one at a time, in random order"),
    "by-group": "Transitions were shown one at a time; which method came first followed from the participant’s group",
}


def methods_paragraphs(
    protocol: Protocol, manifest: Manifest, analysis: Result, presentations: pd.DataFrame, who: str
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
    """
    return [
        ("Participants and design", _design(protocol, analysis, who)),
        ("Stimuli", _stimuli(protocol, manifest)),
        ("Apparatus and procedure", _procedure(protocol, analysis, presentations)),
        ("Analysis", _analysis(protocol, analysis)),
        ("Exclusions", _excluded(analysis)),
        ("Software", _software(protocol)),
    ]


def references(protocol: Protocol, analysis: Result) -> list[str]:
    """Return the works that the methods rest on, by author; only those whose methods were used."""
    works = {work for method in _methods(protocol).values() for work in method.sources}
    works |= {WANG_2003} if analysis["ratings"] or analysis["pair_ratings"] else set()
    works |= {WANG_2004} if analysis["jnd"] else set()
    used: set[str] = set()
    used |= {"fieller", "differencing", "wilson"} if analysis["jnd"] else set()
    if analysis["preference"]:
        used |= {"wilson", "holm", "gee", "gee-small", "equivalence", "bayes"}
    used |= {"strengths"} if any(analysis["bradley_terry"].values()) else set()
    return sorted({*works, *(REFERENCES[key] for key in used)})


def _methods(protocol: Protocol) -> dict[str, Method]:
    """The methods that the protocol's studies show, by name."""
    return {name: method for study in protocol.studies for name, method in protocol.methods_of(study).items()}


def _design(protocol: Protocol, analysis: Result, who: str) -> str:
    studies = counted(len(protocol.studies), "study", "studies")
    asked = analysis["quality"]
    each = asked["trials"] / max(asked["participants"], 1)
    return (
        f"{words.sentence(who)} took part in one sitting of {studies}. "
        f"{' '.join(_study(protocol, study) for study in protocol.studies)} Trials came in an order drawn anew for "
        f"every participant (seed {protocol.seed}); a participant was asked {counted(round(each), 'question')} "
        "on average."
    )


def _study(protocol: Protocol, study: StudySpec) -> str:
    title = words.readable(study.title or study.name)
    what = task_of(study).in_words(study, lambda method: _blends(protocol, study, method))
    repeated = f", {study.repeats} times" if study.repeats > 1 else ""
    order = (ORDERS if task_of(study).slots > 1 else SINGLE_ORDERS)[study.order]
    return f"In “{title}”, participants {what}. {order}{repeated}."


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
    camera = f"a camera travelling with it (smoothed over {shown.track_s:g} s)" if shown.track_s else "a fixed camera"
    ground = "above a ground plane" if shown.floor else "without a ground plane"
    how, joint = _made(protocol, manifest)
    return (
        f"{counted(len(manifest.records), 'transition')} between {motions} {how} Each was rendered as a "
        f"{shown.style} figure of {shown.width} × {shown.height} pixels at {protocol.fps:g} frames per second, seen by "
        f"{camera} {ground}, with {shown.entry_s:g} s before and {shown.exit_s:g} s after the {joint}."
    )


def _made(protocol: Protocol, manifest: Manifest) -> tuple[str, str]:
    """How the transitions were made, as the end of a sentence and further ones, and what they are called."""
    methods = _methods(protocol)
    others = [f" Those by “{words.readable(name)}” {one.make.how}." for name, one in methods.items() if one.make.how]
    plain = [record for record in manifest.records if not methods[record.method].make.how]
    blended = sum(record.blend_frames > 0 for record in plain)
    cuts = len(plain) - blended
    if not plain:
        return f"were shown.{''.join(others)}", "transition"
    if not blended:
        return f"were cuts from a frame of the source to a frame of the destination.{''.join(others)}", "cut"
    makes = [method.make for method in methods.values() if isinstance(method.make, Blending)]
    weights, feet = sorted({make.weight for make in makes}), {make.clean_feet for make in makes}
    how = (
        f"were blended by spherical linear interpolation under a {' or '.join(weights)} weight, between a start frame "
        f"in the source and an end frame in the destination{' (cuts were not blended)' if cuts else ''}."
    )
    if True in feet:
        where = ", where the method is said to do so" if False in feet else ""
        how += f" Sliding of planted feet was removed after blending{where}."
    return how + "".join(others), "blend or the cut" if cuts else "blend"


def _procedure(protocol: Protocol, analysis: Result, presentations: pd.DataFrame) -> str:
    timing = protocol.timing
    paired = any(task_of(study).slots > 1 for study in protocol.studies)
    pair = f"The two stimuli of a pair followed each other after {timing.gap_s:g} s. " if paired else ""
    rest = f" A break was offered after every {counted(timing.break_after, 'trial')}." if timing.break_after else ""
    limit = (
        f"Participants had {timing.answer_s:g} s to answer; an answer not given in time was recorded as missed. "
        if any(task_of(study).timed for study in protocol.studies)
        else ""
    )
    free = "Ratings had no time limit. " if any(not task_of(study).timed for study in protocol.studies) else ""
    return f"{pair}{limit}{free}A pause of {timing.pause_s:g} s followed.{rest} {_shown(analysis, presentations)}"


def _shown(analysis: Result, presentations: pd.DataFrame) -> str:
    if not len(presentations):
        nobody = "No stimulus was shown: observers were simulated." if analysis["data"] == "simulated" else ""
        return nobody or "How stimuli were shown was not recorded."
    timers = {
        "requestVideoFrameCallback": "a web browser, every presented frame logged",
        "swap": "a window, every buffer swap timed",
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


def _analysis(protocol: Protocol, analysis: Result) -> str:
    parts = ["The participant was the unit of analysis; published statistics, which pool all answers, stand beside."]
    if analysis["jnd"]:
        percent = f"{100 * protocol.analysis.threshold:.0f}%"
        parts.append(
            f"Percentages of “different” are means over participants ± standard errors. Just noticeable differences "
            f"are where these reach {percent}: read off straight lines as in 2004, with Fieller’s intervals over "
            "participants, and on a differencing model of the same-different task (Macmillan & Creelman 2005: one "
            "criterion, a slope each for shorter and longer blends, a lapse rate of at most 10%), fitted by maximum "
            "likelihood to all answers, with intervals by Student’s t of the logarithm from a jackknife over "
            "participants; profile-likelihood intervals are given beside them."
        )
    if analysis["preference"]:
        count = len(analysis["confirmatory"])
        family = f" and adjusted by Holm’s method over {count} comparisons" if count > 1 else ""
        parts.append(
            "Preferences were tested by Student’s t of one share a participant against one half"
            f"{family}; chi-square and exact binomial tests of all answers are given as published, with Wilson’s "
            "intervals. A logistic mixed model (random intercept, adaptive Gauss-Hermite quadrature) and generalised "
            "estimating equations (Liang & Zeger 1986, covariance of Mancl & DeRouen 2001) account for the order of "
            "presentation. Evidence for no preference is an equivalence test (Schuirmann 1987) and a Bayes factor "
            "(Rouder et al. 2009)."
        )
    if analysis["ratings"]:
        parts.append(
            "Ratings were compared by the two-way between-subjects analysis of variance of 2003 (method by order; type "
            "III sums of squares), and by Student’s t of each participant’s own difference."
        )
    if analysis["pair_ratings"]:
        parts.append(
            "Comparisons on a scale were turned by the order of presentation, so that they say how the comparison was "
            "rated against the reference; one mean score a participant was tested against the middle of the scale by "
            "Student’s t and Wilcoxon’s signed ranks, and between the orders by analysis of variance."
        )
    parts.append(
        f"Intervals are of {100 * analysis['confidence']:g}%, the level of significance is {analysis['alpha']:g}. "
        "Missed answers were left out and counted."
    )
    return " ".join(parts)


def _excluded(analysis: Result) -> str:
    found = analysis["exclusions"]
    if not found["rules"]:
        return "No rule of exclusion was stated beforehand; no participant and no answer was left out."
    rules = words.joined([rule["rule"] for rule in found["rules"]])
    wholly = counted(len(found["participants"]), "participant")
    return (
        f"By rules stated before there was data, these were left out: {rules}; "
        f"{counted(found['answers_left_out'], 'answer')} of {analysis['quality']['trials']:,} in all, among them "
        f"those of {wholly} left out wholly. Results of all answers are given beside."
    )


def _software(protocol: Protocol) -> str:
    import study

    return (
        f"Stimuli, sessions and analysis were made with Segue {study.__version__}, under the protocol {protocol.name} "
        f"(sha256 {protocol.sha256[:12]})."
    )
