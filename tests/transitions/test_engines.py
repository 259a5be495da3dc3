"""What engines get: times against the blends that they stand for, Godot's poses and C# look-ups against ours."""

from __future__ import annotations

import json
import os
import re
import runpy
import shutil
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest
from parts import unavailable

from study.apps.cli import run
from study.errors import TransitionError
from study.motion.clip import Clip, joint_positions, moved, retarget
from study.motion.library import Library, open_library
from study.motion.readers.bvh_writing import write_bvh
from study.motion.readers.registry import read_clip
from study.transitions.blending import blend, blend_weights
from study.transitions.engines.export import Advised, export, read_advice
from study.transitions.methods.makes.blends import Slerp
from study.transitions.methods.method import Place
from study.transitions.methods.registry import DIRECT
from study.transitions.one_hop.problem import Alignment
from study.transitions.one_hop.table import OneHopTable, Row
from study.transitions.point_cloud import alignment
from tests.walks import make_walk

ROOT = Path(__file__).parents[2]
IMPORTERS = ROOT / "study" / "transitions" / "engines" / "importers"
VALIDATOR = ROOT / "build" / "node_modules" / "gltf-validator"


def pair(library: Library, source: str, destination: str) -> dict[str, Clip]:
    first, second = library.clip(source, fps=30.0), library.clip(destination, fps=30.0)
    return {source: first, destination: retarget(second, first.skeleton)}


def walks() -> dict[str, Clip]:
    first = make_walk(90, name="slow walk")
    return {"slow walk": first, "out/run": retarget(make_walk(80, cadence=1.4, name="out/run"), first.skeleton)}


ROW = {"source": "a", "destination": "b", "method": "m", "make": "slerp", "start_frame": 1, "end_frame": 9,
       "blend_frames": 5}  # fmt: skip


# -- The folder -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("start", "end", "blend_frames"), [(30, 40, 10), (12, 20, 5), (1, 30, 31), (0, 30, 8)])
def test_the_fade_has_the_shares_of_the_blend_at_every_frame(
    tmp_path: Path, start: int, end: int, blend_frames: int
) -> None:
    clips = walks()
    advice = [Advised("slow walk", "out/run", "velocity", "slerp", start, end, blend_frames)]
    machine = export(tmp_path / "out", clips, list(clips.values()), advice, None)
    assert json.loads((tmp_path / "out" / "state_machine.json").read_text()) == machine
    (one,) = machine["transitions"]
    made = blend(clips["slow walk"], clips["out/run"], start, end, blend_frames)
    # What an engine does: the share grows evenly over the duration, and the destination plays from its offset on.
    times = np.arange(start, start + blend_frames) / 30.0
    shares = (times - one["start_s"]) / one["duration_s"]
    if start > 0 and end - blend_frames >= 0:
        assert np.allclose(shares, blend_weights(blend_frames), atol=1e-12)
    assert np.allclose((times - one["start_s"] + one["offset_s"]) * 30.0, np.arange(end - blend_frames + 1, end + 1))
    assert one["start_normalised"] == pytest.approx(one["start_s"] / (89 / 30))
    assert one["offset_normalised"] == pytest.approx(one["offset_s"] / (79 / 30))
    root = np.array(one["root"])
    first = round(one["start_s"] * 30)
    assert len(root) == round(one["duration_s"] * 30) + 1
    assert np.abs(root[:, :3] - made.clip.root_positions[first : first + len(root)]).max() < 1e-6


@pytest.mark.parametrize("make", [name for name in DIRECT if name != "slerp"])
def test_what_is_no_fade_is_an_animation_from_the_sources_last_frame_to_the_destination_alone(
    tmp_path: Path, make: str
) -> None:
    library = open_library("synthetic")
    clips = pair(library, "walk", "run")
    row = Advised("walk", "run", "geodesic", make, 52, 63, 12)
    machine = export(tmp_path / "out", clips, [library.clip(name) for name in clips], [row], None)
    (one,), made = machine["transitions"], as_made(clips, row)
    read = read_clip(tmp_path / "out" / "clips.glb" / one["animation"])
    assert (one["animation"], one["root"], read.fps) == ("walk to run", [], 30.0)
    start = round(30 * one["start_s"])
    order = [read.skeleton.names.index(name) for name in made.skeleton.names]
    own, walk = joint_positions(made), joint_positions(clips["walk"])
    np.testing.assert_allclose(joint_positions(read)[:, order], own[start : start + read.frames], atol=1e-5)
    np.testing.assert_allclose(own[: start + 1], walk[: start + 1], atol=1e-9)
    # The destination goes on from its own last frame, placed as the file says.
    enters = round(30 * (one["offset_s"] + one["duration_s"]))
    placed = moved(clips["run"], one["turn_radians"], np.array(one["shift_m"]))
    np.testing.assert_allclose(joint_positions(placed)[enters:], own[start + read.frames - 1 :], atol=1e-5)


def test_clips_and_animations_keep_their_names_apart(tmp_path: Path) -> None:
    clips = walks()
    again = replace(clips["out/run"], name="out_run")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "game.txt").write_text("mine")
    machine = export(tmp_path / "out", {**clips, "out_run": again}, [*clips.values(), again], [], None)
    assert [state["animation"] for state in machine["states"]] == ["slow walk", "out_run", "out_run_2"]
    for state, clip in zip(machine["states"], [*clips.values(), again], strict=True):
        read = read_clip(tmp_path / "out" / "clips.glb" / state["animation"])
        assert (read.frames - 1) / read.fps == pytest.approx(state["length_s"])
        order = [read.skeleton.names.index(name) for name in clip.skeleton.names]
        assert np.abs(joint_positions(read)[:, order] - joint_positions(clip)).max() < 1e-5
    assert {file.name for file in IMPORTERS.iterdir() if file.is_file()} < {
        file.name for file in (tmp_path / "out").iterdir()
    }
    assert (tmp_path / "out" / "game.txt").read_text() == "mine"


def test_the_verb_takes_what_advise_and_one_hop_write(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert run(["advise", "walk", "run", "--no-strips", "--out", str(tmp_path / "advice")]) == 0
    found, out = tmp_path / "advice" / "advice.json", tmp_path / "game"
    capsys.readouterr()
    assert run(["export-engine", str(found), "--out", str(out), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["transitions"], [state["name"] for state in told["states"]]) == (2, ["walk", "run"])
    arguments = ["dance", "box", "--pair", "dance", "box", "--fps", "15", "--weight", "0.0005"]
    assert run(["one-hop", "build", *arguments, "--out", str(tmp_path / "t.npz")]) == 0
    assert run(["export-engine", str(tmp_path / "t.npz"), "--out", str(out), "--native"]) == 0
    machine = json.loads((out / "state_machine.json").read_text())
    assert [state["fps"] for state in machine["states"]] == [30.0, 30.0], "native, not the table's 15"
    assert machine["one_hop"] == {"table": "one_hop.bin", "header": "one_hop.json"}
    capsys.readouterr()
    assert run(["one-hop", "show", str(out / "one_hop.bin")]) == 0
    assert run(["export-engine", str(found), "walk", "--out", str(out)]) == 2
    assert "expected 2 clips (walk, run), found 1" in capsys.readouterr().err


def test_states_of_files_have_the_files_names(tmp_path: Path) -> None:
    files = {name: tmp_path / "moves" / f"{name}.bvh" for name in ("slow", "quick")}
    for name, file in files.items():
        write_bvh(make_walk(80, cadence=1.4 if name == "quick" else 1.0), file)
    row = {**ROW, "source": str(files["slow"]), "destination": str(files["quick"]), "make": "dead-blend",
           "start_frame": 30, "end_frame": 40, "blend_frames": 8}  # fmt: skip
    (tmp_path / "advice.json").write_text(json.dumps({"fps": 30, "advice": [row]}))
    assert run(["export-engine", str(tmp_path / "advice.json"), "--out", str(tmp_path / "game")]) == 0
    machine = json.loads((tmp_path / "game" / "state_machine.json").read_text())
    assert [state["name"] for state in machine["states"]] == ["slow", "quick"]
    (one,) = machine["transitions"]
    assert (one["source"], one["destination"], one["animation"]) == ("slow", "quick", "slow to quick")


@pytest.mark.parametrize(
    "said",
    [
        *([], {"advice": []}, {"advice": [{"source": 1}], "fps": 30}, {"advice": 3, "fps": "x"}),
        {"advice": [{**ROW, "start_frame": "3"}], "fps": 30.0},
        {"advice": [ROW], "fps": -1},
    ],
)
def test_other_json_is_refused(said: Any) -> None:
    with pytest.raises(TransitionError, match=r"x.json: expected the advice.json of .* found neither"):
        read_advice(Path("x.json"), said)
    with pytest.raises(TransitionError, match=r"expected makes out of slerp, .*, found 'morph'"):
        read_advice(Path("x.json"), {"advice": [{**ROW, "make": "morph"}], "fps": 30})
    assert read_advice(Path("x.json"), {"advice": [ROW], "fps": 30})[1] == [Advised(**ROW)]  # type: ignore[arg-type]


# -- Programs that read it --------------------------------------------------------------------------------------------


def ran(*command: object, cwd: Path, timeout: float = 120) -> str:
    done = subprocess.run(
        [*map(str, command)], cwd=cwd, capture_output=True, text=True, check=False, timeout=timeout,
        env={**os.environ, "HOME": str(cwd)},
    )  # fmt: skip
    return done.stdout + done.stderr


DRIVE = """extends SceneTree

func _init():
	var model = load("res://clips.glb").instance()
	get_root().add_child(model)
	var player = load("res://segue_player.gd").new()
	player.setup(model, "res://state_machine.json", "SOURCE")
	var skeleton = player._skeleton
	var wishes = ["DESTINATION", "SOURCE"]
	var out = {"names": [], "frames": [], "states": []}
	for bone in range(skeleton.get_bone_count()):
		out["names"].append(skeleton.get_bone_name(bone))
	for frame in range(FRAMES):
		if frame > 0:
			player.advance(1.0 / 30.0)
		if wishes and player.coming == null and player.travel(wishes[0]):
			wishes.pop_front()
		out["states"].append(player.state)
		var row = []
		for bone in range(skeleton.get_bone_count()):
			var place = (model.transform * skeleton.transform * skeleton.get_bone_global_pose(bone)).origin
			row.append([place.x, place.y, place.z])
		out["frames"].append(row)
	out["over"] = player.travel("DESTINATION")
	player.free()
	var file = File.new()
	file.open("res://out.json", 2)
	file.store_string(JSON.print(out))
	file.close()
	quit()
"""
# Keys as they are, not sampled anew at 15 a second and thinned out, as Godot does unless told otherwise.
IMPORT = (
    """[remap]\nimporter="scene"\ntype="PackedScene"\n[params]\nanimation/fps=30\nanimation/optimizer/enabled=false\n"""
)


def godot(folder: Path, *arguments: str, makes: str) -> None:
    """Godot makes a file; once in some hundred times it doesn't end, and is ended and asked again."""
    said = ""
    for _ in range(3):
        with suppress(subprocess.TimeoutExpired):
            said = ran("godot3-server", "--path", ".", *arguments, cwd=folder, timeout=30)
        if list(folder.glob(makes)):
            break
    assert list(folder.glob(makes)), said
    assert "SCRIPT ERROR" not in said, said


def as_made(clips: dict[str, Clip], row: Advised) -> Clip:
    """A transition as `segue advise` measures it, or as an engine fades, which leaves the feet as they come."""
    make = Slerp(clean_feet=False) if row.make == "slerp" else DIRECT[row.make]()
    place = Place("", ("", ""), clips[row.source], clips[row.destination], row.start_frame, row.end_frame)
    return make.way(place, (row.blend_frames, row.blend_frames)).made(place).clip


def in_godot(folder: Path, clips: dict[str, Clip], there: Advised, back: Advised) -> None:
    """Godot plays a transition and the one back: its joints are where ours are in every frame, to a millimetre."""
    if shutil.which("godot3-server") is None:
        unavailable("Godot", "apt-get install godot3-server", "godot3-server")
    once, again = (as_made(clips, row) for row in (there, back))
    machine = export(folder, clips, list(clips.values()), [there, back], None)
    # What comes back starts from the second clip, placed as the first transition has left it.
    later = once.frames - clips[there.destination].frames
    turn, shift, _ = alignment(joint_positions(once)[-1], joint_positions(clips[there.destination])[-1])
    over = [round(30 * (one["start_s"] + one["duration_s"])) for one in machine["transitions"]]
    turning = later + back.start_frame - 1
    expected = np.concatenate(
        [joint_positions(once)[:turning], joint_positions(moved(again, turn, shift))[turning - later :]]
    )
    frames = min(len(expected), later + over[1] + 60)
    (folder / "project.godot").write_text("config_version=4\n")
    (folder / "clips.glb.import").write_text(IMPORT)
    drive = DRIVE.replace("SOURCE", there.source).replace("DESTINATION", there.destination)
    (folder / "drive.gd").write_text(drive.replace("FRAMES", str(frames)))
    godot(folder, "-e", "--quit", makes=".import/*.scn")
    godot(folder, "-s", "drive.gd", makes="out.json")
    found = json.loads((folder / "out.json").read_text())
    assert not found["over"], "the clip is past the point"
    other = [there.destination] * (later + over[1] - over[0])
    assert found["states"] == [there.source] * over[0] + other + [there.source] * (frames - later - over[1])
    # Godot 3 writes names of bones in its own way.
    plain = [re.sub(r"[^a-z0-9]", "", name.lower()) for name in found["names"]]
    order = [plain.index(re.sub(r"[^a-z0-9]", "", name.lower())) for name in once.skeleton.names]
    apart = np.linalg.norm(np.array(found["frames"])[:, order] - expected[:frames], axis=-1)
    assert apart.max() < 1e-3, f"{1000 * apart.max():.3f} mm in frame {apart.max(axis=1).argmax()}"


@pytest.mark.parametrize(("there", "back"), [("slerp", "slerp"), ("dead-blend", "registration-curve"),
                                             ("inertialize", "slerp")])  # fmt: skip
def test_godot_plays_synthetic_transitions_as_they_are_made(tmp_path: Path, there: str, back: str) -> None:
    clips = pair(open_library("synthetic"), "walk", "run")
    go = Advised("walk", "run", "geodesic", there, 52, 63, 8)
    in_godot(tmp_path / "game", clips, go, Advised("run", "walk", "geodesic", back, 90, 59, 12))


@pytest.mark.mocap
@pytest.mark.parametrize("make", ["slerp", "inertialize-quintic"])
def test_godot_plays_captured_transitions_as_they_are_made(mocap: Path, tmp_path: Path, make: str) -> None:
    clips = pair(open_library(mocap / "cmu"), "walk_turn_left", "dance_modern")
    go = Advised("walk_turn_left", "dance_modern", "velocity", make, 40, 30, 21)
    in_godot(tmp_path / "game", clips, go, Advised("dance_modern", "walk_turn_left", "velocity", make, 90, 20, 8))


@pytest.mark.parametrize("motions", [("walk", "run"), ("dance", "box")])
def test_the_khronos_validator_finds_nothing(tmp_path: Path, motions: tuple[str, str]) -> None:
    if not VALIDATOR.is_dir():
        pytest.skip("the glTF validator is missing: npm install --prefix build gltf-validator")
    clips = pair(open_library("synthetic"), *motions)
    row = Advised(*motions, "fixed", "inertialize", 40, 60, 10)
    export(tmp_path / "out", clips, list(clips.values()), [row], None)
    script = (
        f"require('{VALIDATOR}').validateBytes(new Uint8Array(require('fs').readFileSync('out/clips.glb')))"
        ".then(found => console.log(JSON.stringify(found)))"
    )
    found = json.loads(ran("node", "-e", script, cwd=tmp_path))
    assert found["issues"]["messages"] == []
    assert found["info"]["animationCount"] == 3


MAIN = """using System;
using System.IO;
public static class Program {
    public static void Main() {
        var header = new SegueOneHop.Header {
            entries = ENTRIES, blend_frames = 30, columns = new string[WIDTH],
            transitions = new[] { ROWS }
        };
        var table = new SegueOneHop(header, File.ReadAllBytes("one_hop.bin"));
        foreach (string line in File.ReadAllLines("asked.txt")) {
            string[] asked = line.Split(' ');
            SegueOneHop.Entry e;
            bool found = table.TryLookUp(int.Parse(asked[0]), int.Parse(asked[1]), int.Parse(asked[2]), out e);
            Console.WriteLine(found ? String.Join(" ", e.Hop, e.Offset, e.StaySource, e.StayHop, e.BlendFirst,
                e.BlendSecond) : "none");
        }
    }
}
"""


@pytest.mark.parametrize("width", [4, 6])
def test_the_look_up_in_c_sharp_finds_what_ours_finds(tmp_path: Path, width: int) -> None:
    if shutil.which("mcs") is None or shutil.which("mono") is None:
        unavailable("Mono", "apt-get install mono-mcs", "mono-mcs")
    rng = np.random.default_rng(8)
    entries = rng.integers(-(2**31), 2**31 - 1, (20, width)).astype(np.int32)
    entries[:, 0] = rng.integers(-1, 3, 20)
    rows = (Row(0, 1, Alignment(offset=0), 2, 12, 0), Row(2, 0, Alignment(offset=0), 0, 8, 12))
    nowhere = np.full(20, np.inf)
    table = OneHopTable(("a", "b", "c"), (20,) * 3, 60.0, 30, rows, entries, nowhere, nowhere, 1e-4, "cost")
    clips = {name: make_walk(20, name=name) for name in "abc"}
    clips = {name: retarget(clip, clips["a"].skeleton) for name, clip in clips.items()}
    export(tmp_path / "out", clips, list(clips.values()), [], table)
    asked = [(row.source, row.destination, frame) for row in rows for frame in range(15)] + [(1, 0, 3)]
    (tmp_path / "out" / "asked.txt").write_text("\n".join(" ".join(map(str, one)) for one in asked))
    said = ", ".join(
        f"new SegueOneHop.Row {{ source = {r.source}, destination = {r.destination}, "
        f"first_trigger = {r.first_trigger}, triggers = {r.triggers}, first_entry = {r.first_entry} }}"
        for r in rows
    )
    main = MAIN.replace("ENTRIES", "20").replace("WIDTH", str(width)).replace("ROWS", said)
    (tmp_path / "out" / "Program.cs").write_text(main)
    said = ran("mcs", "-warnaserror", "-out:look.exe", "Program.cs", "SegueOneHop.cs", cwd=tmp_path / "out")
    assert said == ""
    answers = ran("mono", "look.exe", cwd=tmp_path / "out").splitlines()
    for (source, destination, frame), answer in zip(asked, answers, strict=True):
        try:
            entry = table.look_up(source, destination, frame)
        except TransitionError:
            entry = None
        if entry is None:
            assert answer == "none"
        else:
            blends = [30 if own is None else own for own in (entry.blend_first, entry.blend_second)]
            numbers = [entry.hop, entry.offset, entry.stay_source, entry.stay_hop, *blends]
            assert answer == " ".join(map(str, numbers))


def test_importers_can_be_parsed() -> None:
    import tree_sitter
    import tree_sitter_c_sharp
    import tree_sitter_gdscript  # of Godot 4

    for language, suffix, count in ((tree_sitter_c_sharp, "cs", 2), (tree_sitter_gdscript, "gd", 1)):
        parser = tree_sitter.Parser(tree_sitter.Language(language.language()))
        files = list(IMPORTERS.glob(f"*.{suffix}"))
        assert len(files) == count
        for file in files:
            assert not parser.parse(file.read_bytes()).root_node.has_error, file
        assert parser.parse(b"class {{ func (").root_node.has_error


def test_the_importer_for_unreal_sets_the_transition_of_each_number(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a stand-in for Unreal's module, which notes what it is told."""

    class Node:
        def __init__(self, number: int) -> None:
            self.told: dict[str, object] = {"priority_order": number}
            self.get_editor_property, self.set_editor_property = self.told.__getitem__, self.told.__setitem__

    nodes, unreal, blueprint = [Node(number) for number in (2, 1, 7)], MagicMock(), MagicMock()
    unreal.AnimStateTransitionNode, unreal.AnimBlueprint = Node, MagicMock
    unreal.EditorUtilityLibrary.get_selected_assets.return_value = [blueprint]
    graphs = [MagicMock(**{"get_outer.return_value": node}) for node in (*nodes, object())]
    unreal.BlueprintEditorLibrary.list_graphs.return_value = graphs
    monkeypatch.setitem(sys.modules, "unreal", unreal)
    clips = walks()
    there = Advised("slow walk", "out/run", "velocity", "slerp", 30, 40, 10)
    back = Advised("out/run", "slow walk", "velocity", "dead-blend", 20, 30, 7)
    machine = export(tmp_path / "out", clips, list(clips.values()), [there, back], None)
    runpy.run_path(str(tmp_path / "out" / "segue-unreal.py"))
    fade_s = machine["transitions"][0]["duration_s"]
    assert [node.told.get("crossfade_duration") for node in nodes] == [pytest.approx(8 / 30), fade_s, None]
    assert nodes[0].told["logic_type"] is unreal.TransitionLogicType.TLT_INERTIALIZATION
    assert nodes[1].told["logic_type"] is unreal.TransitionLogicType.TLT_STANDARD_BLEND
    unreal.BlueprintEditorLibrary.compile_blueprint.assert_called_once_with(blueprint)


def test_importers_ask_for_keys_that_are_there(tmp_path: Path) -> None:
    clips = walks()
    machine = export(tmp_path / "out", clips, list(clips.values()),
                     [Advised("slow walk", "out/run", "velocity", "slerp", 30, 40, 10)], None)  # fmt: skip
    keys = {*machine, *machine["states"][0], *machine["transitions"][0]}
    read = (IMPORTERS / "SegueImporter.cs").read_text()
    fields = re.findall(r"public (?:string|float|State\[\]|Transition\[\]) ([\w, ]+);", read, re.MULTILINE)
    for file, used in (
        ("SegueImporter.cs", {name for line in fields for name in line.split(", ")}),
        (
            "segue_player.gd",
            set(re.findall(r"(?:coming|one|machine)\[\"(\w+)\"\]", (IMPORTERS / "segue_player.gd").read_text())),
        ),
        (
            "segue-unreal.py",
            set(re.findall(r"(?:row|machine)\[[\"'](\w+)[\"']\]", (IMPORTERS / "segue-unreal.py").read_text())),
        ),
    ):
        assert len(used) >= 5, file
        assert used <= keys, file
