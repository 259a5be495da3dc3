"""The runtime: frames where the table says, bodies that don't jump, triggers that are refused."""

from __future__ import annotations

import numpy as np
import pytest

from study.errors import TransitionError
from study.motion.clip import Clip, joint_positions, moved
from study.motion.synthetic import synthesize
from study.transitions.one_hop.build import build_table
from study.transitions.one_hop.play import Trigger, crossfade, play
from study.transitions.one_hop.problem import Alignment, PointCloudDistance, Problem, Settings, Switch, weight_in_counts
from study.transitions.one_hop.table import OneHopTable


@pytest.fixture(scope="module")
def clips() -> tuple[Clip, ...]:
    names = ("dance", "box", "dance_turns", "walk")
    return tuple(synthesize(name, seconds=8.0, fps=30.0, seed=k) for k, name in enumerate(names))


@pytest.fixture(scope="module")
def table(clips: tuple[Clip, ...]) -> OneHopTable:
    distance = PointCloudDistance()
    switches = (
        Switch(0, 1, Alignment(offset=0)),
        Switch(1, 2, Alignment(destination_frame=20)),
        Switch(2, 0, Alignment(destination_frame=0)),
    )
    return build_table(Problem(clips, switches, Settings.at(30.0), weight_in_counts(3e-4, distance), distance))


def step_sizes(clip: Clip) -> np.ndarray:
    return np.linalg.norm(np.diff(joint_positions(clip), axis=0), axis=-1).max(axis=1)


def test_each_segment_shows_its_clip_at_the_frames_of_the_table(clips: tuple[Clip, ...], table: OneHopTable) -> None:
    played = play(clips, table, [Trigger(40, 1), Trigger(140, 2)])
    entry = table.look_up(0, 1, 40)
    assert entry is not None
    assert played.entries[0] == entry
    state, blend, *_ = played.segments
    assert (state.kind, state.stop) == ("state", 40 + entry.stay_source)
    assert (blend.kind, blend.clip, blend.clip_start) == ("blend", entry.hop, 40 + entry.stay_source - entry.offset)
    assert played.clip.frames == played.segments[-1].stop
    for before, after in zip(played.segments, played.segments[1:], strict=False):
        assert before.stop == after.start
    for segment in played.segments:
        if segment.kind != "blend":  # local rotations are the clip's own, wherever it was placed
            stop = segment.clip_start + segment.stop - segment.start
            own = clips[segment.clip].rotations[segment.clip_start : stop, 1:]
            shown = played.clip.rotations[segment.start : segment.stop, 1:]
            assert np.abs(np.sum(own * shown, axis=-1)).min() > 1 - 1e-9


def test_the_destination_keeps_its_place_in_time(clips: tuple[Clip, ...], table: OneHopTable) -> None:
    """Music: whatever the hop, the destination shows the frame that its alignment says."""
    for method in ("one-hop", "direct"):
        last = play(clips, table, [Trigger(40, 1)], method=method).segments[-1]
        assert last.clip == 1
        assert last.clip_start == last.start
    last = play(clips, table, [Trigger(50, 2)], first=1).segments[-1]
    assert last.clip_start - last.start == 20 - 50


def test_nothing_jumps(clips: tuple[Clip, ...], table: OneHopTable) -> None:
    usual = max(step_sizes(clip).max() for clip in clips)
    played = play(clips, table, [Trigger(40, 1), Trigger(140, 2)])
    assert step_sizes(played.clip).max() < 1.5 * usual


def test_a_long_run_with_many_triggers(clips: tuple[Clip, ...], table: OneHopTable) -> None:
    triggers = [Trigger(10, 1), Trigger(130, 2), Trigger(240, 0), Trigger(330, 1)]
    played = play(clips, table, triggers)
    assert [segment.clip for segment in played.segments if segment.kind == "state"][-1] == 1
    assert len(played.entries) == 4


def test_a_crossfade_of_a_stretch_with_itself_is_that_stretch(clips: tuple[Clip, ...]) -> None:
    whole = crossfade(clips[0], clips[0])
    assert np.allclose(whole.root_positions, clips[0].root_positions)
    assert np.abs(np.sum(whole.rotations * clips[0].rotations, axis=-1)).min() > 1 - 1e-12


def test_where_the_clips_lie_on_the_floor_does_not_matter(clips: tuple[Clip, ...], table: OneHopTable) -> None:
    elsewhere = tuple(moved(clip, k, np.array([k, 0.0, -k])) for k, clip in enumerate(clips))
    one, other = (play(each, table, [Trigger(40, 1)]).clip for each in (clips, elsewhere))
    assert np.allclose(joint_positions(one), joint_positions(other), atol=1e-9)


def test_refusals(clips: tuple[Clip, ...], table: OneHopTable) -> None:
    with pytest.raises(TransitionError, match=r"from output frame .* when .* plays alone, got 41"):
        play(clips, table, [Trigger(40, 1), Trigger(41, 2)])
    with pytest.raises(TransitionError, match=r"before output frame 240, where .* ends, got 240"):
        play(clips, table, [Trigger(240, 1)])
    with pytest.raises(TransitionError, match="where none fits in the clips"):
        play(clips, table, [Trigger(239, 1)])
    with pytest.raises(TransitionError, match="15 frames for a direct transition at frame 239"):
        play(clips, table, [Trigger(239, 1)], method="direct")
    with pytest.raises(TransitionError, match="the table's clips"):
        play(clips[:3], table, [])
    with pytest.raises(TransitionError, match="method of one-hop or direct, got 'cut'"):
        play(clips, table, [], method="cut")
