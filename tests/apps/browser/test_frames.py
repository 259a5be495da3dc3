"""What the page makes of the frames that a browser tells of, with callbacks made up here."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from devtools import Tab
from serving import Site

pytestmark = pytest.mark.gl

FPS, FRAMES = 30, 20

# Each told frame is (index, counter of presented frames, milliseconds).
MEASURED = """(async () => {{
  const {{ Frames }} = await import('/pages/playing.js');
  const frames = new Frames({{ frames: {frames} }}, {fps});
  for (const [index, presentedFrames, at] of {told}) {{
    frames.add({{ mediaTime: index / {fps}, presentedFrames, expectedDisplayTime: at }});
  }}
  return frames.measured(0);
}})()"""


def steady(period_ms: float = 1000 / FPS, leave_out: Any = (), first: int = 0) -> list[Any]:
    return [(i, i + 7, 500 + i * period_ms) for i in range(first, FRAMES) if i not in leave_out]


def twice_counted(at: Any, leave_out: Any = ()) -> list[Any]:
    return [(i, count + (i >= at), time) for i, count, time in steady(leave_out=leave_out)]


def told_twice(at: Any) -> list[Any]:
    told = steady()
    return [*told[: at + 1], (at, told[at][1] + 1, told[at][2] + 5), *[(i, n + 1, ms) for i, n, ms in told[at + 1 :]]]


def jumped() -> list[Any]:
    """Frame 9 was never presented: the counter goes on by one where the film goes on by two."""
    return [(i, i + 7 - (i > 9), 500 + i * 1000 / FPS) for i in range(FRAMES) if i != 9]


@pytest.mark.parametrize(
    ("told", "presented", "well"),
    [
        pytest.param(steady(), FRAMES, True, id="steady"),
        pytest.param(steady(first=1), FRAMES, True, id="the first stood there before"),
        pytest.param(steady(leave_out=(9,)), FRAMES, True, id="one presented without a callback"),
        pytest.param(jumped(), FRAMES - 1, False, id="one not presented"),
        pytest.param(steady(first=2), FRAMES - 1, False, id="the second never seen"),
        pytest.param(twice_counted(5), FRAMES, True, id="one counted twice"),
        pytest.param(told_twice(0), FRAMES, True, id="the first told twice"),
        pytest.param([(i, n + (i >= 4), ms) for i, n, ms in jumped()], FRAMES - 1, False, id="twice and none"),
        pytest.param(steady(period_ms=45.0), FRAMES, False, id="slow throughout"),
        pytest.param(steady(period_ms=25.0), FRAMES, False, id="fast throughout"),
        pytest.param(steady(period_ms=36.0), FRAMES, True, id="two frames late at most"),
        pytest.param(steady()[:-1], FRAMES - 1, False, id="not to its end"),
    ],
)
def test_only_a_film_with_every_frame_at_its_time_counts_as_shown_well(
    make_site: Callable[..., Site],
    make_tab: Callable[..., Tab],
    told: list[tuple[float, ...]],
    presented: int,
    well: bool,
) -> None:
    tab = make_tab()
    tab.open(make_site().address)
    found = tab.run(MEASURED.format(frames=FRAMES, fps=FPS, told=[list(one) for one in told]))
    assert (found["frames_presented"], found["shown_well"]) == (presented, well)
