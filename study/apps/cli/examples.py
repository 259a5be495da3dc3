"""What `--help` says below the options of each verb: what its arguments may be, and an example that can be typed."""

from __future__ import annotations

import click

EXAMPLES = {
    "demo": "segue demo --out results/demo",
    "new": "segue new walk.bvh run.bvh --study preference",
    "motions list": "segue motions list --library motions",
    "motions inspect": "segue motions inspect walk.bvh",
    "motions download": "segue motions download 16_35 run --out cmu",
    "preview": "segue preview walk.bvh --out walk.mp4",
    "blend-length": "segue blend-length walk run --start 60 --end 80 --method geodesic",
    "transition": "segue transition walk run --start 60 --end 80 --method geodesic --out joined.mp4",
    "cost-matrix": "segue cost-matrix walk run --out costs.png",
    "label": "segue label walk run --out labels.csv",
    "fit-weights": "segue fit-weights labels.csv",
    "one-hop build": "segue one-hop build dance dance_modern box --out dances.npz",
    "one-hop show": "segue one-hop show dances.npz --at dance box 200",
    "one-hop play": "segue one-hop play dances.npz --first dance --trigger 200 box --out played.mp4",
    "one-hop chain": "segue one-hop chain dance dance_modern box --pair dance box --at 200 --hops 2",
    "one-hop reach": "segue one-hop reach dance dance_modern box --pair dance box --at 200 --turn 30 --within-turn 60",
    "one-hop connect": "segue one-hop connect dance box dance_modern --out joined.mp4",
    "one-hop between": "segue one-hop between walk_slow walk_fast --count 3 --out walks",
    "one-hop robustness": "segue one-hop robustness dance dance_modern box --out costs.png",
    "advise": "segue advise walk run box --out advice",
    "check": "segue check my_study.toml --library motions",
    "render": "segue render my_study.toml --library motions",
    "play": "segue play my_study.toml --library motions --participant p01",
    "serve": "segue serve my_study.toml --library motions",
    "simulate": "segue simulate my_study.toml --library motions --participants 20 --out results/try",
    "analyse": "segue analyse results/my_study",
    "report": "segue report results/my_study",
    "export": "segue export results/my_study --to release --author 'Doe, Jane' --licence CC-BY-4.0",
    "export-stimuli": "segue export-stimuli my_study.toml --library motions --to jspsych --out web",
    "import-answers": "segue import-answers web segue_p001.json segue_p002.json",
    "export-engine": "segue export-engine advice/advice.json --out game",
    "fit": "segue fit data.csv --task 2afc --level contrast --answer correct --participant participant",
    "power": "segue power my_study.toml --library motions --out results/my_study",
    "doctor": "segue doctor",
}
"""Verb -> a command; the documentation's test runs each."""

CLIP = "a motion file (.bvh, .asf/.amc, .glb, .gltf), or the name of a motion in --library."
ARGUMENTS = {
    "PROTOCOL": "a TOML file of your own (`segue new` writes one), or the name of one that comes with Segue: {names}.",
    "RESULTS": "the folder that `segue render`, `play`, `serve` or `simulate` wrote: results/NAME, unless --out says.",
    "SRC": f"source, {CLIP}",
    "DST": f"destination, {CLIP}",
    "HOP": CLIP,
    "SLOW": CLIP,
    "FAST": CLIP,
    "CLIP": CLIP,
    "FILE": "a motion file: .bvh, .amc with its .asf, .glb or .gltf.",
    "FILE|NAME": CLIP,
    "TRIAL": "a trial of the CMU database, such as 16_35, or the name of one of its motions, such as run.",
    "TABLE": "a file that `segue one-hop build` wrote.",
    "ADVICE|TABLE": "advice.json of `segue advise --out`, or a file that `segue one-hop build` wrote.",
    "DATA": "a file of responses: CSV or other delimited text, or JSON.",
    "TRANSITIONS.csv": "a table with the columns source, destination, source_frame, destination_frame and label.",
}
"""Argument, as the usage line names it -> what it may be."""


def explain(command: click.Command, verb: str) -> None:
    """Give a verb, or each verb of a group, its arguments and its example."""
    if isinstance(command, click.Group):
        for name, inner in command.commands.items():
            explain(inner, f"{verb} {name}")
        return
    named = [f"{word} is {_said(word)}" for word in arguments(command)]
    # A verb without them is for the tests to find, and no reason to refuse it.
    command.epilog = "\n\n".join([*named, f"\b\nExample: {EXAMPLES.get(verb, 'none yet')}"])


def arguments(command: click.Command) -> list[str]:
    """The arguments of a verb without brackets, dots and repetition."""
    plain = (
        parameter.make_metavar(click.Context(command)).replace("[", "").replace("]", "").replace("...", "")
        for parameter in command.params
        if isinstance(parameter, click.Argument)
    )
    return list(dict.fromkeys(word for text in plain for word in text.split()))


def _said(argument: str) -> str:
    if argument != "PROTOCOL":
        return ARGUMENTS.get(argument, CLIP)
    from study.experiment.protocol.published import protocols_folder

    return ARGUMENTS[argument].format(names=", ".join(sorted(path.stem for path in protocols_folder().glob("*.toml"))))
