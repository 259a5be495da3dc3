# Plays a state machine of `segue export-engine`, in Godot 3.2 and later, and in Godot 4: an AnimationTree fades from
# clip to clip, or plays what was made between them, and the model is moved so that each clip goes on where the last one
# has come to.
#
#     var character = preload("res://segue_player.gd").new()
#     character.setup($clips, "res://state_machine.json", "walk")  # $clips is the scene of clips.glb
#     add_child(character)
#     character.travel("run")  # goes over at the point that Segue chose; false where the clip is past it
extends Node

const CLOSE = 1e-5  # seconds, to which times are the same

var state = ""
var time = 0.0
var machine = {}
var states = {}
var coming = null  # the transition that is waited for or under way

var _model
var _skeleton
var _tree
var _four
var _none  # the identity, whose class has another name in each version
var _start  # where the model stands
var _placed  # where the clip that plays has been moved to


func setup(model, path, first):
	_four = Engine.get_version_info()["major"] >= 4
	machine = _read(path)
	for one in machine["states"]:
		states[one["name"]] = one
	_model = model
	_start = model.transform
	_none = _start.affine_inverse() * _start
	_placed = _none
	_skeleton = _find(model, ["Skeleton", "Skeleton3D"])
	_tree = AnimationTree.new()
	_tree.tree_root = AnimationNodeBlendTree.new()
	_tree.tree_root.add_node("fade", AnimationNodeBlend2.new())
	_tree.tree_root.connect_node("output", 0, "fade")
	for slot in ["source", "destination"]:
		_tree.tree_root.add_node(slot, AnimationNodeAnimation.new())
		_tree.tree_root.add_node(slot + "_at", AnimationNodeTimeSeek.new())
		_tree.tree_root.connect_node(slot + "_at", 0, slot)
		_tree.tree_root.connect_node("fade", int(slot == "destination"), slot + "_at")
		_play(slot, states[first]["animation"])
	model.add_child(_tree)
	_tree.anim_player = _tree.get_path_to(_find(model, ["AnimationPlayer"]))
	_tree.set("callback_mode_process" if _four else "process_mode", 2)  # by hand, in `_pose`
	_tree.active = true
	state = first
	advance(0.0)


func travel(to):
	for one in machine["transitions"]:
		if one["source"] == state and one["destination"] == to and time < one["start_s"] + CLOSE:
			coming = one
			_play("destination", one["animation"] if one["animation"] else states[to]["animation"])
			return true
	return false


func _process(delta):
	advance(delta)


func advance(delta):
	time += delta
	if coming != null and time > coming["start_s"] + coming["duration_s"] - CLOSE:
		time += coming["offset_s"] - coming["start_s"]
		var shift = coming["shift_m"]
		_placed = _placed * _at(Vector3(0, 1, 0), coming["turn_radians"], shift)
		state = coming["destination"]
		coming = null
		_play("source", states[state]["animation"])
	var since = -1.0 if coming == null else time - coming["start_s"]
	var share = 0.0 if coming == null else max(0.0, since / coming["duration_s"])
	var made = share > 0.0 and coming["animation"]
	_pose(1.0 if made else share)
	_model.transform = _start * _placed
	if share > 0.0 and not made:
		if _four:
			# Trees of Godot 4 blend rotations about the rest pose, off by centimetres; this is the shortest way.
			var from = _rotations(0.0)
			var to = _rotations(1.0)
			for bone in range(_skeleton.get_bone_count()):
				_skeleton.set_bone_pose_rotation(bone, from[bone].slerp(to[bone], share))
		# Engines blend places; Segue blends steps, whose path is in the file. The root is put on it.
		var frame = since * coming["fps"]
		var before = int(min(floor(frame), len(coming["root"]) - 2))
		var root = _root(before).interpolate_with(_root(before + 1), frame - before)
		_model.transform = _start * _placed * root * _skeleton.get_bone_global_pose(0).affine_inverse()


func _play(slot, animation):
	_tree.tree_root.get_node(slot).animation = animation


func _pose(share):
	var seek = "seek_request" if _four else "seek_position"
	var entered = 0.0
	if coming != null:
		entered = max(0.0, time - coming["start_s"] + (0.0 if coming["animation"] else coming["offset_s"]))
	_tree.set("parameters/source_at/" + seek, min(time, states[state]["length_s"]))
	_tree.set("parameters/destination_at/" + seek, entered)
	_tree.set("parameters/fade/blend_amount", share)
	_tree.advance(0.0)


func _rotations(share):
	_pose(share)
	var found = []
	for bone in range(_skeleton.get_bone_count()):
		found.append(_skeleton.get_bone_pose_rotation(bone))
	return found


func _root(frame):
	# Position, then a quaternion with its real part last.
	var numbers = coming["root"][frame]
	var axis = Vector3(numbers[3], numbers[4], numbers[5])
	return _at(axis, 2.0 * atan2(axis.length(), numbers[6]), numbers)


func _at(axis, angle, place):
	var found = _none
	if axis.length() > 1e-9:
		found.basis = found.basis.rotated(axis.normalized(), angle)
	found.origin = Vector3(place[0], place[1], place[2])
	return found


func _find(node, classes):
	if node.get_class() in classes:
		return node
	for child in node.get_children():
		var found = _find(child, classes)
		if found != null:
			return found
	return null


func _read(path):
	if _four:
		return load(path).data
	var file = ClassDB.call("instance", "_File")
	file.open(path, 1)
	return Engine.get_singleton("JSON").parse(file.get_as_text()).result
