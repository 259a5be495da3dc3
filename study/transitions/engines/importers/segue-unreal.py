"""Unreal 5: imports clips.glb, and sets the transitions of an Animation Blueprint as state_machine.json says.

In the editor, Tools > Execute Python Script, with this file beside the others. Select the Animation Blueprint first:
its transitions get their values by their Priority Order, which is to be the number that this script logs for each
(Unreal tells a script neither the states of a transition nor its name). With none selected, the clips are imported.
"""

import json
from pathlib import Path

import unreal

HERE = Path(__file__).parent
machine = json.loads((HERE / "state_machine.json").read_text(encoding="utf-8"))
task = unreal.AssetImportTask()
for name, value in (
    ("filename", str(HERE / machine["file"])),
    ("destination_path", "/Game/Segue"),
    ("automated", True),
    ("replace_existing", True),
    ("save", True),
):
    task.set_editor_property(name, value)
unreal.AssetToolsHelpers.get_asset_tools().import_asset_tasks([task])

rows = dict(enumerate(machine["transitions"], start=1))
for number, row in rows.items():
    places = f"at {row['start_s']:.3f} s, enters at {row['offset_s']:.3f} s, takes {row['duration_s']:.3f} s"
    made = f", made as {row['animation']}" if row["animation"] else ""
    unreal.log(f"Segue {number}: {row['source']} to {row['destination']} {places}{made}")
blueprints = [one for one in unreal.EditorUtilityLibrary.get_selected_assets() if isinstance(one, unreal.AnimBlueprint)]
for blueprint in blueprints:
    for node in [graph.get_outer() for graph in unreal.BlueprintEditorLibrary.list_graphs(blueprint)]:
        row = isinstance(node, unreal.AnimStateTransitionNode) and rows.get(node.get_editor_property("priority_order"))
        if row:
            # Makes that Unreal has as a node of its own are asked of it, for as long as the fade would last.
            inertial = row["make"] in ("inertialize", "inertialize-quintic", "dead-blend")
            fade_s = (row["blend_frames"] + 1) / row["fps"] if row["animation"] else row["duration_s"]
            kind = "TLT_INERTIALIZATION" if inertial else "TLT_STANDARD_BLEND"
            node.set_editor_property("crossfade_duration", fade_s)
            node.set_editor_property("blend_mode", unreal.AlphaBlendOption.LINEAR)
            node.set_editor_property("logic_type", getattr(unreal.TransitionLogicType, kind))
    unreal.BlueprintEditorLibrary.compile_blueprint(blueprint)
