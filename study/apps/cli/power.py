"""`segue power`: participants that a protocol needs, by simulation through its real plan and the real analysis."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from study.analysis.to_json import to_json
from study.apps.cli.console import FOLDER, emit, json_option, library_option, progress, workers_options
from study.counting import counted
from study.errors import AnalysisError
from study.power.usual import USUAL

if TYPE_CHECKING:
    from study.power.design import PlannedStudy


def _sizes(text: str, option: str = "--participants", example: str = "10,20,40") -> list[int]:
    try:
        found = [int(part) for part in text.split(",")]
    except ValueError:
        found = []
    if not found or min(found) < 1:
        raise AnalysisError(f"expected {option} as numbers such as {example}, found {text!r}")
    return found


@click.command()
@click.argument("protocol")
@click.option("--study", "name", help="Name of the study (default: the only one).")
@click.option(
    "--participants",
    default="8,12,16,24,35,50",
    show_default=True,
    help="Numbers of participants to try, with commas between.",
)
@click.option(
    "--target",
    type=click.FloatRange(0, 1, True, True),
    default=USUAL["target"],
    show_default=True,
    help="Power that is wanted: the share of studies that find the effect.",
)
@click.option("--share", type=click.FloatRange(0, 1, True, True), default=USUAL["share"], show_default=True,
              help="Preference: true share of answers for the first method, from 0 to 1.")  # fmt: skip
@click.option("--correlation", type=click.FloatRange(0, 0.9), default=USUAL["correlation"], show_default=True,
              help="Preference, rating: intraclass correlation of a participant's responses.")  # fmt: skip
@click.option(
    "--order-bias",
    type=float,
    default=USUAL["order_bias"],
    show_default=True,
    help="Preference: how much likelier the film shown first is chosen, log-odds.",
)
@click.option("--motion-sd", type=click.FloatRange(0, 3), default=USUAL["motion_sd"], show_default=True,
              help="Preference: how motions differ, standard deviation in log-odds.")  # fmt: skip
@click.option("--motions", help="Preference: other numbers of motions to try as well, such as 4,8,16 (default: none).")
@click.option("--difference", type=float, default=USUAL["difference"], show_default=True,
              help="Rating: by how many points the comparison is rated higher.")  # fmt: skip
@click.option("--shorter", type=click.FloatRange(min=0, min_open=True), default=USUAL["shorter"], show_default=True,
              help="Differences of length: true threshold, frames shorter.")  # fmt: skip
@click.option("--longer", type=click.FloatRange(min=0, min_open=True), default=USUAL["longer"], show_default=True,
              help="Differences of length: true threshold, frames longer.")  # fmt: skip
@click.option("--spread", type=click.FloatRange(0, 1), default=USUAL["spread"], show_default=True,
              help="Differences of length: how participants differ, SD of the logarithm of sensitivity.")  # fmt: skip
@click.option("--precision", type=click.FloatRange(min=0, min_open=True), default=USUAL["precision"], show_default=True,
              help="Differences of length: required half-width of the intervals (1 - alpha), frames.")  # fmt: skip
@click.option("--missed", type=click.FloatRange(0, 1, max_open=True), default=USUAL["missed"], show_default=True,
              help="Share of trials without a response, from 0 to 1, besides late responses.")  # fmt: skip
@click.option(
    "--studies", type=click.IntRange(min=10), help="Number of simulated studies (default: 1000; for thresholds 200)."
)
@click.option(
    "--sessions", is_flag=True, help="Simulate whole sessions and the whole analysis: slow, with the same result."
)
@click.option(
    "--seed", type=click.IntRange(min=0), default=USUAL["seed"], show_default=True, help="Seed, a whole number."
)
@click.option("--out", type=FOLDER,
              help="Results folder for power_STUDY.json and .csv, which its report shows (default: none).")  # fmt: skip
@library_option
@workers_options
@json_option
def power(
    protocol: str,
    name: str | None,
    participants: str,
    library: str | None,
    out: Path | None,
    workers: int | str | None,
    **options: Any,
) -> None:
    """How many participants a protocol needs for given effects, by simulation."""
    from study.apps.cli.shared import load, prepare_stimuli
    from study.files import check_place
    from study.power.planned import chosen_study, plan_power

    checked, sizes = load(protocol), _sizes(participants)
    study = chosen_study(checked, name)
    if out is not None:
        check_place(out / f"power_{study.name}.json")
    options["motions"] = _sizes(options["motions"], "--motions", "4,8,16") if options["motions"] else ()
    pairs = prepare_stimuli(checked, library).pairs
    with progress("studies") as report:
        result = plan_power(
            checked,
            study,
            pairs,
            sizes,
            options,
            lambda done, total: report(done / total, f"{done} of {total}"),
            workers,
        )
    if out is not None:
        _write(out, result)
    emit(to_json(result), _in_words(result))


def _write(folder: Path, result: PlannedStudy) -> None:
    """The result as JSON, and its curve as CSV."""
    from study.files import write_whole

    stem = folder / f"power_{result.study}"
    write_whole(stem.with_suffix(".json"), json.dumps(to_json(result), indent=1, ensure_ascii=False) + "\n")
    rows = io.StringIO()
    table = csv.writer(rows)
    table.writerow(["study", "participants", "power", "low", "high", "simulations", "icc", "test", *result.effect])
    for point in result.points:
        numbers = [point.participants, point.power, point.interval.low, point.interval.high]
        table.writerow([result.study, *numbers, result.simulations, result.icc, result.test, *result.effect.values()])
    write_whole(stem.with_suffix(".csv"), rows.getvalue())


def _in_words(found: PlannedStudy) -> str:
    """The curve as a table with bars, and the number."""
    lines = [f"{'participants':>12}  power  95% interval"]
    for point in found.points:
        low, high = point.interval.low or 0.0, point.interval.high or 0.0
        bar = "#" * round(30 * point.power)
        lines.append(f"{point.participants:12}  {point.power:5.2f}  {low:.2f} to {high:.2f}   {bar}")
    who = counted(found.needed, "participant") if found.needed else "no number tried"
    lines.append(
        f"To {found.aim} in {100 * found.target:g}% of studies, "
        f"{counted(found.answers_per_participant, 'answer')} each: {who}" + (f" ({found.note})." if found.note else ".")
    )
    for row in found.by_motions:
        powers = ", ".join(f"{point.power:.2f} with {point.participants}" for point in row.points)
        lines.append(
            f"With {counted(row.motions, 'motion')}: "
            + (counted(row.needed, "participant") if row.needed else "no number tried is enough")
            + f" (power {powers})."
        )
    return "\n".join(lines)
