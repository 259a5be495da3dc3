"""Whole sessions in which things go wrong at random: what was acknowledged is there once, and nothing is missing."""

from __future__ import annotations

import json
import random
import time
from collections.abc import Callable
from typing import Any

import pytest
from devtools import Tab
from serving import QUESTIONS, Site
from walking import END, LOOK, answers, details, go_on, press, read_on

from study.experiment.store.sessions import all_sessions

pytestmark = [pytest.mark.gl, pytest.mark.slow]

CHANCE = 0.08
"""Of something going wrong between two looks at the page."""

# Notes what the server acknowledged, and sends every third answer twice more: the same, and one that contradicts it.
EAVESDROP = """
const plain = window.fetch.bind(window);
window.fetch = async (address, options) => {
  const response = await plain(address, options);
  if (!String(address).endsWith('api/answer') || !response.ok) return response;
  const message = JSON.parse(options.body);
  const told = await response.clone().json();
  const heard = JSON.parse(sessionStorage.getItem('heard') ?? '[]');
  heard.push([message.trial, message.attempt, message.item, message.value, told.counted]);
  sessionStorage.setItem('heard', JSON.stringify(heard));
  if (heard.length % 3 === 0) {
    const other = { ...message, value: { same: 'different', first: 'second' }[message.value] ?? null };
    for (const body of [options.body, JSON.stringify(other)]) {
      await plain(address, { ...options, signal: undefined, body }).catch(() => {});
    }
  }
  return response;
};
"""


def reload(site: Site, tab: Any, chance: Any) -> None:
    del site, chance
    tab.reload()
    tab.wait(f"({LOOK}) !== ''")


def restart_server(site: Site, tab: Any, chance: Any) -> None:
    site.stop()
    time.sleep(chance.uniform(0, 2))
    if tab.run(LOOK) == "question":
        press(tab)
    site.start()


def cut_network(site: Site, tab: Any, chance: Any) -> None:
    del site
    tab.offline(True)
    if tab.run(LOOK) == "question":
        press(tab)
    time.sleep(chance.uniform(0, 2))
    tab.offline(False)


def truncate_films(site: Site, tab: Any, chance: Any) -> None:
    site.film_fault = "truncated"
    end = time.monotonic() + chance.uniform(0.5, 4)
    while time.monotonic() < end:
        if tab.run(LOOK) == "question":
            press(tab)
        else:
            read_on(tab)
    site.film_fault = None


def hide(site: Site, tab: Any, chance: Any) -> None:
    del site
    tab.window("minimized")
    time.sleep(chance.uniform(0, 3))
    tab.window("normal")


def close_lid(site: Site, tab: Any, chance: Any) -> None:
    del site
    with tab.browser.stopped():
        time.sleep(chance.uniform(0, 4))


DISTURBANCES = (reload, restart_server, cut_network, truncate_films, hide, close_lid)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_session_in_which_everything_goes_wrong(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab], seed: int
) -> None:
    site, tab, chance = make_site(), make_tab(), random.Random(seed)
    tab.call("Page.addScriptToEvaluateOnNewDocument", source=EAVESDROP)
    tab.open(site.address)
    done = []

    def disturb() -> None:
        if len(done) < 15 and chance.random() < CHANCE and END not in tab.text():
            happens = chance.choice(DISTURBANCES)
            done.append(happens.__name__)
            happens(site, tab, chance)

    slowest = go_on(tab, on_step=disturb, at_most=600)
    print(f"seed {seed}: {', '.join(done)}")
    assert len(set(done)) >= 3
    heard = json.loads(tab.run("sessionStorage.getItem('heard')"))
    check_records(site, heard, slowest)


def check_records(site: Site, heard: Any, slowest: Any) -> None:
    (session,) = all_sessions(site.responses)
    every = answers(site, all_attempts=True)
    assert not every.duplicated(["trial", "attempt", "item"]).any()
    stored = {
        (row.trial, row.attempt, row.item): None if row.missed else row.answer for row in every.itertuples(index=False)
    }
    # What was acknowledged as counted is what is stored; a second, other answer never is.
    counted = [(tuple(key), value) for *key, value, told in heard if told]
    assert len(counted) >= QUESTIONS - 5
    assert all(stored[key] == value for key, value in counted)
    final = answers(site)
    assert set(final["trial"]) == {trial.trial for trial in session.plan.trials}
    assert len(final) == QUESTIONS
    # Everything that was shown badly was shown again, but for practice; and nothing that was shown well.
    for (trial, role), rows in every.groupby(["trial", "role"]):
        first = rows[rows["attempt"] == 1]
        again = bool((rows["attempt"] == 2).any())
        assert again == (not first["shown_well"].all() and role != "practice"), f"trial {trial}"
    # No clock ran while nothing was shown: answers given at once took no long time, unless they are flagged.
    quick = every[every["shown_well"] & ~every["missed"]]
    assert (quick["response_s"] < slowest + 1).all()
    # Every film of every answer has its record, and what is called well has all its frames.
    shown = details(site)
    for row in shown:
        assert not row["shown_well"] or row["frames_presented"] >= row["frames_expected"]
    with_films = {(row["trial"], row["attempt"]) for row in shown}
    assert {(row.trial, row.attempt) for row in quick.itertuples(index=False)} <= with_films
