"""The verbs of the analysis by itself: fit data from elsewhere, and plan how many participants a study needs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from study.apps.console import emit, json_option
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

    from study.analysis.foreign import Columns, Trials


def read_table(path: Path) -> pd.DataFrame:
    """A table of texts from a file whose cells are parted by commas, semicolons or tabs.

    Raises
    ------
    AnalysisError
        When it can't be read as one.
    """
    import pandas as pd

    try:
        text = path.read_bytes()
        heading = text.splitlines()[0].decode("utf-8-sig") if text.strip() else ""
    except (OSError, UnicodeDecodeError) as error:
        raise AnalysisError(f"{path}: expected a table of UTF-8 text: {error}; save it as CSV, UTF-8") from error
    if not heading:
        raise AnalysisError(f"{path}: expected a table with a heading, found an empty file")
    separator = max(",;\t", key=heading.count)
    try:
        table = pd.read_csv(path, sep=separator, dtype=str, keep_default_na=False, encoding="utf-8-sig")
    except (ValueError, pd.errors.ParserError) as error:
        raise AnalysisError(f"{path}: expected a table, found what can't be read as one: {error}") from error
    if table.empty:
        raise AnalysisError(f"{path}: expected rows under the heading, found none")
    return table.reset_index(drop=True)


def _pairs(where: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    found = []
    for text in where:
        name, equals, value = text.partition("=")
        if not equals or not name.strip():
            raise AnalysisError(f"expected --where COLUMN=VALUE, found {text!r}")
        found.append((name.strip(), value))
    return tuple(found)


def _fit_function(trials: Trials, settings: dict[str, Any]) -> dict[str, Any]:
    """2AFC or yes-no."""
    from study.analysis.psychometric import make_model
    from study.analysis.psychometric_study import analyse_psychometric

    confidence = settings.pop("confidence")
    return analyse_psychometric(trials.table, make_model(**settings), confidence=confidence, simulations=500)


def _fit_pairs(trials: Trials, threshold: float, confidence: float, reference_first: str | None) -> dict[str, Any]:
    """Same-different, through the analysis of our own studies."""
    import numpy as np

    from study.analysis.jnd import analyse_jnd

    table = trials.table
    parts = []
    for column, answer in (("yes", "different"), ("no", "same")):
        count = table["yes"] if column == "yes" else table["shown"] - table["yes"]
        if (count % 1 != 0).any():
            raise AnalysisError(f"expected whole numbers of answers, found {count[count % 1 != 0].iloc[0]:g}")
        rows = table.loc[np.repeat(table.index.to_numpy(), count.to_numpy(dtype=int))]
        parts.append(rows.assign(answer=answer))
    import pandas as pd

    answers = pd.concat(parts, ignore_index=True).rename(columns={"level": "difference_frames"})
    answers["task"] = "same-different"
    if "order" in answers and reference_first is not None:
        answers["reference_first"] = answers["order"].str.lower() == reference_first.strip().lower()
    return analyse_jnd(answers, level=threshold, confidence=confidence)


@click.command()
@click.argument("data", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--task", type=click.Choice(["2afc", "yes-no", "same-different"]), required=True)
@click.option("--level", required=True, help="Column of the stimulus level (same-different: the signed difference).")
@click.option("--answer", required=True, help="Column of the answer: right or wrong, yes or no, same or different.")
@click.option("--participant", help="Column that says who answered; one participant unless given.")
@click.option("--shown", help="Column with the number of answers a row stands for; then --answer counts them.")
@click.option("--yes", multiple=True, help="What counts as right, yes or different; may be repeated.")
@click.option("--where", multiple=True, help="COLUMN=VALUE: take only these rows; may be repeated.")
@click.option("--order", help="Same-different: column that says which of a pair came first.")
@click.option("--reference-first", help="Same-different: what it holds where the reference came first.")
@click.option(
    "--sigmoid", type=click.Choice(["normal", "logistic", "gumbel", "weibull"]), default="normal", show_default=True
)
@click.option("--choices", type=click.IntRange(min=2), default=2, show_default=True, help="2afc: of how many.")
@click.option("--guess", type=click.FloatRange(0, 1, max_open=True), help="Hold the guess rate (yes-no).")
@click.option("--lapse", type=click.FloatRange(0, 1, max_open=True), help="Hold the lapse rate.")
@click.option("--threshold", type=click.FloatRange(0.5, 1, True, True), default=0.75, help="Same-different: share.")
@click.option("--confidence", type=click.FloatRange(0.5, 1, True, True), default=0.95, show_default=True)
@json_option
def fit(data: Path, task: str, threshold: float, as_json: bool, **options: Any) -> None:
    """Fit data that another program wrote (PsychoPy, jsPsych, Gorilla): CSV, with its columns named here.

    Example: segue fit data.csv --task 2afc --level contrast --answer key_resp.corr --participant participant
    """
    trials = _read(data, task, options)
    confidence, reference = options["confidence"], options["reference_first"]
    if task == "same-different":
        found = _fit_pairs(trials, threshold, confidence, reference)
    else:
        names = ("sigmoid", "choices", "guess", "lapse", "confidence")
        found = _fit_function(trials, {"task": task, **{name: options[name] for name in names}})
    counts = {"rows": trials.rows, "used": trials.used, "blank": trials.blank, "missed": trials.missed}
    people = trials.table["participant"].nunique()
    text = (
        f"{data}: {trials.used} of {trials.rows} rows used ({trials.blank} without a level, {trials.missed} without an "
        f"answer), {people} participant{'' if people == 1 else 's'}\n{found['answer']}"
    )
    emit({"file": data.name, "task": task, **counts, **found}, as_json, text)


def _read(data: Path, task: str, options: dict[str, Any]) -> Trials:
    from study.analysis.foreign import Columns, read_trials

    columns: Columns = Columns(
        level=options["level"],
        answer=options["answer"],
        shown=options["shown"],
        participant=options["participant"],
        order=options["order"],
        yes=tuple(options["yes"]),
        where=_pairs(options["where"]),
    )
    try:
        return read_trials(read_table(data), columns, task)
    except AnalysisError as error:
        text = str(error)
        raise error if text.startswith(str(data)) else AnalysisError(f"{data}: {text}") from error
