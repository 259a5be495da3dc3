"""Whole sessions with a scripted participant: what is asked, stored, repeated, and how times are taken."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scripted import Act, ScriptedWindow, click, press

from renderer.events import CloseAsked, Focus, Key, Resized, Typed
from study.apps.player.lettering import default_font
from study.apps.player.loop import Outcome, Setting, play
from study.apps.player.pages import Look
from study.errors import SessionError
from study.experiment.protocol.stimuli import Screen
from study.experiment.session import open_session

LOOK = Look((222, 223, 225), (default_font(),))
GO = press("space")


def sit(small: Any, window: ScriptedWindow, store: Any, answers: Any = (), passed: Any = ()) -> Outcome:
    session = open_session(small.protocol, small.plan, answers, passed=passed)
    return play(window, session, small.stimuli.stimulus, store, LOOK)


def whole(answers: list[Act], before: int = 2, after: int = 2) -> list[Act]:
    """Pages before the trials, an act for each question, and the pages after them."""
    return [GO] * before + answers + [GO] * after


def test_a_session_stores_every_answer_with_its_time_and_how_it_was_shown(make_small: Any, store: Any) -> None:
    small = make_small()
    times = [0.2, 0.31, 0.42, 0.53, 0.64, 0.75]
    window = ScriptedWindow(whole([press(key, t) for key, t in zip("sdsdsd", times, strict=True)]))
    outcome = sit(small, window, store)
    assert outcome == Outcome("finished", 6, 0, 0)
    answers = store.all("answer")
    assert [answer.trial for answer in answers] == [1, 2, 3, 4, 5, 6]
    assert [answer.value for answer in answers] == ["same", "different"] * 3
    # The question came up with the flip after the last frame's second one.
    assert [answer.response_s for answer in answers] == pytest.approx([t + 2 / 60 for t in times])
    shown = store.all("shown")
    assert len(shown) == 12
    assert all(one.shown_well and one.method == "swap" for one in shown)
    trial = small.plan.trials[0]
    assert [(one.place, one.stimulus) for one in shown[:2]] == [
        ("first", trial.stimuli[0]),
        ("second", trial.stimuli[1]),
    ]
    assert (
        shown[0].frames_presented == shown[0].frames_expected == len(small.stimuli.stimulus(trial.stimuli[0]).positions)
    )
    assert [kind for kind, _ in store.log if kind not in ("answer", "shown")] == ["display", "begin", "finished"]


def test_stimuli_of_30_fps_hold_each_frame_for_two_flips_and_gaps_last_as_written(make_small: Any, store: Any) -> None:
    small = make_small()
    window = ScriptedWindow(whole([press("s")] * 6))
    sit(small, window, store)
    kinds = [kind for kind, _, _ in window.shown]
    start = kinds.index("frame")
    trial = small.plan.trials[0]
    first, second = (len(small.stimuli.stimulus(one).positions) for one in trial.stimuli)
    frames = [thing[1] for kind, thing, _ in window.shown[start:] if kind == "frame"]
    assert frames[: 2 * first] == [frame for frame in range(first) for _ in range(2)]
    gap = window.shown[start + 2 * first]
    after = window.shown[start + 2 * first + 1]
    assert gap[0] == "blank"
    assert after[0] == "frame"
    assert after[2] - gap[2] == pytest.approx(0.1)
    assert window.shown[start + 2 * first + 1 + 2 * second][0] == "page"


@pytest.mark.parametrize(("hz", "holds"), [(144.0, {4, 5}), (59.94, {2}), (120.0, {4}), (75.0, {2, 3})])
def test_sessions_on_other_displays_are_shown_well(make_small: Any, store: Any, hz: float, holds: set[int]) -> None:
    window = ScriptedWindow(whole([press("s")] * 6), refresh_hz=hz)
    assert sit(make_small(), window, store) == Outcome("finished", 6, 0, 0)
    counts: dict[Any, int] = {}
    stimulus = 0
    for kind, thing, _ in window.shown:
        stimulus += kind != "frame"
        if kind == "frame":
            counts[stimulus, thing[1]] = counts.get((stimulus, thing[1]), 0) + 1
    last = {number: max(frame for n, frame in counts if n == number) for number, _ in counts}
    assert {count for (number, frame), count in counts.items() if 0 < frame < last[number]} == holds
    display = store.all("display")[0]
    assert (display["shortest_flips"], display["longest_flips"]) == (min(holds), max(holds))
    assert display["fps"] == pytest.approx(30, rel=0.002)
    assert all(one.shown_well for one in store.all("shown"))


def test_stimuli_of_60_fps_change_with_every_flip_of_60_hz(make_small: Any, store: Any) -> None:
    small = make_small("", ("fps = 30", "fps = 60"))
    window = ScriptedWindow(whole([press("s")] * 6))
    assert sit(small, window, store) == Outcome("finished", 6, 0, 0)
    frames = [thing[1] for kind, thing, _ in window.shown if kind == "frame"]
    assert all(b == a + 1 or b == 0 for a, b in pairwise(frames))


def test_a_window_that_was_moved_to_another_display_is_paced_by_that(make_small: Any, store: Any) -> None:
    small = make_small()
    moved_at = first_frame_flips(small)[10]
    window = ScriptedWindow(whole([press("s")] * 7))
    window.other_hz = 144.0
    original = window.flip

    def flip() -> float:
        if len(window.shown) == moved_at:
            window.monitor = "another"
        return original()

    window.flip = flip  # type: ignore[method-assign]
    assert sit(small, window, store).faulty_trials == 1
    answers = store.all("answer")
    assert [answer.trial for answer in answers if not answer.shown_well] == [1]
    assert store.all("shown")[0].detail["faults"] == ["moved to another display"]
    assert [one["longest_flips"] for one in store.all("display")] == [2, 5]
    assert window.pacing.refresh_hz == 144.0


def test_a_display_that_is_too_slow_is_refused_before_anything_is_shown(make_small: Any, store: Any) -> None:
    small = make_small("", ("fps = 30", "fps = 60"))
    window = ScriptedWindow(refresh_hz=50.0)
    with pytest.raises(SessionError, match="Expected a display that shows 60 frames a second evenly"):
        sit(small, window, store)
    assert not window.shown
    assert not store.log


def test_no_answer_within_the_window_is_missed(make_small: Any, store: Any) -> None:
    window = ScriptedWindow(whole([Act(), press("s", 1.99), *[press("s")] * 4]))
    sit(make_small(), window, store)
    answers = store.all("answer")
    assert [answer.missed for answer in answers] == [True, True, False, False, False, False]
    assert answers[1].value is None  # 1.99 s after the page, but 2.02 s after the last frame


def test_keys_that_answer_nothing_count_for_nothing(make_small: Any, store: Any) -> None:
    keys = Act(tuple(Key(name, 0.1 * i) for i, name in enumerate(("q", "1", "space", "enter", "d"), start=1)))
    window = ScriptedWindow(whole([keys, *[press("s")] * 5]))
    sit(make_small(), window, store)
    first = store.all("answer")[0]
    assert (first.value, first.response_s) == ("different", pytest.approx(0.5 + 2 / 60))


def test_a_key_from_before_the_question_answers_nothing_however_late_it_arrives(make_small: Any, store: Any) -> None:
    window = ScriptedWindow(whole([Act((Key("d", 0.1), Key("s", 0.4))), *[press("s")] * 5]))
    original = window.wait

    def late(timeout_s: float | None = None) -> Any:
        """The first `d` was pressed while the film played; it comes only now."""
        return tuple(replace(e, time_s=e.time_s - 0.3) if e == Key("d", e.time_s) else e for e in original(timeout_s))

    window.wait = late  # type: ignore[method-assign]
    sit(make_small(), window, store)
    assert store.all("answer")[0].value == "same"


def test_a_key_pressed_while_the_motion_plays_answers_nothing(make_small: Any, store: Any) -> None:
    early = {flip: Key("d", 0.0) for flip in range(3, 60)}
    window = ScriptedWindow(whole([press("s")] * 6), at_flip=early)
    sit(make_small(), window, store)
    assert store.all("answer")[0].value == "same"


def first_frame_flips(small: Any) -> list[int]:
    """Numbers of the flips that show the first trial's first stimulus."""
    window = ScriptedWindow(whole([press("s")] * 6))

    class Nothing:
        def __getattr__(self, _: str) -> Any:
            return lambda *_: None

    sit(small, window, Nothing())
    kinds = [kind for kind, _, _ in window.shown]
    start = kinds.index("frame")
    return list(range(start, start + kinds[start:].index("blank")))


def test_a_stalled_trial_comes_again_at_the_end(make_small: Any, store: Any) -> None:
    small = make_small()
    stalled = first_frame_flips(small)[10]
    window = ScriptedWindow(whole([press("s")] * 7), late_s={stalled: 0.2})
    outcome = sit(small, window, store)
    answers = store.all("answer")
    assert [(answer.trial, answer.attempt) for answer in answers] == [(n, 1) for n in range(1, 7)] + [(1, 2)]
    assert [answer.shown_well for answer in answers] == [False] + [True] * 6
    assert (outcome.faulty_trials, outcome.dropped_flips) == (1, 12)
    first, second = store.all("shown")[:2]
    assert (first.shown_well, second.shown_well) == (False, True)
    assert first.longest_gap_frames == pytest.approx(7.0)  # two flips of its own, and twelve more


@pytest.mark.parametrize("event", [Focus(False, 0.0), Resized((800, 600), 0.0)], ids=["focus", "resize"])
def test_a_window_left_or_resized_in_mid_stimulus_flags_the_trial(make_small: Any, store: Any, event: Any) -> None:
    small = make_small()
    window = ScriptedWindow(whole([press("s")] * 7), at_flip={first_frame_flips(small)[5]: event})
    sit(small, window, store)
    assert [answer.trial for answer in store.all("answer") if not answer.shown_well] == [1]
    if isinstance(event, Focus):
        assert store.all("focus")[0] == {"focused": False, "trial": 1, "step": "first"}


def test_a_film_that_begins_while_the_window_is_away_is_flagged_too(make_small: Any, store: Any) -> None:
    small = make_small()
    flips = first_frame_flips(small)
    window = ScriptedWindow(whole([press("s")] * 7), at_flip={flips[5]: Focus(False, 0.0)})
    original = window.flip

    def flip() -> float:
        at = original()
        window.focused = not flips[5] < len(window.shown) < flips[-1] + 20  # comes back in the second film
        return at

    window.flip = flip  # type: ignore[method-assign]
    sit(small, window, store)
    assert [one.shown_well for one in store.all("shown")[:4]] == [False, False, True, True]


def test_what_comes_with_an_answer_is_logged_all_the_same(make_small: Any, store: Any) -> None:
    both = Act((Key("s", 0.3), Key("d", 0.3), Focus(False, 0.3)))
    window = ScriptedWindow(whole([both, *[press("d")] * 6]))
    sit(make_small(), window, store)
    assert store.all("answer")[0].value == "same"
    assert store.all("focus") == [{"focused": False, "trial": 1, "step": "answer"}]


@pytest.mark.parametrize("event", [Key("escape", 0.0), CloseAsked(0.0)], ids=["escape", "close"])
def test_going_on_after_escape_shows_the_trial_from_its_start(make_small: Any, store: Any, event: Any) -> None:
    small = make_small()
    script = [GO, GO, press("space"), *[press("s")] * 6, GO, GO]
    window = ScriptedWindow(script, at_flip={first_frame_flips(small)[5]: event})
    assert sit(small, window, store).end == "finished"
    answers = store.all("answer")
    assert [(answer.trial, answer.attempt) for answer in answers] == [(n, 1) for n in range(1, 7)]
    assert all(answer.shown_well for answer in answers)
    assert store.all("trial begun again") == [{"trial": 1, "attempt": 1, "step": "first"}]
    frames = [thing[1] for kind, thing, _ in window.shown if kind == "frame"]
    assert frames[:8] == [0, 0, 1, 1, 2, 2, 0, 0]


def test_stopping_keeps_what_was_answered_and_the_next_session_goes_on(make_small: Any, store: Any) -> None:
    small = make_small()
    window = ScriptedWindow([GO, GO, press("s"), press("d"), press("escape"), press("x")])
    assert sit(small, window, store).end == "stopped"
    answers = store.all("answer")
    assert [answer.trial for answer in answers] == [1, 2]
    assert store.all("stopped") == [{"trial": 3, "step": "answer"}]
    assert not store.all("finished")
    # No welcome again, but the study's instructions.
    again = ScriptedWindow(whole([press("s")] * 4, before=1))
    assert sit(small, again, store, answers).end == "finished"
    assert [answer.trial for answer in store.all("answer")] == [1, 2, 3, 4, 5, 6]


def test_a_question_interrupted_by_escape_is_asked_on_but_its_trial_comes_again(make_small: Any, store: Any) -> None:
    window = ScriptedWindow([GO, GO, press("escape", 0.1), press("space", 0.1), *[press("s")] * 7, GO, GO])
    sit(make_small(), window, store)
    answers = store.all("answer")
    assert [(answer.trial, answer.shown_well) for answer in answers][:2] == [(1, False), (2, True)]
    assert [answer.trial for answer in answers][-1] == 1


def test_ratings_take_digits_arrows_and_the_mouse(make_small: Any, store: Any, texts: Any) -> None:
    """A scale of 11 points: the last has no digit, so the arrow keys and Enter reach it."""
    small = make_small(texts["rating"])
    arrows = Act((Key("left", 0.1), Key("enter", 0.2)))
    window = ScriptedWindow([GO, GO, *[press("s")] * 6, press("7", 40.0), arrows, GO, GO])
    sit(small, window, store)
    ratings = [answer for answer in store.all("answer") if answer.item]
    assert [(answer.item, answer.value) for answer in ratings] == [("natural", "7"), ("smooth", "10")]
    assert ratings[0].response_s == pytest.approx(40.0 + 2 / 60)  # a questionnaire has no time limit
    assert ratings[1].response_s == pytest.approx(0.2)  # a further question is timed from when it was put up
    assert [one.trial for one in store.all("shown")].count(7) == 1  # shown once, whatever it is asked


def test_buttons_can_be_clicked(make_small: Any, store: Any) -> None:
    from study.apps.player.screens import answer_page
    from study.apps.player.sheet import draw_page
    from study.experiment.session import advanced, current

    small = make_small()
    session = open_session(small.protocol, small.plan)
    while current(session).kind != "answer":
        session = advanced(session)
    left, top, right, bottom = draw_page(answer_page(small.protocol, current(session), (0, 6)), (640, 480), LOOK).boxes[
        1
    ]
    place = (left + right) / 2, (top + bottom) / 2
    aside = Act((*click(2, 2, 0.1).events, *click(*place, 0.3).events))
    window = ScriptedWindow(whole([aside, *[press("s")] * 5]))
    sit(small, window, store)
    first = store.all("answer")[0]
    assert (first.value, first.response_s) == ("different", pytest.approx(0.3 + 2 / 60))


def typed(text: str) -> Act:
    return Act((*(Typed(letter, 0.1) for letter in text), Key("enter", 0.2)))


def test_consent_and_form_come_first(make_small: Any, store: Any, texts: Any) -> None:
    small = make_small(texts["about_you"])
    # 17 is refused where it stands; a backspace and 8 mend it.
    mend = Act((Typed("1", 0.1), Typed("7", 0.1), Key("enter", 0.2), Key("backspace", 0.3), Typed("8", 0.4)))
    mend = Act((*mend.events, Key("enter", 0.5)))
    script = [press("1"), mend, *[Act()] * 5, press("2"), press("enter"), GO, GO, *[press("s")] * 6, GO, GO]
    window = ScriptedWindow(script)
    assert sit(small, window, store).end == "finished"
    kinds = [kind for kind, _ in store.log]
    assert kinds[:4] == ["display", "begin", "consent", "form"]
    assert store.all("form") == [{"age": "18", "vision": "with glasses"}]


def test_the_form_leads_back_to_what_was_filled_in_before(make_small: Any, store: Any, texts: Any) -> None:
    small = make_small(texts["about_you"])
    back = press("up", 0.1)
    script = [
        press("1"), typed("30"), *[Act()] * 2,  # the age, drawn anew after each digit
        press("1"), back,  # vision: yes; back from the remarks
        press("3"),  # vision: no
        typed("none"), *[Act()] * 4, GO, GO, *[press("s")] * 6, GO, GO,
    ]  # fmt: skip
    assert sit(small, ScriptedWindow(script), store).end == "finished"
    assert store.all("form") == [{"age": "30", "vision": "no", "remarks": "none"}]


def test_going_back_shows_what_was_chosen_and_typed(texts: Any, make_small: Any) -> None:
    from study.apps.player.screens import field_page

    small = make_small(texts["about_you"])
    age, vision, _ = small.protocol.form
    assert field_page(small.protocol, age, "", "30", first=True).entry == "30"
    assert field_page(small.protocol, age, "", "30", first=True).back is None
    chosen = field_page(small.protocol, vision, "", "with glasses", first=False)
    assert chosen.chosen == 1
    assert chosen.back is not None


def test_enter_goes_on_wherever_the_space_bar_does(make_small: Any, store: Any) -> None:
    enter = press("enter")
    window = ScriptedWindow([enter] * 2 + [press("s")] * 6 + [enter] * 2)
    assert sit(make_small(), window, store).end == "finished"


def test_who_declines_leaves_nothing_behind(make_small: Any, store: Any, texts: Any) -> None:
    window = ScriptedWindow([press("2"), GO])
    assert sit(make_small(texts["about_you"]), window, store).end == "declined"
    assert [kind for kind, _ in store.log] == ["display"]  # which a real store keeps to itself until it begins


def test_an_example_plays_and_counts_for_nothing(make_small: Any, store: Any) -> None:
    small = make_small("", ("example = false\n", ""))
    window = ScriptedWindow([GO, press("e"), GO, *[press("s")] * 6, GO, GO])
    assert sit(small, window, store).answers == 6
    assert len(store.all("shown")) == 12
    frames = sum(kind == "frame" for kind, _, _ in window.shown)
    shown = sum(one.frames_presented for one in store.all("shown"))
    example = len(small.stimuli.stimulus(small.plan.trials[0].stimuli[0]).positions)
    assert frames == 2 * (shown + example)


def test_practice_gets_feedback(make_small: Any, store: Any) -> None:
    small = make_small("", ("example = false\n", "example = false\npractice = 1\n"))
    window = ScriptedWindow([GO, GO, press("s"), GO, GO, *[press("s")] * 6, GO, GO])
    assert sit(small, window, store).end == "finished"
    assert len(store.all("answer")) == 7  # after the practice stands a page that says so


def test_an_own_clock_says_that_it_measured_nothing(make_small: Any, store: Any) -> None:
    window = ScriptedWindow(whole([press("s")] * 6), own_clock=True)
    sit(make_small(), window, store)
    assert {one.method for one in store.all("shown")} == {"own clock"}
    assert store.all("display")[0]["timing_measured"] is False


def test_a_window_that_was_left_asks_before_it_shows_a_trial(make_small: Any, store: Any) -> None:
    window = ScriptedWindow([GO, GO, GO, *[press("s")] * 6, GO, GO])

    original = window.flip

    def flip() -> float:
        at = original()
        window.focused = len([1 for kind, _, _ in window.shown if kind == "page"]) != 2
        return at

    window.flip = flip  # type: ignore[method-assign]
    assert sit(make_small(), window, store).end == "finished"
    assert len(store.all("answer")) == 6


def test_everything_is_prepared_before_a_trial_starts(make_small: Any, store: Any) -> None:
    """Between a trial's first flip and its question nothing is laid out, drawn as text or loaded."""
    window = ScriptedWindow(whole([press("s")] * 6))
    made: list[int] = []
    for name in ("picture", "drawing"):
        original = getattr(window, name)

        def counted(*given: Any, original: Any = original, **more: Any) -> Any:
            made.append(len(window.shown))
            return original(*given, **more)

        setattr(window, name, counted)
    sit(make_small(), window, store)
    kinds = [kind for kind, _, _ in window.shown]
    for number in made:
        # What was shown last when something was made: a page or a pause; after a frame only where a trial is over.
        assert kinds[number - 1] != "frame" if number else True
        if kinds[number - 1] == "blank":
            assert kinds[number - 2] == "page"  # a pause after an answer, not a gap between stimuli


def test_pictures_are_as_high_as_the_protocol_states_and_on_record(make_small: Any, store: Any) -> None:
    """A full-HD screen 53 cm wide, seen from 60 cm."""
    small, window = make_small(), ScriptedWindow(whole([press("s")] * 6))
    window.describe = lambda: {"display": "scripted", "display_pixels": [1920, 1080], "display_mm": [530, 298]}
    session = open_session(small.protocol, small.plan)
    play(window, session, small.stimuli.stimulus, store, LOOK, setting=Setting(distance_cm=60.0))
    shown = [row.detail for row in store.all("shown")]
    assert {row["height_px"] for row in shown} == {756}
    assert {row["screen_height_px"] for row in shown} == {1080}
    centimetres = 756 / (1920 / 53.0)
    assert shown[0]["height_degrees"] == pytest.approx(np.degrees(2 * np.arctan(centimetres / 2 / 60)), abs=1e-3)


def test_actual_size_is_that_of_the_stimuli_and_degrees_need_a_known_screen(make_small: Any, store: Any) -> None:
    small = make_small()
    window = ScriptedWindow(whole([press("s")] * 6))
    session = open_session(small.protocol, small.plan)
    play(window, session, small.stimuli.stimulus, store, LOOK, setting=Setting(actual_size=True))
    assert {row.detail["height_px"] for row in store.all("shown")} == {small.protocol.stimuli.height}
    screen = Screen(height_degrees=15.0, distance_cm=60.0)
    other = replace(session, protocol=small.protocol.model_copy(update={"screen": screen}))
    with pytest.raises(SessionError, match="Expected the width of the screen"):
        play(ScriptedWindow([]), other, small.stimuli.stimulus, store, LOOK)
