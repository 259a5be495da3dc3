"""Simulated participants: known truth, chance that repeats, work that is taken up."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from toys import FakeStimuli

from study.errors import SessionError
from study.experiment.observers import lengths_apart, person, truth
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.experiment.session import open_session, walk
from study.experiment.simulation import simulate
from study.experiment.stimuli.stimulus import MotionUse, StimulusRecord
from study.experiment.store.answers import has_event
from study.experiment.store.frames import answers_frame
from study.experiment.store.responses import Responses, open_responses
from study.experiment.store.sessions import all_sessions
from study.models.choice import PreferenceObserver, preference_probability
from study.models.population import SameDifferentObserver, population_different, probability_different
from study.tasks.observer import ObserverSettings, default_observer
from study.tasks.trial import Pair

METHODS = ("geodesic", "fixed")


def alike(settings: ObserverSettings) -> ObserverSettings:
    """The same observer without differences between participants."""
    return replace(settings, same_different=replace(settings.same_different, log_sensitivity_sd=0.0, criterion_sd=0.0))


def timeless(responses: Responses) -> pd.DataFrame:
    roles = ("trial", "practice", "check")
    return answers_frame(responses, all_attempts=True, roles=roles).drop(columns="answered_at")


def test_the_differencing_model_agrees_with_simulated_percepts() -> None:
    """Percepts drawn one by one, against the closed form."""
    observer = SameDifferentObserver(0.3, 0.5, criterion=1.7, lapse=0.1)
    rng = np.random.default_rng(1)
    for difference in (-8, -2, 0, 3, 9):
        distance = abs(difference) * (0.3 if difference < 0 else 0.5)
        first, second = rng.standard_normal((2, 200_000))
        different = np.abs(first - (second + distance)) > 1.7
        lapsed = rng.random(200_000) < 0.1
        different = np.where(lapsed, rng.random(200_000) < 0.5, different)
        assert float(probability_different(observer, difference)) == pytest.approx(different.mean(), abs=0.005)


def test_false_alarms_have_their_closed_form() -> None:
    """2 Phi(-criterion / sqrt 2) with no difference, no lapse."""
    observer = SameDifferentObserver(0.3, 0.5, criterion=1.7, lapse=0.0)
    assert float(probability_different(observer, 0.0)) == pytest.approx(math.erfc(1.7 / 2.0), abs=1e-12)


def test_the_population_is_the_mean_over_participants() -> None:
    observer = SameDifferentObserver(0.37, 0.43, log_sensitivity_sd=0.3, criterion_sd=0.3)
    settings = replace(default_observer(), same_different=observer)
    people = [person(settings, f"sim-{n}", 3).settings.same_different for n in range(4000)]
    for difference in (-10, -5, 0, 5, 10):
        mean = np.mean([float(probability_different(one, difference)) for one in people])
        assert float(population_different(observer, difference)) == pytest.approx(mean, abs=0.012)


def test_the_default_observer_has_the_threshold_of_the_paper(jnd_protocol: Protocol) -> None:
    """2004 section 5.1: 75% at k - 8 and k + 7."""
    settings = default_observer()
    known = truth(jnd_protocol, settings)["studies"]["jnd"]
    assert known["threshold_shorter_frames"] == pytest.approx(-8.0, abs=1e-5)
    assert known["threshold_longer_frames"] == pytest.approx(7.0, abs=1e-5)
    for frames in (-8.0, 7.0):
        assert float(population_different(settings.same_different, frames)) == pytest.approx(0.75, abs=1e-6)
    assert 0.05 < known["false_alarms"] < 0.2
    # The paper's linear interpolation between the levels gives a value near it, but not equal.
    assert known["interpolated_shorter_frames"] == pytest.approx(-8.0, abs=1.0)
    assert known["interpolated_longer_frames"] == pytest.approx(7.0, abs=1.0)


def test_the_default_preferences_are_those_of_table_2() -> None:
    """2004 Table 2: 96.4% for the geodesic method, 65.7% for the velocity method."""
    from study.experiment.protocol.whole import find_protocol, load_protocol

    for name, percent in (("geodesic_vs_fixed", 96.4), ("velocity_vs_fixed", 65.7)):
        study = load_protocol(find_protocol(name)).studies[0]
        assert 100 * preference_probability(default_observer().preference, *study.methods) == pytest.approx(
            percent, abs=1.0
        )


def test_an_observer_without_threshold_is_refused(jnd_protocol: Protocol) -> None:
    settings = default_observer()
    stubborn = replace(settings, same_different=replace(settings.same_different, lapse=0.6))
    with pytest.raises(SessionError, match=r"reaches 75% 'different' at some difference, found .* at none and"):
        truth(jnd_protocol, stubborn)


def test_simulated_answers_follow_the_known_curve(
    tmp_path: Path, jnd_protocol: Protocol, make_stimuli: Callable[[Protocol], FakeStimuli]
) -> None:
    settings = replace(alike(default_observer()), missed=0.0)
    with open_responses(tmp_path) as responses:
        simulate(jnd_protocol, make_stimuli(jnd_protocol), responses, 60, seed=11, settings=settings)
        table = answers_frame(responses)
    for difference, rows in table[~table["missed"]].groupby("difference_frames"):
        chance = float(probability_different(settings.same_different, int(difference)))
        error = math.sqrt(chance * (1 - chance) / len(rows))
        assert abs((rows["answer"] == "different").mean() - chance) < 3.5 * error, difference


def test_simulated_preferences_follow_the_known_ones(
    tmp_path: Path, toy_protocol: Protocol, toy_stimuli: FakeStimuli
) -> None:
    preference = PreferenceObserver({"fixed": 0.0, "geodesic": 1.0}, order_bias=0.4, lapse=0.1)
    settings = replace(default_observer(), preference=preference)
    with open_responses(tmp_path) as responses:
        simulate(toy_protocol, toy_stimuli, responses, 120, seed=2, settings=settings)
        table = answers_frame(responses)
    chosen = table[(table["task"] == "preference") & ~table["missed"]]
    for first, rows in chosen.groupby("a_first"):
        chance = 0.05 + 0.9 / (1 + math.exp(-(1.0 + (0.4 if first else -0.4))))
        assert rows["chose_a"].mean() == pytest.approx(chance, abs=0.12)
    expected = preference_probability(preference, *toy_protocol.study("liking").methods)
    assert chosen["chose_a"].mean() == pytest.approx(expected, abs=0.09)


def test_preferences_follow_how_visible_the_difference_is(tmp_path: Path) -> None:
    """Nine frames against ten are hardly told apart, 25 are; at other points, or made otherwise, the methods count."""
    names = ("hardly", "plainly", "elsewhere")
    transitions = [
        f'[[transitions]]\nname = "{name}"\ncategory = "c"\nsource = "a"\ndestination = "b"' for name in names
    ]
    liking = 'task = "preference"\nreference = "geodesic"\ncomparison = "fixed"\norder = "both"\nrepeats = 20'
    text = 'name = "seen"\ntitle = "Seen"\nfps = 30\nseed = 1\n' + "\n".join(transitions)
    protocol = parse_protocol(f'{text}\n[[studies]]\nname = "liking"\n{liking}\n')
    pairs, records = [], []
    for name, length, at in (("hardly", 9, 60), ("plainly", 25, 60), ("elsewhere", 9, 61)):
        pairs.append(Pair(f"liking/{name}", "liking", "preference", name, "c", (name, f"{name} fixed"), METHODS))
        for identifier, frames, frame, method in ((name, length, 60, "geodesic"), (f"{name} fixed", 10, at, "fixed")):
            use = MotionUse("a", "a.bvh", frame, 300, 0, 0)
            records.append(
                StimulusRecord(identifier, name, "c", method, frames, 0, frames, 120, 50, 70, use, use, "g", True)
            )
    stimuli = FakeStimuli(tuple(pairs), records=tuple(records))
    assert lengths_apart(protocol, stimuli) == {"liking/hardly": 1, "liking/plainly": -15}
    settings = replace(alike(default_observer()), missed=0.0)
    with open_responses(tmp_path) as responses:
        known = simulate(protocol, stimuli, responses, 25, seed=2, settings=settings).truth
        table = answers_frame(responses)
    rng, shares = np.random.default_rng(3), {}
    slopes = settings.same_different.d_prime_longer, settings.same_different.d_prime_shorter
    for name, apart in (("hardly", slopes[0]), ("plainly", 15 * slopes[1]), ("elsewhere", 99.0)):
        right = (rng.standard_normal(400_000) + apart > rng.standard_normal(400_000)).mean()
        logit = (2 * right - 1) * 3.29  # 270 of 280, as told apart beyond guessing
        shares[name] = 0.005 + 0.99 * np.mean([1 / (1 + math.exp(-logit + bias)) for bias in (-0.1, 0.1)])
    assert 0.6 < shares["hardly"] < 0.72 < 0.95 < shares["plainly"] <= shares["elsewhere"]
    for name, rows in table.groupby("motion"):
        error = math.sqrt(shares[name] * (1 - shares[name]) / len(rows))
        assert rows["chose_a"].astype(float).mean() == pytest.approx(shares[name], abs=4 * error), name
    assert known["studies"]["liking"]["favouring_a"] == pytest.approx(np.mean(list(shares.values())), abs=0.005)


def test_response_times_are_plausible_and_some_answers_are_missed(
    tmp_path: Path, toy_protocol: Protocol, toy_stimuli: FakeStimuli
) -> None:
    settings = replace(default_observer(), missed=0.1)
    with open_responses(tmp_path) as responses:
        simulate(toy_protocol, toy_stimuli, responses, 60, seed=2, settings=settings)
        table = answers_frame(responses)
    assert 0.06 < table["missed"].mean() < 0.15
    assert table.loc[table["missed"], "response_s"].isna().all()
    times = table.loc[~table["missed"], "response_s"]
    assert times.between(0.1, 5.0).all()
    assert 1.0 < times.median() < 2.0


def test_sessions_are_marked_as_simulated_with_their_truth(
    tmp_path: Path, toy_protocol: Protocol, toy_stimuli: FakeStimuli
) -> None:
    with open_responses(tmp_path) as responses:
        summary = simulate(toy_protocol, toy_stimuli, responses, 2, seed=3)
        assert (summary.participants, summary.answers, summary.found) == (2, 16, 0)
        records = all_sessions(responses)
        assert [record.participant for record in records] == ["sim-001", "sim-002"]
        for record in records:
            assert record.simulated
            assert record.truth == summary.truth
            assert record.truth["seed"] == 3
            assert has_event(responses, record, "finished")
        assert answers_frame(responses)["simulated"].all()


def test_running_again_adds_nothing_and_more_participants_leave_the_first(
    tmp_path: Path, toy_protocol: Protocol, toy_stimuli: FakeStimuli
) -> None:
    with open_responses(tmp_path) as responses:
        simulate(toy_protocol, toy_stimuli, responses, 2, seed=3)
        first = timeless(responses)
        again = simulate(toy_protocol, toy_stimuli, responses, 2, seed=3)
        assert (again.answers, again.found) == (0, 16)
        pd.testing.assert_frame_equal(timeless(responses), first)
        simulate(toy_protocol, toy_stimuli, responses, 3, seed=3)
        pd.testing.assert_frame_equal(timeless(responses).iloc[:16], first)


class StopHereError(Exception):
    pass


@pytest.mark.parametrize("after", [1, 7, 8, 9, 20])
def test_an_interrupted_simulation_ends_as_an_uninterrupted_one(
    tmp_path: Path, toy_protocol: Protocol, toy_stimuli: FakeStimuli, after: int
) -> None:
    with open_responses(tmp_path / "whole.sqlite") as responses:
        simulate(toy_protocol, toy_stimuli, responses, 3, seed=4)
        whole = timeless(responses)

    def stop(done: Any, total: int) -> None:
        assert total == 24
        if done == after:
            raise StopHereError

    with open_responses(tmp_path / "halves.sqlite") as responses:
        with pytest.raises(StopHereError):
            simulate(toy_protocol, toy_stimuli, responses, 3, seed=4, progress=stop)
        assert len(timeless(responses)) == after
        assert simulate(toy_protocol, toy_stimuli, responses, 3, seed=4).answers == 24 - after
        pd.testing.assert_frame_equal(timeless(responses), whole)


KILLED = """
import sys
sys.path.insert(0, "tests/experiment")
import toys as c
from study.experiment.simulation import simulate
from study.experiment.protocol.whole import find_protocol, load_protocol
from study.experiment.store.responses import open_responses
from study.models.choice import PreferenceObserver, preference_probability
from study.models.population import SameDifferentObserver, population_different, probability_different
from study.tasks.observer import ObserverSettings, default_observer
protocol = load_protocol(find_protocol("blend_length_jnd"))
say = lambda done, total: print(done, flush=True)
simulate(protocol, c.FakeStimuli(c.pairs_of(protocol)), open_responses(sys.argv[1]), 4, 9, say)
"""


def test_a_killed_simulation_is_finished_by_running_it_again(
    tmp_path: Path, repository: Path, jnd_protocol: Protocol, make_stimuli: Callable[[Protocol], FakeStimuli]
) -> None:
    """SIGKILL at several moments; in the end the answers are those of a run that was let alone."""
    stimuli = make_stimuli(jnd_protocol)
    with open_responses(tmp_path / "whole.sqlite") as responses:
        simulate(jnd_protocol, stimuli, responses, 4, seed=9)
        whole = timeless(responses)
    path = tmp_path / "killed.sqlite"
    for lines in (1, 42, 30):
        child = subprocess.Popen(
            [sys.executable, "-c", KILLED, str(path)], cwd=repository, stdout=subprocess.PIPE, text=True
        )
        acknowledged = [int(child.stdout.readline()) for _ in range(lines)][-1]
        os.kill(child.pid, signal.SIGKILL)
        child.stdout.read()
        child.stdout.close()
        child.wait()
        with open_responses(path) as responses:
            stored = timeless(responses)
        assert len(stored) >= acknowledged
        assert not stored.duplicated(["participant", "trial", "item", "attempt"]).any()
    with open_responses(path) as responses:
        simulate(jnd_protocol, stimuli, responses, 4, seed=9)
        pd.testing.assert_frame_equal(timeless(responses), whole)


def test_another_observer_or_seed_does_not_continue_a_session(
    tmp_path: Path, toy_protocol: Protocol, toy_stimuli: FakeStimuli
) -> None:
    with open_responses(tmp_path) as responses:
        simulate(toy_protocol, toy_stimuli, responses, 1, seed=3)
        with pytest.raises(SessionError, match="Expected the observer and seed under which 'sim-001' was begun"):
            simulate(toy_protocol, toy_stimuli, responses, 1, seed=4)
        with pytest.raises(SessionError, match="Expected one participant or more"):
            simulate(toy_protocol, toy_stimuli, responses, 0)


def test_a_person_is_the_same_whatever_else_is_drawn() -> None:
    settings = default_observer()
    assert person(settings, "sim-002", 5) == person(settings, "sim-002", 5)
    assert person(settings, "sim-002", 5).settings != person(settings, "sim-003", 5).settings
    assert person(settings, "sim-002", 5).settings != person(settings, "sim-002", 6).settings


def test_ratings_stay_on_their_scale_and_follow_utility(
    tmp_path: Path, rating_protocol: Protocol, make_stimuli: Callable[[Protocol], FakeStimuli]
) -> None:
    with open_responses(tmp_path) as responses:
        simulate(rating_protocol, make_stimuli(rating_protocol), responses, 30, seed=1)
        table = answers_frame(responses)
    rated = table[table["task"] == "rating"]
    assert len(rated) == 30 * 4 * 2
    assert set(rated["item"]) == {"natural", "noticeable"}
    assert rated["answer"].isin([str(point) for point in range(5)]).all()
    means = rated.assign(point=rated["answer"].astype(float)).groupby("method_a")["point"].mean()
    assert means["geodesic"] > means["cut"] + 0.5


def test_rated_pairs_are_compared_second_with_first(
    tmp_path: Path, pair_rating_protocol: Protocol, make_stimuli: Callable[[Protocol], FakeStimuli]
) -> None:
    """Turned by order, the answers have the mean that the truth names; as given, they lean either way."""
    with open_responses(tmp_path) as responses:
        simulate(pair_rating_protocol, make_stimuli(pair_rating_protocol), responses, 100, seed=1)
        table = answers_frame(responses)
    compared = table[table["study"] == "compared"].astype({"answer": float, "a_first": bool})
    assert len(compared) == 100 * 2 * 2
    assert compared["chose_a"].isna().all()
    given = compared.groupby("a_first")["answer"].mean()
    assert given[True] < 1.2  # the second is the cut, and the first is better
    assert given[False] > 2.8
    score = compared["answer"].where(compared["a_first"], 4 - compared["answer"])
    expected = truth(pair_rating_protocol, default_observer())["studies"]["compared"]["mean_score"]
    assert expected < 1.0
    by_person = score.groupby(compared["participant"]).mean()
    assert by_person.mean() == pytest.approx(expected, abs=4 * by_person.std() / 10)


def test_front_ends_and_simulation_drive_the_same_session(toy_protocol: Protocol, toy_stimuli: FakeStimuli) -> None:
    """What a simulated participant is asked is what the session asks: by hand the same trials come."""
    from study.experiment.observers import respond
    from study.experiment.plan import draw_plan

    plan = draw_plan(toy_protocol, toy_stimuli.pairs, "sim-001")
    who = person(default_observer(), "sim-001", 3)
    asked = [answer for _, answer in walk(open_session(toy_protocol, plan), partial(respond, who))]
    with open_responses("sqlite://") as responses:
        simulate(toy_protocol, toy_stimuli, responses, 1, seed=3)
        table = answers_frame(responses)
    assert [a.value for a in asked] == [None if pd.isna(value) else value for value in table["answer"]]


def test_showings_that_stall_come_again_and_bear_it(
    tmp_path: Path, toy_protocol: Protocol, toy_stimuli: FakeStimuli
) -> None:
    with open_responses(tmp_path) as responses:
        settings = replace(default_observer(), badly_shown=0.3)
        made = simulate(toy_protocol, toy_stimuli, responses, 40, seed=3, settings=settings).answers
        every, last = (answers_frame(responses, all_attempts=all_attempts) for all_attempts in (True, False))
    first = every[every["attempt"] == 1]
    # 320 showings, four standard errors of a share of 0.3.
    assert 1 - first["shown_well"].mean() == pytest.approx(0.3, abs=0.103)
    assert len(every) == made == len(first) + (~first["shown_well"]).sum()
    assert len(last) == 320
    assert 1 - last["shown_well"].mean() == pytest.approx(0.09, abs=0.064)


def test_the_careless_answer_at_random_and_are_found_by_the_rules(
    tmp_path: Path, toy_protocol: Protocol, make_stimuli: Callable[[Protocol], FakeStimuli]
) -> None:
    from study.analysis.exclusions import Rules, exclude

    text = toy_protocol.text.replace('order = "both"', 'order = "both"\nrepeats = 3\nattention_checks = 6')
    protocol = parse_protocol(text)
    with open_responses(tmp_path) as responses:
        settings = replace(default_observer(), careless=0.3, missed=0.0)
        simulate(protocol, make_stimuli(protocol), responses, 40, seed=3, settings=settings)
        answers, checks = answers_frame(responses), answers_frame(responses, roles=("check",))
    people = [person(settings, name, 3) for name in sorted(set(answers["participant"]))]
    careless = {who.name for who in people if who.careless}
    assert 5 <= len(careless) <= 20
    _, left_out = exclude(answers, Rules(most_failed_checks=0.1, most_too_fast=0.2), checks)
    assert {one.participant for one in left_out.participants} <= careless
    # One in 64 passes all six checks by chance, and answers no slower for it.
    assert len(left_out.participants) >= len(careless) - 1


def test_shares_of_what_goes_wrong_are_from_0_to_1() -> None:
    with pytest.raises(SessionError, match=r"Expected badly_shown as a share from 0 to 1, found 1\.5"):
        replace(default_observer(), badly_shown=1.5)


@pytest.mark.parametrize("after", [3, 9, 20])
def test_a_simulation_with_stalls_goes_on_as_it_would_have(
    tmp_path: Path, toy_protocol: Protocol, toy_stimuli: FakeStimuli, after: int
) -> None:
    settings = replace(default_observer(), badly_shown=0.4, missed=0.2, careless=0.2)
    with open_responses(tmp_path / "whole.sqlite") as responses:
        simulate(toy_protocol, toy_stimuli, responses, 3, seed=4, settings=settings)
        whole = timeless(responses)

    def stop(done: Any, _total: int) -> None:
        if done == after:
            raise StopHereError

    with open_responses(tmp_path / "parts.sqlite") as responses:
        with pytest.raises(StopHereError):
            simulate(toy_protocol, toy_stimuli, responses, 3, seed=4, progress=stop, settings=settings)
        simulate(toy_protocol, toy_stimuli, responses, 3, seed=4, settings=settings)
        pd.testing.assert_frame_equal(timeless(responses), whole)
