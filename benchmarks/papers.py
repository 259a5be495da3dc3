# ruff: noqa: E501, D102 (sentences of a page, and the steps that make them)
"""Every figure and table of the three papers in one page, each beside what the paper has.

    python benchmarks/papers.py [--library FOLDER] [--out results/papers] [--only 2003,2004,2019] [--workers 2]

With the CMU's motions where the library has them, else with synthetic ones. Each entry says what the paper has, what is
found here, the command that makes it, and what differs and why. Where people answered, simulated observers do, who were
given the paper's findings: only the way from answers to numbers is tested.
"""

from __future__ import annotations

import argparse
import base64
import html
import json
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parent))

from fit_weights import labelled
from one_hop_robustness import WEIGHT, draw_path, floor_of, smoothness_of

from renderer.strip import render_strip
from renderer.workers import run_jobs
from study.files import write_whole
from study.motion.clip import Clip, joint_positions, retarget, trim
from study.motion.drawing import figure_for
from study.motion.library import open_library
from study.transitions.fit_weights import fit_weights
from study.transitions.one_hop.beats import all_beat_offsets, find_beats
from study.transitions.one_hop.build import build_table
from study.transitions.one_hop.play import Played, Trigger, play
from study.transitions.one_hop.problem import Alignment, PointCloudDistance, Problem, Settings, Switch, weight_in_counts
from study.transitions.one_hop.robustness import costs_of, draw_costs, robustness_set
from study.transitions.one_hop.strip import strip_segments
from study.transitions.weights import WANG2003

GIVEN = "Simulated observers answer, who were given the paper's findings: this tests the way from answers to numbers."


KEY = "A pose every 0.33 s. Source blue, blends purple, hop yellow, destination orange; the right side is darker."


@dataclass(frozen=True)
class Entry:
    """One figure or table of a paper."""

    what: str
    printed: str
    found: str
    command: str
    differs: str = ""
    pictures: tuple[tuple[str, bytes], ...] = ()
    """Files by their names."""


def draw_played(played: Played, path: Path, first: int, height: int = 300) -> None:
    """Thirteen poses of four seconds from a frame on, so that several strips show the same times."""
    last = min(first + 240, played.clip.frames - 1)
    render_strip(
        path,
        joint_positions(played.clip, ends=True),
        figure_for(played.clip.skeleton),
        frames=sorted({round(first + (last - first) * k / 12) for k in range(13)}),
        segments=strip_segments(played),
        height=height,
    )


def labelled_rows(rows: list[tuple[str, Path]], path: Path, key: str) -> None:
    """Strips one below the other, each under its label, with a key below."""
    from matplotlib.font_manager import findfont
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.truetype(findfont("DejaVu Sans"), 22)
    strips = [(words, Image.open(strip).convert("RGB")) for words, strip in rows]
    width, line = max(strip.width for _, strip in strips), 34
    sheet = Image.new("RGB", (width, sum(strip.height + line for _, strip in strips) + line), "white")
    draw, top = ImageDraw.Draw(sheet), 0
    for words, strip in strips:
        draw.text((8, top + 4), words, fill="#1d2328", font=font)
        sheet.paste(strip, (0, top + line))
        top += strip.height + line
    draw.text((8, top + 4), key, fill="#5b666e", font=font)
    sheet.save(path)


class Papers:
    """The figures, made from one library in a folder of their own."""

    def __init__(self, library: str, out: Path) -> None:
        self.library, self.out = library, out
        self.opened = open_library(library)
        self.synthetic = self.opened.synthetic

    def clip(self, name: str, fps: float) -> Clip:
        return self.opened.clip(self.opened.find(name), fps=fps)

    def segue(self, command: str) -> dict[str, Any]:
        """What a command of Segue says in JSON; its files are in the folder."""
        there = str(Path(self.library).resolve()) if Path(self.library).is_dir() else self.library
        words = [there if word == self.library else word for word in command.split()[1:]]
        done = subprocess.run(
            [sys.executable, "-m", "study.apps.cli", *words, "--json"],
            cwd=self.out,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise RuntimeError(f"{command}: {done.stderr}")
        said: dict[str, Any] = json.loads(done.stdout)
        return said

    def at(self, name: str) -> Path:
        return self.out / f"{name}.png"

    def files(self, *names: str) -> tuple[tuple[str, bytes], ...]:
        """Pictures that were made."""
        return tuple((f"{name}.png", self.at(name).read_bytes()) for name in names)

    # 2003: which frames to join

    def cost_matrices(self) -> Iterator[Entry]:
        """2003, Figures 1, 2 and 3."""
        pair = "dance dance_modern"
        same = "Other dances; ours are as long as they were recorded." if not self.synthetic else "Synthetic dances."
        for figure, words, options in (
            ("1", "The cost matrix of two dances, original weights", "--weights lee2002"),
            ("2a", "The same with nu = 0.1", "--weights lee2002 --nu 0.1"),
            ("2b", "The same with nu = 10", "--weights lee2002 --nu 10"),
            ("3", "The same with the weights of Table 1", "--weights wang2003"),
        ):
            command = f"segue cost-matrix {pair} --library {self.library} {options} --out 2003_{figure}.png"
            said = self.segue(command)
            printed = {
                "1": "a picture of the costs, darker is cheaper; the number of cheap frames is not given",
                "2a": "the least cost is at the same frames for nu from 0 to 100",
                "2b": "as 2a",
                "3": "fewer cheap frames than Figure 1: “more restrictive”",
            }[figure]
            found = f"least cost {said['min']:.3g} at frames {said['argmin'][0]} and {said['argmin'][1]} (30 fps), of at most {said['max']:.3g}"
            yield Entry(f"2003, Figure {figure}: {words}", printed, found, command, same, self.files(f"2003_{figure}"))

    def joint_weights(self) -> Iterator[Entry]:
        """2003, Table 1."""
        names = ("dance", "dance_modern", "dance_turns", "walk", "run", "walk_slow", "jog", "walk_fast")
        clips = [self.clip(name, 30.0) for name in names]
        pairs = [(a, retarget(b, a.skeleton)) for a, b in zip(clips, clips[1:] + clips[:1], strict=True)]
        pairs = [(trim(a, 0, min(a.frames, 300)), trim(b, 0, min(b.frames, 300))) for a, b in pairs]
        fitted = fit_weights(labelled(pairs, 0.1, 0))
        parts = {part: fitted.weights[f"{part}.L"] for part in ("hip", "knee", "shoulder", "elbow")}
        yield Entry(
            "2003, Table 1: joint weights from 16 good and 26 bad transitions",
            ", ".join(f"{part} {WANG2003[f'{part}.L']:.4f}" for part in parts),
            ", ".join(f"{part} {value:.4f}" for part, value in parts.items()),
            "segue label SRC DST --out labels.csv; segue fit-weights labels.csv",
            "The paper's labels were people's. Ours are made from its weights, so that least squares has them to find again.",
        )

    def character(self) -> Iterator[Entry]:
        """2003, Figure 4."""
        command = f"segue preview dance --library {self.library} --out 2003_4.png --poses 5 --floor"
        self.segue(command)
        differs = "The paper's is a skinned character; ours is a mannequin of capsules."
        yield Entry("2003, Figure 4: the character of the user study", "one frame of a dance", "the same dance, five poses", command,
                    differs, self.files("2003_4"))  # fmt: skip

    def ratings(self) -> Iterator[Entry]:
        """2003, Table 2."""
        results = "transition_points"
        self.segue(f"segue simulate transition_points --library {self.library} --participants 26 --out {results}")
        ratings = self.segue(f"segue analyse {results}")["headline"]
        yield Entry(
            "2003, Table 2: do optimized weights look better, more natural?",
            "better 2.73 (SD 1.00), more natural 2.69 (SD 0.84); F = 6.39, p = 0.01",
            " ".join(s for one in ratings if (s := one["statement"]).startswith(("looks_better", "more_natural"))),
            f"segue simulate transition_points --library {self.library} --participants 26; segue analyse RESULTS",
            GIVEN + " We print the degrees of freedom, which the paper leaves out.",
        )

    # 2004: how long to blend

    def walk_and(self, name: str) -> str:
        """A walk and another motion, and where one is left for the other, for commands of two clips."""
        end = min(80, self.clip(name, 30.0).frames - 5)
        return f"walk {name} --library {self.library} --start 60 --end {end}"

    def transition(self) -> Iterator[Entry]:
        """2004, Figure 1."""
        command = f"segue transition {self.walk_and('run')} --method geodesic --out 2004_1.png"
        self.segue(command)
        yield Entry("2004, Figure 1: a transition", "an example of a transition",
                    "source blue, blend purple, destination orange; the right side is darker", command, "Other motions.", self.files("2004_1"))  # fmt: skip

    def blend_costs(self) -> Iterator[Entry]:
        """2004, Figures 2, 3 and 5, and Table 1."""
        walks = self.walk_and("walk_fast")
        command = f"segue blend-length {walks} --method geodesic --out 2004_3.png"
        said = self.segue(command)
        yield Entry(
            "2004, Figures 2, 3 and 5: cost by blend length, frame by frame and joint by joint",
            "the least cost is at 0.5 s; three joints have no minimum there",
            f"least at {said['blend_s']:.2f} s ({said['blend_frames']} frames at 30 fps), cost {said['cost']:.3g}",
            command,
            "Another walk, and other points.",
            self.files("2004_3"),
        )
        most = max(said["differences"], key=said["differences"].get)
        yield Entry(
            "2004, Table 1: differences of the joints between two frames",
            "right shoulder 0.3029, left shoulder 0.1192, right knee 0.0481, ...",
            ", ".join(f"{role} {value:.4f}" for role, value in said["differences"].items())
            + f"; the largest is {most}",
            f"segue blend-length {walks} --method velocity",
            "Other frames. The paper's own eight numbers are in tests/papers/test_transitions_2004.py.",
        )

    def two_lengths(self) -> Iterator[Entry]:
        """2004, Figure 4."""
        command = f"segue blend-length {self.walk_and('run')} --method timewarp --out 2004_4.png"
        said = self.segue(command)
        yield Entry(
            "2004, Figure 4: two lengths, one for each motion",
            "an illustration: fewer frames of the source than of the destination",
            f"{said['source_frames']} frames of the walk over {said['destination_frames']} of the run; ringed in the costs of all pairs of lengths",
            command,
            "The paper's figure is a drawing; ours shows the costs of Eqs. 5 and 6, white where one length is twice the other.",
            self.files("2004_4"),
        )

    def session(self) -> Iterator[Entry]:
        """2004, Figure 6 and Table 2."""
        results = "wang2004_session"
        command = f"segue simulate wang2004_session --library {self.library} --participants 35 --out {results}"
        self.segue(command)
        said = self.segue(f"segue analyse {results}")
        self.segue(f"segue report {results}")
        lengths = [
            one["statement"].partition(" At the first")[0]
            for one in said["headline"]
            if one["unit"].startswith("frames")
        ]
        others = [one["statement"] for one in said["headline"] if not one["unit"].startswith("frames")]
        curves = sorted((self.out / results / "figures").glob("*curve.png"))
        yield Entry(
            "2004, Figure 6: the just noticeable difference of blend length",
            "75% “different” at k + 7 and k − 8 frames",
            " ".join(dict.fromkeys(lengths)),
            f"{command}; segue analyse RESULTS",
            GIVEN + " Below the published number stand those of a model, with and without the criterion.",
            tuple((path.name, path.read_bytes()) for path in curves),
        )
        yield Entry(
            "2004, Table 2: which method people prefer",
            "geodesic over 10 frames 96.4% (χ² 241.4), velocity over 10 frames 65.7% (27.7), geodesic over timewarp 55.7% (3.66)",
            " ".join(others),
            f"{command}; segue analyse RESULTS",
            GIVEN
            + " The paper's χ² treats 280 answers as independent; ours tests participants and motions as samples.",
        )

    # 2019: through a third motion

    def clips(self) -> list[Clip]:
        """The clips that the paper's are stood in for by."""
        names = ["dance", "dance_modern", "dance_turns"]
        names += (
            ["box"] if self.synthetic else [one for one in ("49_14", "49_15", "49_18") if one in self.opened.names()]
        )
        clips = [replace(self.clip(name, 60.0), name=name) for name in dict.fromkeys(names)]
        return [retarget(trim(clip, 0, min(clip.frames, 1500)), clips[0].skeleton) for clip in clips]

    def problem(self, clips: list[Clip]) -> Problem:
        """The robustness set of these clips."""
        settings, distance = Settings.at(60.0), PointCloudDistance()
        switches = robustness_set(clips, settings)
        return Problem(tuple(clips), switches, settings, weight_in_counts(WEIGHT, distance), distance)

    def one_hop(self) -> Iterator[Entry]:
        """2019, Figures 1, 5 and 7 to 11."""
        clips = self.clips()
        problem = self.problem(clips)
        switches = problem.switches
        tables = [build_table(replace(problem, switches=(switch,))) for switch in switches]
        costs = [costs_of(replace(problem, switches=(switch,)), table, 0, switch.first_trigger)
                 for switch, table in zip(switches, tables, strict=True)]  # fmt: skip
        gain = np.array([one.direct - one.total for one in costs])
        command = f"segue one-hop robustness {' '.join(clip.name for clip in clips)} --library {self.library}"

        def pair(number: int, name: str) -> tuple[tuple[str, bytes], ...]:
            switch, table = switches[number], tables[number]
            paths = []
            for method in ("direct", "one-hop"):
                played = self.played(clips, table, switch, method)
                first = max(switch.first_trigger - 24, 0)
                draw_played(played, self.at(f"{name}_{method}"), first)
                paths.append(self.at(f"{name}_{method}"))
            cost = costs[number]
            says = f"direct, {cost.direct:.3f} m²", f"one-hop, {cost.total:.3f} m²"
            labelled_rows(list(zip(says, paths, strict=True)), self.at(name), KEY)
            return self.files(name)

        def words(number: int) -> str:
            switch, cost = switches[number], costs[number]
            where = f"{clips[switch.source].name} frame {switch.first_trigger} to {clips[switch.destination].name}"
            return f"{where}: direct {cost.direct:.4g}, one-hop {cost.total:.4g} m²"

        ranked = np.argsort(-gain)
        shown = "Above the direct transition, below through the hop (yellow); blends purple, a pose every 0.33 s."
        dances = "Other dances; the paper has 20 s clips of hip-hop, jazz and pop."
        for figure, rank, printed in (
            ("1", 0, "a natural transition where the direct one has severe artifacts"),
            (
                "7",
                1,
                "triggered while crouching, or from a dance that stands to one on the floor: the hop stands up, or sinks down",
            ),
        ):
            number = int(ranked[rank])
            yield Entry(f"2019, Figure {figure}: direct and optimal one-hop transition", printed, words(number),
                        f"segue one-hop play TABLE --first {clips[switches[number].source].name} --trigger {switches[number].first_trigger} "
                        f"{clips[switches[number].destination].name} --out X.png", f"{dances} {shown}", pair(number, f"2019_{figure}"))  # fmt: skip
        best = int(ranked[0])
        draw_path(clips, tables[best], switches[best], self.at("2019_5"))
        yield Entry("2019, Figure 5: distances between all frames of two clips", "a colour map, in units the paper does not state",
                    f"{words(best)}; a cross where each blend starts",
                    "python benchmarks/one_hop_robustness.py FOLDER A.bvh B.bvh ...", dances, self.files("2019_5"))  # fmt: skip
        floor, skates = floor_of(clips), []
        for number, switch in enumerate(switches):
            slide = [smoothness_of(self.played(clips, tables[number], switch, method), switch.first_trigger, floor).slide_m
                     for method in ("direct", "one-hop")]  # fmt: skip
            skates.append(slide)
        slides = np.array(skates)
        worst = int(np.argmax(slides[:, 0] - slides[:, 1]))
        yield Entry("2019, Figure 8: feet that slide", "severe sliding in the direct transition, almost negligible through the hop",
                    f"{words(worst)}; the slower toe slides {slides[worst, 0]:.2f} m in the direct transition, {slides[worst, 1]:.2f} m through "
                    f"the hop (mean of all {len(switches)}: {slides[:, 0].mean():.2f} and {slides[:, 1].mean():.2f} m)",
                    f"{command}", f"{dances} Nothing is done about feet in either row.", pair(worst, "2019_8"))  # fmt: skip
        alike = int(ranked[-1])
        yield Entry("2019, Figure 9: where both are alike", "the destination itself is the hop", words(alike), command,
                    f"{dances} The transition of the set that gains least.", pair(alike, "2019_9"))  # fmt: skip
        draw_costs(costs, self.at("2019_10"))
        yield Entry(
            "2019, Figure 10 and the robustness set: 15 transitions by rule",
            "one-hop costs less in every one",
            f"one-hop costs less in {int((gain > 0).sum())} of {len(gain)}; mean {np.mean([one.total for one in costs]):.4g}, direct "
            f"{np.mean([one.direct for one in costs]):.4g} m²",
            f"{command} --out X.png",
            dances,
            self.files("2019_10"),
        )
        yield self.weights(clips, problem, switches[best])

    def played(self, clips: list[Clip], table: Any, switch: Switch, method: str) -> Played:
        trigger = [Trigger(switch.first_trigger, switch.destination)]
        return play(clips, table, trigger, first=switch.source, method=method)

    def weights(self, clips: list[Clip], problem: Problem, switch: Switch) -> Entry:
        """Figure 11: the same trigger with other weights."""
        names, found = [], []
        for times in (0.1, 1.0, 10.0):
            weighted = replace(problem, switches=(switch,), weight=round(problem.weight * times))
            table = build_table(weighted)
            entry = table.look_up(switch.source, switch.destination, switch.first_trigger)
            assert entry is not None
            smooth = costs_of(weighted, table, 0, switch.first_trigger)
            found.append(f"{times:g} w: stays {entry.stay_source + entry.stay_hop} frames, blends cost "
                         f"{smooth.total - weighted.weight * weighted.distance.unit * (entry.stay_source + entry.stay_hop):.4g} m²")  # fmt: skip
            names.append(f"2019_11_{times:g}")
            played = self.played(clips, table, switch, "one-hop")
            first = max(switch.first_trigger - 24, 0)
            draw_played(played, self.at(names[-1]), first, height=220)
        return Entry("2019, Figure 11: the weight trades smoothness for responsiveness", "0.1 w, w, 10 w: larger weights respond sooner, smaller ones are smoother",
                     "; ".join(found), "segue one-hop build CLIPS --times 3 --out X.npz", "Other dances; w is 0.00025 m² a frame. Rows are 0.1 w, w and 10 w, as in the paper.",
                     self.files(*names))  # fmt: skip

    def beats(self) -> Iterator[Entry]:
        """2019, Figure 12: hops that share the beats."""
        clips = self.clips()
        beats = {number: find_beats(clip) for number, clip in enumerate(clips)}
        switch = Switch(0, 2, Alignment(0))
        offsets = all_beat_offsets(beats, [0], range(len(clips)))
        table = build_table(replace(self.problem(clips), switches=(switch,), offsets=offsets))
        usable = np.flatnonzero(table.entries[:, 0] >= 0)
        through = usable[~np.isin(table.entries[usable, 0], [0, 2])]  # a third clip, where one is the best
        at = through if len(through) else usable
        trigger = int(at[len(at) // 2]) + table.rows[0].first_trigger
        played = self.played(clips, table, replace(switch, first_trigger=trigger), "one-hop")
        draw_played(played, self.at("2019_12"), max(trigger - 24, 0))
        entry = table.look_up(0, 2, trigger)
        assert entry is not None
        own = set((beats[entry.hop] + entry.offset).tolist())
        shared = sum(min((abs(beat - other) for other in own), default=99) <= 1 for beat in beats[0].tolist())
        yield Entry("2019, Figure 12: hops that keep the beat", "the hop has the beats of source and destination",
                    f"hop {clips[entry.hop].name} at offset {entry.offset}: {shared} of {len(beats[0])} beats of the source lie on beats of the hop",
                    "segue one-hop build CLIPS --on-beat --out X.npz",
                    "Beats are estimated from the motions, which were danced to no common music as the paper's were: only the beat at which the clips are aligned is shared.", self.files("2019_12"))  # fmt: skip


FIGURES = {
    "2003": ("cost_matrices", "joint_weights", "character", "ratings"),
    "2004": ("transition", "blend_costs", "two_lengths", "session"),
    "2019": ("one_hop", "beats"),
}
"""The parts of each paper that are made without the others, methods of `Papers`."""


def entries_of(part: str, library: str) -> list[Entry]:
    """The entries of one part, made in a folder that is gone afterwards."""
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as folder:
        return list(getattr(Papers(library, Path(folder)), part)())


PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>The figures of three papers</title>
<style>body {{ font: 15px/1.5 system-ui, sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem; color: #1d2328 }}
h2 {{ font-size: 1.1rem; margin-top: 2.5rem; border-top: 1px solid #dfe4e7; padding-top: 1rem }}
table {{ border-spacing: 0 }} th {{ text-align: left; vertical-align: top; padding-right: 1rem; white-space: nowrap; color: #5b666e }}
code {{ font-size: 12px; overflow-wrap: anywhere }} img {{ max-width: 100%; display: block; margin: .6rem 0 }}</style>
<h1>Figures and tables of three papers</h1><p>{intro}</p>{entries}</html>
"""


def as_html(entries: list[Entry], intro: str) -> str:
    """The page, with its pictures inside."""
    parts = []
    for one in entries:
        rows = {"in the paper": one.printed, "here": one.found, "differs": one.differs}
        cells = "".join(f"<tr><th>{name}</th><td>{html.escape(text)}</td></tr>" for name, text in rows.items() if text)
        cells += f"<tr><th>command</th><td><code>{html.escape(one.command)}</code></td></tr>"
        pictures = "".join(
            f'<img alt="{html.escape(one.what)}" src="data:image/png;base64,{base64.b64encode(content).decode()}">'
            for _, content in one.pictures
        )
        parts.append(f"<h2>{html.escape(one.what)}</h2><table>{cells}</table>{pictures}")
    return PAGE.format(intro=html.escape(intro), entries="".join(parts))


def as_markdown(entries: list[Entry]) -> str:
    """The same in short, for docs/papers.md."""
    rows = ["| figure or table | in the paper | here | what differs |", "|---|---|---|---|"]
    rows += [
        "| " + " | ".join(text.replace("|", "\\|") for text in (one.what, one.printed, one.found, one.differs)) + " |"
        for one in entries
    ]
    return "\n".join(rows) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--library", default="synthetic", help="a folder with the CMU's motions (default: synthetic)")
    parser.add_argument("--out", type=Path, default=Path("results/papers"))
    parser.add_argument("--only", default="2003,2004,2019", help="papers, with commas between")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument(
        "--cluster", help="a Dask scheduler, whose workers have this folder on their PYTHONPATH, and the library"
    )
    given = parser.parse_args()
    parts = [part for name, those in FIGURES.items() if name in given.only.split(",") for part in those]
    entries: list[Entry] = []
    make = partial(entries_of, library=given.library)
    for _, those in run_jobs(make, parts, given.cluster or given.workers, in_order=True):
        for entry in those:
            print(f"{entry.what}\n    paper: {entry.printed}\n    here:  {entry.found}", flush=True)
            for name, content in entry.pictures:
                write_whole(given.out / "figures" / name, content)
        entries += those
    papers = open_library(given.library)
    intro = f"Motions: {'synthetic' if papers.synthetic else given.library}. {papers.acknowledgement or ''} Made by benchmarks/papers.py."
    write_whole(given.out / "papers.html", as_html(entries, intro))
    write_whole(given.out / "papers.md", as_markdown(entries))
    print(given.out / "papers.html")


if __name__ == "__main__":
    main()
