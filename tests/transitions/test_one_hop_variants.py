"""Variants of the search: beats, genres, ends that don't overlap, body parts, blends of their own length, chains."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from walks import make_walk

from study.errors import TransitionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions, moved, trim
from study.motion.skeleton import Skeleton
from study.motion.synthetic import synthesize
from study.transitions.blending import facing
from study.transitions.one_hop import beats as on_beat
from study.transitions.one_hop.adaptive import StrainDistance, adaptive
from study.transitions.one_hop.build import build_table
from study.transitions.one_hop.chains import find_chains
from study.transitions.one_hop.connect import connect
from study.transitions.one_hop.parts import part_joints, part_weights, put_together
from study.transitions.one_hop.play import Step, Trigger, play, play_steps
from study.transitions.one_hop.problem import Alignment, PointCloudDistance, Problem, Settings, Switch
from study.transitions.one_hop.reach import Wanted, reach
from study.transitions.point_cloud import alignment as align

DISTANCE = PointCloudDistance()


def turning(frames: int, seed: int, fps: float = 30.0) -> Clip:
    """A leg that swings, on the roles that the weights of 2003 need."""
    rng = np.random.default_rng(seed)
    names, parents = ["Hips"], [-1]
    for side in ("Left", "Right"):
        for part in ("UpLeg", "Leg", "Arm", "ForeArm"):
            parents.append(0 if part in ("UpLeg", "Arm") else len(names) - 1)
            names.append(side + part)
    skeleton = Skeleton(
        tuple(names), np.array(parents), rng.uniform(-0.3, 0.3, (9, 3)), np.zeros(0, dtype=np.int64), np.zeros((0, 3))
    )
    turns = 0.15 * np.cumsum(rng.standard_normal((frames, 9, 3)), axis=0)
    path = np.cumsum(rng.standard_normal((frames, 3)) * 0.03, axis=0)
    return Clip(skeleton, path, quat.exp(turns), fps, f"turning {seed}")


def one_rig(*lengths: int) -> tuple[Clip, ...]:
    clips = [turning(length, k) for k, length in enumerate(lengths)]
    return tuple(Clip(clips[0].skeleton, c.root_positions, c.rotations, c.fps, c.name) for c in clips)


# Beats (section 4.4)


@pytest.mark.parametrize("tempo", [84.0, 100.0, 143.0])
def test_the_tempo_of_a_dancer_is_found(tempo: float) -> None:
    """A joint that swings once in two beats comes to rest on each."""
    clip = one_rig(300)[0]
    times = np.arange(300) / 30.0
    angle = 0.6 * np.cos(np.pi * tempo / 60.0 * times)
    rotations = np.tile([1.0, 0.0, 0.0, 0.0], (300, 9, 1))
    rotations[:, 1] = quat.from_axis_angle(np.array([1.0, 0.0, 0.0]), angle)
    swinging = Clip(clip.skeleton, np.zeros((300, 3)), rotations, 30.0, "swing")
    found = on_beat.find_beats(swinging)
    expected = on_beat.regular_beats(swinging, tempo)
    inner = expected[(expected > 30) & (expected < 270)]
    assert all(np.abs(found - beat).min() <= 2 for beat in inner)
    assert len(found) == pytest.approx(len(expected), abs=1)


def test_beats_from_a_file(tmp_path: Path) -> None:
    clip = one_rig(90)[0]
    (tmp_path / "a.beats").write_text("# time beat\n0.5 1\n1.0 2\n\n1.5 3\n7.0 4\n")
    assert on_beat.read_beats(tmp_path / "a.beats", clip).tolist() == [15, 30, 45]
    (tmp_path / "b.beats").write_text("0.5\nend\n")
    with pytest.raises(TransitionError, match=r"b\.beats:2: expected a time in seconds, found 'end'"):
        on_beat.read_beats(tmp_path / "b.beats", clip)


def test_offsets_put_beats_on_beats() -> None:
    source, hop = np.array([10, 25, 40, 55, 70]), np.array([4, 19, 34])
    offsets = on_beat.beat_offsets(source, hop, tolerance=0)
    assert offsets.tolist() == [-24, -9, 6, 21, 36, 51, 66]
    for offset in offsets:
        shown = [beat + offset for beat in hop if 10 <= beat + offset <= 70]
        assert set(shown) <= set(source.tolist())
        assert shown
    assert len(on_beat.beat_offsets(source, np.array([0, 11, 22, 33]), tolerance=0)) < 5
    assert len(on_beat.beat_offsets(source, np.zeros(0, dtype=np.int64))) == 0


def test_a_beat_aware_search_uses_those_offsets_only_and_costs_no_less() -> None:
    clips = one_rig(80, 90, 70)
    beats = {number: on_beat.regular_beats(clip, 150.0, 0.1 * number) for number, clip in enumerate(clips)}
    offsets = on_beat.all_beat_offsets(beats, [0], range(3))
    settings, switches = (
        Settings(6, 12, 12),
        (Switch(0, 1, Alignment(offset=int(offsets[0, 1][len(offsets[0, 1]) // 2]))),),
    )
    free = build_table(Problem(clips, switches, settings, 100, DISTANCE))
    kept = build_table(Problem(clips, switches, settings, 100, DISTANCE, offsets=offsets))
    some = kept.entries[:, 0] >= 0
    assert some.sum() > 40
    assert all(entry[1] in offsets[0, int(entry[0])] for entry in kept.entries[some])
    assert (kept.costs[some] >= free.costs[some]).all()
    assert (kept.costs[some] <= kept.direct_costs[some]).all()


# Genres (section 5, Eq. 6)


def test_a_genre_is_preferred_by_its_cost() -> None:
    clips = one_rig(80, 90, 70, 85)
    genres = ("jazz", "jazz", "pop", "pop")
    switches = (Switch(0, 1, Alignment(offset=0)),)
    hops = []
    for cost in (0.0, 0.02, 3.0):
        costs = on_beat.genre_costs(genres, "pop", cost, DISTANCE)
        table = build_table(Problem(clips, switches, Settings(6, 12, 12), 100, DISTANCE, hop_costs=costs))
        hops.append(np.isin(table.entries[table.entries[:, 0] >= 0, 0], (2, 3)).mean())
    assert hops[0] < hops[1] < hops[2]
    assert hops[2] > 0.5
    with pytest.raises(TransitionError, match=r"genres \(jazz, pop\), got 'waltz'"):
        on_beat.genre_costs(genres, "waltz", 1.0, DISTANCE)


# No overlap (section 5, Connection of nonoverlapping motions)


@pytest.mark.parametrize("seed", range(50))
def test_a_connection_is_the_best_of_all_hops_frames_and_stays(seed: int) -> None:
    """Every hop, frame and stay is tried, with costs of hops, allowed offsets and a bound on stays now and then."""
    rng = np.random.default_rng([seed, 4])
    blend, weight = int(rng.integers(2, 7)), int(rng.choice([0, 50, 20_000]))
    frames = [int(n) for n in rng.integers(blend, 30, 2)] + [int(n) for n in rng.integers(2 * blend, 40, 2)]
    clips, stay = one_rig(*frames), int(rng.integers(0, 10))
    both = int(rng.integers(0, 6)) if rng.random() < 0.4 else None
    extra = {int(rng.integers(4)): int(rng.integers(0, 500_000))} if rng.random() < 0.5 else {}
    allowed = {(0, 2): np.unique(rng.integers(-20, 30, 12))} if rng.random() < 0.5 else {}
    settings = Settings(blend, 12, stay, both)
    problem = Problem(clips, (), settings, weight, DISTANCE, hop_costs=extra, offsets=allowed)
    found, last = connect(problem, 0, 1), frames[0] - blend
    prepared = [DISTANCE.prepare(clip, blend) for clip in clips]
    costs = []
    for hop in range(4):
        whole = range(frames[hop] - blend + 1)
        first = DISTANCE.counts(prepared[0], prepared[hop], blend, range(last, last + 1), whole)[0]
        second = DISTANCE.counts(prepared[1], prepared[hop], blend, range(1), whole)[0]
        for frame, waited in product(whole, range(min(stay, settings.stay_both) + 1)):
            if frame + blend + waited < len(whole) and ((0, hop) not in allowed or last - frame in allowed[0, hop]):
                cost = int(first[frame]) + int(second[frame + blend + waited]) + weight * waited + extra.get(hop, 0)
                costs.append((cost, hop, frame, waited))
    cost, hop, frame, waited = min(costs)
    entry = found.entry
    assert (entry.hop, last - entry.offset, entry.stay_hop) == (hop, frame, waited)
    assert found.cost == pytest.approx(cost * DISTANCE.unit, abs=3 * DISTANCE.unit)
    steps = [Step(0, entry.hop, entry.offset, blend), Step(entry.stay_hop, 1, found.offset, blend)]
    played = play_steps(clips, 0, last, steps)
    assert played.clip.frames == last + blend + waited + frames[1]


def test_clips_shorter_than_the_blend_cannot_be_connected() -> None:
    clips = one_rig(40, 50, 45)
    with pytest.raises(TransitionError, match="at least 6 frames, the blend"):
        connect(Problem((clips[0], trim(clips[1], 0, 4)), (), Settings(6, 12, 9)), 0, 1)


# Upper and lower body apart (section 5, Separate handling of body parts)


def test_each_part_has_its_own_transition_and_they_end_together() -> None:
    clips = tuple(synthesize(name, seconds=6.0, fps=30.0, seed=k) for k, name in enumerate(("dance", "box", "walk")))
    skeleton = clips[0].skeleton
    upper = part_joints(skeleton, "upper")
    assert upper[[skeleton.role(role) for role in ("spine", "head", "elbow.L", "wrist.R")]].all()
    assert not upper[[skeleton.role(role) for role in ("pelvis", "knee.L", "ankle.R")]].any()
    played = {}
    for part in ("lower", "upper"):
        distance = PointCloudDistance(part_weights(skeleton, part))
        problem = Problem(clips, (Switch(0, 1),), Settings.at(30.0), 5000, distance)
        played[part] = play(clips, build_table(problem), [Trigger(30, 1)]).clip
    whole = put_together(played["lower"], played["upper"])
    assert np.array_equal(whole.root_positions, played["lower"].root_positions)
    knee, elbow = skeleton.role("knee.L"), skeleton.role("elbow.L")
    assert np.allclose(np.abs(np.sum(whole.rotations[:, knee] * played["lower"].rotations[:, knee], axis=-1)), 1)
    assert np.allclose(np.abs(np.sum(whole.rotations[:, elbow] * played["upper"].rotations[:, elbow], axis=-1)), 1)
    with pytest.raises(TransitionError, match="one rig and length"):
        put_together(played["lower"], trim(clips[0], 0, 99))


# A bound on the duration (section 5, Higher responsiveness)


def test_a_bound_on_both_stays_holds() -> None:
    clips = one_rig(80, 90, 70)
    switches = (Switch(0, 1, Alignment(offset=0)), Switch(1, 2, Alignment(destination_frame=5)))
    free = build_table(Problem(clips, switches, Settings(6, 12, 12), 0, DISTANCE))
    bounded = build_table(Problem(clips, switches, Settings(6, 12, 12, 8), 0, DISTANCE))
    some = bounded.entries[:, 0] >= 0
    assert (free.entries[some, 2:].sum(axis=1) > 8).any()
    assert (bounded.entries[some, 2:].sum(axis=1) <= 8).all()
    assert (bounded.costs[some] >= free.costs[some]).all()


def test_hops_kept_near_to_direct_are_the_destination() -> None:
    clips = one_rig(80, 90, 70)
    problem = Problem(
        clips, (Switch(0, 1, Alignment(offset=-3)),), Settings(6, 12, 12), 10, DISTANCE, nearest_to_direct=2
    )
    table = build_table(problem)
    some = table.entries[:, 0] >= 0
    assert set(table.entries[some, 0].tolist()) == {1}
    assert np.abs(table.entries[some, 1] + 3).max() <= 2
    assert (table.costs[some] <= table.direct_costs[some]).all()


# Blends of their own length (section 5, Blending duration)


@pytest.mark.parametrize("seed", range(50))
def test_blends_of_their_own_length_equal_exhaustive_search(seed: int) -> None:
    """Every hop, frame, stay and pair of lengths is tried; each entry and cost is the search's, ties included."""
    rng = np.random.default_rng(seed)
    frames = [int(n) for n in rng.integers(11, 18, 3)]
    clips, stay = one_rig(*frames), int(rng.integers(0, 4))
    lengths = tuple(sorted({int(n) for n in rng.integers(2, 10, 3)}))
    fixed = bool(rng.integers(2))
    alignment = (
        Alignment(offset=int(rng.integers(-4, 5))) if fixed else Alignment(destination_frame=int(rng.integers(6)))
    )
    weight, extra = int(rng.choice([0, 400, 40_000])), {int(rng.integers(3)): int(rng.integers(0, 50_000))}
    switches = (Switch(0, 1, alignment), Switch(1, 0, alignment))
    settings = Settings(5, stay, stay, lengths=lengths)
    problem = adaptive(Problem(clips, switches, settings, weight, DISTANCE, hop_costs=extra))
    table = build_table(problem, workers=1, memory_bytes=int(rng.choice([2**20, 2**26])))
    prepared = [problem.distance.prepare(clip, 5) for clip in clips]
    costs = {
        (a, hop, b): problem.distance.counts(
            prepared[a], prepared[hop], b, range(frames[a] - b + 1), range(frames[hop] - b + 1)
        )
        for a, hop, b in product(range(2), range(3), lengths)
        if min(frames[a], frames[hop]) >= b
    }

    def blend(a: int, at: int, hop: int, frame: int, length: int) -> int | None:
        known = costs.get((a, hop, length))
        if known is None or not (0 <= at < known.shape[0] and 0 <= frame < known.shape[1]):
            return None
        if known[at, frame] >= 2**29:
            return None
        return int(known[at, frame]) + weight * (length - lengths[0])

    assert table.columns[4:] == ("blend_first", "blend_second")
    every = [(row, trigger) for row in table.rows for trigger in range(row.triggers)]
    for row, trigger in every:
        to = alignment.offset_at(trigger)
        found, straight = [], []
        for s, hop, b1 in product(range(stay + 1), range(3), lengths):
            for u in range(frames[hop]):
                first = blend(row.source, trigger + s, hop, u, b1)
                if first is None:
                    continue
                cost, e, v = first + weight * s + extra.get(hop, 0), trigger + s + b1 - to, u + b1
                if hop == row.destination and e == v and e <= frames[hop]:
                    found.append((cost, s, hop, u, 0, b1, 0))
                    straight += [first] if s == 0 else []
                for h, b2 in product(range(stay + 1), lengths):
                    second = blend(row.destination, e + h, hop, v + h, b2)
                    if second is not None:
                        found.append((cost + second + weight * h, s, hop, u, h, b1, b2))
        at = row.first_entry + trigger
        entry = table.entries[at].tolist()
        if not found:
            assert entry == [-1, 0, 0, 0, 0, 0]
            continue
        cost, s, hop, u, h, b1, b2 = min(found)
        assert entry == [hop, trigger + s - u, s, h, b1, b2]
        assert table.costs[at] == cost * problem.distance.unit
        if straight:
            assert table.direct_costs[at] == min(straight) * problem.distance.unit


def test_no_transition_costs_more_than_with_any_one_length() -> None:
    clips = one_rig(70, 80, 60)
    switches = (Switch(0, 1, Alignment(offset=3)), Switch(2, 0, Alignment(destination_frame=5)))
    settings = Settings(6, 10, 10, lengths=(3, 6, 12))
    problem = adaptive(Problem(clips, switches, settings, 3000, DISTANCE))
    table = build_table(problem)
    for length in (3, 6, 12):
        one = replace(problem, settings=Settings(length, 10, 10))
        paid = 2 * 3000 * (length - 3) * problem.distance.unit
        known = build_table(one)
        some = np.isfinite(known.costs)
        assert (table.costs[some] <= known.costs[some] + paid).all()
    # The fixed length costs what it does without adaptive blends.
    rows = range(40)
    alike = [
        distance.counts(*(distance.prepare(clip, 6) for clip in clips[:2]), 6, rows, rows)
        for distance in (problem.distance, DISTANCE)
    ]
    np.testing.assert_array_equal(*alike)
    played = play(clips, table, [Trigger(13, 1)])
    entry = table.look_up(0, 1, 13)
    assert entry is not None
    blends = [segment.stop - segment.start for segment in played.segments if segment.kind == "blend"]
    assert blends == [length for length in (entry.blend_first, entry.blend_second) if length]


def test_motions_that_cross_are_not_alike_for_being_at_one_place_for_a_moment() -> None:
    """Two legs that swing against each other and meet: a cut there costs nothing by the mean over its own frames."""
    rest = one_rig(80)[0]
    clips = []
    for sign in (1.0, -1.0):
        turns = np.zeros((80, 9, 3))
        turns[:, 1, 0] = sign * 0.02 * (np.arange(80) - 40.0)
        clips.append(Clip(rest.skeleton, np.zeros((80, 3)), quat.exp(turns), 30.0))
    asked = Problem(tuple(clips), (Switch(0, 1, Alignment(offset=0), 25, 25),), Settings(15, 20, 20), 0, DISTANCE)
    problem = adaptive(asked)
    short = problem.settings.lengths[0]
    prepared = [DISTANCE.prepare(clip, short) for clip in clips]
    assert problem.settings.lengths[-1] == 30
    mean = {b: DISTANCE.counts(*prepared, b, range(66), range(66))[40 - b // 2, 40 - b // 2] for b in (short, 15)}
    assert mean[short] < 0.1 * mean[15]
    prepared = [problem.distance.prepare(clip, short) for clip in clips]
    costs = [
        int(problem.distance.counts(*prepared, b, range(51), range(51))[40 - b // 2, 40 - b // 2]) for b in (short, 15)
    ]
    assert costs[0] > costs[1]
    entry = build_table(replace(problem, hops=(1,))).look_up(0, 1, 25)
    assert entry is not None
    assert entry.blend_first is not None
    assert entry.blend_first >= 15


@pytest.mark.parametrize("blend", [2, 4, 15, 30])
def test_a_blend_costs_what_it_bends_and_what_it_adds_to_the_velocities(blend: int) -> None:
    clips = one_rig(120, 100)
    problem = adaptive(Problem(clips, (), Settings(15, 0, 0), 0, DISTANCE))
    strain, window = problem.distance, max(blend, 15)
    assert isinstance(strain, StrainDistance)
    prepared = [strain.prepare(clip, blend) for clip in clips]
    found = strain.counts(*prepared, blend, range(121 - blend), range(101 - blend))
    plain = [DISTANCE.prepare(clip, window) for clip in clips]
    distance = DISTANCE.counts(*plain, window, range(121 - window), range(101 - window))
    factor = (1 + (strain.own_time / (blend + 1)) ** 2) / (1 + (strain.own_time / 16) ** 2)
    supplied = found[: 121 - window, : 101 - window]
    np.testing.assert_allclose(supplied, np.minimum(distance * factor, 2**26), atol=0.51)
    assert (found[121 - window :] == 2**29).all()
    assert (found[:, 101 - window :] == 2**29).all()
    with pytest.raises(TransitionError, match=r"ascending, got \(6, 3\)"):
        Settings(6, lengths=(6, 3))


# Places to reach


class Drawn:
    """A distance that is drawn: small whole numbers, exact, so that ties abound. Clips go by their number."""

    unit, words = 1.0, "drawn costs"

    def __init__(self, rng: np.random.Generator, clips: tuple[Clip, ...], blend: int) -> None:
        windows = [clip.frames - blend + 1 for clip in clips]
        self.costs: dict[tuple[int, int], np.ndarray] = {}
        for a, b in product(range(len(clips)), repeat=2):
            drawn = rng.integers(0, 6, (windows[a], windows[b])).astype(np.int32)
            if a == b:
                drawn = np.minimum(drawn, drawn.T)
                np.fill_diagonal(drawn, 0)
            self.costs[a, b] = self.costs[b, a].T.copy() if a > b else drawn

    def prepare(self, clip: Clip, blend_frames: int) -> int:
        del blend_frames
        return int(clip.name)

    def counts(self, a: int, b: int, blend_frames: int, rows: range, columns: range) -> np.ndarray:
        del blend_frames
        return self.costs[a, b][rows.start : rows.stop, columns.start : columns.stop].copy()


def placed_on(a: Clip, at: int, b: Clip, there: int, blend: int) -> tuple[float, np.ndarray]:
    yaw, shift, _ = align(*(joint_positions(trim(c, f, f + blend)) for c, f in ((a, at), (b, there))))
    return yaw, shift


@pytest.mark.parametrize("seed", range(50))
def test_a_place_is_reached_by_the_best_of_all_transitions_that_end_there(seed: int) -> None:
    """Every hop, frame and stay is tried, each end found by aligning and moving clips; with nothing wanted it is the
    table's entry."""
    rng = np.random.default_rng([seed, 9])
    blend, clips = int(rng.integers(2, 5)), wandering(*(int(n) for n in rng.integers(8, 15, 3)))
    stay, weight = int(rng.integers(0, 3)), int(rng.integers(0, 3))
    both = int(rng.integers(0, 4)) if rng.random() < 0.4 else None
    extra, distance = {int(rng.integers(3)): int(rng.integers(0, 4))}, Drawn(rng, clips, blend)
    allowed = {(0, 2): np.unique(rng.integers(-8, 12, 9))} if rng.random() < 0.4 else {}
    settings, to = Settings(blend, stay, stay, both), int(rng.integers(-3, 4))
    switch = Switch(0, 1, Alignment(offset=to))
    problem = Problem(clips, (switch,), settings, weight, distance, hop_costs=extra, offsets=allowed)
    trigger = int(rng.integers(0, 5))
    every = []
    source, destination = clips[:2]
    counts, windows = distance.costs, [clip.frames - blend + 1 for clip in clips]
    for s, hop in product(range(min(stay, settings.stay_both) + 1), range(3)):
        for u in range(windows[hop]) if trigger + s < windows[0] else ():
            if (0, hop) in allowed and trigger + s - u not in allowed[0, hop]:
                continue
            yaw, shift = placed_on(source, trigger + s, clips[hop], u, blend)
            first = int(counts[0, hop][trigger + s, u]) + weight * s + extra.get(hop, 0)
            e = trigger + s + blend - to
            if hop == 1 and e == u + blend:
                every.append(((first, s, hop, u, 0), moved(destination, yaw, shift), e - 1))
            for h in range(min(stay, settings.stay_both - s) + 1):
                if 0 <= e + h < windows[1] and u + blend + h < windows[hop]:
                    then = placed_on(moved(clips[hop], yaw, shift), u + blend + h, destination, e + h, blend)
                    cost = first + int(counts[1, hop][e + h, u + blend + h]) + weight * h
                    every.append(((cost, s, hop, u, h), moved(destination, *then), e + h + blend - 1))
    ends = []
    for _, there, frame in every:
        turned = facing(there)[frame] - facing(source)[trigger]
        way = there.root_positions[frame] - source.root_positions[trigger]
        way = quat.rotate(quat.yaw(-facing(source)[trigger]), way)
        ends.append((way[2], way[0], (turned + np.pi) % (2 * np.pi) - np.pi))
    table = build_table(problem)
    free = reach(problem, switch, trigger, Wanted())
    known = table.look_up(0, 1, trigger)
    assert (free and free.entry) == known
    if not every:
        assert free is None
        return
    aim = ends[int(rng.integers(len(ends)))]
    for wanted in (
        Wanted(aim[0], aim[1], 0.05),
        Wanted(turn_rad=aim[2], within_rad=0.1),
        Wanted(aim[0], aim[1], 0.1, aim[2], 0.3),
        Wanted(left_m=aim[1], within_m=0.02),
    ):
        fits = [
            k
            for k, (ahead, left, turn) in enumerate(ends)
            if sum((value - want) ** 2 for value, want in ((ahead, wanted.forward_m), (left, wanted.left_m))
                   if want is not None) <= wanted.within_m**2
            and (wanted.turn_rad is None
                 or abs((turn - wanted.turn_rad + np.pi) % (2 * np.pi) - np.pi) <= wanted.within_rad)
        ]  # fmt: skip
        best = min(fits, key=lambda k: every[k][0])
        found = reach(problem, switch, trigger, wanted)
        assert found is not None
        cost, s, hop, u, h = every[best][0]
        assert (found.entry.hop, found.entry.stay_source, found.entry.stay_hop) == (hop, s, h)
        assert trigger + s - found.entry.offset == u
        assert found.cost == cost
        assert (found.forward_m, found.left_m) == pytest.approx(ends[best][:2], abs=1e-9)
        assert np.angle(np.exp(1j * (found.turn_rad - ends[best][2]))) == pytest.approx(0.0, abs=1e-9)
    assert reach(problem, switch, trigger, Wanted(forward_m=50.0)) is None


def wandering(*lengths: int) -> tuple[Clip, ...]:
    """Clips with hips and shoulders to face by, that go and turn."""
    clips = []
    for number, frames in enumerate(lengths):
        walk = make_walk(frames, speed=1.0 + number, phase=1.0 * number, turn_rate=0.5 * number - 0.4, heading=number)
        clips.append(replace(walk, name=str(number)))
    return tuple(clips)


def test_what_is_reached_is_where_the_destination_plays() -> None:
    clips = wandering(60, 70, 65)
    switch = Switch(0, 1, Alignment(offset=2))
    problem = Problem(clips, (switch,), Settings(6, 8, 8), 200, DISTANCE)
    free = reach(problem, switch, 20, Wanted())
    assert free is not None
    found = reach(problem, switch, 20, Wanted(free.forward_m + 0.15, free.left_m, 0.1))
    assert found is not None
    assert found.entry != free.entry
    assert found.cost >= free.cost
    steps = [Step(found.entry.stay_source, found.entry.hop, found.entry.offset, 6), Step(found.entry.stay_hop, 1, 2, 6)]
    played = play_steps(clips, 0, 20, steps)
    state = played.segments[-1]
    yaw, shift, rest = align(
        joint_positions(trim(played.clip, state.start, state.stop)),
        joint_positions(trim(clips[1], state.clip_start, state.clip_start + state.stop - state.start)),
    )
    assert rest == pytest.approx(0.0, abs=1e-12)
    there = moved(clips[1], yaw, shift)
    way = there.root_positions[state.clip_start - 1] - clips[0].root_positions[20]
    way = quat.rotate(quat.yaw(-facing(clips[0])[20]), way)
    assert (found.forward_m, found.left_m) == pytest.approx((way[2], way[0]), abs=1e-9)


def test_rules_that_a_search_for_a_place_does_not_know_are_refused() -> None:
    clips = one_rig(20, 20)
    problem = Problem(clips, (Switch(0, 1),), Settings(3, 2, 2), 0, DISTANCE, nearest_to_direct=2)
    with pytest.raises(TransitionError, match="blends of one length and any hop"):
        reach(problem, problem.switches[0], 0, Wanted())


# More than one hop (section 5, Multiple hops)


def cheapest_chain(
    costs: dict[tuple[int, int], np.ndarray], clips: tuple[Clip, ...], settings: Settings, weight: int, to: int
) -> dict[int, float]:
    """By triggered frame the least cost from clip 0 to clip 1 with at most two hops, by trying everything."""
    blend, stays = settings.blend_frames, range(settings.longest_stay_hop + 1)

    def cheapest(clip: int, frame: int, time: int, left: int, hopped: bool) -> float:
        best = 0.0 if hopped and clip == 1 and frame == time and 0 <= time <= clips[1].frames else np.inf
        for stay in stays:
            if frame + stay >= clips[clip].frames - blend + 1:
                break
            there = time + stay
            if hopped and 0 <= there < clips[1].frames - blend + 1:
                best = min(best, costs[clip, 1][frame + stay, there] + weight * stay)
            for hop in range(len(clips)) if left else ():
                for start in range(clips[hop].frames - blend + 1):
                    cost = costs[clip, hop][frame + stay, start] + weight * stay
                    if cost < best:
                        best = min(best, cost + cheapest(hop, start + blend, there + blend, left - 1, True))
        return best

    return {trigger: cheapest(0, trigger, trigger - to, 2, False) for trigger in range(clips[0].frames)}


@pytest.mark.parametrize("seed", range(50))
def test_chains_of_two_hops_equal_exhaustive_search(seed: int) -> None:
    rng = np.random.default_rng([seed, 6])
    blend, stay = int(rng.integers(2, 4)), int(rng.integers(0, 3))
    clips, to = one_rig(*(int(n) for n in rng.integers(5, 10, 3))), int(rng.integers(-4, 5))
    settings, weight = Settings(blend, stay, stay), int(rng.choice([0, 300, 30_000]))
    prepared = [DISTANCE.prepare(clip, blend) for clip in clips]
    windows = [range(max(clip.frames - blend + 1, 0)) for clip in clips]
    costs = {
        (a, b): DISTANCE.counts(prepared[a], prepared[b], blend, windows[a], windows[b])
        for a in range(3)
        for b in range(3)
    }
    expected = cheapest_chain(costs, clips, settings, weight, to)
    found = find_chains(Problem(clips, (), settings, weight, DISTANCE), Switch(0, 1, Alignment(offset=to)), 2)
    for trigger, chain in enumerate(found):
        cost = np.inf if chain is None else chain.cost
        assert cost == pytest.approx(expected[trigger] * DISTANCE.unit, abs=4 * DISTANCE.unit)


def test_two_hops_equal_exhaustive_search_and_never_cost_more_than_one() -> None:
    clips, settings, weight = one_rig(14, 16, 12), Settings(3, 2, 2), 300
    problem = Problem(clips, (), settings, weight, DISTANCE)
    prepared = [DISTANCE.prepare(clip, 3) for clip in clips]
    windows = [range(clip.frames - 2) for clip in clips]
    costs = {
        (a, b): DISTANCE.counts(prepared[a], prepared[b], 3, windows[a], windows[b]) for a in range(3) for b in range(3)
    }
    switch = Switch(0, 1, Alignment(offset=-1))
    expected = cheapest_chain(costs, clips, settings, weight, -1)
    two, one = (find_chains(problem, switch, hops) for hops in (2, 1))
    table = build_table(Problem(clips, (switch,), settings, weight, DISTANCE))
    gained = 0
    for trigger in range(14):
        chain, single = two[trigger], one[trigger]
        if chain is None:
            assert expected[trigger] == np.inf
            assert single is None
            continue
        assert chain.cost == pytest.approx(expected[trigger] * DISTANCE.unit, abs=4 * DISTANCE.unit)
        if single is not None:
            assert single.cost == pytest.approx(table.costs[trigger], abs=2 * DISTANCE.unit)
            assert len(single.steps) == 2
            assert chain.cost <= single.cost
            gained += chain.cost < single.cost
        played = play_steps(clips, 0, trigger, chain.steps)
        assert played.segments[-1].clip == 1
        assert played.clip.frames == 16 - 1  # the destination stands one frame before the source, and ends as it would
    assert gained > 2


def test_chains_that_need_too_much_memory_are_refused() -> None:
    problem = Problem(one_rig(60, 60), (), Settings(3, 2, 2), 300, DISTANCE)
    with pytest.raises(TransitionError, match=r"chains of 116 hop frames needs .* GB\. Give fewer"):
        find_chains(problem, Switch(0, 1, Alignment(offset=0)), 2, memory_bytes=1000)
    with pytest.raises(TransitionError, match="an alignment by an offset"):
        find_chains(problem, Switch(0, 1, Alignment(destination_frame=0)), 2)
