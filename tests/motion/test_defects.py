"""Defects: planted ones are found and mended, the traps of real files too, and clean motion stays as it is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.errors import MotionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions, resample, trim
from study.motion.defects import Defect, find_defects
from study.motion.mending import mend
from study.motion.readers.registry import read_clip
from study.motion.skeleton import Skeleton

JOINTS = {  # name: (parent, offset in metres)
    "Hips": (None, (0, 0, 0)),
    "LeftUpLeg": ("Hips", (0.1, 0, 0)),
    "LeftLeg": ("LeftUpLeg", (0, -0.42, 0)),
    "LeftFoot": ("LeftLeg", (0, -0.40, 0)),
    "RightUpLeg": ("Hips", (-0.1, 0, 0)),
    "RightLeg": ("RightUpLeg", (0, -0.42, 0)),
    "RightFoot": ("RightLeg", (0, -0.40, 0)),
    "Spine": ("Hips", (0, 0.2, 0)),
    "LeftArm": ("Spine", (0.2, 0.3, 0)),
    "LeftForeArm": ("LeftArm", (0, -0.3, 0)),
    "LeftHand": ("LeftForeArm", (0, -0.25, 0)),
    "RightArm": ("Spine", (-0.2, 0.3, 0)),
    "RightForeArm": ("RightArm", (0, -0.3, 0)),
    "RightHand": ("RightForeArm", (0, -0.25, 0)),
}
NAMES = tuple(JOINTS)


def swinging(frames: int = 240, fps: float = 120.0) -> Clip:
    """A made-up body that swings arms and legs, bends its knees and moves along Z."""
    time = np.arange(frames) / fps
    rotations = np.tile(quat.IDENTITY, (frames, len(JOINTS), 1))
    for name, size, phase in (
        ("LeftUpLeg", 0.5, 0.0),
        ("RightUpLeg", 0.5, np.pi),
        ("LeftArm", 0.6, np.pi),
        ("RightArm", 0.6, 0.0),
    ):
        rotations[:, NAMES.index(name)] = quat.from_axis_angle([1.0, 0, 0], size * np.sin(2 * np.pi * time + phase))
    for name in ("LeftLeg", "RightLeg"):
        rotations[:, NAMES.index(name)] = quat.from_axis_angle([1.0, 0, 0], 0.6 + 0.3 * np.sin(2 * np.pi * time))
    ends = [NAMES.index(n) for n in ("LeftFoot", "RightFoot")]
    skeleton = Skeleton(
        NAMES,
        np.array([-1 if p is None else NAMES.index(p) for p, _ in JOINTS.values()]),
        np.array([o for _, o in JOINTS.values()], dtype=float),
        np.array(ends),
        np.array([[0, -0.05, 0.15]] * 2),
    )
    path = np.stack([np.zeros(frames), np.full(frames, 0.87), 1.2 * time], axis=1)
    clip = Clip(skeleton, path, rotations, fps, name="swinging")
    lowest = min(joint_positions(clip, ends=True)[..., 1].min(axis=1))
    return replace(clip, root_positions=path - [0, lowest, 0])


def turned(clip: Clip, name: str, angle: float, frames: slice, axis: tuple[float, float, float] = (0, 1, 0)) -> Clip:
    rotations = clip.rotations.copy()
    joint = clip.skeleton.names.index(name)
    rotations[frames, joint] = quat.multiply(rotations[frames, joint], quat.from_axis_angle(np.array(axis), angle))
    return replace(clip, rotations=rotations)


def flipped(clip: Clip, start: int, stop: int) -> Clip:
    """The right leg turned by half about the line from hip to ankle, as capture software does it."""
    hip, knee, ankle = (clip.skeleton.role(f"{part}.R") for part in ("hip", "knee", "ankle"))
    rotations = clip.rotations.copy()
    shin = quat.rotate(rotations[:, knee], clip.skeleton.offsets[ankle])
    leg = quat.rotate(rotations[:, hip], clip.skeleton.offsets[knee] + shin)
    turn = quat.from_axis_angle(leg / np.linalg.norm(leg, axis=1, keepdims=True), np.pi)
    rotations[start:stop, hip] = quat.multiply(turn, rotations[:, hip])[start:stop]
    return replace(clip, rotations=rotations)


def kinds(clip: Clip) -> list[str]:
    return [d.kind for d in find_defects(clip)]


def largest_step(clip: Clip) -> float:
    return float(np.max(quat.half_angle_between(clip.rotations[1:], clip.rotations[:-1]))) * 2


def test_a_clean_clip_has_no_defects_at_any_rate() -> None:
    clip = swinging()
    for fps in (120.0, 60.0, 30.0, 24.0):
        assert find_defects(resample(clip, fps)) == ()
    assert mend(clip) is clip


def test_an_added_t_pose_is_found_and_cut_off() -> None:
    clip = swinging()
    rotations, path = clip.rotations.copy(), clip.root_positions.copy()
    rotations[0] = quat.IDENTITY
    for name, angle in (("LeftArm", np.pi / 2), ("RightArm", -np.pi / 2)):
        rotations[0, NAMES.index(name)] = quat.from_axis_angle([0, 0, 1.0], angle)
    path[0] += [0.5, 0, 0]
    posed = replace(clip, rotations=rotations, root_positions=path)
    defects = find_defects(posed)
    assert [d.kind for d in defects] == ["t-pose", "root-jump"]
    assert (defects[0].frame_start, defects[0].frame_stop) == (0, 1)
    assert "the first frame is an added T-pose: the body jumps by up to 90 degrees" in defects[0].message
    mended = mend(posed)
    assert np.array_equal(mended.rotations, trim(clip, 1, clip.frames).rotations)
    assert mended.history == ("trimmed to frames 1 to 239 of 240",)


def test_frames_at_the_end_that_are_no_part_of_the_motion_are_cut_off() -> None:
    clip = swinging()
    rotations = clip.rotations.copy()
    rotations[-2:, 1:] = quat.from_axis_angle([0, 0, 1.0], 1.0)
    defects = find_defects(replace(clip, rotations=rotations))
    assert [(d.kind, d.frame_start, d.frame_stop) for d in defects] == [("end-jump", 238, 240)]
    assert mend(replace(clip, rotations=rotations)).frames == 238


@pytest.mark.parametrize("span", [(100, 101), (100, 108), (60, 110)])
def test_a_flipped_leg_is_turned_back_exactly_where_it_was(span: tuple[int, int]) -> None:
    clip = swinging()
    broken = flipped(clip, *span)
    (defect,) = [d for d in find_defects(broken) if d.kind == "joint-flip"]
    assert (defect.frame_start, defect.frame_stop, defect.joint) == (*span, "RightUpLeg")
    assert defect.size == pytest.approx(np.pi, abs=0.1)
    mended = mend(broken)
    before, after, right = joint_positions(broken), joint_positions(mended), joint_positions(clip)
    hip, knee, ankle = (clip.skeleton.role(f"{part}.R") for part in ("hip", "knee", "ankle"))
    assert np.max(np.abs(after[:, [hip, ankle]] - before[:, [hip, ankle]])) < 1e-12
    assert np.max(np.abs(before[:, knee] - right[:, knee])) > 0.1
    assert np.max(np.abs(after[:, knee] - right[:, knee])) < 0.01
    assert largest_step(mended) < 0.1
    assert find_defects(mended) == ()
    untouched = [j for j in range(clip.skeleton.joints) if j not in (hip, ankle)]
    assert np.array_equal(mended.rotations[:, untouched], broken.rotations[:, untouched])


def test_a_leg_that_flips_back_and_forth_is_mended_in_every_span() -> None:
    clip = swinging()
    broken = clip
    spans = [(50, 53), (55, 64), (66, 67), (120, 138)]
    for span in spans:
        broken = flipped(broken, *span)
    assert [(d.frame_start, d.frame_stop) for d in find_defects(broken)] == spans
    assert find_defects(mend(broken)) == ()


def test_a_joint_that_jumps_for_a_frame_is_bridged() -> None:
    clip = swinging()
    broken = turned(clip, "LeftForeArm", 1.2, slice(90, 91))
    (defect,) = find_defects(broken)
    assert (defect.kind, defect.joint, defect.severity) == ("joint-jump", "LeftForeArm", "major")
    assert defect.frame_start <= 90 < defect.frame_stop
    mended = mend(broken)
    assert np.max(np.abs(joint_positions(mended) - joint_positions(clip))) < 0.005


def test_a_hand_that_jumps_is_minor() -> None:
    (defect,) = find_defects(turned(swinging(), "LeftHand", 2.0, slice(90, 130), (1, 0, 0)))[:1]
    assert defect.severity == "minor"


def test_a_root_that_jumps_and_comes_back_is_bridged_and_one_that_stays_away_cuts() -> None:
    clip = swinging()
    path = clip.root_positions.copy()
    path[100:102] += [0.1, 0, 0]
    broken = replace(clip, root_positions=path)
    assert kinds(broken) == ["root-jump", "root-jump"]
    assert np.max(np.abs(mend(broken).root_positions - clip.root_positions)) < 1e-3
    path = clip.root_positions.copy()
    path[180:] += [0.1, 0, 0]
    cut = mend(replace(clip, root_positions=path))
    assert np.array_equal(cut.root_positions, clip.root_positions[:180])
    path[60:] += [0.1, 0, 0]
    path[120:] += [0.1, 0, 0]
    with pytest.raises(MotionError, match="Expected at least half of swinging in one piece, found 60 of 240"):
        mend(replace(clip, root_positions=path))


@pytest.mark.parametrize(("shift", "kind"), [(-0.08, "below-floor"), (0.2, "floating")])
def test_a_floor_at_another_height_is_found_and_put_right(shift: float, kind: str) -> None:
    clip = swinging()
    moved = replace(clip, root_positions=clip.root_positions + np.array([0, shift, 0]))
    assert kinds(moved) == [kind]
    assert "onto the floor" in mend(moved).history[-1]
    assert find_defects(mend(moved)) == ()


def test_a_body_that_lies_is_told() -> None:
    clip = swinging()
    turn = quat.from_axis_angle([1.0, 0, 0], np.pi / 2)
    rotations = clip.rotations.copy()
    rotations[:, 0] = quat.multiply(turn, rotations[:, 0])
    lying = replace(clip, rotations=rotations, root_positions=quat.rotate(turn, clip.root_positions))
    (defect,) = find_defects(lying)
    assert defect.kind == "not-upright"
    assert "lies along Z" in defect.message


def test_only_the_defects_given_are_dealt_with() -> None:
    broken = turned(turned(swinging(), "LeftForeArm", 1.2, slice(60, 61)), "RightForeArm", 1.2, slice(120, 121))
    left = [d for d in find_defects(broken) if d.joint == "LeftForeArm"]
    assert [d.joint for d in find_defects(mend(broken, left))] == ["RightForeArm"]


def test_clips_of_one_or_two_frames_are_left_alone() -> None:
    assert find_defects(trim(swinging(), 0, 1)) == ()
    assert find_defects(trim(swinging(), 0, 2)) == ()


# -- Real files -----------------------------------------------------------------------------------------------------


def real(mocap: Path, name: str) -> Clip:
    subject = name.split("_")[0]
    return read_clip(mocap / "cmu" / "subjects" / subject / name if name.endswith(".amc") else mocap / name)


def covering(clip: Clip, kind: str, frame: int) -> list[Defect]:
    return [d for d in find_defects(clip) if d.kind == kind and d.frame_start <= frame < d.frame_stop]


@pytest.mark.mocap
@pytest.mark.parametrize(
    ("name", "kind", "frame"),
    [
        ("cmu_bvh/02_01.bvh", "t-pose", 0),
        ("cmu_bvh/06_13.bvh", "t-pose", 0),
        ("cmu_bvh/07_12.bvh", "t-pose", 1),
        ("cmu_bvh/07_12.bvh", "root-jump", 1),
        ("cmu_bvh/05_16.bvh", "root-jump", 467),
        ("perfume/perfume_A_test.bvh", "t-pose", 0),
        ("perfume/perfume_B_test.bvh", "root-jump", 0),
        ("16_15.amc", "end-jump", 1),
        ("135_06.amc", "joint-jump", 1798),
        ("16_17.amc", "root-jump", 474),
    ],
)
def test_the_known_traps_are_found_and_mended(mocap: Path, name: str, kind: str, frame: int) -> None:
    clip = real(mocap, name)
    assert covering(clip, kind, frame)
    assert [d.message for d in find_defects(mend(clip)) if d.severity == "major"] == []


@pytest.mark.mocap
@pytest.mark.parametrize("trial", ["05", "06", "08", "10", "15", "16", "17", "19", "20"])
def test_flipping_hips_of_the_ballet_are_found_and_mended(mocap: Path, trial: str) -> None:
    clip = real(mocap, f"cmu_bvh/05_{trial}.bvh")
    flips = [d for d in find_defects(clip) if d.kind == "joint-flip"]
    assert flips
    assert {d.joint for d in flips} <= {"LeftUpLeg", "RightUpLeg"}
    mended = mend(clip)
    assert [d.message for d in find_defects(mended) if d.severity == "major"] == []
    before, after = joint_positions(trim(clip, 1, 1 + mended.frames)), joint_positions(mended)
    legs = [clip.skeleton.role(f"{part}.{side}") for part in ("hip", "ankle") for side in "LR"]
    same_height = after - before - np.median(after[:, 0] - before[:, 0], axis=0)
    kept = np.max(np.abs(same_height[:, legs]), axis=(1, 2)) < 1e-9
    assert kept.mean() > 0.97, "hips and ankles stay but where other jumps are bridged"
    knee = [clip.skeleton.role(f"knee.{side}") for side in "LR"]
    steps = np.linalg.norm(np.diff(after[:, knee], axis=0), axis=-1)
    assert steps.max() < 0.08, "a knee moves under 10 m/s"


@pytest.mark.mocap
@pytest.mark.parametrize(
    "name",
    ["02_01.amc", "16_35.amc", "09_02.amc", "127_08.amc", "14_02.amc", "bandai/dataset-1_dance-short_normal_001.bvh"],
)
def test_walking_running_boxing_and_dancing_are_no_defects(mocap: Path, name: str) -> None:
    assert find_defects(real(mocap, name)) == ()


@pytest.mark.mocap
@pytest.mark.parametrize("name", ["02_01", "07_01", *(f"09_0{k}" for k in range(1, 9))])
def test_conversions_have_their_t_pose_alone(mocap: Path, name: str) -> None:
    clip = real(mocap, f"cmu_bvh/{name}.bvh")
    assert {d.frame_start for d in find_defects(clip)} == {0}
    mended = mend(clip)
    assert np.array_equal(mended.rotations, trim(clip, 1, clip.frames).rotations)
    assert find_defects(resample(mended, 30.0)) == ()
