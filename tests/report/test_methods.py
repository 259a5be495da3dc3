"""The methods say what was run, and cite what was used."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from study.analysis.analyse import analyse
from study.analysis.study_result import Settings
from study.experiment.protocol.whole import parse_protocol
from study.report.material import Material, gather
from study.report.methods import methods_paragraphs, references

MakeFolder = Callable[..., Path]


def paragraphs(material: Material) -> tuple[dict[str, str], list[str]]:
    """The methods by heading, and the references."""
    analysis = analyse(material.answers, Settings(resamples=10))
    who = "two observers"
    told = methods_paragraphs(material.protocol, material.manifest, analysis, material.presentations, who)
    return dict(told), references(material.protocol, analysis)


def test_methods_follow_from_the_protocol(results_folder: MakeFolder) -> None:
    def edit(text: str) -> str:
        return text.replace("height = 120\n", "height = 120\nfloor = true\ntrack_s = 0.5\nentry_s = 1.5\n")

    material = gather(results_folder(2, videos=0, edit=edit))
    told, cited = paragraphs(material)
    assert told["Participants and design"].startswith("Two observers took part in one session of 3 studies.")
    assert (
        "differ from their length by −15, −10, −5, 0, +5, +10, +20 frames. Each pair was shown in both orders."
        in told["Participants and design"]
    )
    assert "blends of 10 frames" in told["Participants and design"]
    assert "They were asked: “Were the two motions the same or different?”" in told["Participants and design"]
    assert re.match(r"\d+ stimuli of 2 transitions between synthetic motions were blended", told["Stimuli"])
    assert re.search(r"Blends were \d+ to \d+ frames long\.", told["Stimuli"])
    assert "a camera following it (smoothed over 0.5 s) above a ground plane, with 1.5 s before" in told["Stimuli"]
    assert "No stimulus was shown: observers were simulated." in told["Apparatus and procedure"]
    assert "those of the median observer" in told["Analysis"]
    assert told["Exclusions"].startswith("No rule of exclusion was preregistered")
    assert material.protocol.sha256[:12] in told["Software"]
    assert any(work.startswith("Macmillan") for work in cited)
    assert cited == sorted(cited)


@pytest.mark.parametrize("cuts", ["none", "some", "all"])
def test_cuts_are_not_called_blends(results_folder: MakeFolder, cuts: str) -> None:
    material = gather(results_folder(2, videos=0))
    shown = tuple(
        replace(record, blend_frames=0) if cuts == "all" or (cuts == "some" and record.method == "fixed") else record
        for record in material.manifest.records
    )
    told, _ = paragraphs(replace(material, manifest=replace(material.manifest, records=shown)))
    assert ("were blended by spherical linear" in told["Stimuli"]) == (cuts != "all")
    assert ("(cuts were not blended)" in told["Stimuli"]) == (cuts == "some")
    assert ("were cuts from a frame" in told["Stimuli"]) == (cuts == "all")


def test_works_whose_methods_were_not_used_are_not_cited(results_folder: MakeFolder) -> None:
    def edit(text: str) -> str:
        start, end = text.index('[[studies]]\nname = "jnd"'), text.index('[[studies]]\nname = "geodesic_vs_fixed"')
        return text[:start] + text[end:]

    _, cited = paragraphs(gather(results_folder(2, videos=0, edit=edit)))
    assert not any(work.startswith(("Macmillan", "Fieller", "Koyama", "Bradley")) for work in cited)
    assert any(work.startswith("Schuirmann") for work in cited)


def test_own_methods_are_described_by_their_parts_and_settings(results_folder: MakeFolder) -> None:
    def edit(text: str) -> str:
        own = (
            '\n[[methods]]\nname = "eased_in"\nmake = "slerp"\nlength = "fixed"\nfixed_frames = 7\nweight = "sigmoid"\n'
        )
        return text.replace('comparison = "fixed"', 'comparison = "eased_in"') + own + "clean_feet = false\n"

    told, cited = paragraphs(gather(results_folder(2, videos=0, edit=edit)))
    words = "“eased in” (blends of 7 frames; sigmoid weight, sliding of planted feet left in)"
    assert f"blends as long as the geodesic distance gives (2004) and {words}" in told["Participants and design"]
    assert "under a linear or sigmoid weight" in told["Stimuli"]
    assert "so that feet that bear weight stand, if the method includes this." in told["Stimuli"]
    assert any(work.startswith("Shoemake") for work in cited)


def test_given_transitions_are_not_called_blends(results_folder: MakeFolder) -> None:
    material = gather(results_folder(2, videos=0))
    given = '\n[[methods]]\nname = "ours"\nmake = "given"\nwords = "blends by our network"\nsource = "Doe (2026)."\n'
    given += "[methods.files]\n"
    files = "".join(
        f'{one.name} = {{ file = "{one.name}.bvh", start_frame = 3, end_frame = 9 }}\n'
        for one in material.protocol.transitions
    )
    protocol = parse_protocol(
        material.protocol.text.replace('comparison = "fixed"', 'comparison = "ours"') + given + files
    )
    named = [replace(one, method="ours") if one.method == "fixed" else one for one in material.manifest.records]
    shown = replace(material.manifest, records=tuple(named))
    told, cited = paragraphs(replace(material, protocol=protocol, manifest=shown))
    assert "and “ours” (blends by our network)" in told["Participants and design"]
    assert "Doe (2026)." in cited
    assert "under a linear weight" in told["Stimuli"]
    assert "Those by “ours” were read from motion files." in told["Stimuli"]
    alone = replace(material.manifest, records=tuple(one for one in named if one.method == "ours"))
    told, _ = paragraphs(replace(material, protocol=protocol, manifest=alone))
    assert "motions were shown. Those by “ours” were read from motion files. Each was rendered" in told["Stimuli"]
    assert "after the transition." in told["Stimuli"]


def test_what_makes_stimuli_alike_and_their_size_are_told(results_folder: MakeFolder) -> None:
    def edit(text: str) -> str:
        keys = 'match = "duration"\nview = "least-cue"\njitter_s = 0.3\nending = "fade"\nending_s = 0.4\n'
        screen = "[screen]\nheight_degrees = 12.0\ndistance_cm = 60\n\n"
        return text.replace("height = 120\n", f"height = 120\n{keys}").replace("[analysis]", f"{screen}[analysis]")

    told, _ = paragraphs(gather(results_folder(2, videos=0, edit=edit)))
    for words in (
        "from the side from which the stimuli of a pair began and ended most alike.",
        "took equally long, with their blends around the same moment",
        "of at most 0.3 s.",
        "faded into the background in the last 0.4 s.",
        "was 12 degrees of visual angle high.",
    ):
        assert words in told["Stimuli"]
