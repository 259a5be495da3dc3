"""Joint roles on the rigs that people have: one body under many names and trees, without names, and animals."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from growth import assert_linear

from study.errors import MotionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions, moved, with_roles
from study.motion.joint_names import ROLES, read_names
from study.motion.skeleton import Skeleton


@dataclass
class Rig:
    """A rig in the making: joints as name -> (parent, offset), and tips as name -> offset."""

    joints: dict[str, tuple[str, tuple[float, float, float]]] = field(default_factory=dict)
    tips: dict[str, tuple[float, float, float]] = field(default_factory=dict)

    def add(self, name: str, parent: str, x: float, y: float, z: float = 0.0) -> str:
        self.joints[name] = (parent, (x, y, z))
        return name

    def chain(self, parent: str, *joints: tuple[str, float, float, float]) -> str:
        for name, x, y, z in joints:
            parent = self.add(name, parent, x, y, z)
        return parent

    def between(self, name: str, joint: str, share: float = 0.5) -> str:
        """A joint put into the bone that leads to another."""
        parent, offset = self.joints[joint]
        self.joints[name] = (parent, tuple(share * c for c in offset))  # type: ignore[assignment]
        self.joints[joint] = (name, tuple((1.0 - share) * c for c in offset))  # type: ignore[assignment]
        return name

    def skeleton(self, names: Mapping[str, str] | None = None, order: np.random.Generator | None = None) -> Skeleton:
        """Depth first; siblings shuffled by `order`; joints renamed by `names`."""
        children: dict[str, list[str]] = {}
        for name, (parent, _) in self.joints.items():
            children.setdefault(parent, []).append(name)
        line: list[str] = []

        def visit(name: str) -> None:
            line.append(name)
            own = children.get(name, [])
            for child in own if order is None else [own[k] for k in order.permutation(len(own))]:
                visit(child)

        visit(children[""][0])
        index = {name: k for k, name in enumerate(line)}
        tips = [name for name in line if name in self.tips]
        return Skeleton(
            tuple((names or {}).get(name, name) for name in line),
            np.array([index.get(self.joints[name][0], -1) for name in line]),
            np.array([self.joints[name][1] for name in line]),
            np.array([index[name] for name in tips], dtype=np.int64),
            np.array([self.tips[name] for name in tips]).reshape(-1, 3),
        )


def human(arms: str = "hang", *, collars: bool = True, toes: bool = True, head: bool = True, upper: bool = True) -> Rig:
    """One body; its joints have their roles as names. Arms `hang`, or point `aside` as in a T-pose, or `aslant`."""
    rig = Rig()
    rig.add("pelvis", "", 0.0, 0.95)
    if upper:
        rig.chain("pelvis", ("spine", 0, 0.08, -0.01), ("spine2", 0, 0.12, 0), ("chest", 0, 0.13, 0))
        rig.add("neck", "chest", 0, 0.19, -0.01)
        rig.tips["neck"] = (0, 0.1, 0.0)
        if head:
            rig.add("head", "neck", 0, 0.09, 0.02)
            rig.tips = {"head": (0, 0.16, 0.0)}
    along = {"hang": (0.0, -1.0), "aside": (1.0, 0.0), "aslant": (0.8, -0.6)}[arms]
    for side, x in (("L", 1.0), ("R", -1.0)):
        rig.chain("pelvis", (f"hip.{side}", 0.09 * x, -0.06, 0), (f"knee.{side}", 0, -0.42, 0.01))
        rig.add(f"ankle.{side}", f"knee.{side}", 0, -0.41, -0.01)
        rig.tips[f"ankle.{side}"] = (0.0, -0.06, 0.13)
        if toes:
            rig.add(f"toe.{side}", f"ankle.{side}", 0, -0.05, 0.13)
            del rig.tips[f"ankle.{side}"]
            rig.tips[f"toe.{side}"] = (0.0, 0.0, 0.07)
        if not upper:
            continue
        base = rig.add(f"collar.{side}", "chest", 0.03 * x, 0.13, 0.01) if collars else "chest"
        place = (0.15 * x, 0.01) if collars else (0.18 * x, 0.14)
        rig.add(f"shoulder.{side}", base, *place)
        for name, length in ((f"elbow.{side}", 0.31), (f"wrist.{side}", 0.25)):
            rig.add(
                name,
                f"shoulder.{side}" if "elbow" in name else f"elbow.{side}",
                *(length * c * s for c, s in zip(along, (x, 1.0), strict=True)),
            )
        rig.tips[f"wrist.{side}"] = (0.09 * along[0] * x, 0.09 * along[1], 0.0)
    return rig


def expected(rig: Rig) -> dict[str, str]:
    return {role: role for role in ROLES if role in rig.joints}


def walking(skeleton: Skeleton, roles: Mapping[str, int], yaw: float = 0.0) -> Clip:
    """Legs and arms that swing, knees that bend, on a straight way."""
    time = np.linspace(0.0, 2.0 * np.pi, 30, endpoint=False)
    rotations = np.tile(quat.IDENTITY, (30, skeleton.joints, 1))
    for side, sign in (("L", 1.0), ("R", -1.0)):
        for role, angle in (
            ("hip", 0.5 * np.sin(time) * sign),
            ("knee", 0.4 - 0.4 * np.cos(time + sign)),
            ("ankle", 0.2 * np.cos(time) * sign),
            ("shoulder", -0.4 * np.sin(time) * sign),
            ("elbow", -0.4 - 0.2 * np.sin(time) * sign),
            ("wrist", 0.2 * np.cos(time)),
        ):
            if f"{role}.{side}" in roles:
                # Arms swing to the front whether they hang in rest or point aside.
                axis = (
                    [0.8, 0.6 if side == "R" else -0.6, 0.0]
                    if role in ("shoulder", "elbow", "wrist")
                    else [1.0, 0.0, 0.0]
                )
                rotations[:, roles[f"{role}.{side}"]] = quat.from_axis_angle(axis, angle)
    path = np.stack([np.zeros(30), np.full(30, 0.95), np.linspace(0.0, 1.2, 30)], axis=1)
    return moved(Clip(skeleton, path, rotations, 30.0), yaw, np.zeros(3))


def found(skeleton: Skeleton) -> dict[str, str]:
    return {role: skeleton.names[joint] for role, joint in skeleton.roles.items()}


# -- Names ------------------------------------------------------------------------------------------------------------

_CENTRE = ("pelvis", "spine", "spine2", "chest", "neck", "head")
_SIDED = ("hip", "knee", "ankle", "toe", "collar", "shoulder", "elbow", "wrist")
_STYLES = """
mixamo
    mixamorig:{}, Left{} Right{}
    Hips Spine Spine1 Spine2 Neck Head
    UpLeg Leg Foot ToeBase Shoulder Arm ForeArm Hand
motionbuilder
    {}, Left{} Right{}
    Hips Spine Spine1 Spine2 Neck Head
    UpLeg Leg Foot ToeBase Shoulder Arm ForeArm Hand
actor
    Actor_01_{}, Left{} Right{}
    Hips Spine Spine1 Spine2 Neck Head
    UpLeg Leg Foot ToeBase Shoulder Arm ForeArm Hand
unreal
    {}, {}_l {}_r
    pelvis spine_01 spine_02 spine_03 neck_01 head
    thigh calf foot ball clavicle upperarm lowerarm hand
unity
    {}, Left{} Right{}
    Hips Spine Chest UpperChest Neck Head
    UpperLeg LowerLeg Foot Toes Shoulder UpperArm LowerArm Hand
rigify
    DEF-{}, {}.L {}.R
    spine spine.001 spine.002 spine.003 spine.004 spine.006
    thigh shin foot toe shoulder upper_arm forearm hand
blender
    {}, {}.L {}.R
    Hips Spine Chest UpperChest Neck Head
    Upper_Leg Lower_Leg Foot Toe Shoulder Upper_Arm Lower_Arm Hand
daz
    {}, l{} r{}
    hip abdomenLower abdomenUpper chestLower neckLower head
    ThighBend Shin Foot Toe Collar ShldrBend ForearmBend Hand
poser
    {}, l{} r{}
    hip abdomen waist chest neck head
    Thigh Shin Foot Toe Collar Shldr ForeArm Hand
biped
    Bip001 {}, L_{} R_{}
    Pelvis Spine Spine1 Spine2 Neck Head
    Thigh Calf Foot Toe0 Clavicle UpperArm Forearm Hand
xsens
    {}, Left{} Right{}
    Pelvis L5 L3 T12 Neck Head
    UpperLeg LowerLeg Foot Toe Shoulder UpperArm ForeArm Hand
rokoko
    {}, Left{} Right{}
    Hips Spine1 Spine2 Spine3 Neck Head
    Thigh Shin Foot Toe Shoulder Arm ForeArm Hand
hips and knees
    {}, Left{} Right{}
    Hips Chest Chest2 Chest3 Neck Head
    Hip Knee Ankle Toe Collar Shoulder Elbow Wrist
kinect
    {}, {}Left {}Right
    SpineBase SpineMid Spine3 SpineShoulder Neck Head
    Hip Knee Ankle Foot Clavicle Shoulder Elbow Wrist
smpl
    {}, L_{} R_{}
    Pelvis Spine1 Spine2 Spine3 Neck Head
    Hip Knee Ankle Foot Collar Shoulder Elbow Wrist
smpl-x
    {}, left_{} right_{}
    pelvis spine1 spine2 spine3 neck head
    hip knee ankle foot collar shoulder elbow wrist
soma
    {}, Left{} Right{}
    Hips Spine1 Spine2 Chest Neck1 Head
    Leg Shin Foot ToeBase Shoulder Arm ForeArm Hand
maya
    {}_jnt, l_{} r_{}
    root spine_a spine_b spine_c neck head
    upLeg loLeg foot ball clav upArm loArm hand
vroid
    J_Bip_{}, L_{} R_{}
    C_Hips C_Spine C_Chest C_UpperChest C_Neck C_Head
    UpperLeg LowerLeg Foot ToeBase Shoulder UpperArm LowerArm Hand
acclaim
    {}, l{} r{}
    root lowerback upperback thorax lowerneck head
    femur tibia foot toes clavicle humerus radius wrist
valve
    ValveBiped.Bip01_{}, L_{} R_{}
    Pelvis Spine Spine1 Spine2 Neck1 Head1
    Thigh Calf Foot Toe0 Clavicle UpperArm Forearm Hand
source 2
    {}, {}_L {}_R
    pelvis spine_0 spine_1 spine_2 neck_0 head
    leg_upper leg_lower ankle ball clavicle arm_upper arm_lower hand
auto-rig
    {}, {}.l {}.r
    root.x spine_01.x spine_02.x spine_03.x neck.x head.x
    thigh_stretch leg_stretch foot toes_01 shoulder arm_stretch forearm_stretch hand
cascadeur
    {}, {}_l {}_r
    pelvis stomach chest0 chest neck head
    thigh calf foot toe clavicle arm forearm hand
full path
    |world|{}, Left{} Right{}
    Hips Spine Spine1 Spine2 Neck Head
    UpLeg Leg Foot Toe Shoulder Arm ForeArm Hand
capitals
    {}, LEFT_{} RIGHT_{}
    HIPS SPINE SPINE1 SPINE2 NECK HEAD
    THIGH CALF FOOT TOE CLAVICLE UPPERARM FOREARM HAND
lower case
    {}, left{} right{}
    hips spine spine1 spine2 neck head
    upleg leg foot toe shoulder arm forearm hand
japanese
    {}, 左{} 右{}
    センター 上半身 上半身2 上半身3 首 頭
    足 ひざ 足首 つま先 肩 腕 ひじ 手首
german
    {}, {}_links {}_rechts
    Becken Wirbel1 Wirbel2 Brust Hals Kopf
    Oberschenkel Unterschenkel Fuß Zehen Schlüsselbein Oberarm Unterarm Hand
spanish
    {}, {}_izq {}_der
    cadera columna1 columna2 pecho cuello cabeza
    muslo pierna pie dedos clavicula brazo antebrazo mano
french
    {}, {}_gauche {}_droite
    bassin dos1 dos2 poitrine cou tête
    cuisse tibia pied orteils clavicule bras avant_bras main
outside ascii
    体_{}_é, Left{} Right{}
    Hips Spine Spine1 Chest Neck Head
    UpLeg Leg Foot ToeBase Shoulder Arm ForeArm Hand
"""


def _read_styles() -> dict[str, tuple[str, str, str, str]]:
    """By name: the pattern of all joints, those of the two sides, the words of the trunk and of a limb."""
    lines = [line.strip() for line in _STYLES.strip().splitlines()]
    return {lines[k]: (*lines[k + 1].rsplit(", ", 1), lines[k + 2], lines[k + 3]) for k in range(0, len(lines), 4)}  # type: ignore[misc]


STYLES = _read_styles()


def style(name: str) -> dict[str, str]:
    """The name of each joint of `human()` in a style."""
    pattern, sides, centre, sided = STYLES[name]
    names = {joint: pattern.format(word) for joint, word in zip(_CENTRE, centre.split(), strict=True)}
    for letter, side in zip("LR", sides.split(), strict=True):
        names |= {f"{j}.{letter}": pattern.format(side.format(w)) for j, w in zip(_SIDED, sided.split(), strict=True)}
    return names


@pytest.mark.parametrize("name", STYLES)
@pytest.mark.parametrize("arms", ["hang", "aside"])
def test_every_role_is_the_same_joint_in_every_style(name: str, arms: str) -> None:
    names, rig = style(name), human(arms)
    skeleton = rig.skeleton(names)
    assert found(skeleton) == {role: names[role] for role in ROLES}
    assert skeleton.body.human
    assert skeleton.leg_length == pytest.approx(0.83, abs=0.001)
    assert not skeleton.body.notes


@pytest.mark.parametrize("name", STYLES)
@pytest.mark.parametrize("lacking", [{"toes": False}, {"head": False}, {"collars": False}, {"upper": False}])
def test_what_a_rig_lacks_is_missing_and_nothing_else_changes(name: str, lacking: dict[str, bool]) -> None:
    names, rig = style(name), human(**lacking)  # type: ignore[arg-type]
    if name == "rigify":
        names["neck"] = "DEF-neck"  # one joint called spine.004 may as well be the head
    skeleton = rig.skeleton(names)
    assert found(skeleton) == {role: names[role] for role in expected(rig)}
    assert set(skeleton.body.missing) == set(ROLES) - set(expected(rig))
    assert all(skeleton.body.missing.values())


# -- Other joints -----------------------------------------------------------------------------------------------------


def _fingers(rig: Rig, names: str, toes: str = "") -> None:
    """Five fingers of three joints on each wrist, by a pattern of side, finger and number; toes by theirs."""
    for side, x in (("L", 1.0), ("R", -1.0)):
        for k, finger in enumerate(("Thumb", "Index", "Middle", "Ring", "Pinky")):
            parent = f"wrist.{side}"
            for n in (1, 2, 3):
                parent = rig.add(
                    names.format(side, finger, n), parent, 0.0, -0.03 - 0.01 * (n == 1), 0.01 * (k - 2) * x * (n == 1)
                )
        for k in range(5) if toes else ():
            rig.add(toes.format(side, k), f"toe.{side}", 0.01 * (k - 2), 0.0, 0.05)


def _mixamo_hands() -> Rig:
    rig = human("aside")
    _fingers(rig, "{0}:Hand{1}{2}")
    rig.add("HeadTop_End", "head", 0.0, 0.18)
    for side in "LR":
        rig.add(f"{side}:Toe_End", f"toe.{side}", 0.0, 0.0, 0.07)
    return rig


def _unreal_helpers() -> Rig:
    rig = human("aslant")
    rig.add("root", "", 0.0, 0.0)
    rig.joints["pelvis"] = ("root", (0.0, 0.95, 0.0))
    _fingers(rig, "{1}_0{2}_{0}")
    for side, x in (("L", 1.0), ("R", -1.0)):
        rig.add(f"thigh_twist_01_{side}", f"hip.{side}", 0.0, -0.2)
        rig.add(f"calf_twist_01_{side}", f"knee.{side}", 0.0, -0.2)
        rig.add(f"upperarm_twist_01_{side}", f"shoulder.{side}", 0.02 * x, 0.0)
        rig.add(f"lowerarm_twist_01_{side}", f"elbow.{side}", 0.12 * x, -0.09)
    rig.add("ik_foot_root", "root", 0.0, 0.0)
    rig.add("ik_foot_l", "ik_foot_root", 0.09, 0.06)
    rig.add("ik_foot_r", "ik_foot_root", -0.09, 0.06)
    rig.add("ik_hand_root", "root", 0.0, 0.0)
    rig.add("ik_hand_gun", "ik_hand_root", -0.5, 1.0)
    rig.add("ik_hand_l", "ik_hand_gun", 1.0, 0.0)
    rig.add("weapon_r", "wrist.R", 0.0, 0.0, 0.9)
    return rig


def _hip_joints_in_the_root() -> Rig:
    """As CMU's: zero-length joints before the hips, collars in the chest, hands behind the wrists."""
    rig = human("aside")
    for side, x in (("L", 1.0), ("R", -1.0)):
        rig.add(f"{side}HipJoint", "pelvis", 0.0, 0.0)
        rig.joints[f"hip.{side}"] = (f"{side}HipJoint", (0.09 * x, -0.06, 0.0))
        rig.joints[f"collar.{side}"] = ("chest", (0.0, 0.0, 0.0))
        rig.joints[f"shoulder.{side}"] = (f"collar.{side}", (0.17 * x, 0.09, 0.0))
        rig.add(f"{side}Fingers", f"wrist.{side}", 0.0, 0.0)
        rig.add(f"{side}FingersTip", f"{side}Fingers", 0.04 * x, 0.0)
        rig.add(f"{side}Thumb", f"wrist.{side}", 0.0, 0.0)
        rig.tips[f"{side}Thumb"] = (0.03 * x, 0.0, 0.03)
    return rig


def _twists_in_the_chain() -> Rig:
    """As Daz has it: thighs and arms in two pieces, a metatarsal before the toe, toes with digits."""
    rig = human("aside")
    for side in "LR":
        rig.between(f"{side}ThighTwist", f"knee.{side}")
        rig.between(f"{side}ShldrTwist", f"elbow.{side}")
        rig.between(f"{side}ForearmTwist", f"wrist.{side}")
    _fingers(rig, "{0}{1}{2}", "{0}SmallToe{1}")
    return rig


def _two_trunks() -> Rig:
    """As MMD has it: legs on a lower body, the rest on an upper body, both on one joint."""
    rig = human()
    rig.add("centre", "", 0.0, 0.9)
    rig.joints["pelvis"] = ("centre", (0.0, 0.05, 0.0))
    rig.joints["spine"] = ("centre", (0.0, 0.1, 0.0))
    return rig


def _worn() -> Rig:
    """Skirt, hair, breasts, a tail, a face and a sword."""
    rig = human()
    for k, angle in enumerate(np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)):
        parent = "pelvis"
        for n in range(4):
            parent = rig.add(
                f"skirt_{k}_{n}",
                parent,
                *(0.12 * float(c) * (n == 0) for c in (np.sin(angle),)),
                -0.12,
                0.12 * float(np.cos(angle)) * (n == 0),
            )
        parent = "head"
        for n in range(6):
            parent = rig.add(f"hair_{k}_{n}", parent, 0.02 * (k - 4) * (n == 0), -0.1, -0.05)
    for side, x in (("L", 1.0), ("R", -1.0)):
        rig.add(f"breast_{side}", "chest", 0.08 * x, 0.05, 0.12)
        rig.add(f"eye_{side}", "head", 0.03 * x, 0.08, 0.08)
        rig.add(f"sword_{side}", f"wrist.{side}", 0.0, 0.0, 1.2)
    rig.add("jaw", "head", 0.0, 0.02, 0.05)
    rig.chain("pelvis", *((f"tail_{n}", 0.0, -0.02, -0.12) for n in range(8)))
    return rig


TREES = {
    "fingers and ends": _mixamo_hands,
    "twists, inverse kinematics, a weapon": _unreal_helpers,
    "zero-length joints": _hip_joints_in_the_root,
    "split bones": _twists_in_the_chain,
    "two trunks": _two_trunks,
    "clothes, hair and a tail": _worn,
}


@pytest.mark.parametrize("tree", TREES)
@pytest.mark.parametrize("name", ["mixamo", "unreal", "smpl", "daz", "japanese", "maya", "kinect"])
def test_joints_beside_the_body_take_no_role(tree: str, name: str) -> None:
    names, rig = style(name), TREES[tree]()
    assert found(rig.skeleton(names)) == {role: names[role] for role in ROLES}


@pytest.mark.parametrize("tree", TREES)
def test_trees_without_any_names_have_the_same_limbs(tree: str) -> None:
    """Frames tell what names don't: which joints never bend."""
    rig = TREES[tree]()
    named = rig.skeleton()
    silent = replace(named, names=tuple(f"joint_{k}" for k in range(named.joints)))
    limbs = {
        role: named.roles[role]
        for role in ROLES
        if role.partition(".")[0] in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist", "pelvis", "chest")
    }
    roles = with_roles(walking(silent, {role: named.names.index(role) for role in ROLES})).skeleton.roles
    assert {role: roles.get(role) for role in limbs} == limbs


def test_bones_in_two_pieces_that_share_a_name() -> None:
    """As Rigify and MakeHuman number them."""
    rig = human("aside")
    names = {**style("rigify")}
    for side in "LR":
        for joint, word in (("knee", "thigh"), ("ankle", "shin"), ("elbow", "upper_arm"), ("wrist", "forearm")):
            piece = rig.between(f"{word}.{side}.001", f"{joint}.{side}")
            names[piece] = f"DEF-{piece}"
    skeleton = rig.skeleton(names)
    assert found(skeleton) == {role: names[role] for role in ROLES}
    assert skeleton.leg_length == pytest.approx(0.83, abs=0.001)


def test_arms_that_end_without_a_joint_for_the_hand() -> None:
    rig = human("aside")
    for side, x in (("L", 1.0), ("R", -1.0)):
        del rig.joints[f"wrist.{side}"], rig.tips[f"wrist.{side}"]
        rig.tips[f"elbow.{side}"] = (0.25 * x, 0.0, 0.0)
    for names in (style("mixamo"), {}):
        skeleton = rig.skeleton(names)
        assert found(skeleton) == {role: names.get(role, role) for role in ROLES if not role.startswith("wrist")}


# -- Without names, in any order, from anywhere -----------------------------------------------------------------------


def _random_names(rng: np.random.Generator, rig: Rig) -> dict[str, str]:
    """Names that say nothing: numbers, or letters without any word of the body."""
    numbers = rng.permutation(len(rig.joints))
    patterns = ("joint_{}", "Bone.{:03d}", "{}", "node-{}-x", "骨{}", "b{}q")
    pattern = patterns[int(rng.integers(len(patterns)))]
    return {name: pattern.format(int(number)) for name, number in zip(rig.joints, numbers, strict=True)}


_VARIANTS = {
    **{arms: human(arms) for arms in ("hang", "aside", "aslant")},
    **{f"{arms}, no collars": human(arms, collars=False) for arms in ("hang", "aside", "aslant")},
    **{f"{arms}, no toes": human(arms, toes=False) for arms in ("hang", "aside", "aslant")},
    "legs": human(upper=False),
    "two trunks": _two_trunks(),
}


@pytest.mark.parametrize("what", _VARIANTS)
@pytest.mark.parametrize("seed", range(6))
def test_names_that_say_nothing_and_siblings_in_any_order_leave_the_roles(what: str, seed: int) -> None:
    rng, rig = np.random.default_rng([seed, zlib.crc32(what.encode())]), _VARIANTS[what]
    names = _random_names(rng, rig)
    skeleton = rig.skeleton(names, rng)
    assert found(skeleton) == {role: names[role] for role in expected(rig)}
    assert any("told by the toes" in note for note in skeleton.body.notes)


@pytest.mark.parametrize("yaw", [0.0, 0.7, np.pi / 2, np.pi, -2.0])
def test_the_way_the_body_faces_changes_nothing(yaw: float) -> None:
    rig = human("aslant")
    turned = Rig(
        {n: (p, tuple(quat.rotate(quat.yaw(yaw), np.array(o)))) for n, (p, o) in rig.joints.items()},
        {n: tuple(quat.rotate(quat.yaw(yaw), np.array(o))) for n, o in rig.tips.items()},
    )
    names = _random_names(np.random.default_rng(3), rig)
    assert found(turned.skeleton(names)) == {role: names[role] for role in ROLES}
    skeleton = rig.skeleton(names)
    roles = {role: skeleton.names.index(names[role]) for role in ROLES}
    assert with_roles(walking(skeleton, roles, yaw)).skeleton.roles == roles


def test_a_rest_pose_with_all_bones_along_one_axis_is_told_by_the_frames() -> None:
    """As in LAFAN1: every offset lies along +X, and the frames turn the bones to where they belong."""
    rig = human("hang")
    straight = rig.skeleton({name: f"n{k}" for k, name in enumerate(rig.joints)})
    index = {name: straight.names.index(f"n{k}") for k, name in enumerate(rig.joints)}
    clip = _along_x(walking(straight, index))
    single = [index[f"{part}.{side}"] for part in ("knee", "ankle", "toe", "elbow", "wrist") for side in "LR"]
    assert np.all(clip.skeleton.offsets[single, 1:] == 0.0)
    roles = with_roles(clip).skeleton.roles
    assert roles == {role: index[role] for role in ROLES}


def _along_x(clip: Clip) -> Clip:
    """The same motion on a rig whose bones lie along +X in rest, but for those that branch off one joint."""
    rig = clip.skeleton
    children = [np.flatnonzero(rig.parents == joint) for joint in range(rig.joints)]
    frames = np.tile(quat.IDENTITY, (rig.joints, 1))
    for joint, own in enumerate(children):
        way = rig.offsets[own[0]] if len(own) else rig.offsets[joint]
        if np.linalg.norm(way) > 0:
            axis = np.cross([1.0, 0.0, 0.0], way)
            angle = np.arccos(way[0] / np.linalg.norm(way))
            if np.linalg.norm(axis) > 1e-9:
                frames[joint] = quat.from_axis_angle(axis / np.linalg.norm(axis), angle)
    offsets = np.array(
        [quat.rotate(quat.conjugate(frames[max(p, 0)]), o) for p, o in zip(rig.parents, rig.offsets, strict=True)]
    )
    flat = np.stack([np.linalg.norm(rig.offsets, axis=1), np.zeros(rig.joints), np.zeros(rig.joints)], axis=1)
    ends = np.array(
        [quat.rotate(quat.conjugate(frames[p]), o) for p, o in zip(rig.end_parents, rig.end_offsets, strict=True)]
    )
    above = np.array([frames[max(p, 0)] if p >= 0 else quat.IDENTITY for p in rig.parents])
    rotations = quat.multiply(quat.multiply(quat.conjugate(above), clip.rotations), frames)
    single = np.array([len(children[p]) == 1 if p >= 0 else True for p in rig.parents])
    flat[~single] = offsets[~single]
    flat[0] = 0.0
    return replace(clip, skeleton=replace(rig, offsets=flat, end_offsets=ends), rotations=rotations)


def test_names_that_contradict_the_shape_are_followed_and_said() -> None:
    rig = human()
    names = {name: name.replace(".L", ".X").replace(".R", ".L").replace(".X", ".R") for name in rig.joints}
    skeleton = rig.skeleton(names)
    assert found(skeleton)["hip.L"] == "hip.L"
    assert skeleton.offsets[skeleton.roles["hip.L"], 0] < 0
    assert any("the names call those legs left that lie on the right" in note for note in skeleton.body.notes)


def test_arms_without_sides_in_their_names_take_those_of_the_legs() -> None:
    rig = human("aside")
    names = {
        **style("mixamo"),
        **{
            f"{part}.{side}": f"arm{k}{part}"
            for part in ("collar", "shoulder", "elbow", "wrist")
            for k, side in enumerate("RL")
        },
    }
    skeleton = rig.skeleton(names)
    assert found(skeleton) == {role: names[role] for role in ROLES}


# -- A mapping by hand ------------------------------------------------------------------------------------------------


def _with(skeleton: Skeleton, mapping: dict[str, str]) -> Skeleton:
    clip = Clip(skeleton, np.zeros((1, 3)), np.tile(quat.IDENTITY, (1, skeleton.joints, 1)), 30.0)
    return with_roles(clip, mapping).skeleton


def test_a_mapping_has_the_last_word_and_may_be_partial() -> None:
    rig = human()
    skeleton = _with(rig.skeleton(), {"chest": "spine2", "head": "neck"})
    assert found(skeleton)["chest"] == "spine2"
    assert found(skeleton)["head"] == "neck"
    assert found(skeleton)["knee.R"] == "knee.R"


def test_a_mapping_makes_a_body_of_a_rig_in_which_none_is_found() -> None:
    crab = _crab().skeleton()
    assert not crab.roles
    skeleton = _with(crab, {f"{part}.{side}": f"{part}0{side}" for part in ("hip", "knee", "ankle") for side in "LR"})
    assert set(skeleton.roles) >= {"hip.L", "knee.R", "ankle.L", "pelvis"}
    assert skeleton.body.human


@pytest.mark.parametrize(
    ("mapping", "message"),
    [
        ({"hips.L": "hip.L"}, r"Expected a role in the joint mapping, found 'hips\.L'\. Did you mean 'hip\.L'\?"),
        (
            {"hip.L": "hip_L"},
            r"Expected a joint of the rig in the joint mapping, found 'hip_L'\. Did you mean 'hip\.L'\?",
        ),
        ({"hip.L": "knee.L", "knee.L": "hip.L"}, r"Expected knee\.L below hip\.L in the joint mapping, but 'hip\.L'"),
    ],
)
def test_a_mapping_with_what_does_not_exist_is_refused(mapping: dict[str, str], message: str) -> None:
    with pytest.raises(MotionError, match=message):
        _with(human().skeleton(), mapping)


# -- No humans --------------------------------------------------------------------------------------------------------


def _crab(pattern: str = "{}{}{}") -> Rig:
    rig = Rig()
    rig.add("body", "", 0.0, 0.1)
    rig.tips["body"] = (0.0, 0.0, 0.1)
    for side, x in (("L", 1.0), ("R", -1.0)):
        for k in range(5):
            z = 0.1 - 0.05 * k
            rig.chain(
                "body",
                (pattern.format("hip", k, side), 0.08 * x, 0.0, z),
                (pattern.format("knee", k, side), 0.14 * x, 0.06, 0.0),
                (pattern.format("ankle", k, side), 0.14 * x, -0.1, 0.0),
                (pattern.format("tip", k, side), 0.03 * x, -0.05, 0.0),
            )
    return rig


def _dog(tail: bool = True) -> Rig:
    rig = Rig()
    rig.add("Hips", "", 0.0, 0.5)
    rig.chain(
        "Hips",
        ("Spine", 0, 0.02, 0.15),
        ("Spine1", 0, 0.01, 0.2),
        ("Chest", 0, 0, 0.15),
        ("Neck", 0, 0.1, 0.1),
        ("Head", 0, 0.1, 0.1),
    )
    rig.tips["Head"] = (0.0, -0.05, 0.15)
    for side, x in (("Left", 1.0), ("Right", -1.0)):
        rig.chain(
            "Hips",
            (f"{side}UpLeg", 0.07 * x, -0.03, 0),
            (f"{side}Leg", 0, -0.2, 0.06),
            (f"{side}Foot", 0, -0.16, -0.12),
            (f"{side}ToeBase", 0, -0.1, 0.03),
        )
        rig.chain(
            "Chest",
            (f"{side}Shoulder", 0.05 * x, -0.05, 0.05),
            (f"{side}Arm", 0.02 * x, -0.1, 0),
            (f"{side}ForeArm", 0, -0.15, -0.04),
            (f"{side}Hand", 0, -0.17, 0.02),
        )
        rig.tips[f"{side}ToeBase"] = rig.tips[f"{side}Hand"] = (0.0, -0.02, 0.05)
    if tail:
        rig.chain("Hips", *((f"Tail{n}", 0.0, -0.03, -0.1) for n in range(5)))
    return rig


def _bird() -> Rig:
    rig = Rig()
    rig.add("pelvis", "", 0.0, 0.3)
    rig.chain(
        "pelvis",
        ("back", 0, 0.04, 0.08),
        ("breastbone", 0, 0.03, 0.07),
        *((f"neck{n}", 0, 0.05, 0.01) for n in range(6)),
        ("head", 0, 0.03, 0.03),
    )
    rig.tips["head"] = (0.0, 0.0, 0.06)
    for side, x in (("l", 1.0), ("r", -1.0)):
        rig.chain(
            "pelvis",
            (f"femur_{side}", 0.03 * x, -0.01, 0),
            (f"tibia_{side}", 0, -0.05, 0.05),
            (f"tarsus_{side}", 0, -0.12, -0.05),
            (f"toes_{side}", 0, -0.1, 0.03),
        )
        rig.chain(
            "breastbone",
            (f"wing1_{side}", 0.04 * x, 0, 0),
            (f"wing2_{side}", 0.13 * x, 0, -0.03),
            (f"wing3_{side}", 0.16 * x, 0, 0.03),
            (f"wing4_{side}", 0.12 * x, 0, -0.02),
        )
        rig.tips[f"toes_{side}"] = (0.0, -0.01, 0.05)
        rig.tips[f"wing4_{side}"] = (0.2 * x, 0.0, 0.0)
    return rig


def _rope() -> Rig:
    rig = Rig()
    rig.add("j0", "", 0.0, 1.0)
    rig.chain("j0", *((f"j{n}", 0.0, -0.1, 0.0) for n in range(1, 12)))
    return rig


def _table() -> Rig:
    rig = Rig()
    rig.add("top", "", 0.0, 0.8)
    for k, (x, z) in enumerate(((0.4, 0.3), (0.4, -0.3), (-0.4, 0.3), (-0.4, -0.3))):
        rig.chain("top", (f"leg{k}", x, 0.0, z), (f"leg{k}b", 0.0, -0.4, 0.0), (f"leg{k}c", 0.0, -0.38, 0.0))
    return rig


ANIMALS = {
    "crab": _crab,
    "dog": _dog,
    "dog without tail": lambda: _dog(False),
    "bird": _bird,
    "rope": _rope,
    "table": _table,
}


@pytest.mark.parametrize("animal", ANIMALS)
@pytest.mark.parametrize("named", [True, False])
def test_what_is_no_human_has_no_roles_and_says_why(animal: str, named: bool) -> None:
    rig = ANIMALS[animal]()
    names = {} if named else {name: f"joint_{k}" for k, name in enumerate(rig.joints)}
    skeleton = rig.skeleton(names)
    assert not skeleton.roles
    assert not skeleton.body.human
    assert all(skeleton.body.missing[role] == skeleton.body.missing["hip.L"] for role in ROLES)


def test_why_it_is_no_human_is_said_in_words() -> None:
    assert "the trunk lies across the legs" in _dog().skeleton().body.missing["hip.L"]
    assert "more than two legs" in _crab().skeleton().body.missing["hip.L"]
    assert "parts that only animals have" in _bird().skeleton().body.missing["hip.L"]
    assert "no two like chains" in _rope().skeleton().body.missing["hip.L"]


def test_a_human_on_all_fours_is_human_by_the_rest_pose() -> None:
    skeleton = human().skeleton()
    rotations = np.tile(quat.IDENTITY, (5, skeleton.joints, 1))
    rotations[:, skeleton.role("spine")] = quat.from_axis_angle([1.0, 0.0, 0.0], np.pi / 2)
    clip = with_roles(Clip(skeleton, np.zeros((5, 3)), rotations, 30.0))
    assert clip.skeleton.body.human
    assert joint_positions(clip)[0, skeleton.role("chest"), 2] > 0.2


# -- Names alone ------------------------------------------------------------------------------------------------------


def test_words_that_all_joints_share_say_nothing() -> None:
    read = read_names([f"Left_Hand_Puppet_{part}" for part in ("Hips", "UpLeg", "Leg", "Foot", "Head")])
    assert read[1].speaks.keys() == {"hip"}
    assert [name.side for name in read] == [""] * 5


@pytest.mark.parametrize(
    "name",
    ["LeftForeArmRoll", "ik_foot_l", "左足ＩＫ", "左腕捩", "LeftToe_End", "RThumb", "hair_l_01", "thigh_twist_01_r"],
)
def test_names_beside_the_body(name: str) -> None:
    assert read_names([name])[0].beside


def test_what_lies_far_away_does_not_hide_the_limbs() -> None:
    for word in ("camera", "thing"):
        rig = human("aside")
        rig.add(word, "pelvis", 0.0, 0.0, 30.0)
        assert found(rig.skeleton(style("unreal"))) == {role: style("unreal")[role] for role in ROLES}


@pytest.mark.parametrize("shape", ["deep", "wide", "twins"])
def test_trees_of_thousands_of_joints_take_a_time_by_their_number(shape: str) -> None:
    def find(count: int) -> Callable[[], object]:
        parents = {
            "deep": np.arange(count) - 1,
            "wide": np.where(np.arange(count) == 0, -1, 0),
            "twins": (np.arange(count) - 1) // 2,
        }[shape]
        parents[0] = -1
        names = tuple(f"j{k}" for k in range(count))
        offsets = np.tile([0.01, 0.02, 0.0], (count, 1))
        skeletons = (Skeleton(names, parents, offsets, np.zeros(0, dtype=np.int64), np.zeros((0, 3))) for _ in range(4))
        assert not next(skeletons).roles
        return lambda: next(skeletons).roles  # each skeleton finds its roles once

    assert_linear(find, 6000)


@pytest.mark.parametrize("seed", range(12))
def test_people_of_other_proportions_have_their_roles_without_names(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rig = human(("hang", "aside", "aslant")[seed % 3])
    parts = {name: name.partition(".")[0] for name in rig.joints}
    scale = {part: float(np.exp(rng.normal(0.0, 0.05))) for part in sorted(set(parts.values()))}
    for name, (parent, offset) in rig.joints.items():
        share = scale[parts[name]] * float(np.exp(rng.normal(0.0, 0.02)))
        rig.joints[name] = (parent, tuple(share * c for c in offset))  # type: ignore[assignment]
    names = _random_names(rng, rig)
    assert found(rig.skeleton(names, rng)) == {role: names[role] for role in ROLES}
