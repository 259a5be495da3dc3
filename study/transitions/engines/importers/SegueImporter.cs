// Unity: makes an Animator Controller of state_machine.json: a state for each clip and for each transition that is no
// fade, a trigger for each destination. Put it into a folder called Editor, import clips.glb (with glTFast), select state_machine.json, and choose
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
    [Serializable] public class State {
        public string name, animation;
        public float length_s;
    }

    [Serializable] public class Transition {
        public string source, destination, animation;
        public float start_normalised, offset_s, duration_s;
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
        Func<string, AnimatorState> added = animation => {
            AnimatorState state = controller.layers[0].stateMachine.AddState(animation.Replace('.', '_'));
            state.motion = clips.FirstOrDefault(clip => clip.name == animation);
            if (state.motion == null) {
                Debug.LogWarning("Segue: expected an animation " + animation + " in " + file + ", found none.");
            }
            return state;
        };
        foreach (State one in machine.states) {
            states[one.name] = added(one.animation);
            controller.AddParameter(one.name, AnimatorControllerParameterType.Trigger);
        }
        foreach (Transition one in machine.transitions) {
            bool fades = string.IsNullOrEmpty(one.animation);
            float length = machine.states.First(state => state.name == one.destination).length_s;
            AnimatorState next = fades ? states[one.destination] : added(one.animation);
            AnimatorStateTransition made = states[one.source].AddTransition(next);
            made.AddCondition(AnimatorConditionMode.If, 0f, one.destination);
            // Where the source is left, of its length; for how long both play; where the destination starts, of its own.
            Set(made, one.start_normalised, fades ? one.duration_s : 0f, fades ? one.offset_s / length : 0f);
            if (!fades) {
                Set(next.AddTransition(states[one.destination]), 1f, 0f, (one.offset_s + one.duration_s) / length);
            }
        }
        AssetDatabase.SaveAssets();
    }

    static void Set(AnimatorStateTransition made, float exitTime, float duration, float offset) {
        made.hasExitTime = true;
        made.exitTime = exitTime;
        made.hasFixedDuration = true;
        made.duration = duration;
        made.offset = offset;
    }
}
