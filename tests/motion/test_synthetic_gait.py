"""Synthetic walking and running against published measurements of people, and the feet against the floor."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from study.motion import quaternions as quat
from study.motion.clip import Clip, global_rotations, joint_positions
from study.motion.synthetic import NAMES, body, synthesize

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

FPS = 100.0
# Knee flexion in walking at natural cadence, degrees at every 10 % of the cycle from heel strike, read from the mean
# curve of Winter 1991 (to about 2 degrees); Bovi et al. 2011 and Fukuchi et al. 2018 lie within one deviation of it.
WINTER_KNEE = (4.0, 17.5, 18.0, 12.0, 8.0, 16.0, 40.0, 64.0, 54.0, 21.0, 4.0)


@dataclass(frozen=True)
class Gait:
    """What the tests need of one motion, left leg; angles in degrees."""

    clip: Clip
    positions: FloatArray
    down: BoolArray
    strikes: NDArray[np.int64]
    knee: FloatArray
    hip: FloatArray
    ankle: FloatArray

    def cycle(self, values: FloatArray) -> FloatArray:
        """Mean over the cycles, at every percent from strike to strike."""
        rows = [np.interp(np.linspace(a, b, 101), np.arange(len(values)), values) for a, b in pairwise(self.strikes)]
        return np.asarray(np.mean(rows, axis=0))

    @property
    def stance(self) -> float:
        return float(np.mean([self.down[a:b].mean() for a, b in pairwise(self.strikes)]))


def soles(clip: Clip, side: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The heel's lowest point, the joint of the toes and their tip, each `(frames, 3)`."""
    positions, world = joint_positions(clip, ends=True), global_rotations(clip)
    ankle, toe = (body.INDEX[f"{side}{part}"] for part in ("Foot", "ToeBase"))
    heel = positions[:, ankle] + quat.rotate(world[:, ankle], np.array([0.0, -body.ANKLE_HEIGHT, -body.HEEL_BACK]))
    tip = len(body.JOINTS) + [name for name, _ in body.ENDS].index(f"{side}ToeBase")
    return heel, positions[:, toe], positions[:, tip]


def on_floor(clip: Clip, side: str) -> BoolArray:
    heel, toe, tip = soles(clip, side)
    return (heel[:, 1] < 0.002) | (np.minimum(toe, tip)[:, 1] < body.TOE_HEIGHT + 0.0003)


def measure(name: str, speed: float) -> Gait:
    clip = synthesize(name, seconds=16.0, fps=FPS, seed=2, speed=speed)
    down = on_floor(clip, "Left")
    knee, hip, ankle = (clip.rotations[:, body.INDEX[f"Left{part}"]] for part in ("Leg", "UpLeg", "Foot"))
    return Gait(
        clip=clip,
        positions=joint_positions(clip),
        down=down,
        strikes=np.flatnonzero(down[1:] & ~down[:-1]) + 1,
        knee=np.degrees(2.0 * np.arctan2(knee[:, 1], knee[:, 0])),
        hip=-np.degrees(quat.to_euler("XZY", hip)[:, 0]),
        ankle=-np.degrees(quat.to_euler("XZY", ankle)[:, 0]),
    )


@pytest.fixture(scope="module")
def walk() -> Gait:
    return measure("walk", 1.3)


@pytest.fixture(scope="module")
def run() -> Gait:
    return measure("run", 3.3)


def test_walking_knee_follows_the_published_curve(walk: Gait) -> None:
    difference = walk.cycle(walk.knee)[::10] - np.array(WINTER_KNEE)
    assert np.sqrt(np.mean(difference**2)) < 7.0
    assert np.abs(difference).max() < 13.0


def test_walking_knee_peaks(walk: Gait) -> None:
    knee = walk.cycle(walk.knee)
    assert 58.0 < knee.max() < 68.0
    assert 69 <= knee.argmax() <= 77
    assert 12.0 < knee[5:30].max() < 24.0
    assert knee[30:50].min() < 13.0


def test_walking_hip_and_ankle_ranges(walk: Gait) -> None:
    """Hip 40-48 degrees, most extended near 50-60 % (Winter 1991); ankle 25-35 degrees, pointed most after toe-off."""
    hip, ankle = walk.cycle(walk.hip), walk.cycle(walk.ankle)
    assert 38.0 < np.ptp(hip) < 50.0
    assert 48 <= hip.argmin() <= 64
    assert 22.0 < np.ptp(ankle) < 40.0
    assert 58 <= ankle.argmin() <= 70


@pytest.mark.parametrize(("speed", "least", "most"), [(0.8, 0.63, 0.69), (1.3, 0.60, 0.645), (1.8, 0.57, 0.62)])
def test_walking_stance_share_falls_with_speed(speed: float, least: float, most: float) -> None:
    """Murray et al. 1966: 65, 61 and 57 % for slow, free and fast walking."""
    assert least < measure("walk", speed).stance < most


@pytest.mark.parametrize("speed", [0.8, 1.3, 1.8])
def test_step_rate_in_walking(speed: float) -> None:
    """Grieve & Gear 1966: step rate by the 0.42nd power of speed; 112 steps a minute at 1.3 m/s."""
    gait = measure("walk", speed)
    rate = 2.0 * FPS / np.mean(np.diff(gait.strikes))
    assert rate == pytest.approx(1.87 * (speed / 1.3) ** 0.42, rel=0.02)


@pytest.mark.parametrize(("name", "speed"), [("walk_slow", 0.8), ("walk", 1.3), ("jog", 2.4), ("run_fast", 4.5)])
def test_speed_is_what_was_asked(name: str, speed: float) -> None:
    gait = measure(name, speed)
    first, last = gait.strikes[0], gait.strikes[-1]
    way = gait.positions[last, 0] - gait.positions[first, 0]
    assert np.hypot(way[0], way[2]) * FPS / (last - first) == pytest.approx(speed, rel=0.02)


def test_walking_never_flies_and_running_does(walk: Gait, run: Gait) -> None:
    for gait, flying in ((walk, False), (run, True)):
        down = np.stack([on_floor(gait.clip, side) for side in ("Left", "Right")])
        assert bool((~down.any(axis=0)).any()) is flying
        assert bool(down.all(axis=0).any()) is not flying


def test_running_stance_and_knee(run: Gait) -> None:
    """Novacheck 1998: toe-off before 40 % of the cycle, knee 40-50 degrees in stance and 90-110 in swing."""
    knee = run.cycle(run.knee)
    assert 0.32 < run.stance < 0.40
    assert 40.0 < knee[:30].max() < 57.0
    assert 88.0 < knee.max() < 112.0
    assert 15.0 < knee[0] < 32.0


def test_flight_is_a_free_fall(run: Gait) -> None:
    """In flight the body's middle falls with about 1 g, whatever the legs do."""
    flying = ~np.stack([on_floor(run.clip, side) for side in ("Left", "Right")]).any(axis=0)
    fall = np.gradient(np.gradient(run.positions[:, 0, 1])) * FPS**2
    assert np.mean(fall[flying]) == pytest.approx(-9.81, abs=2.0)


def test_pelvis_rises_falls_and_sways(walk: Gait) -> None:
    """Vertical 3-6 cm and twice a cycle (Murray et al. 1964; Gard et al. 2004), sideways 2-6 cm and once."""
    root = walk.positions[:, 0]
    rise, sway = walk.cycle(root[:, 1]), walk.cycle(root[:, 0] - np.mean(root[:, 0]))
    assert 0.02 < np.ptp(rise) < 0.06
    assert 0.02 < np.ptp(sway) < 0.06
    assert np.abs(np.fft.rfft(rise - rise.mean())).argmax() == 2
    assert np.abs(np.fft.rfft(sway - sway.mean())).argmax() == 1


def test_pelvis_and_chest_turn_against_each_other(walk: Gait) -> None:
    """Pelvis 8-10 degrees in all, list 6-8, chest the other way round (Murray et al. 1964; Crosbie et al. 1997)."""
    world = global_rotations(walk.clip)
    pelvis, chest = (quat.to_euler("YXZ", world[:, body.INDEX[joint]]) for joint in ("Hips", "Chest"))
    turn, counter = (np.degrees(walk.cycle(np.unwrap(part[:, 0]))) for part in (pelvis, chest))
    assert 6.0 < np.ptp(turn) < 12.0
    assert 4.0 < np.ptp(np.degrees(walk.cycle(pelvis[:, 2]))) < 10.0
    assert np.corrcoef(turn, counter)[0, 1] < -0.8


def test_arms_swing_against_legs(walk: Gait) -> None:
    arms = {}
    for side in ("Left", "Right"):
        across = walk.positions[:, body.INDEX[f"{side}ForeArm"]] - walk.positions[:, body.INDEX[f"{side}Arm"]]
        arms[side] = walk.cycle(np.degrees(np.arctan2(across[:, 2], -across[:, 1])))
    leg = walk.cycle(walk.hip)
    assert np.corrcoef(arms["Left"], leg)[0, 1] < -0.8
    assert np.corrcoef(arms["Right"], leg)[0, 1] > 0.8
    assert 25.0 < np.ptp(arms["Left"]) < 50.0


def test_head_is_steadier_than_the_chest(walk: Gait) -> None:
    world = global_rotations(walk.clip)
    chest, head = (quat.to_euler("YXZ", world[:, body.INDEX[joint]])[:, 0] for joint in ("Chest", "Head"))
    assert np.ptp(walk.cycle(head)) < 0.5 * np.ptp(walk.cycle(chest))


@pytest.mark.parametrize("name", NAMES)
def test_balls_of_the_feet_do_not_slide(name: str) -> None:
    """While the ball of a foot is down, flat, heel up or turning, the joint of the toes stays within 3 mm."""
    clip = synthesize(name, seconds=12.0, fps=60.0, seed=1)
    seen = 0
    for side in ("Left", "Right"):
        _, toe, tip = soles(clip, side)
        down = (toe[:, 1] < body.TOE_HEIGHT + 0.0003) & (tip[:, 1] < body.TOE_HEIGHT + 0.0003)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], down, [False]]).astype(int)))
        for start, stop in edges.reshape(-1, 2):
            # The frames of touch-down and take-off may lie just outside the contact.
            inside = toe[start + 1 : stop - 1, [0, 2]]
            if len(inside):
                assert np.ptp(inside, axis=0).max() < 0.003, (name, side, start)
            seen += len(inside)
    assert seen > 100


@pytest.mark.parametrize("name", ["walk_slow", "walk", "walk_fast", "stand_to_walk", "walk_turn_left", "idle", "stand"])
def test_one_foot_always_has_a_fixed_point(name: str) -> None:
    clip = synthesize(name, seconds=8.0, fps=100.0, seed=4)
    slowest = np.full(clip.frames - 1, np.inf)
    for side in ("Left", "Right"):
        for point, height in zip(soles(clip, side), (0.0, body.TOE_HEIGHT, body.TOE_HEIGHT), strict=True):
            speed = np.linalg.norm(np.diff(point[:, [0, 2]], axis=0), axis=1) * 100.0
            slowest = np.minimum(slowest, np.where(point[1:, 1] < height + 0.004, speed, np.inf))
    assert slowest.max() < 0.05


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", NAMES)
def test_nothing_jerks(name: str, seed: int) -> None:
    """No point accelerates by more than captured people do (CMU 09_01: 364 m/s^2, 14_02: 363 at 60 fps)."""
    clip = synthesize(name, seconds=8.0, fps=60.0, seed=seed)
    acceleration = np.linalg.norm(np.diff(joint_positions(clip, ends=True), n=2, axis=0), axis=-1) * 60.0**2
    assert acceleration.max() < 300.0
    spin = 2.0 * quat.half_angle_between(clip.rotations[1:], clip.rotations[:-1]) * 60.0
    assert np.degrees(spin.max()) < 2300.0


@pytest.mark.parametrize("speed", [0.5, 1.0, 1.6, 1.9, 2.05, 2.2, 3.0, 4.0, 6.0])
def test_any_speed_keeps_the_legs_whole(speed: float) -> None:
    clip = synthesize("walk", seconds=5.0, fps=60.0, speed=speed, seed=1)
    positions = joint_positions(clip, ends=True)
    assert positions[..., 1].min() > 0.0
    acceleration = np.linalg.norm(np.diff(positions, n=2, axis=0), axis=-1) * 60.0**2
    assert acceleration.max() < 420.0


@pytest.mark.parametrize(
    ("name", "angle"), [("walk_turn_left", 90.0), ("walk_turn_right", -90.0), ("run_turn_left", 90.0)]
)
def test_turns_turn_by_their_angle(name: str, angle: float) -> None:
    clip = synthesize(name, fps=30.0, seed=0)
    second = 30
    before = clip.root_positions[3 * second] - clip.root_positions[0]
    after = clip.root_positions[-1] - clip.root_positions[-3 * second]
    turned = np.arctan2(after[0], after[2]) - np.arctan2(before[0], before[2])
    assert np.degrees(turned) == pytest.approx(angle, abs=4.0)


def test_turn_angle_is_a_parameter() -> None:
    clip = synthesize("walk_turn_left", fps=30.0, seed=0, angle=-45.0)
    after = clip.root_positions[-1] - clip.root_positions[-60]
    assert np.degrees(np.arctan2(after[0], after[2])) == pytest.approx(-45.0, abs=4.0)


@pytest.mark.parametrize(("name", "speed"), [("stand_to_walk", 1.3), ("stand_to_run", 3.3)])
def test_starts_stand_until_their_event(name: str, speed: float) -> None:
    clip = synthesize(name, seconds=10.0, fps=30.0, event_s=4.0)
    pace = np.linalg.norm(np.diff(clip.root_positions[:, [0, 2]], axis=0), axis=1) * 30.0
    assert pace[: 30 * 3].max() < 0.12
    assert pace[30 * 7 :].mean() == pytest.approx(speed, rel=0.05)


@pytest.mark.parametrize(("name", "speed"), [("walk_to_stop", 1.3), ("run_to_stop", 3.3)])
def test_stops_end_standing_with_feet_together(name: str, speed: float) -> None:
    clip = synthesize(name, seconds=11.0, fps=30.0, event_s=5.0)
    pace = np.linalg.norm(np.diff(clip.root_positions[:, [0, 2]], axis=0), axis=1) * 30.0
    assert pace[: 30 * 4].mean() == pytest.approx(speed, rel=0.05)
    assert pace[30 * 9 :].max() < 0.12
    feet = joint_positions(clip)[-1, [body.INDEX["LeftFoot"], body.INDEX["RightFoot"]]]
    assert abs(feet[0, 2] - feet[1, 2]) < 0.25
    assert on_floor(clip, "Left")[-30:].all()
    assert on_floor(clip, "Right")[-30:].all()
