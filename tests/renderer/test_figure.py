from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from renderer.capsules import Figure, place
from renderer.colour import nv12_to_rgb, to_rgb, to_ycbcr
from renderer.errors import RendererError
from renderer.figure import COLOURS, STYLES, make_figure
from study.motion.clip import joint_positions
from study.motion.drawing import figure_for
from study.motion.library import open_library


@pytest.mark.parametrize("style", STYLES)
def test_every_style_has_a_head_and_every_limb(puppet: Any, style: str) -> None:
    figure = make_figure(puppet.bones, puppet.sides, puppet.parts, style=style)
    assert figure.style == style
    hung_on = set(figure.ends.ravel().tolist())
    for role in ("knee.L", "knee.R", "elbow.L", "elbow.R", "wrist.L", "wrist.R", "ankle.L", "ankle.R", "head"):
        assert puppet.parts[role] in hung_on, role


def test_the_lights_are_those_of_johansson(puppet: Any) -> None:
    figure = make_figure(puppet.bones, puppet.sides, puppet.parts, style="points")
    assert len(figure.ends) == 13
    assert not figure.lit
    assert np.unique(figure.colours, axis=0).shape[0] == 1, "left and right are not told apart"


@pytest.mark.parametrize("style", ["stick", "mannequin"])
def test_limbs_take_the_colour_of_their_side(puppet: Any, style: str) -> None:
    figure = make_figure(puppet.bones, puppet.sides, puppet.parts, style=style)
    by_end = {tuple(e): tuple(c) for e, c in zip(figure.ends.tolist(), figure.colours.tolist(), strict=True)}
    parts = puppet.parts
    for side, name in (("L", "left"), ("R", "right")):
        for start, end in (
            ("hip", "knee"),
            ("knee", "ankle"),
            ("ankle", "toe"),
            ("shoulder", "elbow"),
            ("elbow", "wrist"),
        ):
            assert by_end[parts[f"{start}.{side}"], parts[f"{end}.{side}"]] == COLOURS[name]
    if style == "stick":
        assert by_end[parts["spine"], parts["chest"]] not in (COLOURS["left"], COLOURS["right"])


def seen_by(colour: tuple[int, ...], kind: str) -> np.ndarray:
    """A colour as people without one kind of cone see it: Vienot, Brettel and Mollon (1999), linear RGB."""
    linear = (np.array(colour) / 255.0) ** 2.2
    matrix = {
        "protan": [[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]],
        "deutan": [[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]],
    }[kind]
    return 255.0 * np.clip(np.array(matrix) @ linear, 0, 1) ** (1 / 2.2)


@pytest.mark.parametrize("kind", ["protan", "deutan"])
def test_colour_blind_people_tell_left_from_right(kind: str) -> None:
    left, right = seen_by(COLOURS["left"], kind), seen_by(COLOURS["right"], kind)
    assert np.linalg.norm(left - right) > 100
    # By lightness alone too, for those who see no colours at all.
    assert abs(to_ycbcr(COLOURS["left"])[0] - to_ycbcr(COLOURS["right"])[0]) > 50


def test_a_rig_without_roles_is_drawn_all_the_same(puppet: Any) -> None:
    figure = make_figure(puppet.bones, puppet.sides)
    assert len(figure.ends) == len(puppet.bones)
    lights = make_figure(puppet.bones, puppet.sides, style="points")
    assert len(lights.ends) == len(puppet.sides)


def test_a_hand_is_one_piece_to_the_tip_of_its_longest_finger() -> None:
    # wrist 1 with a thumb 2 and a finger 3-4-5.
    bones = np.array([[0, 1], [1, 2], [1, 3], [3, 4], [4, 5]])
    figure = make_figure(bones, ["left"] * 6, {"elbow.L": 0, "wrist.L": 1})
    assert figure.ends.tolist() == [[0, 1], [1, 5]]


def test_thickness_and_head_grow_with_the_person(puppet: Any) -> None:
    small = make_figure(puppet.bones, puppet.sides, puppet.parts, height_m=0.86)
    tall = make_figure(puppet.bones, puppet.sides, puppet.parts, height_m=1.72)
    np.testing.assert_allclose(tall.radii, 2 * small.radii)
    np.testing.assert_allclose(tall.beyond, 2 * small.beyond)


def test_the_head_sits_on_its_joint_whatever_the_length_of_its_bone(puppet: Any) -> None:
    figure = make_figure(puppet.bones, puppet.sides, puppet.parts)
    pose = puppet.walk(1)
    head = np.flatnonzero((figure.beyond != 0).any(axis=1))
    assert len(head) == 1
    stretched = pose.copy()
    crown = len(puppet.parts) and 5
    stretched[:, crown] += 3 * (pose[:, crown] - pose[:, puppet.parts["head"]])
    np.testing.assert_allclose(place(figure, pose)[:, head], place(figure, stretched)[:, head])


def test_the_nose_points_the_way_the_body_faces(puppet: Any) -> None:
    """Of all that is drawn of the head, that ahead of its joint reaches furthest, by a nose's length."""
    figure = make_figure(puppet.bones, puppet.sides, puppet.parts, style="mannequin")
    pose = puppet.walk(5)
    for turn in (1.0, -1.0):
        turned = pose * [turn, 1, turn]
        ends, radii = place(figure, turned).reshape(len(turned), -1, 3), figure.radii.reshape(-1)
        head = turned[:, puppet.parts["head"], :]
        high = ends[..., 1] > head[:, None, 1] + 0.05
        ahead = np.where(high, (ends[..., 2] - head[:, None, 2]) * turn + radii, -np.inf).max(axis=1)
        behind = np.where(high, (head[:, None, 2] - ends[..., 2]) * turn + radii, -np.inf).max(axis=1)
        assert (ahead > 0.10).all()
        assert (ahead < 0.14).all()
        assert (behind < ahead).all()


def proportions(clip: np.ndarray, parts: dict[str, int], figure: Figure) -> dict[str, float]:
    """What a tape would measure of a standing figure, as shares of its height, of balls along all of its capsules."""
    placed = place(figure, clip)[0]
    # Many balls along each capsule.
    share = np.linspace(0, 1, 33)[:, None]
    middles = (placed[:, None, 0] * (1 - share) + placed[:, None, 1] * share).reshape(-1, 3)
    radii = (figure.radii[:, None, 0] * (1 - share[:, 0]) + figure.radii[:, None, 1] * share[:, 0]).reshape(-1)
    low, high = (middles[:, 1] - radii).min(), (middles[:, 1] + radii).max()
    height = high - low

    def across(level: float, axis: int, near: float = np.inf) -> float:
        """Extent along an axis of what crosses a height, no further than `near` from the middle of the body."""
        half = radii**2 - (middles[:, 1] - level) ** 2
        cut = (half > 0) & (np.abs(middles[:, 0] - clip[0, parts["pelvis"], 0]) < near)
        reach = np.sqrt(np.maximum(half, 0))
        return float((middles[cut, axis] + reach[cut]).max() - (middles[cut, axis] - reach[cut]).min())

    joints = clip[0]
    hips = joints[[parts["hip.L"], parts["hip.R"]], 1].mean()
    shoulders = joints[[parts["shoulder.L"], parts["shoulder.R"]], 1].mean()
    chest = hips + 0.72 * (shoulders - hips)
    heel_to_toe = middles[:, 1] < joints[parts["ankle.L"], 1]
    left = heel_to_toe & (np.abs(middles[:, 0] - joints[parts["ankle.L"], 0]) < 0.06)
    return {
        "hip breadth": across(hips, 0, 0.2) / height,
        "chest breadth": across(chest, 0, 0.13) / height,
        "chest depth": across(chest, 2, 0.13) / height,
        "shoulder breadth": across(shoulders - 0.02, 0) / height,
        "foot": float(((middles[left, 2] + radii[left]).max() - (middles[left, 2] - radii[left]).min()) / height),
        "head": float(high - joints[parts["head"], 1]) / height,
    }


def test_the_mannequin_is_as_wide_and_deep_as_people_are() -> None:
    """Shares of stature: means of the 1,774 men of 1988 (Gordon et al. 1989), taken from the survey's public data."""
    stands = open_library("synthetic").clip("stand", fps=30)
    clip, skeleton = joint_positions(stands, ends=True)[:1], stands.skeleton
    figure = figure_for(skeleton, "mannequin")
    found = proportions(clip, dict(skeleton.roles), figure)
    published = {
        "hip breadth": 0.342 / 1.756,
        "chest breadth": 0.322 / 1.756,
        "chest depth": 0.243 / 1.756,
        "shoulder breadth": 0.492 / 1.756,
        "foot": 0.270 / 1.756,
    }
    for what, share in published.items():
        assert 0.80 * share < found[what] < 1.10 * share, (what, found[what], share)


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"bones": np.zeros((0, 2), int)}, r"bones as whole numbers of shape \(bones, 2\)"),
        ({"bones": np.array([[0.0, 1.0]])}, "whole numbers"),
        ({"bones": np.array([[0, 99]])}, "between points 0 and 21"),
        ({"bones": np.array([[0, 1], [2, 1]])}, "far end of one bone"),
        ({"sides": ["port"] * 22}, "left, right, centre, got 'port'"),
        ({"parts": {"head": 40}}, "role head on a point from 0 to 21"),
        ({"style": "ghost"}, "stick, points, mannequin, got 'ghost'"),
        ({"height_m": -1.0}, "height from 0.1"),
        ({"colours": {"left": (1, 2)}}, "left colour as three whole numbers"),
        ({"colours": {"top": (1, 2, 3)}}, "colours for left, right, centre, got 'top'"),
        ({"background": (0, 0, 300)}, "background colour"),
        ({"floor_m": float("nan")}, "floor at a finite height"),
    ],
)
def test_what_makes_no_figure(puppet: Any, changes: dict[str, Any], match: str) -> None:
    arguments = {"bones": puppet.bones, "sides": puppet.sides, "parts": puppet.parts, **changes}
    with pytest.raises(RendererError, match=match):
        make_figure(**arguments)


def test_positions_of_another_skeleton_are_refused(puppet: Any) -> None:
    figure = make_figure(puppet.bones, puppet.sides, puppet.parts)
    with pytest.raises(RendererError, match=r"Expected 22 points a frame.*got 20.*end sites included"):
        place(figure, puppet.walk(2)[:, :20])


def test_a_figure_checks_itself() -> None:
    one = Figure("x", 2, np.array([[0, 1]]), np.zeros((1, 2)), np.zeros((1, 2)), np.ones((1, 2)), np.zeros((1, 3), int))
    with pytest.raises(RendererError, match="radii above 0"):
        replace(one, radii=np.zeros((1, 2)))
    with pytest.raises(RendererError, match=r"along of shape \(1, 2\)"):
        replace(one, along=np.zeros((2, 2)))
    with pytest.raises(RendererError, match="capsules on points 0 to 1"):
        replace(one, ends=np.array([[0, 2]]))


@pytest.mark.parametrize(
    ("rgb", "ycbcr"),
    # ITU-R BT.709 by hand: white, black, and the primaries at full strength.
    [
        ((255, 255, 255), (235, 128, 128)),
        ((0, 0, 0), (16, 128, 128)),
        ((255, 0, 0), (62.56, 102.34, 240)),
        ((0, 255, 0), (172.63, 41.66, 26.27)),
        ((0, 0, 255), (31.81, 240, 117.73)),
    ],
)
def test_colours_are_those_of_bt709(rgb: tuple[int, int, int], ycbcr: tuple[float, float, float]) -> None:
    np.testing.assert_allclose(to_ycbcr(rgb), ycbcr, atol=0.05)
    back = to_rgb(*(np.array(value) for value in to_ycbcr(rgb)))
    assert back.tolist() == list(rgb)


def test_nv12_becomes_rgb_with_its_chroma_in_place() -> None:
    frame = np.full((6, 4), 128, dtype=np.uint8)
    luma, blue, red = (round(v) for v in to_ycbcr((200, 30, 60)))
    frame[:4, 2:], frame[4:, 2], frame[4:, 3] = luma, blue, red
    picture = nv12_to_rgb(frame)
    assert picture.shape == (4, 4, 3)
    assert np.abs(picture[:, 2:].astype(int) - [200, 30, 60]).max() <= 2
    assert np.ptp(picture[:, :2].astype(int), axis=2).max() == 0
