// Unity: makes an Animator Controller of state_machine.json: a state for each clip, a trigger for each destination. Put
// it into a folder called Editor, import clips.glb (with glTFast), select state_machine.json, and choose
// Assets > Segue > Make Animator Controller.
using System;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using UnityEditor;
using UnityEditor.Animations;
using UnityEngine;

public static class SegueImporter {
    // Fields are called as the keys of the JSON are.
    [Serializable] public class State { public string name, animation; }

    [Serializable] public class Transition {
        public string source, destination;
        public float start_normalised, offset_normalised, duration_s;
    }

    [Serializable] public class Machine {
        public string file;
        public State[] states;
        public Transition[] transitions;
    }

    [MenuItem("Assets/Segue/Make Animator Controller")]
    public static void Make() {
        var text = Selection.activeObject as TextAsset;
        if (text == null) {
            Debug.LogError("Segue: expected state_machine.json to be selected, found another asset or none.");
            return;
        }
        var machine = JsonUtility.FromJson<Machine>(text.text);
        string folder = Path.GetDirectoryName(AssetDatabase.GetAssetPath(text));
        string file = Path.Combine(folder, machine.file);
        var clips = AssetDatabase.LoadAllAssetsAtPath(file).OfType<AnimationClip>().ToList();
        var controller = AnimatorController.CreateAnimatorControllerAtPath(Path.Combine(folder, "Segue.controller"));
        var states = new Dictionary<string, AnimatorState>();
        foreach (State one in machine.states) {
            AnimatorState state = controller.layers[0].stateMachine.AddState(one.animation.Replace('.', '_'));
            state.motion = clips.FirstOrDefault(clip => clip.name == one.animation);
            if (state.motion == null) {
                Debug.LogWarning("Segue: expected an animation " + one.animation + " in " + file + ", found none.");
            }
            states[one.name] = state;
            controller.AddParameter(one.name, AnimatorControllerParameterType.Trigger);
        }
        foreach (Transition one in machine.transitions) {
            AnimatorStateTransition made = states[one.source].AddTransition(states[one.destination]);
            made.AddCondition(AnimatorConditionMode.If, 0f, one.destination);
            made.hasExitTime = true;
            made.exitTime = one.start_normalised; // where the fade starts, of the source's length
            made.hasFixedDuration = true;
            made.duration = one.duration_s;
            made.offset = one.offset_normalised; // where the destination starts, of its length
        }
        AssetDatabase.SaveAssets();
    }
}
