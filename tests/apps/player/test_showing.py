"""Which frame a flip shows, and how gaps and drops are counted."""

from __future__ import annotations

import pytest

from study.apps.player.showing import Rate, Showing, find_rate, frame_at
from study.errors import SessionError


def run(fps: float, hz: float, frames: int, jitter: float = 0.0) -> list[int]:
    """The frames shown by flips at every beat, each early or late by `jitter` of a period in turn."""
    shown = []
    for flip in range(40_000):
        at = flip / hz + (jitter / hz * (-1) ** flip if flip else 0.0)
        frame = frame_at(at, 0.0, fps, 1 / hz)
        if frame >= frames:
            return shown
        shown.append(frame)
    raise AssertionError("it never ends")


@pytest.mark.parametrize("jitter", [0.0, 0.4, -0.4])
@pytest.mark.parametrize(("fps", "hz", "holds"), [(30, 60, 2), (60, 60, 1), (30, 120, 4), (60, 240, 4)])
def test_every_frame_is_held_for_as_many_flips(fps: float, hz: float, holds: int, jitter: float) -> None:
    assert run(fps, hz, 20, jitter) == [frame for frame in range(20) for _ in range(holds)]


def test_a_rate_that_does_not_divide_holds_frames_for_two_or_three_flips() -> None:
    shown = run(24, 60, 24)
    assert sorted(set(shown)) == list(range(24))
    assert {shown.count(frame) for frame in range(1, 24)} == {2, 3}
    assert len(shown) == 60  # one second


@pytest.mark.parametrize("jitter", [0.0, 0.4, -0.4])
@pytest.mark.parametrize(
    ("fps", "hz", "holds"),
    [(30, 59.94, 2), (30, 60.3, 2), (60, 59.94, 1), (25, 49.8, 2), (120, 240, 2), (30, 119.88, 4), (24, 120, 5)],
)
def test_rates_that_nearly_divide_are_made_to_divide(fps: float, hz: float, holds: int, jitter: float) -> None:
    """A minute of motion: not one frame stands for longer or shorter."""
    rate = find_rate(fps, hz)
    assert rate == Rate(pytest.approx(hz / holds), holds, holds)
    assert rate.fps == pytest.approx(fps, rel=0.01)
    shown = run(rate.fps, hz, int(60 * fps), jitter)
    assert shown == [frame for frame in range(int(60 * fps)) for _ in range(holds)]


@pytest.mark.parametrize(
    ("fps", "hz", "holds"),
    [(30, 144, {4, 5}), (60, 144, {2, 3}), (24, 60, {2, 3}), (30, 75, {2, 3}), (30, 165, {5, 6})],
)
def test_rates_that_do_not_divide_keep_the_time(fps: float, hz: float, holds: set[int]) -> None:
    rate = find_rate(fps, hz)
    assert rate == Rate(fps, min(holds), max(holds))
    assert not rate.even
    frames = int(3 * fps)
    shown = run(rate.fps, hz, frames)
    assert sorted(set(shown)) == list(range(frames))
    assert {shown.count(frame) for frame in range(1, frames - 1)} == holds
    assert len(shown) / hz == pytest.approx(3.0, abs=1.5 / hz)


@pytest.mark.parametrize(("fps", "hz"), [(60, 30), (60, 50), (55, 60), (120, 60), (60, 75), (50, 60)])
def test_displays_that_cannot_show_a_motion_evenly_are_refused(fps: float, hz: float) -> None:
    with pytest.raises(SessionError, match=rf"shows {fps} frames a second evenly, found one of {hz} Hz; set it to a"):
        find_rate(fps, hz)


def test_what_is_not_refused_is_not_flagged_either() -> None:
    """On every display, a stimulus whose flips all came in time is shown well."""
    tried = 0
    for hz in (50, 59.94, 60, 72, 75, 90, 100, 120, 144, 165, 240, 360):
        for fps in (24, 25, 30, 48, 50, 60, 72, 90, 100, 120):
            try:
                rate = find_rate(fps, hz)
            except SessionError:
                continue
            frames = run(rate.fps, hz, 2 * fps)
            flips = tuple(i / hz for i in range(len(frames)))
            one = Showing("s", rate.fps, 1 / hz, tuple(frames), flips, 2 * fps, len(frames) / hz)
            assert one.shown_well, (hz, fps, one.longest_gap_frames)
            assert one.dropped_flips == 0
            assert one.longest_gap_frames <= 1.5 + 1e-6
            tried += 1
    assert tried > 60


def test_a_display_slower_than_the_motion_skips_frames() -> None:
    shown = run(60, 30, 60)
    assert len(shown) == 30
    assert len(set(shown)) == 30


def showing(flips: list[float], frames: list[int] | None = None, **more: object) -> Showing:
    frames = [i // 2 for i in range(len(flips))] if frames is None else frames
    given = {"ended_s": flips[-1] + 1 / 60, "faults": (), **more}
    return Showing("s", 30.0, 1 / 60, tuple(frames), tuple(flips), max(frames) + 1, **given)  # type: ignore[arg-type]


def test_a_steady_showing_is_well() -> None:
    one = showing([5 + i / 60 for i in range(40)])
    assert one.shown_well
    assert one.dropped_flips == 0
    assert one.longest_gap_frames == pytest.approx(1.0)
    assert one.last_frame_s == pytest.approx(5 + 38 / 60)
    assert one.detail()["at_ms"][:3] == [0.0, 33.33, 66.67]
    assert one.detail()["skipped_frames"] == 0


def test_one_dropped_flip_is_counted_and_still_well() -> None:
    """A frame of 30 fps that stands for three flips of 60 Hz stands for one and a half frames: not over that."""
    flips = [i / 60 + (1 / 60 if i > 20 else 0.0) for i in range(40)]
    one = showing(flips)
    assert one.dropped_flips == 1
    assert one.longest_gap_frames == pytest.approx(1.5)
    assert one.shown_well


@pytest.mark.parametrize("extra", [2, 5])
def test_a_longer_stall_is_a_fault(extra: int) -> None:
    flips = [i / 60 + (extra / 60 if i > 20 else 0.0) for i in range(40)]
    one = showing(flips)
    assert one.dropped_flips == extra
    assert one.longest_gap_frames == pytest.approx(1 + extra / 2)
    assert not one.shown_well


def test_a_last_frame_that_stays_too_long_is_a_fault() -> None:
    flips = [i / 60 for i in range(40)]
    assert not showing(flips, ended_s=flips[-1] + 3 / 60).shown_well


def test_other_faults_and_missing_ends_count() -> None:
    flips = [i / 60 for i in range(40)]
    assert not showing(flips, faults=("focus lost",)).shown_well
    whole = showing(flips)
    assert not Showing("s", 30.0, 1 / 60, whole.frames, whole.flips_s, 25).shown_well
    late_start = Showing("s", 30.0, 1 / 60, tuple(f + 1 for f in whole.frames), whole.flips_s, 21)
    assert not late_start.shown_well
