"""Flaws of stimuli: in the record of each, in the manifest, and the worst in words."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from toys import TOY_PROTOCOL, Toy, ToyLibrary

from study.experiment.protocol.whole import parse_protocol
from study.experiment.stimuli.flawed import flaw_notes, flawed
from study.experiment.stimuli.manifest import read_manifest, record
from study.experiment.stimuli.prepare import prepare
from study.experiment.stimuli.stimulus import StimulusRecord, StimulusSet
from study.report.stimuli import flaw_tables


@pytest.fixture(scope="module")
def prepared() -> StimulusSet:
    toys = ToyLibrary({"slow": Toy(0.8, 1.4), "quick": Toy(1.6, 0.9), "still": Toy(0.0, 3.0)})
    return prepare(parse_protocol(TOY_PROTOCOL), toys)


def with_share(one: StimulusRecord, share: float) -> StimulusRecord:
    """The record with so many frames in which no foot stands, and nothing else to be told of."""
    assert one.flaws is not None
    calm = replace(
        one.flaws,
        unsupported_share=share,
        own_unsupported_share=0.02,
        joint_velocity_change_rad_per_s=0.0,
        root_velocity_change_m_per_s=0.0,
        left=replace(one.flaws.left, sink_m=0.0, toe_acceleration_m_per_s2=0.0),
        right=replace(one.flaws.right, sink_m=0.0, toe_acceleration_m_per_s2=0.0),
    )
    return replace(one, flaws=calm)


def test_every_stimulus_is_measured_and_the_manifest_keeps_it(prepared: StimulusSet, tmp_path: Path) -> None:
    assert all(one.flaws is not None and one.holds_feet for one in prepared.records)
    record(prepared, tmp_path)
    manifest = read_manifest(tmp_path)
    assert [one.flaws for one in manifest.records] == [one.flaws for one in prepared.records]
    (table,) = flaw_tables(manifest)
    assert len(table.rows) == len(prepared.records)


def test_manifests_from_before_there_was_a_measure_are_read(prepared: StimulusSet, tmp_path: Path) -> None:
    record(prepared, tmp_path)
    path = tmp_path / "manifest.json"
    data = json.loads(path.read_text())
    for one in data["stimuli"]:
        del one["flaws"], one["holds_feet"]
    path.write_text(json.dumps(data))
    manifest = read_manifest(tmp_path)
    assert not list(flaw_tables(manifest))
    assert not list(flaw_notes(manifest.records))


def test_the_worst_are_named_first_and_the_rest_counted(prepared: StimulusSet) -> None:
    shares = [0.02, 0.05, 0.2, 0.5, 0.3, 0.4]
    records = [with_share(one, share) for one, share in zip(prepared.records, shares, strict=True)]
    assert flawed(records) == [records[3], records[5], records[4], records[2]]
    (note,) = flaw_notes(records)
    assert note.startswith("4 of 6 stimuli move as their motions don't")
    worst = records[3]
    assert f"{worst.transition}, {worst.method}, {worst.blend_frames} frames: no foot stands in 50% of" in note
    assert note.endswith("; and 1 more.")


def test_what_is_left_in_on_purpose_is_not_named(prepared: StimulusSet) -> None:
    records = [replace(with_share(one, 1.0), holds_feet=False) for one in prepared.records]
    assert not flawed(records)
    assert not list(flaw_notes(records))
