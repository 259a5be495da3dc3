"""What makes do at one place: poses by brute force, and the choice where what is best is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from walks import make_walk

from study.motion.clip import Clip, joint_positions, moved, sample
from study.motion.synthetic import synthesize
from study.transitions.advice import advise
from study.transitions.comparison import Measured, compare, own_pose_m, why
from study.transitions.flaws import find_flaws
from study.transitions.methods.makes.inertialize import Inertialize
from study.transitions.methods.method import Place
from study.transitions.methods.registry import DIRECT


@pytest.fixture(scope="module")
def clips() -> tuple[Clip, Clip]:
    return synthesize("walk", seconds=5.0), synthesize("dance", seconds=5.0)


def test_a_motion_keeps_to_its_own_poses_wherever_it_goes(clips: tuple[Clip, Clip]) -> None:
    walk, dance = clips
    elsewhere = moved(walk, 1.0, np.array([3.0, 0.0, -2.0]))
    assert own_pose_m(elsewhere, (30, 50), (dance, walk)) == pytest.approx(0.0, abs=1e-6)
    assert own_pose_m(elsewhere, (30, 30), (dance,)) == 0.0
    raised = moved(walk, 0.0, np.array([0.0, 0.02, 0.0]))
    few = sample(walk, [30.0])
    assert own_pose_m(raised, (30, 31), (few,)) == pytest.approx(0.02, abs=1e-9)


def test_the_distance_is_that_of_the_best_place_on_the_floor(clips: tuple[Clip, Clip]) -> None:
    ours, theirs = (joint_positions(clip) for clip in (sample(clips[0], [40.0]), sample(clips[1], [60.0])))

    def apart(at: np.ndarray) -> float:
        x, z = (theirs[0, :, axis] for axis in (0, 2))
        cos, sin = np.cos(at[0]), np.sin(at[0])
        there = np.column_stack([x * cos + z * sin + at[1], theirs[0, :, 1], z * cos - x * sin + at[2]])
        return float(np.mean(np.sum((there - ours[0]) ** 2, axis=-1)))

    centre = (ours[0] - theirs[0]).mean(axis=0)
    least = min(minimize(apart, [turn, *centre[[0, 2]]], tol=1e-12).fun for turn in np.linspace(0, 6, 7))
    found = own_pose_m(clips[0], (40, 41), (sample(clips[1], [60.0]),))
    assert found == pytest.approx(np.sqrt(least), rel=1e-5)


def test_all_makes_are_measured_over_the_same_frames_and_sorted_by_what_is_seen(clips: tuple[Clip, Clip]) -> None:
    place = Place("", ("walk", "dance"), *clips, 60, 80)
    found = compare(place, 14)
    assert sorted(one.make for one in found) == sorted(DIRECT)
    made = {name: make().way(place, (14, 14)).made(place) for name, make in DIRECT.items()}
    longest = max(one.blend_stop - one.blend_start for one in made.values())
    for one in found:
        clip = made[one.make].clip
        flaws = find_flaws(clip, (60, 60 + longest), clips)
        assert one.unsupported_share == flaws.unsupported_share
        assert one.toe_acceleration_times == flaws.toe_acceleration_times
        assert one.own_pose_m == own_pose_m(clip, (60, 60 + longest), clips)
    plain = next(one for one in found if one.make == "slerp")
    scores = [one.score(plain) for one in found if one is not plain]
    assert scores == sorted(scores)
    assert found[0] is plain or found[0].score(plain) < plain.score(plain) - 0.1


def test_what_is_steadier_smoother_or_nearer_scores_less() -> None:
    plain = Measured("slerp", 0.2, 0.1, 1.5, 0.04)
    assert plain.score(plain) == pytest.approx(1 + 1 + 1)
    for better in (
        replace(plain, unsupported_share=0.1),
        replace(plain, toe_acceleration_times=1.0),
        replace(plain, own_pose_m=0.03),
    ):
        assert better.score(plain) < plain.score(plain)
    assert replace(plain, unsupported_share=0.0).score(plain) == replace(plain, unsupported_share=0.1).score(plain)
    near = replace(plain, own_pose_m=0.001)
    assert replace(near, own_pose_m=0.005).score(near) == near.score(near), "nobody sees such distances"
    told = why([replace(plain, make="dead-blend", unsupported_share=0.1), plain])
    assert told.startswith("no foot stands in 10% of the frames (blend: 20%), a toe accelerates 1.50 times")
    assert "no make is clearly better" in why([plain])


def test_a_motion_into_itself_is_blended_plainly() -> None:
    walk = synthesize("walk", seconds=5.0)
    found = compare(Place("", ("walk", "walk"), walk, walk, 60, 73), 14)
    assert found[0].make == "slerp"
    assert max(one.own_pose_m for one in found if one.make != "dead-blend") < 1e-6


def test_makes_without_room_are_omitted(clips: tuple[Clip, Clip]) -> None:
    walk, dance = clips
    found = compare(Place("", ("walk", "dance"), walk, dance, 60, dance.frames - 1), 20)
    assert Inertialize.name not in {one.make for one in found}, "a spring goes on after the blend that it matches"
    assert {"slerp", "dead-blend"} <= {one.make for one in found}


def test_a_rig_without_feet_gets_a_plain_blend() -> None:
    source, destination = make_walk(150), make_walk(150, phase=1.0, cadence=1.5)
    body = source.skeleton.body
    feet = {role: joint for role, joint in body.joints.items() if not role.startswith(("ankle", "toe"))}
    skeleton = replace(source.skeleton, known=replace(body, joints=feet))
    bare = [replace(clip, skeleton=skeleton) for clip in (source, destination)]
    found = advise(*bare, cyclic=(True, True))
    assert (found.make, found.makes, found.make_why) == ("slerp", (), "")


def test_the_reason_names_what_the_best_has_over_the_plain_blend() -> None:
    plain = Measured("slerp", 0.2, 0.1, 1.5, 0.04)
    best = replace(plain, make="inertialize", unsupported_share=0.05, toe_acceleration_times=1.25, own_pose_m=0.025)
    assert why((best, plain)) == (
        "no foot stands in 5% of the frames (blend: 20%), a toe accelerates 1.25 times as much as in the clips (1.50), "
        "poses are 2.5 cm from the clips' own (4.0)"
    )
    assert why((plain, best)) == "no make is clearly better in feet, toes and poses together"
    assert why(()) == ""
