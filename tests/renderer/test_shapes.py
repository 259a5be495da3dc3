from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from renderer.camera import Camera, view_axes
from renderer.figure import make_figure
from renderer.framing import frame_group
from renderer.shapes import joined, lay_out, nearest_on_screen, paint_order


def order_of(ends: Any, nearness: Any, radius: float = 4.0, meets: Any = None) -> list[int]:
    ends, nearness = np.array(ends, dtype=float)[None], np.array(nearness, dtype=float)[None]
    count = ends.shape[1]
    shared = np.zeros((count, count), dtype=bool) if meets is None else np.array(meets)
    radii = np.full((1, count, 2), radius)
    return paint_order(ends, radii, nearness, np.full(count, 0.03), shared)[0].tolist()


def test_the_nearer_of_two_crossing_limbs_is_painted_last() -> None:
    cross = [[[0, 0], [100, 100]], [[0, 100], [100, 0]]]
    assert order_of(cross, [[0.2, 0.2], [0.3, 0.3]]) == [0, 1]
    assert order_of(cross, [[0.3, 0.3], [0.2, 0.2]]) == [1, 0]


def test_what_counts_is_the_depth_where_they_cross_not_their_middles() -> None:
    # The first limb comes from far behind, but where it crosses the second one it is before it.
    cross = [[[0, 0], [100, 0]], [[95, -50], [95, 50]]]
    nearness = [[0.05, 0.35], [0.3, 0.3]]
    assert np.mean(nearness[0]) < np.mean(nearness[1])
    assert order_of(cross, nearness) == [1, 0]


def test_limbs_that_do_not_touch_on_the_screen_do_not_bind_each_other() -> None:
    # 0 before 1 before 2 where they cross; 2 and 0 are apart, and 2's middle is the nearest of all.
    limbs = [[[0, 0], [100, 0]], [[90, -50], [90, 50]], [[60, 45], [200, 45]]]
    order = order_of(limbs, [[0.3, 0.3], [0.2, 0.2], [0.1, 0.45]])
    assert order.index(1) < order.index(0)
    assert order.index(2) < order.index(1)


def test_a_ring_of_limbs_is_drawn_in_some_order_without_loss() -> None:
    ring = [[[0, 0], [100, 10]], [[90, 0], [50, 100]], [[60, 100], [10, -5]]]
    nearness = [[0.2, 0.3], [0.2, 0.3], [0.2, 0.3]]
    assert sorted(order_of(ring, nearness)) == [0, 1, 2]


def test_the_order_is_that_of_a_brute_force_painter() -> None:
    random = np.random.default_rng(3)
    for _ in range(40):
        ends = random.uniform(0, 100, (8, 2, 2))
        nearness = np.repeat(random.permutation(8)[:, None] * 0.1 + 0.1, 2, axis=1)
        order = order_of(ends, nearness)
        # Flat limbs: wherever two touch, the further one comes first.
        s, t, gap = nearest_on_screen(ends[:, None], ends[None])
        assert ((s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)).all()
        for i in range(8):
            for j in range(8):
                if gap[i, j] < 8 and nearness[i, 0] < nearness[j, 0]:
                    assert order.index(i) < order.index(j)


def test_nearest_points_agree_with_a_fine_search() -> None:
    random = np.random.default_rng(4)
    one, two = random.uniform(0, 10, (30, 2, 2)), random.uniform(0, 10, (30, 2, 2))
    _, _, gap = nearest_on_screen(one, two)
    share = np.linspace(0, 1, 401)
    a = one[:, :1] + share[:, None] * (one[:, 1:] - one[:, :1])
    b = two[:, :1] + share[:, None] * (two[:, 1:] - two[:, :1])
    searched = np.linalg.norm(a[:, :, None] - b[:, None], axis=-1).min(axis=(1, 2))
    np.testing.assert_allclose(gap, searched, atol=0.03)


def test_a_frame_has_the_same_shapes_alone_as_in_a_clip(puppet: Any) -> None:
    figure = make_figure(puppet.bones, puppet.sides, puppet.parts, style="mannequin", floor_m=0.0)
    clip = puppet.walk(20)
    camera = frame_group([clip], size=(320, 240))
    whole = lay_out(clip, figure, camera)
    for frame in (0, 11, 19):
        alone = lay_out(clip[frame : frame + 1], figure, camera)
        assert (alone.data[0] == whole.data[frame]).all()
        assert (alone.boxes[0] == whole.boxes[frame]).all()


def test_bones_without_length_are_left_out_when_others_hang_on_them() -> None:
    bones = np.array([[0, 1], [1, 2]])
    figure = make_figure(bones, ["centre"] * 3)
    camera = Camera(np.array([0.0, 0.0, 4.0]), view_axes(0.0, 0.0), 100.0, (64, 64))
    pose = np.array([[[0.0, 0, 0], [0, 0, 0], [0, 0.5, 0]]])
    assert lay_out(pose, figure, camera).data.shape[1] == 1
    lights = make_figure(bones, ["centre"] * 3, style="points")
    assert lay_out(pose, lights, camera).data.shape[1] == 3, "a light has no length, and is there"


def test_capsules_that_share_one_joint_meet(puppet: Any) -> None:
    figure = make_figure(puppet.bones, puppet.sides, puppet.parts)
    meets = joined(figure)
    assert not meets.diagonal().any()
    assert (meets == meets.T).all()
    index = {tuple(e): i for i, e in enumerate(figure.ends.tolist())}
    parts = puppet.parts
    thigh, shin = (index[parts[a], parts[b]] for a, b in (("hip.L", "knee.L"), ("knee.L", "ankle.L")))
    other = index[parts["hip.R"], parts["knee.R"]]
    assert meets[thigh, shin]
    assert not meets[thigh, other]


@pytest.mark.parametrize("frames", [1, 3])
def test_boxes_hold_all_that_is_drawn(puppet: Any, frames: int) -> None:
    figure = make_figure(puppet.bones, puppet.sides, puppet.parts)
    clip = puppet.walk(frames)
    shapes = lay_out(clip, figure, frame_group([clip], size=(320, 240)))
    assert (shapes.boxes % 2 == 0).all()
    x, y, dx, dy, r = (shapes.data[..., i] for i in (0, 1, 2, 3, 4))
    for px, py in ((x, y), (x + dx, y + dy)):
        assert (px - r >= shapes.boxes[:, :1]).all()
        assert (px + r <= shapes.boxes[:, 2:3]).all()
        assert (py - r >= shapes.boxes[:, 1:2]).all()
        assert (py + r <= shapes.boxes[:, 3:4]).all()
