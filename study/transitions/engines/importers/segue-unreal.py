"""Unreal 5: imports clips.glb, and sets the transitions of an Animation Blueprint as state_machine.json says.

In the editor, Tools > Execute Python Script, with this file beside the others. Select the Animation Blueprint first:
its transitions get their values by their Priority Order, which is to be the number that this script logs for each
(Unreal tells a script neither the states of a transition nor its name). With none selected, the clips are imported.
"""

import json
from pathlib import Path

import unreal

HERE = Path(__file__).parent
GAME_FOLDER = "/Game/Segue"
# Makes of Segue that Unreal has as a node: transitions then ask for it instead of fading.
INERTIAL = ("inertialize", "dead-blend")


def import_clips(file):
    """The skeleton, mesh and animations, as assets in GAME_FOLDER."""
    task = unreal.AssetImportTask()
    task.set_editor_property("filename", str(HERE / file))
    task.set_editor_property("destination_path", GAME_FOLDER)
    task.set_editor_property("automated", True)
    task.set_editor_property("replace_existing", True)
    task.set_editor_property("save", True)
    unreal.AssetToolsHelpers.get_asset_tools().import_asset_tasks([task])


def set_transition(node, row):
    """Duration, linear blend, and whether it fades or inertializes."""
    node.set_editor_property("crossfade_duration", row["duration_s"])
    node.set_editor_property("blend_mode", unreal.AlphaBlendOption.LINEAR)
    inertial = row["make"] in INERTIAL
    kinds = unreal.TransitionLogicType
    node.set_editor_property("logic_type", kinds.TLT_INERTIALIZATION if inertial else kinds.TLT_STANDARD_BLEND)


def main():
    """Import, list the transitions, and set those of the selected Animation Blueprint."""
    machine = json.loads((HERE / "state_machine.json").read_text(encoding="utf-8"))
    import_clips(machine["file"])
    rows = dict(enumerate(machine["transitions"], start=1))
    for number, row in rows.items():
        unreal.log(
            f"Segue {number}: {row['source']} to {row['destination']} at {row['start_s']:.3f} s, enters at "
            f"{row['offset_s']:.3f} s, {row['duration_s']:.3f} s"
        )
    for asset in unreal.EditorUtilityLibrary.get_selected_assets():
        if isinstance(asset, unreal.AnimBlueprint):
            for graph in unreal.BlueprintEditorLibrary.list_graphs(asset):
                node = graph.get_outer()
                if isinstance(node, unreal.AnimStateTransitionNode):
                    row = rows.get(node.get_editor_property("priority_order"))
                    if row is not None:
                        set_transition(node, row)
            unreal.BlueprintEditorLibrary.compile_blueprint(asset)


main()
