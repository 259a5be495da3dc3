"""Rendering: videos once, a manifest that says what they are, and work that is taken up after any interruption."""

from __future__ import annotations

import hashlib
import itertools
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from toys import TOY_PROTOCOL, Toy, ToyLibrary

from study.errors import FileError, StimulusError
from study.experiment.protocol.whole import load_protocol, parse_protocol
from study.experiment.stimuli import manifest
from study.experiment.stimuli.manifest import made_from, read_manifest, record
from study.experiment.stimuli.prepare import prepare
from study.experiment.stimuli.rendering import render, rendered_already, rendered_before
from study.experiment.stimuli.stimulus import StimulusSet

MOTIONS = {"slow": Toy(0.8, 1.4), "quick": Toy(1.6, 0.9), "still": Toy(0.0, 3.0)}

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def prepared() -> StimulusSet:
    return prepare(parse_protocol(TOY_PROTOCOL), ToyLibrary(MOTIONS))


@pytest.fixture(scope="module")
def rendered(prepared: StimulusSet, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A results folder that is complete; tests copy what they change."""
    folder = tmp_path_factory.mktemp("rendered")
    summary = render(prepared, folder, workers=1)
    return folder, summary


def files(folder: Path) -> dict[Any, Any]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def pictures(folder: Path) -> dict[Any, Any]:
    """Hashes of the videos' frames; checks that the files are those of the manifest and nothing else is there.

    Files aren't compared byte by byte: the encoder's bytes may differ from run to run where its pictures do not.
    """
    manifest = read_manifest(folder)
    assert manifest.complete
    videos = {name: content for name, content in files(folder).items() if name.startswith("stimuli/")}
    assert set(videos) == {video["file"] for video in manifest.videos.values()}
    for video in manifest.videos.values():
        assert hashlib.sha256(videos[video["file"]]).hexdigest() == video["file_sha256"]
    assert set(files(folder)) - set(videos) == {"manifest.json", "protocol.toml"}
    return {name: video["frames_sha256"] for name, video in manifest.videos.items()}


def frames_in(path: Path) -> Any:
    import av

    with av.open(str(path)) as container:
        return sum(1 for _ in container.decode(video=0))


def copied(rendered: Any, tmp_path: Path) -> Any:
    for name, content in files(rendered[0]).items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    return tmp_path


def test_everything_is_rendered_once(prepared: StimulusSet, rendered: Any) -> None:
    folder, summary = rendered
    count = len(prepared.stimuli)
    assert (summary.videos, summary.rendered, summary.reused) == (count, count, 0)
    assert summary.frames == sum(record.frames for record in prepared.records)
    assert summary.seconds == pytest.approx(summary.frames / 30.0)
    assert sorted(path.name for path in (folder / "stimuli").iterdir()) == sorted(
        f"{s.id}.mp4" for s in prepared.stimuli
    )


def test_the_folder_holds_the_protocol_as_run(prepared: StimulusSet, rendered: Any) -> None:
    stored = load_protocol(rendered[0] / "protocol.toml")
    assert stored.text == prepared.protocol.text
    assert stored.sha256 == prepared.protocol.sha256


def test_the_manifest_says_what_each_stimulus_is(prepared: StimulusSet, rendered: Any) -> None:
    folder, _ = rendered
    manifest = read_manifest(folder)
    assert manifest.complete
    assert manifest.records == prepared.records
    assert manifest.pairs == prepared.pairs
    assert (manifest.library, manifest.synthetic, manifest.acknowledgement) == ("toy", True, "made up for tests")
    assert (manifest.protocol, manifest.protocol_sha256) == ("toy", prepared.protocol.sha256)
    assert (manifest.fps, manifest.size) == (30.0, (96, 64))
    for stimulus in prepared.stimuli:
        video, path = manifest.videos[stimulus.id], manifest.video(stimulus.id)
        assert hashlib.sha256(path.read_bytes()).hexdigest() == video["file_sha256"]
        assert path.stat().st_size == video["bytes"]
        assert video["frames"] == stimulus.record.frames
        assert len(video["frames_sha256"]) == 64
    data = json.loads((folder / "manifest.json").read_text())
    assert set(data["versions"]) >= {"segue", "python", "numpy"}
    assert set(data["cameras"]) == {"slow_quick", "still_slow"}


def test_videos_hold_their_frames(prepared: StimulusSet, rendered: Any) -> None:
    import av

    stimulus = prepared.stimuli[0]
    with av.open(str(read_manifest(rendered[0]).video(stimulus.id))) as container:
        frames = [frame.to_ndarray(format="gray") for frame in container.decode(video=0)]
    assert len(frames) == stimulus.record.frames
    assert frames[0].shape == (64, 96)
    # A figure stands before a plain ground.
    assert len({int(value) for value in frames[0].ravel()}) > 10


def test_running_again_reuses_all(prepared: StimulusSet, rendered: Any, tmp_path: Path) -> None:
    folder = copied(rendered, tmp_path)
    before = files(folder)
    summary = render(prepared, folder, workers=1)
    assert (summary.rendered, summary.reused) == (0, len(prepared.stimuli))
    assert files(folder) == before


@pytest.mark.parametrize("damage", ["missing", "short", "changed"])
def test_damaged_videos_are_rendered_again(prepared: StimulusSet, rendered: Any, tmp_path: Path, damage: str) -> None:
    folder = copied(rendered, tmp_path)
    victim = folder / "stimuli" / f"{prepared.stimuli[1].id}.mp4"
    content = victim.read_bytes()
    if damage == "missing":
        victim.unlink()
    elif damage == "short":
        victim.write_bytes(content[:-100])
    else:
        victim.write_bytes(content[:200] + bytes([content[200] ^ 1]) + content[201:])
    summary = render(prepared, folder, workers=1)
    assert (summary.rendered, summary.reused) == (1, len(prepared.stimuli) - 1)
    assert pictures(folder) == pictures(rendered[0])


def test_recording_makes_the_manifest_without_videos(prepared: StimulusSet, tmp_path: Path) -> None:
    assert record(prepared, tmp_path) == {}
    manifest = read_manifest(tmp_path)
    assert not manifest.complete
    assert manifest.pairs == prepared.pairs
    with pytest.raises(StimulusError, match=r"Expected a video of .* found none yet; render first"):
        manifest.video(prepared.stimuli[0].id)


def test_progress_tells_what_is_done_and_left(prepared: StimulusSet, tmp_path: Path) -> None:
    seen = []
    render(prepared, tmp_path, workers=1, progress=seen.append)
    assert [state.videos for state in seen] == list(range(1, len(prepared.stimuli) + 1))
    assert seen[-1].frames == seen[-1].frames_total
    assert seen[0].frames_per_second > 0
    assert seen[0].seconds_left > 0


class StopHereError(Exception):
    pass


@pytest.mark.parametrize("after", [1, 3])
def test_an_interrupted_rendering_is_finished_by_running_it_again(
    prepared: StimulusSet, rendered: Any, tmp_path: Path, after: int
) -> None:
    def stop(state: Any) -> None:
        if state.videos == after:
            raise StopHereError

    with pytest.raises(StopHereError):
        render(prepared, tmp_path, workers=1, progress=stop)
    assert len(read_manifest(tmp_path).videos) == after
    summary = render(prepared, tmp_path, workers=1)
    assert summary.reused == after
    assert pictures(tmp_path) == pictures(rendered[0])


KILLED = """
import sys
sys.path.insert(0, "tests/experiment")
from toys import TOY_PROTOCOL, Toy, ToyLibrary
from study.experiment.protocol.whole import parse_protocol
from study.experiment.stimuli.prepare import prepare
from study.experiment.stimuli.rendering import render
motions = {"slow": Toy(0.8, 1.4), "quick": Toy(1.6, 0.9), "still": Toy(0.0, 3.0)}
prepared = prepare(parse_protocol(TOY_PROTOCOL), ToyLibrary(motions))
print("ready", flush=True)
render(prepared, sys.argv[1], 1, lambda state: print(state.videos, flush=True))
"""


def test_a_killed_rendering_is_finished_by_running_it_again(
    prepared: StimulusSet, rendered: Any, tmp_path: Path, repository: Path
) -> None:
    """SIGKILL before the first video and in the midst of others: nothing half written, no doubles."""
    for lines, delay in ((1, 0.02), (2, 0.05)):
        child = subprocess.Popen(
            [sys.executable, "-c", KILLED, str(tmp_path)], cwd=repository, stdout=subprocess.PIPE, text=True
        )
        for _ in range(lines):
            child.stdout.readline()
        time.sleep(delay)
        os.kill(child.pid, signal.SIGKILL)
        child.stdout.read()
        child.stdout.close()
        child.wait()
        for path in tmp_path.glob("stimuli/*.mp4"):
            assert frames_in(path) == next(r.frames for r in prepared.records if r.id == path.stem)
        if (tmp_path / "manifest.json").exists():
            read_manifest(tmp_path)
    render(prepared, tmp_path, workers=1)
    assert pictures(tmp_path) == pictures(rendered[0])


def test_a_folder_of_another_protocol_or_library_is_refused(prepared: StimulusSet, rendered: Any) -> None:
    folder = rendered[0]
    other = replace(prepared, protocol=parse_protocol(TOY_PROTOCOL + "# changed\n"))
    with pytest.raises(StimulusError, match=r"expected the results of 'toy' with sha256 \w+, found a\s+protocol.toml"):
        render(other, folder)
    with pytest.raises(StimulusError, match="expected stimuli from the library 'mine', found some from 'toy'"):
        render(replace(prepared, library="mine", stimuli=prepared.stimuli[1:]), folder)


def test_a_library_may_be_elsewhere_when_its_motions_are_the_same(
    prepared: StimulusSet, rendered: Any, tmp_path: Path
) -> None:
    """On another machine, or under another spelling of the folder."""
    folder = copied(rendered, tmp_path)
    summary = render(replace(prepared, library="elsewhere/toy"), folder)
    assert (summary.rendered, summary.reused) == (0, rendered[1].videos)
    assert read_manifest(folder).library == "elsewhere/toy"


def test_a_folder_that_is_rendered_whole_can_be_shown_without_its_motions(rendered: Any, tmp_path: Path) -> None:
    folder = copied(rendered, tmp_path)
    protocol = parse_protocol(TOY_PROTOCOL)
    assert rendered_before(protocol, folder) == read_manifest(folder)
    assert rendered_before(parse_protocol(TOY_PROTOCOL + "\n# changed\n"), folder) is None
    assert rendered_before(protocol, tmp_path / "nothing") is None
    video = next((folder / "stimuli").glob("*.mp4"))
    video.write_bytes(video.read_bytes()[:-1])
    assert rendered_before(protocol, folder) is None


def test_stimuli_that_were_answered_to_are_not_replaced(prepared: StimulusSet, tmp_path: Path) -> None:
    """Without answers a folder takes the new stimuli of the same protocol; with answers it keeps the old ones."""
    record(prepared, tmp_path)
    fewer = replace(prepared, stimuli=prepared.stimuli[1:])
    record(fewer, tmp_path)
    assert read_manifest(tmp_path).records == fewer.records
    (tmp_path / "responses.sqlite").write_bytes(b"")
    with pytest.raises(StimulusError, match="expected the stimuli that answers were given to, found 1 that differ"):
        record(prepared, tmp_path)
    assert read_manifest(tmp_path).records == fewer.records
    record(fewer, tmp_path)


def test_what_is_no_results_folder_is_refused(prepared: StimulusSet, tmp_path: Path) -> None:
    with pytest.raises(StimulusError, match="expected the manifest of a results folder, found none; render first"):
        read_manifest(tmp_path)
    (tmp_path / "manifest.json").write_text("{")
    with pytest.raises(StimulusError, match="expected JSON"):
        read_manifest(tmp_path)
    (tmp_path / "manifest.json").write_text('{"version": 99}')
    with pytest.raises(StimulusError, match="expected a manifest of version 2 or older, found 99"):
        read_manifest(tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="expected a folder to write to"):
        render(prepared, tmp_path / "file")


def test_what_is_complete_and_unchanged_needs_no_building(rendered: Any, tmp_path: Path) -> None:
    folder = copied(rendered, tmp_path)
    protocol, library = parse_protocol(TOY_PROTOCOL), ToyLibrary(MOTIONS)
    done = rendered_already(protocol, library, folder)
    assert done == replace(rendered[1], rendered=0, reused=rendered[1].videos)
    assert rendered_already(parse_protocol(TOY_PROTOCOL + "\n# changed\n"), library, folder) is None
    assert rendered_already(protocol, library, tmp_path / "elsewhere") is None


def test_the_program_is_found_wherever_its_modules_stand() -> None:
    import renderer.window
    import study.motion.clip

    found = set(manifest.program_files())
    assert {Path(module.__file__).resolve() for module in (manifest, renderer.window, study.motion.clip)} <= found


def test_what_python_compiles_meanwhile_changes_nothing() -> None:
    protocol, library = parse_protocol(TOY_PROTOCOL), ToyLibrary(MOTIONS)
    before = made_from(protocol, library)
    compiled = Path(manifest.__file__).parent / "__pycache__" / "manifest.cpython-311.pyc.139872"
    compiled.parent.mkdir(exist_ok=True)
    try:
        compiled.write_bytes(b"half written")
        assert made_from(protocol, library) == before
    finally:
        compiled.unlink()


def test_a_changed_motion_file_or_a_damaged_video_is_noticed(
    prepared: StimulusSet, rendered: Any, tmp_path: Path
) -> None:
    folder = copied(rendered, tmp_path)
    protocol, library = parse_protocol(TOY_PROTOCOL), ToyLibrary(MOTIONS)
    motion = tmp_path / "walk.bvh"
    motion.write_text("HIERARCHY", encoding="utf-8")
    library.files = lambda: (motion,)
    assert rendered_already(protocol, library, folder) is None
    video = next((folder / "stimuli").glob("*.mp4"))
    video.write_bytes(video.read_bytes()[:-1])
    assert rendered_already(protocol, ToyLibrary(MOTIONS), folder) is None
    assert render(prepared, folder, workers=1).rendered == 1
    assert rendered_already(protocol, ToyLibrary(MOTIONS), folder) is not None


def test_a_manifest_that_lacks_a_key_or_holds_something_else_is_refused_by_its_place(
    prepared: StimulusSet, tmp_path: Path
) -> None:
    record(prepared, tmp_path)
    path = tmp_path / "manifest.json"
    whole = json.loads(path.read_text())
    keyed = [("fps",), ("size",), ("versions",), ("stimuli", 0, "source", "frame"), ("pairs", 0, "name")]
    for keys, value in [
        *itertools.product(keyed, ("gone", None, [], -1.5)),
        (("pairs",), "gone"),
        (("stimuli",), None),
    ]:
        changed = json.loads(json.dumps(whole))
        at = changed
        for key in keys[:-1]:
            at = at[key]
        if value == "gone":
            del at[keys[-1]]
        else:
            at[keys[-1]] = value
        path.write_text(json.dumps(changed))
        with pytest.raises(StimulusError, match=rf"expected what Segue wrote, found {'.'.join(map(str, keys))}"):
            read_manifest(tmp_path)
    for text in ("[]", "null", '"x"', "{}", json.dumps(whole)[:-9], "\x00"):
        path.write_text(text)
        with pytest.raises(StimulusError, match="expected JSON of a manifest"):
            read_manifest(tmp_path)
    path.write_text(json.dumps(whole))
    assert read_manifest(tmp_path).records == prepared.records
