# Plays a state machine of `segue export-engine`, in Godot 3.2 and later, and in Godot 4: an AnimationTree fades from
# clip to clip, and the model is moved so that each clip goes on where the last one has come to.
#
#     var character = preload("res://segue_player.gd").new()
#     character.setup($clips, "res://state_machine.json", "walk")  # $clips is the scene of clips.glb
#     add_child(character)
#     character.travel("run")  # fades at the point that Segue chose; false where the clip is past it
extends Node

var machine = {}
var state = ""
var time = 0.0

var _model
var _skeleton
var _tree
var _graph
var _four
var _lengths = {}
var _animations = {}
var _next = null
var _none  # the identity, whose class has another name in each version
var _start  # where the model stands
var _placed  # where the clip that plays has been moved to


func setup(model, path, first):
	_four = Engine.get_version_info()["major"] >= 4
	machine = _read(path)
	for one in machine["states"]:
		_animations[one["name"]] = one["animation"]
		_lengths[one["name"]] = one["length_s"]
	_model = model
	_start = model.transform
	_none = _start.affine_inverse() * _start
	_placed = _none
	_skeleton = _find(model, ["Skeleton", "Skeleton3D"])
	_graph = AnimationNodeBlendTree.new()
	for slot in ["source", "destination"]:
		_graph.add_node(slot, AnimationNodeAnimation.new())
		_graph.add_node(slot + "_at", AnimationNodeTimeSeek.new())
		_graph.connect_node(slot + "_at", 0, slot)
	_graph.add_node("fade", AnimationNodeBlend2.new())
	_graph.connect_node("fade", 0, "source_at")
	_graph.connect_node("fade", 1, "destination_at")
	_graph.connect_node("output", 0, "fade")
	_tree = AnimationTree.new()
	_tree.tree_root = _graph
	model.add_child(_tree)
	_tree.anim_player = _tree.get_path_to(_find(model, ["AnimationPlayer"]))
	_tree.set("callback_mode_process" if _four else "process_mode", 2)  # by hand, in `advance`
	_tree.active = true
	state = first
	_graph.get_node("destination").animation = _animations[first]
	_show(0.0)


func _process(delta):
	advance(delta)


func travel(to):
	for one in machine["transitions"]:
		if one["source"] == state and one["destination"] == to and time <= one["start_s"]:
			_next = one
			_graph.get_node("destination").animation = _animations[to]
			return true
	return false


func advance(delta):
	time += delta
	if _next != null and time >= _next["start_s"] + _next["duration_s"]:
		time += _next["offset_s"] - _next["start_s"]
		_placed = _placed * _moved(_next["turn_radians"], _next["shift_m"])
		state = _next["destination"]
		_next = null
	var share = 0.0
	if _next != null:
		share = max(0.0, (time - _next["start_s"]) / _next["duration_s"])
	_show(share)


func _show(share):
	_graph.get_node("source").animation = _animations[state]
	_seek("source_at", min(time, _lengths[state]))
	_seek("destination_at", 0.0 if _next == null else max(0.0, time - _next["start_s"] + _next["offset_s"]))
	_tree.set("parameters/fade/blend_amount", share)
	_tree.advance(0.0)
	_model.transform = _start * _placed
	if share > 0.0:
		# Engines blend places; Segue blends steps, whose path is in the file. The root is put on it.
		var at = (time - _next["start_s"]) * _next["fps"]
		var before = int(min(floor(at), len(_next["root"]) - 2))
		var root = _pose(_next["root"][before]).interpolate_with(_pose(_next["root"][before + 1]), at - before)
		_model.transform = _start * _placed * root * _skeleton.get_bone_global_pose(0).affine_inverse()


func _seek(node, seconds):
	_tree.set("parameters/" + node + ("/seek_request" if _four else "/seek_position"), seconds)


func _moved(turn, shift):
	var place = _none
	place.basis = place.basis.rotated(Vector3(0, 1, 0), turn)
	place.origin = Vector3(shift[0], shift[1], shift[2])
	return place


func _pose(numbers):
	# Position, then a quaternion with its real part last.
	var axis = Vector3(numbers[3], numbers[4], numbers[5])
	var place = _none
	if axis.length() > 1e-9:
		place.basis = place.basis.rotated(axis.normalized(), 2.0 * atan2(axis.length(), numbers[6]))
	place.origin = Vector3(numbers[0], numbers[1], numbers[2])
	return place


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
