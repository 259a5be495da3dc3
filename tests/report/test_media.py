"""Pictures of the page: the same from a process of their own as from this one, and never a reason to fail."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from study.experiment.stimuli.manifest import Manifest, read_manifest
from study.report import media

MakeFolder = Callable[..., Path]


@pytest.fixture
def manifest(results_folder: MakeFolder) -> Manifest:
    return read_manifest(results_folder(1, videos=2))


def refuse(_: Manifest) -> media.Pictures:
    raise AssertionError("made in this process")


def test_a_process_of_its_own_makes_the_same_pictures(manifest: Manifest, monkeypatch: pytest.MonkeyPatch) -> None:
    here = media.embed(manifest)
    assert here.strips
    assert here.videos
    monkeypatch.setattr(media, "embed", refuse)
    with media.embedding(manifest) as pictures:
        assert pictures() == here


@pytest.mark.parametrize("python", ["/nowhere/python", "/bin/false"])
def test_without_such_a_process_they_are_made_here(
    manifest: Manifest, monkeypatch: pytest.MonkeyPatch, python: str
) -> None:
    monkeypatch.setattr(sys, "executable", python)
    with media.embedding(manifest) as pictures:
        assert pictures() == media.embed(manifest)


def test_the_process_ends_with_what_it_was_for(manifest: Manifest, monkeypatch: pytest.MonkeyPatch) -> None:
    started = []
    popen = media.subprocess.Popen

    def start(*arguments: object, **options: object) -> object:
        started.append(popen(*arguments, **options))
        return started[0]

    monkeypatch.setattr(media.subprocess, "Popen", start)
    with pytest.raises(RuntimeError, match="analysis"), media.embedding(manifest):
        raise RuntimeError("the analysis failed")
    assert started[0].returncode is not None
