import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from study.motion import quaternions as quat


@pytest.fixture
def rotations() -> Rotation:
    return Rotation.random(500, rng=np.random.default_rng(7))


def ours(rotation: Rotation) -> np.ndarray:
    return quat.positive(rotation.as_quat(scalar_first=True))


def same(a: np.ndarray, b: np.ndarray, tolerance: float = 1e-12) -> bool:
    return bool(np.max(np.abs(quat.positive(a) - quat.positive(b))) < tolerance)


def test_products_rotations_and_matrices_agree_with_scipy(rotations: Rotation) -> None:
    other = Rotation.random(500, rng=np.random.default_rng(8))
    vectors = np.random.default_rng(9).normal(size=(500, 3))
    assert same(quat.multiply(ours(rotations), ours(other)), ours(rotations * other))
    assert np.allclose(quat.rotate(ours(rotations), vectors), rotations.apply(vectors), rtol=0, atol=1e-12)
    assert np.allclose(quat.to_matrix(ours(rotations)), rotations.as_matrix(), rtol=0, atol=1e-12)
    assert same(quat.from_matrix(rotations.as_matrix()), ours(rotations))
    assert same(quat.conjugate(ours(rotations)), ours(rotations.inv()))


@pytest.mark.parametrize("order", ["XYZ", "ZXY", "ZYX", "YXZ", "YZX", "XZY"])
def test_euler_angles_agree_with_scipy_and_come_back(order: str) -> None:
    angles = np.random.default_rng(3).uniform([-np.pi, -1.5, -np.pi], [np.pi, 1.5, np.pi], size=(300, 3))
    q = quat.from_euler(order, angles)
    assert same(q, ours(Rotation.from_euler(order, angles)))
    assert np.allclose(quat.to_euler(order, q), angles, rtol=0, atol=1e-10)


@pytest.mark.parametrize("order", ["XYZ", "ZXY", "YZX"])
def test_euler_angles_at_gimbal_lock_give_the_same_rotation(order: str) -> None:
    q = quat.from_euler(order, [[0.4, np.pi / 2, 0.3], [0.4, -np.pi / 2, -0.9]])
    assert same(quat.from_euler(order, quat.to_euler(order, q)), q, 1e-7)


def test_the_logarithm_is_the_half_angle(rotations: Rotation) -> None:
    assert np.allclose(2 * quat.log(ours(rotations)), rotations.as_rotvec(), rtol=0, atol=1e-12)
    assert same(quat.exp(quat.log(ours(rotations))), ours(rotations))
    quarter_turn = quat.from_axis_angle([0.0, 1.0, 0.0], np.pi / 2)
    assert np.linalg.norm(quat.log(quarter_turn)) == pytest.approx(np.pi / 4)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-9, 1e-5, 1e-3, 1.0, 3.1])
def test_small_and_large_angles_keep_their_digits(angle: float) -> None:
    q = quat.from_axis_angle([0.6, 0.0, 0.8], angle)
    assert np.linalg.norm(quat.log(q)) == pytest.approx(angle / 2, rel=1e-12, abs=1e-300)
    assert quat.half_angle_between(q, quat.IDENTITY) == pytest.approx(angle / 2, rel=1e-9, abs=1e-300)
    assert quat.half_angle_between(-q, quat.IDENTITY) == pytest.approx(angle / 2, rel=1e-9, abs=1e-300)


def test_slerp_agrees_with_scipy(rotations: Rotation) -> None:
    pair = rotations[:2]
    weights = np.linspace(0, 1, 21)
    expected = Slerp([0, 1], pair)(weights)
    a, b = ours(pair)
    assert same(quat.slerp(a, b, weights), ours(expected))
    assert same(quat.slerp(a, -b, weights), ours(expected))


def test_continuous_signs_never_jump() -> None:
    turning = quat.yaw(np.linspace(0, 20, 400))
    shuffled = turning * np.random.default_rng(1).choice([-1.0, 1.0], size=(400, 1))
    assert np.max(np.abs(np.diff(quat.continuous(shuffled), axis=0))) < 0.05


def test_wrong_shapes_and_orders_are_refused() -> None:
    with pytest.raises(ValueError, match=r"Expected angles of shape \(\.\.\., 3\) for order 'ZXY', got \(2,\)"):
        quat.from_euler("ZXY", [0.0, 1.0])
    with pytest.raises(ValueError, match="three different axes"):
        quat.to_euler("ZXZ", quat.IDENTITY)
