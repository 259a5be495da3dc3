"""glTF files: what they say, against matrices; what is refused; clips written and read again."""

from __future__ import annotations

import base64
import json
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation, Slerp

from study.arrays import FloatArray
from study.errors import MotionError, MotionFileError, MotionWarning, SegueError
from study.motion.clip import Clip, joint_positions, resample, retarget
from study.motion.library import open_library
from study.motion.readers.bvh_writing import write_bvh
from study.motion.readers.gltf_writing import write_glb
from study.motion.readers.registry import read_clip, with_their_parts
from tests.walks import make_walk

# -- A small writer and a reader by matrices, which share no code with ours -------------------------------------------

BODY = [
    # name, parent, translation; legs of 0.8 m, in metres where the armature above has no scale
    ("Hüfte", None, (0.0, 0.9, 0.0)),
    ("bein.links", 0, (0.1, 0.0, 0.0)),
    ("knie.links", 1, (0.0, -0.42, 0.0)),
    ("fuss.links", 2, (0.0, -0.4, 0.0)),
    ("zeh.links", 3, (0.0, -0.05, 0.15)),
    ("bein.rechts", 0, (-0.1, 0.0, 0.0)),
    ("knie.rechts", 5, (0.0, -0.42, 0.0)),
    ("fuss.rechts", 6, (0.0, -0.4, 0.0)),
    ("zeh.rechts", 7, (0.0, -0.05, 0.15)),
    ("rumpf", 0, (0.0, 0.3, 0.0)),
    ("kopf", 9, (0.0, 0.3, 0.0)),
]


class Made:
    """A glTF file in the making: JSON, and numbers in a data URI."""

    def __init__(self) -> None:
        self.data = b""
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}, "accessors": [], "bufferViews": [], "nodes": []}

    def add(self, rows: FloatArray, kind: str, dtype: str = "<f4", component: int = 5126) -> int:
        kept = np.asarray(rows).astype(dtype)
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.data), "byteLength": kept.nbytes})
        self.data += kept.tobytes() + bytes(-kept.nbytes % 4)
        accessor = {"bufferView": len(self.json["bufferViews"]) - 1, "componentType": component, "type": kind}
        self.json["accessors"].append({**accessor, "count": len(kept), "normalized": component != 5126})
        return len(self.json["accessors"]) - 1

    def written(self, path: Path) -> Path:
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        self.json["buffers"] = [{"byteLength": len(self.data), "uri": uri}]
        path.write_text(json.dumps(self.json), encoding="utf-8")
        return path


def figure(seed: int = 0, armature: dict[str, Any] | None = None, size: float = 1.0) -> Made:
    """A body whose bones lie as other programs have them: every joint at rest turned at random."""
    made, rng = Made(), np.random.default_rng(seed)
    turns = Rotation.random(len(BODY), rng=rng)
    world = Rotation.identity() if armature is None else Rotation.from_quat(armature.get("rotation", [0, 0, 0, 1]))
    above = world.inv()
    for number, (name, parent, place) in enumerate(BODY):
        outer = above if parent is None else turns[parent]
        node = {"name": name, "translation": (outer.inv() if parent is not None else above).apply(place).tolist()}
        node["translation"] = [size * x for x in node["translation"]]
        node["rotation"] = ((outer.inv() if parent is not None else above) * turns[number]).as_quat().tolist()
        if children := [k for k, (_, p, _) in enumerate(BODY) if p == number]:
            node["children"] = children
        made.json["nodes"].append(node)
    made.json["skins"] = [{"joints": list(range(len(BODY)))}]
    if armature is not None:
        made.json["nodes"].append({"name": "Armature", "children": [0], **armature})
    return made


def animate(
    made: Made, way: str = "LINEAR", rate: float = 30.0, keys: int = 31, name: str = "walk", seed: int = 1
) -> None:
    """Every joint turns and the first one goes, by keys of one way of interpolation."""
    rng = np.random.default_rng(seed)
    times = np.arange(keys) / rate
    channels, samplers = [], []
    for joint in range(len(BODY)):
        rest = Rotation.from_quat(made.json["nodes"][joint]["rotation"])
        bend = np.cumsum(rng.normal(size=(keys, 3)) * 0.03, axis=0)
        tracks = [("rotation", "VEC4", (rest * Rotation.from_rotvec(bend)).as_quat())]
        if joint == 0:
            start = np.array(made.json["nodes"][0]["translation"])
            tracks.append(("translation", "VEC3", start * (1 + np.linspace(0, 0.5, keys))[:, None]))
        for path, kind, values in tracks:
            if path == "rotation":
                flips = np.sign(np.sum(values[1:] * values[:-1], axis=1)).cumprod()
                values[1:] *= flips[:, None]
            if way == "CUBICSPLINE":
                slopes = np.gradient(values, times, axis=0)
                values = np.stack([slopes, values, slopes], axis=1).reshape(-1, values.shape[1])
            samplers.append({"input": made.add(times[:, None], "SCALAR"), "output": made.add(values, kind)})
            samplers[-1]["interpolation"] = way
            channels.append({"sampler": len(samplers) - 1, "target": {"node": joint, "path": path}})
    made.json.setdefault("animations", []).append({"name": name, "channels": channels, "samplers": samplers})


def by_matrices(made: Made, times: FloatArray, animation: int = 0) -> FloatArray:
    """Where the joints of the body stand, `(times, joints, 3)`, by matrices of four rows."""
    nodes, found = made.json["nodes"], made.json["animations"][animation]

    def numbers(accessor: int) -> FloatArray:
        about = made.json["accessors"][accessor]
        view, width = made.json["bufferViews"][about["bufferView"]], {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[about["type"]]
        kept, top = {5126: ("<f4", 1), 5122: ("<i2", 32767)}[about["componentType"]]
        rows = np.frombuffer(made.data, kept, about["count"] * width, view["byteOffset"]).reshape(-1, width)
        return rows.astype(float) / top

    locals_ = []
    for number, node in enumerate(nodes):
        parts = {"translation": np.tile(node.get("translation", [0.0, 0, 0]), (len(times), 1)),
                 "rotation": np.tile(node.get("rotation", [0.0, 0, 0, 1]), (len(times), 1))}  # fmt: skip
        for channel in found["channels"]:
            if channel["target"]["node"] != number:
                continue
            sampler = found["samplers"][channel["sampler"]]
            at, rows = numbers(sampler["input"])[:, 0], numbers(sampler["output"])
            if sampler["interpolation"] == "CUBICSPLINE":
                slopes_in, rows, slopes_out = rows.reshape(len(at), 3, -1).transpose(1, 0, 2)
                assert np.array_equal(slopes_in, slopes_out)
                values = CubicHermiteSpline(at, rows, slopes_in)(np.clip(times, at[0], at[-1]))
            elif sampler["interpolation"] == "STEP":
                values = rows[np.clip(np.searchsorted(at, times + 1e-5, side="right") - 1, 0, len(at) - 1)]
            elif channel["target"]["path"] == "rotation":
                values = Slerp(at, Rotation.from_quat(rows))(np.clip(times, at[0], at[-1])).as_quat()
            else:
                values = np.stack([np.interp(times, at, column) for column in rows.T], axis=1)
            parts[channel["target"]["path"]] = values
        local = np.tile(np.eye(4), (len(times), 1, 1))
        local[:, :3, :3] = Rotation.from_quat(parts["rotation"]).as_matrix() * np.array(node.get("scale", [1, 1, 1]))
        local[:, :3, 3] = parts["translation"]
        locals_.append(
            local if "matrix" not in node else np.tile(np.reshape(node["matrix"], (4, 4)).T, (len(times), 1, 1))
        )
    above = {child: number for number, node in enumerate(nodes) for child in node.get("children", [])}

    def world(number: int) -> FloatArray:
        return world(above[number]) @ locals_[number] if number in above else locals_[number]

    return np.stack([world(joint)[:, :3, 3] for joint in range(len(BODY))], axis=1)


def positions(clip: Clip) -> FloatArray:
    """Joint positions in the order of BODY."""
    return joint_positions(clip)[:, [clip.skeleton.names.index(name) for name, _, _ in BODY]]


# -- Reading ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", ["LINEAR", "STEP", "CUBICSPLINE"])
def test_samplers_of_every_kind_give_the_poses_that_matrices_give(tmp_path: Path, way: str) -> None:
    made = figure()
    animate(made, way, rate=30.0, keys=31)
    clip = read_clip(made.written(tmp_path / "walk.gltf"))
    assert (clip.fps, clip.frames, clip.name) == (30.0, 31, "walk")
    assert np.abs(positions(clip) - by_matrices(made, np.arange(31) / 30.0)).max() < 1e-6
    assert clip.skeleton.role("knee.L") == clip.skeleton.names.index("knie.links"), "by the shape of the rest pose"


@pytest.mark.parametrize("way", ["LINEAR", "STEP", "CUBICSPLINE"])
def test_keys_that_are_far_apart_are_sampled_in_between(tmp_path: Path, way: str) -> None:
    made = figure()
    animate(made, way, rate=4.0, keys=9)
    clip = read_clip(made.written(tmp_path / "walk.gltf"))
    assert (clip.fps, clip.frames) == (32.0, 65)
    assert np.abs(positions(clip) - by_matrices(made, np.arange(65) / 32.0)).max() < 1e-6
    told = read_clip(tmp_path / "walk.gltf", fps=50.0)
    assert told.frames == 101
    assert "sampled at 50 fps, as told" in told.history
    assert np.abs(positions(told) - by_matrices(made, np.arange(101) / 50.0)).max() < 1e-6


@pytest.mark.parametrize("fps", [24.0, 30000 / 1001, 60.0, 120.0, 40.0])
def test_the_frame_rate_is_that_of_the_keys(tmp_path: Path, fps: float) -> None:
    write_glb({"walk": make_walk(600, fps)}, tmp_path / "walk.glb")
    assert read_clip(tmp_path / "walk.glb").fps == fps


def test_keys_at_uneven_times_are_sampled_at_sixty_frames_a_second(tmp_path: Path) -> None:
    made = figure()
    animate(made, keys=20)
    times = np.sort(np.random.default_rng(3).uniform(0, 1, 20)).astype("<f4")
    for sampler in made.json["animations"][0]["samplers"]:
        sampler["input"] = made.add(times[:, None], "SCALAR")
    clip = read_clip(made.written(tmp_path / "walk.gltf"))
    assert clip.fps == 60.0
    assert np.abs(positions(clip) - by_matrices(made, times[0] + np.arange(clip.frames) / 60.0)).max() < 1e-6


ARMATURES = {
    "centimetres, turned upright": ({"scale": [0.01] * 3, "rotation": [-(0.5**0.5), 0, 0, 0.5**0.5]}, 100.0),
    "moved and turned": ({"translation": [1.0, 0, -2], "rotation": [0, 0.6, 0, 0.8]}, 1.0),
    "a matrix": ({"matrix": [0, 0, -0.01, 0, 0, 0.01, 0, 0, 0.01, 0, 0, 0, 3, 0, 1, 1]}, 100.0),
}


@pytest.mark.parametrize("kind", ARMATURES)
def test_what_stands_above_the_joints_is_taken_into_them(tmp_path: Path, kind: str) -> None:
    armature, size = ARMATURES[kind]
    made = figure(2, armature, size)
    animate(made)
    clip = read_clip(made.written(tmp_path / "walk.gltf"))
    assert np.abs(positions(clip) - by_matrices(made, np.arange(31) / 30.0)).max() < 1e-5
    assert clip.skeleton.names[0] == "Hüfte"


def test_scales_of_joints_are_taken_into_the_lengths(tmp_path: Path) -> None:
    made = figure(3)
    made.json["nodes"][1]["scale"] = [1.2] * 3
    made.json["nodes"][4]["scale"] = [2, 1, 1]  # nothing hangs on a toe
    animate(made)
    clip = read_clip(made.written(tmp_path / "walk.gltf"))
    assert np.abs(positions(clip) - by_matrices(made, np.arange(31) / 30.0)).max() < 1e-6


def test_an_armature_that_moves_is_folded_into_the_body(tmp_path: Path) -> None:
    made = figure(4, {"translation": [0.0, 0, 0]})
    animate(made)
    channels, samplers = made.json["animations"][0]["channels"], made.json["animations"][0]["samplers"]
    path = np.stack([np.zeros(31), np.zeros(31), np.linspace(0, 2, 31)], axis=1)
    samplers.append({"input": 0, "output": made.add(path, "VEC3"), "interpolation": "LINEAR"})
    channels.append({"sampler": len(samplers) - 1, "target": {"node": len(BODY), "path": "translation"}})
    clip = read_clip(made.written(tmp_path / "walk.gltf"))
    assert clip.skeleton.names[0] == "Hüfte"
    assert np.abs(positions(clip) - by_matrices(made, np.arange(31) / 30.0)).max() < 1e-6


def test_bones_beside_the_body_are_left_out(tmp_path: Path) -> None:
    """As Unreal has them on the root of its figures: for hands and feet to hold to, and for marks."""
    made = figure(4, {"translation": [0.0, 0, 0]})
    animate(made)
    count = len(made.json["nodes"])
    made.json["nodes"] += [{"name": "ik_foot_root", "children": [count + 1]}, {"name": "ik_foot_l"}, {"name": "mark"}]
    made.json["nodes"][count - 1]["children"] += [count, count + 2]
    made.json["skins"][0]["joints"] += range(count - 1, count + 3)
    clip = read_clip(made.written(tmp_path / "walk.gltf"))
    assert sorted(clip.skeleton.names) == sorted(name for name, _, _ in BODY)
    assert np.abs(positions(clip) - by_matrices(made, np.arange(31) / 30.0)).max() < 1e-6


def test_nodes_without_a_skin_are_joints_where_they_move(tmp_path: Path) -> None:
    made = figure(5)
    del made.json["skins"]
    made.json["nodes"].append({"name": "camera", "translation": [0, 2, 5]})
    animate(made)
    clip = read_clip(made.written(tmp_path / "walk.gltf"))
    assert np.abs(positions(clip) - by_matrices(made, np.arange(31) / 30.0)).max() < 1e-6
    assert "camera" not in clip.skeleton.names


def test_rotations_in_normalised_integers(tmp_path: Path) -> None:
    made = figure(6)
    animate(made)
    for sampler in made.json["animations"][0]["samplers"]:
        about = made.json["accessors"][sampler["output"]]
        if about["type"] == "VEC4":
            start = made.json["bufferViews"][about["bufferView"]]["byteOffset"]
            rows = np.frombuffer(made.data, "<f4", about["count"] * 4, start).reshape(-1, 4)
            sampler["output"] = made.add(np.round(rows * 32767), "VEC4", "<i2", 5122)
    clip = read_clip(made.written(tmp_path / "walk.gltf"))
    assert np.abs(positions(clip) - by_matrices(made, np.arange(31) / 30.0)).max() < 1e-6


def test_the_data_may_lie_in_a_file_beside_it(tmp_path: Path) -> None:
    made = figure()
    animate(made)
    whole = read_clip(made.written(tmp_path / "walk.gltf"))
    made.json["buffers"] = [{"byteLength": len(made.data), "uri": "my%20walk.bin"}]
    (tmp_path / "my walk.bin").write_bytes(made.data)
    (tmp_path / "beside.gltf").write_text(json.dumps(made.json))
    assert np.array_equal(read_clip(tmp_path / "beside.gltf").rotations, whole.rotations)
    parts = with_their_parts([tmp_path / "beside.gltf", tmp_path / "walk.glb"])
    assert parts[2:] == [tmp_path / "my walk.bin"], "stimuli are made anew where it changes"


def test_another_size_than_a_person_s_is_told_and_mended(tmp_path: Path) -> None:
    made = figure(0, None, 100.0)
    animate(made)
    with pytest.warns(MotionWarning, match="centimetres"):
        clip = read_clip(made.written(tmp_path / "walk.gltf"))
    assert clip.skeleton.leg_length == pytest.approx(0.82)
    assert read_clip(tmp_path / "walk.gltf", metres_per_unit=0.02).skeleton.leg_length == pytest.approx(1.64)


# -- Several animations -----------------------------------------------------------------------------------------------


def test_a_file_of_several_animations_is_a_motion_for_each(tmp_path: Path) -> None:
    made = figure()
    for number, name in enumerate(["walk", "Armature|mixamo.com", "a/b", "walk"]):
        animate(made, name=name, keys=10 + number, seed=number)
    hero = made.written(tmp_path / "hero.gltf")
    walk = make_walk(50)
    write_glb({"walk": walk}, tmp_path / "walk.glb")
    library = open_library(tmp_path)
    assert set(library.names()) == {"hero.gltf/walk", "Armature|mixamo.com", "a_b", "walk_2", "walk"}
    assert [library.clip(name, as_is=True).frames for name in ("hero.gltf/walk", "a_b", "walk_2")] == [10, 12, 13]
    assert read_clip(hero / "a_b").name == "a_b"
    assert set(library.files()) == {hero, tmp_path / "walk.glb"}
    assert library.where(library.entry("a_b")) == "hero.gltf/a_b"
    with pytest.raises(
        MotionFileError, match=r"found walk, Armature\|mixamo.com, a_b, walk_2. Name one, such as .*hero"
    ):
        read_clip(hero)
    with pytest.raises(MotionFileError, match="Expected an animation of this file, found walk, "):
        read_clip(hero / "run")


def test_library_toml_names_an_animation_like_a_file(tmp_path: Path) -> None:
    made = figure()
    for number, name in enumerate(["walk", "run"]):
        animate(made, name=name, seed=number)
    made.written(tmp_path / "hero.gltf")
    (tmp_path / "library.toml").write_text(
        '[clips.jog]\nfile = "hero.gltf/run"\nfirst_frame = 5\ncategory = "running"\n'
    )
    library = open_library(tmp_path)
    assert library.entry("jog").kind == "running"
    assert library.clip("jog", as_is=True).frames == 26


def test_an_animation_called_like_a_cmu_trial_is_whole(tmp_path: Path) -> None:
    write_glb(on_one_body({"16_35": make_walk(50), "07_01": make_walk(60)}), tmp_path / "cmu.glb")
    assert open_library(tmp_path).clip("16_35", as_is=True).frames == 50


# -- Refusals ---------------------------------------------------------------------------------------------------------


def wrong(key: str, value: Any) -> Any:
    """A mistake: the value at a place of the JSON, `nodes.0.scale`."""

    def make(made: Made) -> None:
        at: Any = made.json
        *way, last = key.split(".")
        for step in way:
            at = at[int(step) if step.isdigit() else step]
        at[int(last) if last.isdigit() else last] = value

    return make


REFUSALS = [
    (wrong("asset.version", "1.0"), r'found version "1.0"'),
    (wrong("nodes", 3), r"nodes: Expected a list, found 3"),
    (wrong("nodes.2.children", [0]), r"nodes\[\d\].children: Expected a tree"),
    (wrong("nodes.2.children", [3, 5]), "Expected nodes that no other has as children, found 5"),
    (wrong("nodes.2.children", [99]), r"nodes\[2\].children: Expected a number of nodes from 0 and below 11, found 99"),
    (wrong("nodes.2.rotation", [0, 0, 0, 0]), r"nodes\[2\].rotation: Expected unit quaternions"),
    (wrong("nodes.2.translation", [0, "a", 0]), r"nodes\[2\].translation: Expected 3 numbers"),
    (wrong("nodes.2.scale", [1, 2, 1]), r"nodes\[2\].scale: Expected one constant scale .*'knie.links', found \[1"),
    (wrong("nodes.2.scale", [-1, -1, -1]), r"nodes\[2\].scale: Expected one constant scale above 0"),
    (wrong("nodes.2.matrix", [1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]), 'found "shear or a mirror'),
    (wrong("skins.0.joints", [99]), r"skins\[0\].joints: Expected a number of nodes"),
    (wrong("animations.0.channels.0.sampler", 99), r"channels\[0\].sampler: Expected a number of samplers"),
    (wrong("animations.0.samplers.1.interpolation", "CUBIC"), r'animations\[0\].samplers\[1\].interpol.*found "CUBIC"'),
    (wrong("animations.0.samplers.1.output", 0), r'accessors\[0\]: Expected VEC3 of floats.*found \["SCALAR", 5126'),
    (wrong("accessors.1.count", 12), r"samplers\[0\].output: Expected 31 rows for 31 keys .*, found 12"),
    (wrong("accessors.1.count", 10**8), r"accessors\[1\]: Expected 1 or more rows within the file's data"),
    (wrong("accessors.1.sparse", {}), 'found ."VEC4", 5126, false, {}'),
    (wrong("accessors.1.componentType", 5125), 'found ."VEC4", 5125'),
    (wrong("bufferViews.0.extensions", {"EXT_meshopt_compression": {}}), "Export it without compression"),
    (wrong("bufferViews.0.byteOffset", -1), "byteOffset: Expected a whole number from 0"),
    (wrong("animations.0.channels.0.target.node", [1]), r"target.node: Expected a number of nodes .*found \[1\]"),
    (wrong("animations", []), "found none in it. Export it with its animation"),
    (wrong("animations.0.channels", []), "Expected one that moves joints"),
]  # fmt: skip


@pytest.mark.parametrize(("mistake", "words"), REFUSALS)
def test_refusals_name_the_part_of_the_file(tmp_path: Path, mistake: Any, words: str) -> None:
    made = figure()
    animate(made)
    path = made.written(tmp_path / "walk.gltf")
    read_clip(path)
    mistake(made)
    with pytest.raises(MotionFileError, match=words):
        read_clip(made.written(path))


def test_times_that_do_not_grow_and_keys_over_years_are_refused(tmp_path: Path) -> None:
    for times, words in (
        ([0, 2, 1], "Expected times from 0 that grow"),
        ([0, 1, 1e7], "keys over less time|frames times joints"),
    ):
        made = figure()
        animate(made, keys=3)
        for sampler in made.json["animations"][0]["samplers"]:
            sampler["input"] = made.add(np.array(times)[:, None], "SCALAR")
        with pytest.raises(SegueError, match=words):
            read_clip(made.written(tmp_path / "walk.gltf"))


def test_a_scale_that_varies_is_refused(tmp_path: Path) -> None:
    made = figure()
    animate(made)
    samplers = made.json["animations"][0]["samplers"]
    samplers.append({"input": 0, "output": made.add(np.linspace(1, 1.1, 31)[:, None] * np.ones(3), "VEC3")})
    target = {"node": 2, "path": "scale"}
    made.json["animations"][0]["channels"].append({"sampler": len(samplers) - 1, "target": target})
    with pytest.raises(
        MotionFileError, match=r"animations\[0\].samplers\[12\].output: Expected one constant scale .*'knie"
    ):
        read_clip(made.written(tmp_path / "walk.gltf"))


@pytest.mark.parametrize(
    "uri", ["../secret.bin", "/etc/passwd", "http://x/y.bin", "%2e%2e/secret.bin", 7, "data:x;base64,*"]
)
def test_data_comes_from_the_file_s_own_folder(tmp_path: Path, uri: Any) -> None:
    made = figure()
    animate(made)
    made.written(tmp_path / "walk.gltf")
    made.json["buffers"][0]["uri"] = uri
    (tmp_path / "walk.gltf").write_text(json.dumps(made.json))
    with pytest.raises(MotionFileError, match=r"buffers\[0\].uri: Expected"):
        read_clip(tmp_path / "walk.gltf")


def test_damaged_binary_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "walk.glb"
    write_glb({"walk": make_walk(5)}, path)
    whole = path.read_bytes()
    for content, words in (
        (b"", "no JSON"),
        (whole[:10], "a damaged one"),
        (whole[:-4], "a damaged one"),
        (whole[:4] + struct.pack("<I", 1) + whole[8:], "another version"),
        (whole[:12] + struct.pack("<I", 2**31) + whole[16:], "a damaged one"),
        (whole[:16] + b"WHAT" + whole[20:], "a damaged one"),
        (b"{" + b'"a":[' * 100_000, "no JSON"),
    ):
        path.write_bytes(content)
        with pytest.raises(MotionFileError, match=words):
            read_clip(path)


# -- Writing, and both ways -------------------------------------------------------------------------------------------


def test_names_that_bvh_files_cannot_hold_are_written_in_others(tmp_path: Path) -> None:
    """Found by the fuzzer: glTF gives any name."""
    clip = open_library("synthetic").clip("stand")
    names = ("{root}", " Spine ", "_root_", *clip.skeleton.names[3:])
    write_bvh(replace(clip, skeleton=replace(clip.skeleton, names=names, known=None)), tmp_path / "walk.bvh")
    again = read_clip(tmp_path / "walk.bvh")
    assert again.skeleton.names[:3] == ("_root_", "Spine", "_root__2")
    assert np.abs(joint_positions(again)[:, 0] - clip.root_positions).max() < 1e-6


def test_only_clips_of_one_skeleton_are_written(tmp_path: Path) -> None:
    with pytest.raises(MotionError, match="Expected clips on one skeleton"):
        write_glb({"a": make_walk(5), "b": make_walk(5)}, tmp_path / "x.glb")


def round_trip(clips: dict[str, Clip], folder: Path) -> None:
    """Ours, through pygltflib, and ours again: the same names, rates, and positions to 1e-5 m."""
    import pygltflib

    write_glb(clips, folder / "ours.glb")
    theirs = pygltflib.GLTF2().load(str(folder / "ours.glb"))
    assert [animation.name for animation in theirs.animations] == list(clips)
    theirs.save_binary(str(folder / "theirs.glb"))
    for name, clip in clips.items():
        read = read_clip(folder / "theirs.glb" / name if len(clips) > 1 else folder / "theirs.glb")
        assert (read.fps, read.skeleton.names) == (clip.fps, clip.skeleton.names)
        assert np.array_equal(read.skeleton.end_parents, clip.skeleton.end_parents)
        assert np.abs(joint_positions(read, ends=True) - joint_positions(clip, ends=True)).max() < 1e-5


def on_one_body(clips: dict[str, Clip]) -> dict[str, Clip]:
    first = next(iter(clips.values()))
    return {name: retarget(clip, first.skeleton) for name, clip in clips.items()}


def test_synthetic_motions_come_back_through_another_program(tmp_path: Path) -> None:
    library = open_library("synthetic")
    clips = {name: library.clip(name) for name in ("walk", "run", "dance")}
    round_trip(on_one_body({**clips, "fast": resample(clips["run"], 60.0)}), tmp_path)


@pytest.mark.mocap
@pytest.mark.parametrize(
    ("folder", "names"),
    [
        ("cmu", ("16_15", "16_35", "49_12")),
        ("bandai", ("dataset-1_walk_normal_001", "dataset-1_run_active_001")),
        ("perfume", ()),
    ],
)
@pytest.mark.filterwarnings("ignore::study.errors.MotionWarning")
def test_captured_motions_come_back_through_another_program(
    mocap: Path, folder: str, names: tuple[str, ...], tmp_path: Path
) -> None:
    library = open_library(mocap / folder)
    round_trip(on_one_body({name: library.clip(name) for name in names or library.distinct()[:1]}), tmp_path)
