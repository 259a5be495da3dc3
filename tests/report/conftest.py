"""A small results folder: protocol, manifest, tiny videos, and answers of simulated observers."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from study.experiment.protocol.whole import Protocol, load_protocol
from study.experiment.simulation import simulate
from study.experiment.stimuli.manifest import MANIFEST_VERSION, read_manifest
from study.experiment.stimuli.stimulus import MotionUse, StimulusRecord
from study.experiment.store.responses import open_responses
from study.tasks.registry import task_of
from study.tasks.trial import Pair

sys.path.insert(0, str(Path(__file__).parent))  # tests are imported by path, without packages

PROTOCOL = """
name = "small"
title = "A small study"
source = "Wang and Bodenheimer 2004, section 4"
fps = 30
seed = 1

[stimuli]
width = 160
height = 120

[analysis]
alpha = 0.01

[[transitions]]
name = "walking"
category = "walking"
source = "walk"
destination = "walk_fast"

[[transitions]]
name = "standing_to_walking"
category = "standing to walking"
source = "stand"
destination = "walk"

[[studies]]
name = "jnd"
title = "Just noticeable difference"
task = "same-different"
instructions = ""
reference = "geodesic"
differences_frames = [-15, -10, -5, 0, 5, 10, 20]
order = "both"

[[studies]]
name = "geodesic_vs_fixed"
title = "Geodesic against fixed"
task = "preference"
instructions = ""
reference = "geodesic"
comparison = "fixed"

[[studies]]
name = "naturalness"
task = "rating"
instructions = ""
reference = "geodesic"
comparison = "fixed"
order = "random"
items = [{ name = "natural", question = "How natural?" }]
"""


def write_video(path: Path, frames: int = 40, size: tuple[int, int] = (160, 120)) -> None:
    """A dark bar that walks across a white ground."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=30)
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        for frame in range(frames):
            picture = np.full((size[1], size[0], 3), 250, dtype=np.uint8)
            picture[30:100, 10 + 2 * frame : 22 + 2 * frame] = 40
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode(None))


def _record(transition: str, method: str, difference: int, synthetic: bool) -> StimulusRecord:
    optimal = 20 if method == "geodesic" else 10
    blend = optimal + difference
    use = MotionUse("walk", "35_01.amc", 60, 300, 0, 24, ("24 frames added after it, 2 gait cycles",))
    return StimulusRecord(
        id=f"{transition}-{method}-{difference}".ljust(64, "0"),
        transition=transition,
        category=transition.replace("_", " "),
        method=method,
        optimal_frames=optimal,
        difference_frames=difference,
        blend_frames=blend,
        frames=120 + blend,
        blend_start=60,
        blend_stop=60 + blend,
        source=use,
        destination=use,
        group=transition,
        synthetic=synthetic,
    )


def _pairs(protocol: Protocol, record: Callable[[str, str, int], StimulusRecord]) -> list[Pair]:
    pairs = []
    for study in protocol.studies:
        for transition in protocol.transitions_of(study):
            base = (study.name, study.task, transition.name, transition.category)
            a = record(transition.name, study.reference, 0)
            for difference in study.differences_frames:
                b = record(transition.name, study.reference, difference)
                name = f"{study.name}/{transition.name}/{difference:+d}"
                pairs.append(Pair(name, *base, (a.id, b.id), (study.reference, study.reference), difference))
            if study.comparison:
                b = record(transition.name, study.comparison, 0)
                name = f"{study.name}/{transition.name}"
                if task_of(study).slots > 1:
                    pairs.append(Pair(name, *base, (a.id, b.id), (study.reference, study.comparison)))
                else:
                    pairs.append(Pair(f"{name}/a", *base, (a.id,), (study.reference,)))
                    pairs.append(Pair(f"{name}/b", *base, (b.id,), (study.comparison,)))
    return pairs


def make_results(
    folder: Path,
    participants: int = 4,
    *,
    synthetic: bool = True,
    title: str = "A small study",
    videos: int = 2,
    edit: Callable[[str], str] = str,
) -> Path:
    """Make a results folder, with as many simulated participants as asked for; `edit` changes the protocol's text."""
    (folder / "stimuli").mkdir(parents=True)
    text = edit(PROTOCOL.replace("A small study", title))
    (folder / "protocol.toml").write_text(text, encoding="utf-8")
    protocol = load_protocol(folder / "protocol.toml")
    records: dict[str, StimulusRecord] = {}

    def record(transition: str, method: str, difference: int) -> StimulusRecord:
        made = _record(transition, method, difference, synthetic)
        return records.setdefault(made.id, made)

    pairs = _pairs(protocol, record)
    stimuli: list[dict[str, Any]] = []
    for place, entry in enumerate(records.values()):
        video = None
        if place < videos or (entry.difference_frames == 20 and videos):
            name = f"stimuli/{entry.id}.mp4"
            write_video(folder / name)
            video = {"file": name, "frames": 40, "frames_sha256": "0", "file_sha256": "0", "bytes": 1}
        stimuli.append({**asdict(entry), "video": video})
    manifest = {
        "version": MANIFEST_VERSION,
        "protocol": protocol.name, "title": protocol.title, "protocol_sha256": protocol.sha256,
        "library": "synthetic" if synthetic else "cmu", "synthetic": synthetic,
        "acknowledgement": "" if synthetic else "The data used in this project was obtained from mocap.cs.cmu.edu.",
        "fps": 30.0, "size": [160, 120], "style": "mannequin", "versions": {"segue": "0.1.0", "numpy": "2.0"},
        "cameras": {}, "pairs": [asdict(pair) for pair in pairs], "stimuli": stimuli,
    }  # fmt: skip
    (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    with open_responses(folder) as responses:
        if participants:
            simulate(protocol, read_manifest(folder), responses, participants, seed=3)
    return folder


@pytest.fixture(scope="session")
def any_folder() -> Callable[..., Path]:
    """`make_results`, for fixtures that several tests share."""
    return make_results


@pytest.fixture
def results_folder(tmp_path: Path) -> Callable[..., Path]:
    """A function that makes a results folder, see `make_results`."""
    return partial(make_results, tmp_path / "small")


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of four simulated participants, for tests that only read it."""
    from study.report.document import write_report

    return write_report(make_results(tmp_path_factory.mktemp("written") / "small"), resamples=50)
