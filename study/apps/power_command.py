"""`segue power`: participants that a protocol needs, by simulation through its real plan and the real analysis."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import click

from study.apps.console import emit, json_option, library_option, progress
from study.errors import AnalysisError

if TYPE_CHECKING:
    import numpy as np

    from study.analysis.power import Power
    from study.experiment.plan import Trial
    from study.experiment.protocol import Protocol, StudySpec

Simulate = Callable[["np.random.Generator", int], Any]
Finds = Callable[[Any, int], bool]


def plans_of(protocol: Protocol, study: StudySpec, library: str | None, participants: int) -> list[list[Trial]]:
    """The trials of one study in the real plans of this many participants."""
    from study.apps.study_commands import prepare_stimuli
    from study.experiment.plan import draw_plan

    pairs = prepare_stimuli(protocol, library).pairs
    plans = [draw_plan(protocol, pairs, f"power-{place:03}", group=place) for place in range(participants)]
    return [[trial for trial in plan.trials if trial.study == study.name and trial.role == "trial"] for plan in plans]


def preference_study(
    plans: Sequence[Sequence[Trial]], share: float, correlation: float, order_bias: float, alpha: float
) -> tuple[Simulate, Finds]:
    """Simulated preferences, and whether the test over participants finds them, in the right direction."""
    import numpy as np

    from study.analysis.power import logit_normal
    from study.analysis.preference import participant_tests
    from study.experiment.observer_models import logistic

    mean, spread = logit_normal(share, correlation)
    signs = [np.array([1.0 if trial.a_first else -1.0 for trial in plan]) for plan in plans]

    def simulate(rng: np.random.Generator, participants: int) -> Any:
        chosen = np.zeros(participants)
        for person in range(participants):
            leaning = mean + spread * rng.standard_normal() + order_bias * signs[person]
            chosen[person] = (rng.random(len(leaning)) < logistic(leaning)).sum()
        return chosen

    shown = np.array([len(plan) for plan in plans], dtype=np.float64)

    def finds(chosen: Any, participants: int) -> bool:
        test = participant_tests(chosen[:participants], shown[:participants])
        towards = test["mean_percent"] is not None and (test["mean_percent"] > 50) == (share > 0.5)
        return test["p_value"] is not None and test["p_value"] < alpha and (towards or share == 0.5)

    return simulate, finds


def same_different_study(
    plans: Sequence[Sequence[Trial]], shorter: float, longer: float, spread: float, precision: float, level: float
) -> tuple[Simulate, Finds]:
    """Simulated same-different answers, and whether the thresholds' intervals are as narrow as asked on every side."""
    from dataclasses import replace

    import numpy as np

    from study.analysis.same_different import Counts
    from study.analysis.same_different_model import ModelFit, fit_model
    from study.experiment.observer_models import default_observer, probability_different
    from study.experiment.observers import person

    settings = default_observer(shorter, longer)
    typical = replace(settings.same_different, log_sensitivity_sd=spread, criterion_sd=spread)
    settings = replace(settings, same_different=typical)
    asked = [np.array([float(trial.difference_frames or 0) for trial in plan]) for plan in plans]
    levels = np.unique(np.concatenate(asked))
    shown = np.array([[float((own == place).sum()) for place in levels] for own in asked])

    def simulate(rng: np.random.Generator, participants: int) -> Any:
        seed = int(rng.integers(2**31))
        people = [person(settings, f"power-{place:03}", seed).settings.same_different for place in range(participants)]
        chances = np.array([probability_different(who, levels) for who in people])
        return rng.binomial(shown[:participants].astype(int), chances).astype(np.float64)

    def finds(different: Any, participants: int) -> bool:
        names = tuple(str(place) for place in range(participants))
        fit = fit_model(Counts(names, levels, different[:participants], shown[:participants]), level=level)
        if not isinstance(fit, ModelFit):
            return False
        return all(
            found.interval.low is not None
            and found.interval.high is not None
            and found.interval.high - found.interval.low <= 2 * precision
            for found in fit.jnd.values()
        )

    return simulate, finds


def chosen_study(protocol: Protocol, name: str | None) -> StudySpec:
    """The study asked for, or the only one whose power can be told.

    Raises
    ------
    AnalysisError
        When there is none, or more than one to choose from.
    """
    known = [study for study in protocol.studies if study.task in ("same-different", "preference")]
    names = ", ".join(study.name for study in known)
    if not known:
        raise AnalysisError(f"{protocol.name}: expected a same-different or preference study, found none")
    if name is None:
        if len(known) > 1:
            raise AnalysisError(f"{protocol.name}: expected --study with one of {names}")
        return known[0]
    for study in known:
        if study.name == name:
            return study
    raise AnalysisError(f"{protocol.name}: expected one of the studies {names}, found {name!r}")


def _sizes(text: str) -> list[int]:
    try:
        return [int(part) for part in text.split(",")]
    except ValueError as error:
        raise AnalysisError(f"expected --participants as numbers such as 10,20,40, found {text!r}") from error


@click.command()
@click.argument("protocol")
@click.option("--study", "name", help="Name of the study; the only one unless given.")
@click.option("--participants", default="8,12,16,24,35,50", show_default=True, help="Numbers to try.")
@click.option("--target", type=click.FloatRange(0, 1, True, True), default=0.8, show_default=True, help="Power.")
@click.option("--share", type=click.FloatRange(0, 1, True, True), default=0.65, show_default=True,
              help="Preference: true share for the first method.")  # fmt: skip
@click.option("--correlation", type=click.FloatRange(0, 0.9), default=0.1, show_default=True,
              help="Preference: intraclass correlation of a participant's answers.")  # fmt: skip
@click.option("--order-bias", type=float, default=0.1, show_default=True, help="Preference: logits for the first.")
@click.option("--shorter", type=click.FloatRange(min=0, min_open=True), default=8.0, show_default=True,
              help="Same-different: true threshold, frames shorter.")  # fmt: skip
@click.option("--longer", type=click.FloatRange(min=0, min_open=True), default=7.0, show_default=True,
              help="Same-different: true threshold, frames longer.")  # fmt: skip
@click.option("--spread", type=click.FloatRange(0, 1), default=0.15, show_default=True,
              help="Same-different: how participants differ.")  # fmt: skip
@click.option("--precision", type=click.FloatRange(min=0, min_open=True), default=1.0, show_default=True,
              help="Same-different: half the width asked of the 95% intervals, frames.")  # fmt: skip
@click.option("--studies", type=click.IntRange(min=10), default=200, show_default=True, help="Simulated studies.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@library_option
@json_option
def power(
    protocol: str, name: str | None, participants: str, library: str | None, as_json: bool, **options: Any
) -> None:
    """How many participants a protocol needs, at stated effects, by simulation."""
    from study.analysis.estimates import plain
    from study.analysis.power import power_curve
    from study.apps.study_commands import load

    checked, sizes = load(protocol), _sizes(participants)
    study = chosen_study(checked, name)
    plans = plans_of(checked, study, library, max(sizes))
    if study.task == "preference":
        effect = {key: options[key] for key in ("share", "correlation", "order_bias")}
        parts = preference_study(plans, **effect, alpha=checked.analysis.alpha)
        aim = f"find a preference of {100 * options['share']:g}% at the level {checked.analysis.alpha:g}"
    else:
        effect = {key: options[key] for key in ("shorter", "longer", "spread", "precision")}
        parts = same_different_study(plans, **effect, level=checked.analysis.threshold)
        aim = f"tell both thresholds to ± {options['precision']:g} frames"
    with progress("studies") as report:
        found = power_curve(
            *parts,
            sizes,
            studies=options["studies"],
            target=options["target"],
            seed=options["seed"],
            progress=lambda done, total: report(done / total, f"{done} of {total}"),
        )
    result = {"protocol": checked.name, "study": study.name, "effect": effect, "aim": aim, **plain(found)}
    emit({**result, "answers_per_participant": len(plans[0])}, as_json, _in_words(found, aim, len(plans[0])))


def _in_words(found: Power, aim: str, answers: int) -> str:
    """The curve as a table with bars, and the number."""
    lines = [f"{'participants':>12}  power  95% interval"]
    for point in found.points:
        low, high = point.interval.low or 0.0, point.interval.high or 0.0
        bar = "#" * round(30 * point.power)
        lines.append(f"{point.participants:12}  {point.power:5.2f}  {low:.2f} to {high:.2f}   {bar}")
    who = f"{found.needed} participants" if found.needed else "no number tried"
    lines.append(
        f"To {aim} in {100 * found.target:g}% of studies, {answers} answers each: {who}"
        + (f" ({found.note})." if found.note else ".")
    )
    return "\n".join(lines)
