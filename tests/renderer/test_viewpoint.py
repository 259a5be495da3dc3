import numpy as np
import pytest

from renderer.camera import project
from renderer.framing import frame_group
from renderer.viewpoint import best_view, clarity


def stepping(speed: float, heading: float = 0.0) -> np.ndarray:
    """A pelvis, a head and two feet that swing along the way, `(frames, 4, 3)`, travelling from the origin."""
    t = np.arange(120) / 30.0
    swing = 0.4 * np.sin(2 * np.pi * t)
    forward = np.array([np.sin(heading), 0.0, np.cos(heading)])
    along = np.stack([np.zeros_like(t), np.zeros_like(t), swing, -swing], axis=1) + (speed * t)[:, None]
    heights = np.array([0.9, 1.7, 0.1, 0.1])
    return along[..., None] * forward + heights[None, :, None] * np.array([0.0, 1.0, 0.0])


def test_a_figure_on_the_spot_is_seen_from_the_side_where_its_limbs_swing() -> None:
    assert abs(np.degrees(best_view([stepping(0.0)], heading=0.0))) == pytest.approx(90, abs=10)


def test_a_traveller_is_seen_from_between_front_and_side() -> None:
    view = abs(np.degrees(best_view([stepping(2.0)], heading=0.0)))
    assert 10 <= view <= 50


def test_the_view_turns_with_the_heading() -> None:
    plain = best_view([stepping(2.0)], heading=0.0)
    assert best_view([stepping(2.0, heading=1.1)], heading=1.1) == pytest.approx(plain)


def test_the_chosen_view_is_clearer_than_the_named_ones_and_nothing_leaves_the_frame() -> None:
    group = [stepping(2.0), stepping(3.0)]
    chosen = frame_group(group, view=best_view(group, heading=0.0), heading=0.0)
    for name in ("front", "side", "three-quarter"):
        assert clarity(group, chosen, 30.0) >= clarity(group, frame_group(group, view=name, heading=0.0), 30.0)
    seen, _ = project(chosen, np.concatenate([clip.reshape(-1, 3) for clip in group]))
    assert seen.min() >= 0
    assert np.all(seen.max(axis=0) <= [640, 480])


def test_a_still_figure_has_a_view_too() -> None:
    still = np.repeat(stepping(0.0)[:1], 5, axis=0)
    assert np.isfinite(best_view([still], heading=0.0))
