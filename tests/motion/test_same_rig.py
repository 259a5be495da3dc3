"""One motion on several rigs: what may differ between them, and what is refused in one line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from study.errors import MotionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions, retarget
from study.motion.skeleton import Skeleton
from study.motion.synthetic import synthesize
from study.motion.synthetic.body import skeleton as synthetic_skeleton

BODY = synthetic_skeleton()


@pytest.fixture(scope="module")
def walk() -> Clip:
    return synthesize("walk", seconds=1.5)


def with_leaves(body: Skeleton, hang: dict[str, str], seed: int = 0) -> Skeleton:
    """A body with more joints at the ends of others, named by what they hang on."""
    rng = np.random.default_rng(seed)
    names, parents, offsets = list(body.names), body.parents.tolist(), body.offsets.tolist()
    for name, parent in hang.items():
        parents.append(names.index(parent))
        names.append(name)
        offsets.append((0.05 * rng.normal(size=3)).tolist())
    return Skeleton(tuple(names), np.array(parents), np.array(offsets), body.end_parents, body.end_offsets)


def reordered(body: Skeleton) -> Skeleton:
    """The same joints, arms before legs."""
    order = [0, *range(9, body.joints), *range(1, 9)]
    place = {old: new for new, old in enumerate(order)}
    return Skeleton(
        tuple(body.names[k] for k in order),
        np.array([place.get(int(body.parents[k]), -1) for k in order]),
        body.offsets[order],
        np.array([place[int(p)] for p in body.end_parents]),
        body.end_offsets,
    )


FINGERS = {"LeftIndex1": "LeftHand", "LeftIndex2": "LeftIndex1", "RightIndex1": "RightHand", "Prop": "RightHand"}


def test_fingers_that_only_one_rig_has_are_left_out_or_stay_at_rest(walk: Clip) -> None:
    fuller = with_leaves(BODY, FINGERS)
    there = retarget(walk, fuller)
    np.testing.assert_allclose(joint_positions(there)[:, : BODY.joints], joint_positions(walk), atol=1e-12)
    assert np.all(there.rotations[:, BODY.joints :] == quat.IDENTITY)
    assert there.history[-1].endswith(
        "root path times 1.000, joints at rest LeftIndex1, LeftIndex2, RightIndex1 and 1 more"
    )
    back = retarget(there, BODY)
    np.testing.assert_allclose(back.rotations, walk.rotations, atol=1e-12)
    assert "removed joints LeftIndex1, LeftIndex2, RightIndex1 and 1 more" in back.history[-1]


def test_a_larger_body_takes_longer_steps_and_its_feet_stand(walk: Clip) -> None:
    larger = replace(BODY, offsets=1.3 * BODY.offsets, end_offsets=1.3 * BODY.end_offsets)
    np.testing.assert_allclose(joint_positions(retarget(walk, larger)), 1.3 * joint_positions(walk), atol=1e-12)


def test_joints_in_another_order_and_with_another_actors_name_are_the_same_joints(walk: Clip) -> None:
    other = replace(reordered(BODY), names=tuple(f"Actor2:{name}" for name in reordered(BODY).names))
    moved = retarget(replace(walk, skeleton=replace(BODY, names=tuple(f"Actor1_{n}" for n in BODY.names))), other)
    place = [other.names.index(f"Actor2:{name}") for name in BODY.names]
    np.testing.assert_allclose(joint_positions(moved)[:, place], joint_positions(walk), atol=1e-12)


def _turned_arms() -> Skeleton:
    offsets = BODY.offsets.copy()
    for side, x in (("L", 1.0), ("R", -1.0)):
        for part in ("elbow", "wrist"):
            joint = BODY.role(f"{part}.{side}")
            offsets[joint] = [x * float(np.linalg.norm(offsets[joint])), 0.0, 0.0]
    return replace(BODY, offsets=offsets)


@pytest.mark.parametrize(
    ("skeleton", "message"),
    [
        (replace(BODY, names=tuple(n.replace("LeftLeg", "Shin") for n in BODY.names)), "'LeftLeg', a joint of the "),
        (replace(BODY, parents=np.where(np.arange(22) == 9, 1, BODY.parents)), "'Spine' hanging on another joint"),
        (_turned_arms(), "rest poses in which 'LeftForeArm' lies 90 degrees apart"),
        (replace(BODY, names=tuple(f"j{k}" for k in range(22))), "a joint of the body itself, in one of them only"),
    ],
)  # fmt: skip
def test_other_rigs_are_refused_in_one_line(walk: Clip, skeleton: Skeleton, message: str) -> None:
    with pytest.raises(MotionError, match=message) as refusal:
        retarget(walk, skeleton)
    assert str(refusal.value).startswith("Expected walk on the rig of the other clip")
    assert len(str(refusal.value)) < 300
    assert "\n" not in str(refusal.value)
