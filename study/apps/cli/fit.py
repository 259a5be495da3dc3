"""`segue fit`: data that another program wrote, through the same analyses as our own."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from study.apps.cli.console import READABLE, emit, json_option
from study.counting import counted, noun
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

    from study.analysis.conditions import OwnEstimate
    from study.analysis.foreign.columns import Columns, Foreign
    from study.analysis.psychometric.analyse import PsychometricStudy
    from study.analysis.same_different.analyse import SameDifferent

Read = tuple["Foreign", Callable[[], dict[str, Any]]]
"""What was read, and its analysis: as JSON holds it, with `answer` in words and `headline`."""

# The options of each task, in addition to the common ones; others are refused.
OWN = {
    "2afc": ("level", "motion", "condition", "shown", "yes", "sigmoid", "choices", "lapse"),
    "yes-no": ("level", "motion", "condition", "shown", "yes", "sigmoid", "guess", "lapse"),
    "same-different": (
        "level",
        "motion",
        "condition",
        "shown",
        "yes",
        "order",
        "reference_first",
        "threshold",
        "lapse",
    ),
    "preference": ("first", "second", "motion", "yes", "tie", "alpha"),
    "rating": ("method", "motion", "item", "scale", "ends", "alpha"),
}
COLUMNS = (
    "level",
    "answer",
    "participant",
    "shown",
    "order",
    "first",
    "second",
    "method",
    "motion",
    "item",
    "condition",
)


def read_table(path: Path, needed: tuple[str, ...], delimiter: str | None = None) -> pd.DataFrame:
    """A table of texts from a file: delimited text, or trials in JSON.

    Raises
    ------
    AnalysisError
        When it can't be read as one.
    """
    from study.analysis.foreign.json_files import looks_like_json, parse_json
    from study.analysis.foreign.text import decoded, parse_table

    try:
        content = path.read_bytes()
    except OSError as error:
        raise AnalysisError(f"expected a table, found a file that can't be read: {error}") from error
    text = decoded(content)
    return parse_json(text) if looks_like_json(text) else parse_table(text, needed, delimiter)


def _scale(given: tuple[str, ...]) -> tuple[tuple[str, float], ...]:
    """Words of a scale and their points."""
    found = []
    for text in given:
        word, equals, point = text.rpartition("=")
        try:
            found.append((word, float(point)))
        except ValueError:
            equals = ""
        if not equals or not word.strip():
            raise AnalysisError(f'expected --scale "WORD=POINT" as in "Agree=4", found {text!r}')
    return tuple(found)


def _where(options: dict[str, Any]) -> tuple[tuple[str, str], ...]:
    """Columns, and the value that a row must hold there."""
    found = []
    for text in options["where"]:
        name, equals, value = text.partition("=")
        if not equals or not name.strip():
            raise AnalysisError(f"expected --where COLUMN=VALUE, found {text!r}")
        found.append((name.strip(), value))
    return tuple(found)


def _function(table: pd.DataFrame, options: dict[str, Any]) -> Read:
    """2AFC or yes-no."""
    from study.analysis.psychometric.analyse import analyse_psychometric, own_functions
    from study.analysis.psychometric.model import make_model

    trials = _trials(table, options)
    settings = {name: options[name] for name in ("guess", "lapse")}
    model = make_model(
        options["task"], sigmoid=options["sigmoid"] or "normal", choices=options["choices"] or 2, **settings
    )
    confidence = options["confidence"]

    def analysed(part: pd.DataFrame) -> PsychometricStudy:
        return analyse_psychometric(part, model, confidence=confidence, simulations=500)

    def own(part: pd.DataFrame, name: str) -> Iterable[OwnEstimate]:
        return own_functions(part, name, model, confidence)

    return trials, lambda: _by_condition(trials.table, analysed, own, options)


def _same_different(table: pd.DataFrame, options: dict[str, Any]) -> Read:
    """Same-different, through the analysis of our own studies."""
    from study.analysis.same_different.analyse import analyse_jnd
    from study.analysis.same_different.counts import count_answers
    from study.analysis.same_different.own import own_estimates

    trials = _trials(table, options)
    level, confidence, lapse = options["threshold"] or 0.75, options["confidence"], options["lapse"]

    def analysed(part: pd.DataFrame) -> SameDifferent:
        return analyse_jnd(_pairs_answered(part, options), level=level, confidence=confidence, lapse=lapse)

    def own(part: pd.DataFrame, name: str) -> Iterable[OwnEstimate]:
        return own_estimates(count_answers(_pairs_answered(part, options)), name, level, lapse)

    return trials, lambda: _by_condition(trials.table, analysed, own, options)


def _by_condition(
    table: pd.DataFrame,
    analysed: Callable[[pd.DataFrame], PsychometricStudy | SameDifferent],
    own: Callable[[pd.DataFrame, str], Iterable[OwnEstimate]],
    options: dict[str, Any],
) -> dict[str, Any]:
    """The analysis of all trials; where they have conditions, of each condition, and the differences between them."""
    from study.analysis.conditions import compare_conditions, headlines_of
    from study.analysis.to_json import to_json

    if not options["condition"]:
        return _told(analysed(table), options)
    parts = {str(name): part.reset_index(drop=True) for name, part in table.groupby("condition", sort=True)}
    studies = {name: _told(analysed(part), options | {"study": name}) for name, part in parts.items()}
    estimates = [one for name, part in parts.items() for one in own(part, name)]
    differences = compare_conditions(estimates, options["confidence"])
    lines = [f"{name}: {study['answer']}" for name, study in studies.items()]
    lines += [f"{one.of}: {one.in_words()} ({one.test})." for one in differences]
    headlines = [line for study in studies.values() for line in study["headline"]]
    compared = to_json(headlines_of(differences, options["study"], options["confidence"]))
    return {
        "conditions": studies,
        "differences": to_json(differences),
        "headline": [*headlines, *compared],
        "answer": "\n".join(lines),
    }


def _told(result: PsychometricStudy | SameDifferent, options: dict[str, Any]) -> dict[str, Any]:
    """A result as JSON, with its headlines."""
    from study.analysis.to_json import to_json

    headlines = result.headlines(options["study"], options["alpha"] or 0.05, options["confidence"])
    return {**to_json(result), "headline": to_json(headlines)}


def _pairs_answered(table: pd.DataFrame, options: dict[str, Any]) -> pd.DataFrame:
    """One row an answer, as our own studies have them."""
    import numpy as np
    import pandas as pd

    parts = []
    for column, answer in (("yes", "different"), ("no", "same")):
        count = table["yes"] if column == "yes" else table["shown"] - table["yes"]
        rows = table.loc[np.repeat(table.index.to_numpy(), count.to_numpy(dtype=int))]
        parts.append(rows.assign(answer=answer))
    answers = pd.concat(parts, ignore_index=True).rename(columns={"level": "difference_frames"})
    answers["task"] = "same-different"
    if options["order"]:
        answers["reference_first"] = _reference_first(answers["order"], options)
    return answers


def _reference_first(order: pd.Series[str], options: dict[str, Any]) -> pd.Series[bool]:
    """Whether the reference came first, from the column that says what did."""
    named, column = options["reference_first"], options["order"]
    seen = ", ".join(repr(value) for value in sorted(set(order))[:8])
    if named is None:
        raise AnalysisError(
            f"expected --reference-first with --order: which of {seen} in {column!r} says that the reference was first"
        )
    first: pd.Series[bool] = order.str.lower() == named.strip().lower()
    if not first.any() or (order == "").any():
        raise AnalysisError(f"expected {named!r} and another word in every row of {column!r}, found {seen}")
    return first


def _own_study(table: pd.DataFrame, options: dict[str, Any]) -> Read:
    """Preferences and ratings, through the analysis of our own studies."""
    from study.analysis.foreign.answers import read_preferences, read_ratings

    return _all_studies(
        {"preference": read_preferences, "rating": read_ratings}[options["task"]](table, _columns(options)), options
    )


def _export(table: pd.DataFrame, options: dict[str, Any]) -> Read:
    """What `segue export` wrote: all its studies, by the columns that they have there."""
    from study.analysis.foreign.own import read_own

    given = sorted(name for names in OWN.values() for name in (*names, "answer", "participant") if options[name])
    if unread := [name for name in given if name not in ("threshold", "alpha", "ends")]:
        raise AnalysisError(
            f"expected no --{unread[0].replace('_', '-')} with an export of segue's, whose columns are known; leave it "
            "out, or say --task"
        )
    return _all_studies(read_own(table, _where(options)), options)


def _all_studies(read: Foreign, options: dict[str, Any]) -> Read:
    from study.analysis.analyse import analyse, analysis_json
    from study.analysis.study_result import Settings

    low, high = options["ends"] or (0, 4)
    settings = Settings(
        confidence=options["confidence"],
        alpha=options["alpha"] or 0.05,
        threshold=options["threshold"] or 0.75,
        scale_points={str(name): round(high - low) + 1 for name in read.table["study"].unique()},
    )

    def analysed() -> dict[str, Any]:
        analysis = analyse(read.table, settings)
        return {**analysis_json(analysis), "answer": "\n".join(analysis.sentences())}

    return read, analysed


FITS: Mapping[str, Callable[[pd.DataFrame, dict[str, Any]], Read]] = {
    "2afc": _function,
    "yes-no": _function,
    "same-different": _same_different,
    "preference": _own_study,
    "rating": _own_study,
}
"""How each task's data are read and analysed."""


@click.command()
@click.argument("data", type=READABLE)
@click.option(
    "--task",
    type=click.Choice(list(FITS)),
    help="What was decided: 2afc, which is right; yes-no; same-different; preference; rating (default: as a file of "
    "segue export says).",
)
@click.option("--answer", help="Column of the response: right or wrong, yes or no, same or different, "
              "first or second (or the method chosen), a rating.")  # fmt: skip
@click.option("--level", help="Column of the stimulus level (same-different: the signed difference).")
@click.option("--participant", help="Column of the participant (default: one participant gave all).")
@click.option(
    "--shown",
    help="Column with the number of responses that a row stands for; --answer then counts them (default: each is one).",
)
@click.option("--yes", multiple=True, help="What counts as right, yes, different or first; may be repeated.")
@click.option("--tie", multiple=True, help="Preference: what counts as neither; may be repeated.")
@click.option("--where", multiple=True, help="COLUMN=VALUE: use only these rows; may be repeated.")
@click.option("--order", help="Same-different: column that says which of a pair came first (default: not considered).")
@click.option(
    "--reference-first", help="Same-different: the value of --order if the reference came first (default: none)."
)
@click.option("--first", help="Preference: column of the method shown first.")
@click.option("--second", help="Preference: column of the method shown second.")
@click.option("--method", help="Rating: column of the method.")
@click.option("--motion", help="Column of the motion (or other item) that was shown (default: not considered).")
@click.option(
    "--condition",
    help="Column of a condition or group to compare: each is analysed by itself (default: no comparison).",
)
@click.option("--item", help="Rating: column of the question (default: one question).")
@click.option("--scale", multiple=True, help="Rating: WORD=POINT, if the scale has words; once for each word.")
@click.option(
    "--ends", type=(float, float), help="Rating: lowest and highest point of the scale (default: those that occur)."
)
@click.option(
    "--sigmoid",
    type=click.Choice(["normal", "logistic", "gumbel", "weibull"]),
    help="2afc, yes-no: curve of normal, logistic, gumbel, or weibull (levels in logarithms) (default: normal).",
)
@click.option("--choices", type=click.IntRange(min=2), help="2afc: number of alternatives (default: 2).")
@click.option(
    "--guess",
    type=click.FloatRange(0, 1, max_open=True),
    help="Yes-no: fix the guess rate, a share (default: estimated).",
)
@click.option(
    "--lapse", type=click.FloatRange(0, 1, max_open=True), help="Fix the lapse rate, a share (default: estimated)."
)
@click.option(
    "--threshold",
    type=click.FloatRange(0.5, 1, True, True),
    help='Same-different: share of "different" at the threshold (default: 0.75).',
)
@click.option(
    "--alpha",
    type=click.FloatRange(0, 1, True, True),
    help="Preference, rating: level of significance, a probability (default: 0.05).",
)
@click.option("--confidence", type=click.FloatRange(0.5, 1, True, True), default=0.95, show_default=True,
              help="Confidence of the intervals, a probability.")  # fmt: skip
@click.option(
    "--delimiter",
    type=click.Choice(["comma", "semicolon", "tab", "pipe", "space"]),
    help="What stands between columns: comma, semicolon, tab, pipe or space (default: detected).",
)
@click.option(
    "--decimal", type=click.Choice(["point", "comma"]), help="Sign before decimals: point or comma (default: detected)."
)
@json_option
def fit(data: Path, task: str | None, **options: Any) -> None:
    """Analyse data from another program (PsychoPy, jsPsych, Gorilla): CSV or JSON, with its columns named here.

    The columns of what segue export writes are known: segue fit answers.csv
    """
    from study.analysis.foreign.own import is_own, own_trials

    if task is not None:
        _refuse_others(task, options)
    needed = tuple(options[name] for name in COLUMNS if options[name]) + tuple(name for name, _ in _where(options))
    try:
        table = read_table(data, needed, options["delimiter"])
        if is_own(table):
            table = table if task is None else own_trials(table)
        elif task is None or options["answer"] is None:
            missing = "--task" if task is None else "--answer"
            raise AnalysisError(f"expected {missing}, since this is no export of segue's with known columns; add it")
        fitting = FITS[task] if task else _export
        read, analysed = fitting(table, options | {"task": task, "study": data.stem})
    except AnalysisError as error:
        raise AnalysisError(f"{data}: {error}") from error
    found = analysed()
    counts = {"rows": read.rows, "used": read.used, "blank": read.blank, "missed": read.missed}
    people = read.table["participant"].nunique()
    text = (
        f"{data}: {read.used} of {counted(read.rows, 'row')} used ({read.blank} without a stimulus, "
        f"{read.missed} without an answer), {counted(people, 'participant')}\n{found['answer']}"
    )
    if copies := _copied_rows(table, options):
        text += (
            f"\n{counted(copies, 'row')} {noun(copies, 'is an exact copy', 'are exact copies')} of another, though "
            "a column tells all other rows of a participant apart: was the file joined twice?"
        )
    emit({"file": data.name, "task": task, **found, **counts, "copies": copies}, text)


def _copied_rows(table: pd.DataFrame, options: dict[str, Any]) -> int:
    """How many rows copy another though a column, such as the trial or its time, tells a participant's others apart."""
    once = table.drop_duplicates()
    who = [options["participant"]] if options["participant"] in table.columns else []
    others = [column for column in table.columns if column not in {options[name] for name in COLUMNS}]
    numbered = any(len(once[[*who, column]].drop_duplicates()) == len(once) for column in others)
    return len(table) - len(once) if numbered and len(once) > 1 else 0


def _refuse_others(task: str, options: dict[str, Any]) -> None:
    """An option that this task does not have would be passed over in silence."""
    others = {name for names in OWN.values() for name in names} - set(OWN[task])
    given = sorted(name for name in others if options[name] not in (None, ()))
    if given:
        raise AnalysisError(f"expected no --{given[0].replace('_', '-')} with --task {task}; leave it out")
    if "level" in OWN[task] and options["level"] is None:
        raise AnalysisError(f"expected --level with --task {task}: the column of the stimulus level")


def _trials(table: pd.DataFrame, options: dict[str, Any]) -> Foreign:
    from study.analysis.foreign.trials import read_trials

    return read_trials(table, _columns(options), options["task"])


def _columns(options: dict[str, Any]) -> Columns:
    from study.analysis.foreign.columns import Columns

    named: dict[str, Any] = {name: options[name] for name in (*COLUMNS, "decimal", "ends") if options[name] is not None}
    named |= {name: tuple(options[name]) for name in ("yes", "tie")}
    return Columns(**named, where=_where(options), scale=_scale(options["scale"]))
