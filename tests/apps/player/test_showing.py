"""Which frame a flip shows, and how gaps and drops are counted."""

from __future__ import annotations

import pytest

from study.apps.player.showing import Showing, frame_at


def run(fps: float, hz: float, frames: int, jitter: float = 0.0) -> list[int]:
    """The frames shown by flips at every beat, each early or late by `jitter` of a period in turn."""
    shown = []
    for flip in range(10_000):
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
