"""Three stimuli a trial in the window."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from scripted import ScriptedWindow, press

from study.apps.player.lettering import default_font
from study.apps.player.loop import play
from study.apps.player.pages import Look
from study.experiment.session import open_session
from study.experiment.store.answers import Presentation


def test_three_stimuli_are_shown_with_gaps_and_the_third_key_answers(make_small: Any, store: Any) -> None:
    small = make_small(
        "",
        ('task = "same-different"', 'task = "oddity"'),
        ("[-3, 0, 4]", "[4]"),
        ("Same or different?", "Which one differed?"),
    )
    pages = ["space", "space", *"123", "space", "space"]
    window = ScriptedWindow([press(key, 0.4) for key in pages])
    session = open_session(small.protocol, small.plan)
    outcome = play(window, session, small.stimuli.stimulus, store, Look((222, 223, 225), (default_font(),)))
    assert (outcome.end, outcome.answers, outcome.faulty_trials) == ("finished", 3, 0)
    assert [answer.value for answer in store.all("answer")] == ["first", "second", "third"]
    shown: list[Presentation] = store.all("shown")
    assert [one.place for one in shown] == ["first", "second", "third"] * 3
    for number, trial in enumerate(small.plan.trials):
        assert tuple(one.stimulus for one in shown[3 * number : 3 * number + 3]) == trial.stimuli
    kinds = [kind for kind, _, _ in window.shown]
    blanks = sum(1 for before, after in pairwise(kinds) if (before, after) == ("blank", "frame"))
    assert blanks == 3 * 2 + 2  # two gaps a trial, and the pause before the second and the third trial
