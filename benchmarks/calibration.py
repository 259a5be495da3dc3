"""How far intervals and tests can be trusted: simulated studies with known truth through the real analysis.

    python benchmarks/calibration.py psychometric --cells check drawn:31 --studies 2000
    python benchmarks/calibration.py psychometric --cells check --profile --studies 500
    python benchmarks/calibration.py same-different --cells 2004 other --out cells.jsonl
    python benchmarks/calibration.py preference | mixed | pooled | speed

Observers are drawn by code that the analysis does not use; what they are stands in `calibration_psychometric` and
`calibration_same_different`. `--cells` takes sets or names of cells. Each cell is printed when it is done; with `--out`
it is also added to a file of JSON lines, and cells that stand there already (same studies and seed) are not run again.
"""

from __future__ import annotations

import argparse
import json
import time
from functools import partial
from pathlib import Path

import calibration_psychometric as psychometric
import calibration_same_different as same_different
import numpy as np
import pandas as pd
from scipy.special import ndtr
from scipy.stats import beta

from renderer.workers import run_jobs
from study.analysis.preference.participants import participant_tests
from study.analysis.preference.published import published_test
from study.analysis.psychometric.analyse import analyse_psychometric
from study.analysis.psychometric.likelihood import fit_likelihood
from study.analysis.psychometric.mixed import psychometric_mixed
from study.analysis.psychometric.model import make_model
from study.analysis.psychometric.posterior import fit_psychometric
from study.analysis.same_different import fits
from study.analysis.same_different.counts import Counts
from study.analysis.same_different.interpolation import crossings
from study.analysis.same_different.mixed import fit_mixed_thresholds
from study.analysis.same_different.model import fit_model

PSYCHOMETRIC = {"first": psychometric.FIRST, "check": psychometric.CHECK, "confirm": psychometric.CONFIRM}
SAME_DIFFERENT = {"2004": same_different.DESIGN_2004, "other": same_different.OTHER}


class Kept:
    """Rows that were done, in a file of JSON lines."""

    def __init__(self, path):
        self.path = Path(path) if path else None
        lines = self.path.read_text(encoding="utf-8").splitlines() if self.path and self.path.exists() else []
        self.rows = [json.loads(line) for line in lines]

    def has(self, cell, studies, seed):
        """Whether this cell was run already."""
        asked = (cell, studies, seed)
        return any((row["cell"], row["studies"], row["seed"]) == asked for row in self.rows)

    def add(self, rows, columns):
        """Print rows and keep them."""
        for row in rows:
            print(" ".join(text(row.get(key), width) for key, width in columns), flush=True)
            if self.path:
                with self.path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({key: plain(value) for key, value in row.items()}) + "\n")


def plain(value):
    return value if isinstance(value, str | int) else None if not np.isfinite(value) else round(float(value), 5)


def text(value, width):
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return f"{'':{width}}"
    return f"{value:{width}.3f}" if isinstance(value, float) else f"{value!s:{width}}"


def head(columns):
    print(" ".join(f"{key:{width}}" for key, width in columns), flush=True)


def chosen(sets, wanted, drawn=None):
    """Cells of the sets and names asked for."""
    everything = [cell for cells in sets.values() for cell in cells]
    found = []
    for name in wanted or sets:
        if drawn and name.startswith("drawn:"):
            found += drawn(int(name.split(":")[1]))
            continue
        cells = sets.get(name) or [cell for cell in everything if cell.name == name]
        if not cells:
            raise SystemExit(
                f"expected cells out of {', '.join([*sets, *(cell.name for cell in everything)])}, found {name}"
            )
        found += cells
    return found


def run_psychometric(options):
    columns = [("cell", 28), ("covers", 6), ("error", 6), ("below", 6), ("above", 6), ("open", 6), ("no value", 8),
               ("bias", 7), ("bias error", 10), ("ms", 6), ("profile", 7)]  # fmt: skip
    head(columns)
    kept = Kept(options.out)
    wanted = [name for name in options.cells if name != "prior"]
    if "prior" in options.cells:
        for task in ("2afc", "yes-no"):
            kept.add([psychometric.run_prior(task, options.studies, options.seed)], columns)
    cells = chosen(PSYCHOMETRIC, wanted, psychometric.drawn_cells) if wanted or not options.cells else ()
    run = partial(psychometric.run, studies=options.studies, seed=options.seed, profile=options.profile)
    for row in done(run, cells, kept, options):
        kept.add([row], columns)


def run_same_different(options):
    columns = [("cell", 14), ("side", 8), ("estimate", 23), ("true", 6), ("mean", 6), ("bias", 7), ("bias error", 10),
               ("sd", 6), ("se", 6), ("covers", 6), ("error", 6), ("open", 6), ("ms mixed", 8)]  # fmt: skip
    head(columns)
    kept = Kept(options.out)
    run = partial(same_different.run, studies=options.studies, seed=options.seed)
    for rows in done(run, chosen(SAME_DIFFERENT, options.cells), kept, options):
        kept.add(rows, columns)


def done(run, cells, kept, options):
    """What cells give that were not run before, as they finish."""
    todo = [cell for cell in cells if not kept.has(cell.name, options.studies, options.seed)]
    return (found for _, found in run_jobs(run, todo, options.cluster or options.workers))


def say_each(make, over, options):
    """Print the line that each of several conditions gives, in their order."""
    run = partial(make, studies=options.studies, seed=options.seed)
    for _, line in run_jobs(run, over, options.cluster or options.workers, in_order=True):
        print(line, flush=True)


def run_preference(options):
    """Type I error at nominal .05 of the test over participants, and of the published pooled one."""
    print(f"{'correlation':>11} {'participants':>12} {'published':>9}")
    say_each(preference, (0.0, 0.1, 0.2, 0.3), options)


def preference(correlation, studies, seed):
    """The same for answers of one person that correlate so."""
    rng, wrong = np.random.default_rng(seed), []
    shape = 0.5 * (1 / correlation - 1) if correlation else None
    for _ in range(studies):
        own = beta.rvs(shape, shape, size=35, random_state=rng) if shape else np.full(35, 0.5)
        chose = rng.binomial(8, own).astype(float)
        tests = participant_tests(chose, np.full(35, 8.0))
        wrong.append((tests.p_value, published_test(int(chose.sum()), 280).p_value))
    rates = (np.array(wrong, dtype=float) < 0.05).mean(axis=0)
    return f"{correlation:11} {rates[0]:12.3f} {rates[1]:9.3f}"


def many_people(rng, people):
    """2AFC answers of people who differ in threshold and slope, 7 levels, 30 answers each; the typical threshold 3."""
    levels, who = np.tile(np.arange(7.0), people), np.repeat(np.arange(people), 7)
    own = rng.multivariate_normal([-3.0, 1.0], [[0.16, 0.0], [0.0, 0.04]], size=people)
    chance = 0.5 + 0.5 * ndtr(own[who, 0] + own[who, 1] * levels)
    return pd.DataFrame({"participant": who, "level": levels, "yes": rng.binomial(30, chance), "shown": 30})


def run_mixed(options):
    """Coverage and time of the mixed model's threshold."""
    say_each(mixed, (8, 20), options)


def mixed(people, studies, seed):
    """The same for so many people."""
    rng, inside, values, spent = np.random.default_rng(seed), [], [], []
    for _ in range(studies):
        table = many_people(rng, people)
        started = time.process_time()
        found = psychometric_mixed(table, guess=0.5)
        spent.append(time.process_time() - started)
        if found.threshold is not None:
            inside.append(found.low <= 3.0 <= found.high)
            values.append(found.threshold)
    return (f"mixed, {people} people: {len(inside)} of {studies} fitted, mean {np.mean(values):.3f} (true 3)"
            f", covers {np.mean(inside):.3f}, {1000 * np.median(spent):.0f} ms")  # fmt: skip


def run_pooled(options):
    """How often intervals cover that take the answers of people who differ as one person's, or people as the unit."""
    say_each(pooled, (8, 20), options)


def pooled(people, studies, seed):
    """The same for so many people."""
    rng, inside = np.random.default_rng(seed + people), []
    for _ in range(studies):
        found = analyse_psychometric(many_people(rng, people))
        parts = found.pooled.threshold.interval, found.group, found.mixed
        inside.append([holds(part.low, part.high, 3.0) for part in parts])
    shares = np.nanmean(inside, axis=0)
    return (f"{people} people cover: all answers as one person's {shares[0]:.3f}, mean over participants "
            f"{shares[1]:.3f}, mixed {shares[2]:.3f}")  # fmt: skip


def holds(low, high, truth):
    """Whether an interval holds the truth; open ends reach on for ever, and both open is no interval."""
    if low is None and high is None:
        return np.nan
    return float((low is None or low <= truth) and (high is None or truth <= high))


def run_speed(options):
    """Milliseconds of processor time: medians of single calls, and batched ones a fit."""
    rng, levels, shown = np.random.default_rng(options.seed), np.arange(1.0, 8), np.full(7, 40.0)
    repeats = min(options.studies, 200)
    for task, guess in (("2afc", 0.5), ("yes-no", 0.05)):
        share, model = guess + (0.98 - guess) * ndtr((levels - 4) / 3 * 2 * 1.6449), make_model(task)
        yes = rng.binomial(40, share, size=(repeats, 7)).astype(float)
        single = clock(lambda row, model=model: fit_psychometric(levels, row, shown, model), yes)
        profile = clock(lambda row, model=model: fit_likelihood(levels, row, shown, model), yes[:20])
        print(f"{task}: posterior with intervals {single:.2f} ms; "
              f"likelihood with profile {profile:.0f} ms", flush=True)  # fmt: skip
    group = same_different.DESIGN_2004[-1]
    places = np.array(group.levels)
    share = same_different.chances(group, places, *same_different.draw_people(rng, group, 35))
    different, asked = rng.binomial(6, share).astype(float), np.full(share.shape, 6.0)
    counts = Counts(tuple(map(str, range(35))), places, different, asked)
    frames = np.column_stack([np.maximum(-places, 0), np.maximum(places, 0)])
    weights = rng.multinomial(35, np.full(35, 1 / 35), size=1000).astype(float)
    print(f"35 people, same-different: model with jackknife {clock(fit_model, [counts] * 20):.0f} ms, mixed model "
          f"{clock(fit_mixed_thresholds, [counts] * 20):.0f} ms", flush=True)  # fmt: skip
    boot = clock(lambda drawn: fits.fit(frames, drawn @ different, drawn @ asked), [weights] * 5)
    lines = clock(lambda number: crossings(counts, resamples=number), [1000] * 5)
    print(
        f"1,000 bootstraps over participants: of the model {boot:.0f} ms, of straight lines {lines:.0f} ms", flush=True
    )


def clock(call, arguments):
    """Median milliseconds of processor time of a call; the first one warms up and does not count."""
    call(arguments[0])
    spent = []
    for argument in arguments:
        started = time.process_time()
        call(argument)
        spent.append(time.process_time() - started)
    return 1000 * float(np.median(spent))


PARTS = {"psychometric": run_psychometric, "same-different": run_same_different, "preference": run_preference,
         "mixed": run_mixed, "pooled": run_pooled, "speed": run_speed}  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", choices=PARTS)
    parser.add_argument(
        "--cells", nargs="*", default=[], help="sets (check, drawn:SEED, 2004, ...) or names; all unless given"
    )
    parser.add_argument("--studies", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--profile", action="store_true", help="profile-likelihood intervals too (psychometric; slow)")
    parser.add_argument("--workers", type=int, default=1, help="processes for cells and conditions")
    parser.add_argument("--cluster", help="a Dask scheduler, whose workers have this folder on their PYTHONPATH")
    parser.add_argument("--out", help="a file of JSON lines to which rows are added")
    asked = parser.parse_args()
    PARTS[asked.part](asked)
