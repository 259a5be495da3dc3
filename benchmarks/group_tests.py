"""How far tests of groups can be trusted: simulated studies, with and without an effect, through the real analysis.

Run it from the repository: `python benchmarks/group_tests.py [part] [studies] [seed]`, part one of those in `PARTS` at
the end, or all; 2,000 studies a cell unless said. Observers are drawn here, percept by percept, by code that the
analysis does not use. `preferences`, `ratings` and `thresholds` write CSV and read the headline of `segue fit`;
`folders` writes sessions into results folders and reads that of `segue analyse`. The 35 people and 8 answers are
2004's, the 26 people and two ratings 2003's.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from dataclasses import dataclass
from functools import cache
from itertools import combinations, product
from pathlib import Path

import numpy as np
import pandas as pd
from click.testing import CliRunner
from scipy.special import expit, ndtr

from study.analysis.crossed import crossed
from study.analysis.preference.bradley_terry import fit_bradley_terry
from study.analysis.preference.no_effect import no_preference
from study.analysis.preference.participants import default_p_values, participant_tests
from study.analysis.preference.published import published_test
from study.analysis.psychometric.mixed import psychometric_mixed
from study.analysis.ratings.comparisons import rating_anova
from study.apps.cli import segue
from study.experiment.plan import draw_plan
from study.experiment.protocol.whole import load_protocol
from study.experiment.session import open_session, walk
from study.experiment.sets import own_set
from study.experiment.store.answers import record_answer
from study.experiment.store.responses import open_responses
from study.experiment.store.sessions import begin_session
from study.tasks.registry import task_of
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


def fitted(rows, *options):
    """The headlines of `segue fit` for a table of rows, written as CSV."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "answers.csv"
        pd.DataFrame(rows).to_csv(path, index=False)
        return printed("fit", path, *options, "--participant", "who", "--motion", "clip")


def printed(*command):
    """What a verb of `segue` prints as JSON; its headlines."""
    found = CliRunner().invoke(segue, [*map(str, command), "--json"])
    if found.exit_code:
        raise found.exception or SystemExit(found.output)
    return json.loads(found.stdout)["headline"]


def drawn_preferences(rng, people, clips, people_sd, clips_sd, effect=0.6):
    """Two films each way of each clip: the more natural percept wins, with logistic noise."""
    own, of_clip = people_sd * rng.normal(size=people), clips_sd * rng.normal(size=clips)
    return [
        {"who": f"p{who}", "clip": f"c{clip}", "left": films[0], "right": films[1],
         "chosen": "first" if (better > 0) == (films[0] == "a") else "second"}
        for who in range(people) for clip in range(clips) for films in (("a", "b"), ("b", "a"))
        for better in [effect + own[who] + of_clip[clip] + rng.logistic()]
    ]  # fmt: skip


def drawn_ratings(rng, people, clips, people_sd, clips_sd, effect=0.5):
    """Films by a and by b on a slider of 100 points; people and clips differ in how much better b is."""
    own, of_clip = people_sd * rng.normal(size=people), clips_sd * rng.normal(size=clips)
    lenient, easy = rng.normal(size=people), rng.normal(size=clips)
    return [
        {"who": f"p{who}", "clip": f"c{clip}", "film": film,
         "points": round(50 + 6 * (lenient[who] + easy[clip] + rng.normal()
                                   + (film == "b") * (effect + own[who] + of_clip[clip])), 2)}
        for who in range(people) for clip in range(clips) for film in "ab"
    ]  # fmt: skip


def drawn_pairs(rng, people, clips, people_sd, clips_sd, threshold=7.0):
    """Same-different: two percepts of unit variance, "different" where they lie further apart than a criterion."""
    own, of_clip = people_sd * rng.normal(size=people), clips_sd * rng.normal(size=clips)
    criterion = 1.9 * np.exp(people_sd * rng.normal(size=people))
    return [
        {"who": f"p{who}", "clip": f"c{clip}", "frames": frames,
         "said": "different" if abs(rng.normal() - rng.normal(apart)) > criterion[who] else "same"}
        for who in range(people) for clip in range(clips) for frames in (-20, -12, -8, -4, 0, 4, 8, 12, 20)
        for _ in range(2)
        for apart in [apart_at_threshold() / threshold * abs(frames) * np.exp(own[who] + of_clip[clip])]
    ]  # fmt: skip


@cache
def apart_at_threshold():
    """How far percepts lie apart where three quarters of the responses are "different"."""
    low, high = 0.0, 10.0
    for _ in range(60):
        middle = (low + high) / 2
        share = ndtr((middle - 1.9) / 2**0.5) + ndtr((-middle - 1.9) / 2**0.5)
        low, high = (middle, high) if share < 0.75 else (low, middle)
    return low


PREFERENCES = ("--task", "preference", "--first", "left", "--second", "right", "--answer", "chosen")
RATINGS = ("--task", "rating", "--method", "film", "--answer", "points")
PAIRS = ("--task", "same-different", "--level", "frames", "--answer", "said")


def headlines(name, drawn, options, truth, spreads, studies, seed, tested=True):
    """Errors of a headline at .05, by motions and how they differ; `truth` follows from how far all differ.

    Each row is the mean over 12 and 35 people and three ways in which these differ, with the lowest and the highest.
    """
    print(f"{name}: false results and intervals that miss at .05; mean, lowest and highest over people and their sd")
    print("motions sd_motions  false       range misses       range MC_error  open")
    for clips in (3, 5, 8):
        for clips_sd in spreads[1]:
            false, missed, opened = [], [], []
            for people, people_sd in product((12, 35), spreads[0]):
                rng = np.random.default_rng([seed, clips, people, int(100 * clips_sd), int(100 * people_sd)])
                size, true = (people, clips, people_sd, clips_sd), truth(np.hypot(people_sd, clips_sd))
                if tested:
                    found = [fitted(drawn(rng, *size, 0.0), *options)[0]["p"] for _ in range(studies)]
                    false.append(rate(found))
                found = [one["interval"] for _ in range(studies) for one in fitted(drawn(rng, *size), *options)]
                ends = [(-np.inf if i["low"] is None else i["low"], i["high"] or np.inf) for i in found]
                missed.append(np.mean([not low <= true <= high for low, high in ends]))
                opened.append(np.mean([not np.isfinite(high) for _, high in ends]))
            cells = [f"{np.mean(own):6.3f} {min(own):.3f}-{max(own):.3f}" for own in (false, missed) if own]
            error = np.sqrt(0.05 * 0.95 / (studies * 6))
            print(f"{clips:7} {clips_sd:10} {' '.join(cells)} {error:8.3f} {np.mean(opened):5.2f}", flush=True)


def preferences(studies, seed):
    """Preferences through `segue fit`."""
    scores = np.random.default_rng(0).normal(size=400_000)

    def truth(spread):
        return 100 * expit(0.6 + spread * scores).mean()

    headlines("preferences", drawn_preferences, PREFERENCES, truth, ((0.0, 0.6, 1.2), (0.0, 0.5, 1.0)), studies, seed)


def slider_ratings(studies, seed):
    """Ratings through `segue fit`."""
    headlines("ratings", drawn_ratings, RATINGS, lambda _: 3.0, ((0.0, 0.6, 1.2), (0.0, 0.5, 1.0)), studies, seed)


def thresholds(studies, seed):
    """Thresholds of the median observer through `segue fit`; people and motions differ in log units."""
    spreads = (0.0, 0.3, 0.6), (0.0, 0.25, 0.5)
    headlines("thresholds", drawn_pairs, PAIRS, lambda _: 7.0, spreads, studies, seed, tested=False)


FOLDER = """
name = "drawn"
title = "Drawn"
fps = 30
seed = 1

[analysis]
alpha = 0.05

{transitions}
[[studies]]
name = "liking"
task = "preference"
reference = "geodesic"
comparison = "fixed"
order = "both"

[[studies]]
name = "jnd"
task = "same-different"
reference = "geodesic"
differences_frames = [-20, -12, -8, -4, 0, 4, 8, 12, 20]
order = "both"
"""


@dataclass(frozen=True)
class Judge:
    """Somebody who compares percepts: how much they lean to method a, how well they see, and their criterion."""

    rng: np.random.Generator
    lean: np.ndarray
    seen: np.ndarray
    criterion: float

    def answer(self, trial, _step):
        """The response to a trial, from percepts drawn for it; and how long it took."""
        clip = int(trial.motion[1:])
        if trial.task == "preference":
            better = self.lean[clip] + self.rng.logistic()
            return ("first" if (better > 0) == trial.a_first else "second"), 1.0
        apart = apart_at_threshold() / 7.0 * abs(trial.difference_frames) * self.seen[clip]
        far = abs(self.rng.normal() - self.rng.normal(apart)) > self.criterion
        return ("different" if far else "same"), 1.0


def session_folder(folder, rng, people, clips, spread):
    """A results folder with the sessions of so many people, who differ as motions do."""
    shown = [
        f'[[transitions]]\nname = "c{n}"\ncategory = "c"\nsource = "a{n}"\ndestination = "b"\n' for n in range(clips)
    ]
    (folder / "protocol.toml").write_text(FOLDER.format(transitions="\n".join(shown)))
    protocol = load_protocol(folder / "protocol.toml")
    pairs = tuple(
        Pair(f"{study.name}/{clip.name}/{one.name}", study.name, study.task, clip.name, "c", ("s", f"s{one.name}"),
             one.methods, one.difference_frames)
        for study in protocol.studies for clip in protocol.transitions
        for one in task_of(study).conditions(study, False)
    )  # fmt: skip
    likes, sees = spread * rng.normal(size=(2, clips))
    with open_responses(folder) as responses:
        for who in range(people):
            lean, eye, strict = spread * rng.normal(size=3)
            judge = Judge(rng, 0.6 + lean + likes, np.exp(eye + sees), 1.9 * np.exp(strict))
            plan = draw_plan(protocol, pairs, f"p{who:02}")
            record = begin_session(responses, protocol, plan, library="drawn")
            for trial, given in walk(open_session(protocol, plan, passed=("consent", "form")), judge.answer):
                record_answer(responses, record, trial, given)


def folders(studies, seed):
    """Coverage of headlines from results folders, whose databases sessions wrote; and that exports give the same."""
    rng, inside, spread = np.random.default_rng([seed, 9]), {}, 0.3
    share = 100 * expit(0.6 + spread * 2**0.5 * rng.normal(size=400_000)).mean()
    for _ in range(studies):
        with tempfile.TemporaryDirectory() as place:
            session_folder(Path(place), rng, 20, 4, spread)
            found = printed("analyse", place)
            CliRunner().invoke(segue, ["export", place])
            again = printed("fit", Path(place) / "answers.csv")
        for one, other in zip(found, again, strict=True):
            assert (one["estimate"], one["interval"]) == (other["estimate"], other["interval"]), "the export differs"
            true, (low, high) = (7.0 if one["p"] is None else share), list(one["interval"].values())[:2]
            inside.setdefault(one["unit"], []).append((low is None or low <= true) and (high is None or true <= high))
    for unit, covers in inside.items():
        print(f"folders, {unit}: {np.mean(covers):.3f} of {len(covers)} 95% intervals hold the true value", flush=True)


def crossed_test(studies, seed):
    """Errors at .05 of the test over participants and motions, with no effect and with one of 0.6 logits.

    Beside it are those of the test over participants alone.
    """
    print("crossed: errors at .05 over participants and motions; mean and range over people, effects and sd of people")
    print(f"{'motions':>7} {'sd motions':>10} {'mean':>6} {'lowest':>7} {'highest':>8} {'participants alone':>19}")
    rng = np.random.default_rng([seed, 6])
    for count, other in product((3, 4, 5, 6, 8), (0.0, 0.25, 0.5, 1.0)):
        found, alone = [], []
        for people, own, effect in product((12, 20, 35), (0.0, 0.6, 1.2), (0.0, 0.6)):
            size = (studies, people, count)
            lean = own * rng.normal(size=(*size[:2], 1)) + other * rng.normal(size=(studies, 1, count))
            shown = rng.binomial(2, 0.97, size=size)
            chosen = rng.binomial(shown, expit(effect + lean))
            mean = expit(effect + np.hypot(own, other) * rng.normal(size=400_000)).mean()
            found.append(float((crossed(chosen, shown).p_values(mean if effect else 0.5) < 0.05).mean()))
            if not effect:
                alone.append(rate(default_p_values(chosen.sum(axis=2), shown.sum(axis=2))))
        cells = f"{np.mean(found):6.3f} {min(found):7.3f} {max(found):8.3f} {np.mean(alone):19.3f}"
        print(f"{count:7} {other:10} {cells}", flush=True)


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


def variance(studies, seed):
    """Type I error and power of every test of the methods, by how alike one person's ratings are."""
    print("variance: how often the methods are found to differ at .05 (26 people, two ratings each)")
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
    from study.apps.cli.shared import load, prepare_stimuli
    from study.power.curve import power_curve
    from study.power.design import Design
    from study.power.planned import AT_ONCE, plans_of
    from study.power.registry import effect_of
    from study.power.sessions import whole_sessions

    protocol = load("geodesic_vs_fixed")
    plans = plans_of(protocol, prepare_stimuli(protocol, None).pairs, 35)
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
    "preferences": preferences,
    "ratings": slider_ratings,
    "thresholds": thresholds,
    "folders": folders,
    "crossed": crossed_test,
    "strengths": strengths,
    "variance": variance,
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
