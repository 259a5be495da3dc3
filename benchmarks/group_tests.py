"""How far tests of groups can be trusted: simulated studies, with and without an effect, through the real analysis.

Run it from the repository: `python benchmarks/group_tests.py [part] [studies] [seed]`, part one of preference, motions,
crossed, strengths, thresholds, ratings, mixed, power, or all; 2,000 studies a cell unless said. Observers are drawn
here, by code that the analysis does not use. The 35 people and 8 answers are 2004's, the 26 people and two ratings
2003's.
"""

from __future__ import annotations

import sys
import time
from itertools import combinations

import numpy as np
import pandas as pd
from scipy.special import expit, ndtr

from study.analysis.crossed import crossed
from study.analysis.preference.bradley_terry import fit_bradley_terry
from study.analysis.preference.motions import motions_as_sample
from study.analysis.preference.no_effect import no_preference
from study.analysis.preference.participants import participant_tests
from study.analysis.preference.published import published_test
from study.analysis.psychometric.mixed import psychometric_mixed
from study.analysis.ratings.comparisons import rating_anova
from study.analysis.same_different.counts import Counts
from study.analysis.same_different.mixed import fit_mixed_thresholds
from study.experiment.sets import own_set
from study.tasks.trial import Pair

CORRELATIONS = (0.0, 0.1, 0.2, 0.3)


def shares(rng, people, correlation, mean=0.5):
    """Participants' own shares, beta distributed, with this intraclass correlation."""
    if not correlation:
        return np.full(people, mean)
    weight = 1 / correlation - 1
    return rng.beta(mean * weight, (1 - mean) * weight, size=people)


def rate(p_values, alpha=0.05):
    """How often a test finds something; where it can't be had, it does not."""
    known = np.array([np.nan if p is None else p for p in p_values], dtype=float)
    return float((known < alpha).mean())


def preference(studies, seed):
    """Type I error at nominal .05: the default test and those beside it; equivalence at the margin's edge."""
    print("preference: type I error at .05 (35 people, 8 answers); equivalence: error where the share is 60%")
    print(f"{'correlation':>11} {'default':>8} {'Wilcoxon':>8} {'published':>9} {'equivalence':>11}")
    for correlation in CORRELATIONS:
        rng = np.random.default_rng([seed, 1, int(100 * correlation)])
        rows, edge = [], []
        for _ in range(studies):
            chosen = rng.binomial(8, shares(rng, 35, correlation)).astype(float)
            tests = participant_tests(chosen, np.full(35, 8.0))
            pooled = published_test(int(chosen.sum()), 280).p_value
            rows.append((tests.p_value, tests.wilcoxon_p_value, pooled))
            far = rng.binomial(8, shares(rng, 35, correlation, 0.6)) / 8
            edge.append(no_preference(far, 0.1).equivalence_p_value)
        rates = [rate(column) for column in zip(*rows, strict=True)]
        print(f"{correlation:11} " + "{:8.3f} {:8.3f} {:9.3f}".format(*rates) + f" {rate(edge):11.3f}", flush=True)


def answers_of(chosen, first=None):
    """A table of answers from an array (people, motions)."""
    people, motions = chosen.shape
    table = pd.DataFrame(
        {
            "participant": np.repeat(np.arange(people), motions),
            "motion": np.tile(np.arange(motions), people),
            "chose_a": chosen.ravel().astype(float),
        }
    )
    return table if first is None else table.assign(a_first=first.ravel())


def motions(studies, seed):
    """Type I error where motions differ too: over participants, and over both. 3% of answers are missed."""
    print("motions: type I error at .05 where participants and motions differ (standard deviations in logits)")
    print(f"{'people':>6} {'motions':>7} {'sd people':>9} {'sd motions':>10} {'people':>7} {'both':>6}")
    for people, count, own, other in (
        (35, 8, 0.0, 0.0), (35, 8, 0.7, 0.0), (35, 8, 0.0, 0.5), (35, 8, 0.7, 0.5), (35, 8, 1.2, 1.0), (12, 4, 0.7, 0.5)
    ):  # fmt: skip
        rng, rows = np.random.default_rng([seed, 2, people, int(10 * own), int(10 * other)]), []
        for _ in range(studies):
            lean = own * rng.normal(size=(people, 1)) + other * rng.normal(size=(1, count))
            part = answers_of(rng.random((people, count)) < expit(lean))
            part = part[rng.random(len(part)) > 0.03]
            by = part.groupby("participant")["chose_a"].agg(["sum", "count"]).to_numpy(dtype=float).T
            found = motions_as_sample(part)
            both = found.both.p_value if found.both else None
            rows.append((participant_tests(*by).p_value, both))
        rates = [rate(column) for column in zip(*rows, strict=True)]
        print(f"{people:6} {count:7} {own:9} {other:10} " + "{:7.3f} {:6.3f}".format(*rates), flush=True)


def crossed_test(studies, seed):
    """Errors at .05 of the test over participants and motions, with no effect and with one of 0.6 logits."""
    print("crossed: errors at .05 over participants and motions; mean and range over people, effects and sd of people")
    print(f"{'motions':>7} {'sd motions':>10} {'mean':>6} {'lowest':>7} {'highest':>8}")
    rng = np.random.default_rng([seed, 6])
    for count in (3, 4, 6, 8):
        for other in (0.0, 0.25, 0.5, 1.0):
            found = []
            for people in (12, 20, 35):
                for own in (0.0, 0.6, 1.2):
                    for effect in (0.0, 0.6):
                        size = (studies, people, count)
                        lean = own * rng.normal(size=(*size[:2], 1)) + other * rng.normal(size=(studies, 1, count))
                        shown = rng.binomial(2, 0.97, size=size)
                        chosen = rng.binomial(shown, expit(effect + lean))
                        mean = expit(effect + np.hypot(own, other) * rng.normal(size=400_000)).mean()
                        found.append(float((crossed(chosen, shown).p_values(mean if effect else 0.5) < 0.05).mean()))
            print(f"{count:7} {other:10} {np.mean(found):6.3f} {min(found):7.3f} {max(found):8.3f}", flush=True)


def strengths(studies, seed):
    """Share of 95% intervals of Bradley-Terry strengths that hold the truth.

    Seven methods in balanced sets of 42 pairs on eight motions; people differ by 0.3 logits a method.
    """
    methods, names = "abcdefg", [f"motion{number}" for number in range(8)]
    true = dict(zip(methods, (0.0, 0.2, 0.4, 0.6, -0.3, 0.8, -1.5), strict=True))
    pairs = [Pair("", "", "", name, "", two, two) for name in names for two in combinations(methods, 2)]
    for people, apart in ((40, 0.0), (40, 0.4), (40, 0.8), (100, 0.4)):
        rng, held = np.random.default_rng(seed), {"participants": [], "participants and motions": []}
        for _ in range(studies):
            own = {name: {one: true[one] + apart * rng.standard_normal() for one in methods} for name in names}
            rows = []
            for person in range(people):
                taste = {one: 0.3 * rng.standard_normal() for one in methods}
                seen = own_set(pairs, 4, person)
                for pair, turned in zip(seen, rng.permutation(np.arange(len(seen)) % 2), strict=True):
                    first, second = pair.methods[::-1] if turned else pair.methods
                    liked = own[pair.motion]
                    chance = expit(liked[first] + taste[first] - liked[second] - taste[second] + 0.1)
                    rows.append((first, second, float(rng.random() < chance), str(person), pair.motion))
            first, second, chosen, who, where = (list(part) for part in zip(*rows, strict=True))
            for over, motions_too in (("participants", None), ("participants and motions", where)):
                found = fit_bradley_terry(
                    first, second, chosen, np.ones(len(rows)), reference="a", participants=who, motions=motions_too
                )
                held[over] += [
                    one.interval.low <= true[one.method] <= one.interval.high
                    for one in found.strengths
                    if one.method != "a"
                ]
        told = ", ".join(f"{np.mean(inside):.3f} over {over}" for over, inside in held.items())
        print(f"strengths, {people} people, motions {apart:g} logits apart: {told}", flush=True)


def thresholds(studies, seed):
    """Coverage of the median observer's threshold over participants and motions, whose log sensitivities differ."""
    print("thresholds: coverage of 95% intervals of the median observer's, over both and for these motions alone")
    print("people motions answers sd_people sd_motions   both  these   mean  true")
    levels, crossing = np.array([-15.0, -10, -5, 0, 5, 10, 20]), 7.0
    for people, count, repeats, own, other in (
        (12, 3, 2, 0.6, 0.5), (20, 3, 2, 0.3, 0.0), (35, 3, 2, 0.3, 0.25), (20, 4, 2, 0.3, 0.5), (12, 6, 1, 0.0, 0.25),
        (20, 8, 1, 0.3, 0.5), (35, 8, 1, 0.3, 0.25),
    ):  # fmt: skip
        rng, rows, values = np.random.default_rng([seed, 7, people, count, int(100 * other)]), [], []
        for _ in range(studies):
            criterion = 1.9 * np.exp(own * rng.normal(size=(people, 1, 1)))
            lean = own * rng.normal(size=(people, 1, 1)) + other * rng.normal(size=(1, count, 1))
            delta = 2.85214 / crossing * np.exp(lean) * np.abs(levels)
            share = ndtr((delta - criterion) / 2**0.5) + ndtr((-delta - criterion) / 2**0.5)
            different = rng.binomial(repeats, share).reshape(people, -1).astype(float)
            shown, names = np.full(different.shape, float(repeats)), np.repeat([f"m{n}" for n in range(count)], 7)
            found = fit_mixed_thresholds(
                Counts(tuple(map(str, range(people))), np.tile(levels, count), different, shown, tuple(names))
            )
            if isinstance(found, str):
                continue
            for side in ("shorter", "longer"):
                pair = (found.typical[side].interval, found.these_motions[side].interval)
                rows.append([(one.low or 0.0) <= crossing <= (one.high or np.inf) for one in pair])
                values.append(found.typical[side].frames or np.nan)
        both, these = np.mean(rows, axis=0)
        print(f"{people:6} {count:7} {repeats:7} {own:9} {other:10} {both:6.3f} {these:6.3f} {np.nanmean(values):6.2f} "
              f"{crossing:5.1f}", flush=True)  # fmt: skip


def rating_answers(rng, people, better, own, place):
    """2003's study, one question of five points: two groups by order, two films each."""
    lenient = own * rng.normal(size=people)
    rows = []
    for person in range(people):
        shown = ["a", "b"] if person % 2 else ["b", "a"]
        for trial, method in enumerate(shown, start=1):
            lean = 2 + lenient[person] + better * (method == "b") + place * (trial - 1.5) + 0.9 * rng.normal()
            rows.append((person, "rating", trial, method, int(np.clip(np.round(lean), 0, 4))))
    return pd.DataFrame(rows, columns=["participant", "task", "trial", "method_a", "answer"])


def ratings(studies, seed):
    """Type I error and power of every test of the methods, by how alike one person's ratings are."""
    print("ratings: how often the methods are found to differ at .05 (26 people, two ratings each)")
    names = ("published F", "t", "mixed design", "Wilcoxon")
    print(f"{'people sd':>9} {'effect':>6}  " + "  ".join(names))
    for own, better in ((0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (0.5, 0.7)):
        rng, rows, spent = np.random.default_rng([seed, 4, int(10 * own), int(10 * better)]), [], 0.0
        for _ in range(studies):
            answers = rating_answers(rng, 26, better, own, 0.3)
            started = time.process_time()
            (question,) = rating_anova(answers)
            spent += time.process_time() - started
            rows.append(_p_values(question))
        rates = [rate(column) for column in zip(*rows, strict=True)]
        cells = "  ".join(f"{value:{len(name)}.3f}" for value, name in zip(rates, names, strict=True))
        print(f"{own:9} {better:6}  {cells}   {1000 * spent / studies:.0f} ms a question", flush=True)


def _p_values(question):
    """The p-values of the methods, test by test."""
    within = {row.source: row for row in question.mixed_design.effects}
    people = question.ranks.participants
    return (
        question.anova[0].p_value if question.anova else None,
        question.difference.p_value,
        within["method"].p_value if within else None,
        people.p_value if people else None,
    )


def mixed(studies, seed):
    """Time of the mixed model of 8 participants, random intercept and slope: processor time, median of 20 fits."""
    del studies
    rng = np.random.default_rng([seed, 5])
    levels, who = np.tile(np.arange(7.0), 8), np.repeat(np.arange(8), 7)
    spent = []
    for _ in range(20):
        own = rng.multivariate_normal([-3.0, 1.0], [[0.16, 0.0], [0.0, 0.04]], size=8)
        chance = ndtr(own[who, 0] + own[who, 1] * levels)
        table = pd.DataFrame({"participant": who, "level": levels, "yes": rng.binomial(30, chance), "shown": 30})
        started = time.process_time()
        psychometric_mixed(table)
        spent.append(time.process_time() - started)
    print(f"mixed: 8 participants, 7 levels: median {np.median(spent):.3f} s, longest {max(spent):.3f} s")


def power(studies, seed):
    """Time of `segue power` for a preference study of 35 people: simulated and analysed studies a second."""
    from study.analysis.exclusions import Rules
    from study.apps.cli.power import AT_ONCE, plans_of
    from study.apps.cli.shared import load
    from study.power.curve import power_curve
    from study.power.design import Design
    from study.power.registry import effect_of
    from study.power.sessions import whole_sessions

    protocol = load("geodesic_vs_fixed")
    plans = plans_of(protocol, None, 35)
    options = {"share": 0.65, "correlation": 0.1, "order_bias": 0.1, "missed": 0.02}
    effect = effect_of(protocol.studies[0], options, protocol.analysis)
    design = Design(protocol, protocol.studies[0], plans, effect.observer, Rules())
    runs = (("at once", studies, effect.study(design)), ("whole sessions", 10, whole_sessions(design, effect.found)))
    for words, size, run in runs:
        started = time.process_time()
        found = power_curve(run, [35], studies=size, at_once=AT_ONCE, seed=seed)
        spent = time.process_time() - started
        print(f"power, {words}: {size} studies of 35 people in {spent:.1f} s, power {found.points[0].power:.3f}")


PARTS = {
    "preference": preference,
    "motions": motions,
    "crossed": crossed_test,
    "strengths": strengths,
    "thresholds": thresholds,
    "ratings": ratings,
    "mixed": mixed,
    "power": power,
}

if __name__ == "__main__":
    part = sys.argv[1] if len(sys.argv) > 1 else "all"
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 2000
    start = int(sys.argv[3]) if len(sys.argv) > 3 else 1
    for name, measure in PARTS.items():
        if part in ("all", name):
            measure(count, start)
