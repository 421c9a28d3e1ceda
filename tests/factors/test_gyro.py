import gtsam
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from factors import bias_walk_factor, gyro_factor, preintegrate_rates

X, Y, B, C = gtsam.symbol("x", 0), gtsam.symbol("x", 1), gtsam.symbol("b", 0), gtsam.symbol("b", 1)
MOUNT = Rotation.from_rotvec([0.3, -1.9, 0.7]).as_matrix()
DENSITY = 1e-3
vectors = arrays(np.float64, 3, elements=st.floats(-1, 1))


def rates_of(angle, n=20, dt=0.005, bias=(0.0, 0.0, 0.0), seed=1):
    """N intervals with unsteady rates whose sum is the angle, in the gyro's axes."""
    noise = np.random.default_rng(seed).normal(0, 0.5, (n, 3))
    rates = np.asarray(angle) / (n * dt) + noise - noise.mean(axis=0) + np.asarray(bias)
    return preintegrate_rates(rates, np.full(n, dt), np.asarray(bias), DENSITY)


def values_of(start, i_R_j, bias):
    i = gtsam.Pose3.Expmap(np.concatenate([start, [1.0, 2.0, 3.0]]))
    turned = gtsam.Rot3(i.rotation().matrix() @ i_R_j)
    values = gtsam.Values()
    values.insert(X, i)
    values.insert(Y, gtsam.Pose3(turned, np.array([4.0, 6.0, 5.0])))
    values.insert(B, np.asarray(bias, float))
    return values


def turn(vector):
    return Rotation.from_rotvec(vector).as_matrix()


@pytest.mark.slow
@settings(deadline=None)
@given(vectors, vectors, vectors, vectors)
def test_jacobians(check_jacobians, start, angle, off, bias):
    rates = rates_of(angle, bias=(0.02, -0.01, 0.03))
    camera = MOUNT.T @ rates.i_R_j @ MOUNT
    check_jacobians(gyro_factor((X, Y), B, rates, MOUNT), values_of(start, camera @ turn(off), 0.1 * bias))


@pytest.mark.parametrize("angle", [0.0, 1e-10, 1e-7, 1e-4, 3.1415, np.pi, 3.2, 6.0])
def test_jacobians_at_any_rotation_between_the_frames(check_jacobians, angle):
    # the rotation itself may be anything, only the residual must stay clear of pi
    rates = rates_of(angle * np.array([0.6, 0.0, 0.8]))
    camera = MOUNT.T @ rates.i_R_j @ MOUNT
    for off in (np.zeros(3), [1e-9, 0, 0], [1e-4, -1e-5, 0]):
        values = values_of([0.1, 0.2, 0.3], camera @ turn(off), [0.01, 0.0, -0.01])
        check_jacobians(gyro_factor((X, Y), B, rates, MOUNT), values)


@pytest.mark.parametrize("off", [2.5, 3.0, 3.1])
def test_jacobians_at_large_residuals(check_jacobians, off):
    rates = rates_of([0.2, 0.1, 0.3])
    camera = MOUNT.T @ rates.i_R_j @ MOUNT
    values = values_of([0.1, 0.2, 0.3], camera @ turn(off * np.array([0.6, 0.0, 0.8])), np.zeros(3))
    check_jacobians(gyro_factor((X, Y), B, rates, MOUNT), values, step=1e-6, tolerance=1e-5)


def test_residual_by_hand():
    # the gyro's z is the camera's x; 0.5 rad/s less 0.1 for 0.2 s are 0.08 rad; the camera turned 0.1
    mount = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])
    rates = preintegrate_rates(np.tile([0, 0, 0.5], (4, 1)), np.full(4, 0.05), np.array([0, 0, 0.1]), 0.01)
    values = values_of([0.3, -0.2, 0.5], turn([0.1, 0, 0]), [0, 0, 0.1])
    factor = gyro_factor((X, Y), B, rates, mount)
    np.testing.assert_allclose(factor.unwhitenedError(values), [0.02, 0, 0], atol=1e-12)
    # sigma = 0.01 rad/s/sqrt(Hz) * sqrt(0.2 s)
    expected = [0.02 / (0.01 * np.sqrt(0.2)), 0, 0]
    np.testing.assert_allclose(factor.whitenedError(values), expected, atol=1e-9)
    values.update(B, np.array([0, 0, 0.0]))
    np.testing.assert_allclose(factor.unwhitenedError(values), [0.0, 0, 0], atol=1e-12)


def oracle(rates, dts, bias):
    params = gtsam.PreintegratedRotationParams()
    params.setGyroscopeCovariance(DENSITY**2 * np.eye(3))
    ahrs = gtsam.PreintegratedAhrsMeasurements(params, bias)
    for rate, dt in zip(rates, dts, strict=True):
        ahrs.integrateMeasurement(rate, dt)
    return ahrs


@pytest.mark.slow
@given(vectors, vectors, vectors, vectors)
def test_agrees_with_the_ahrs_factor_of_gtsam(start, angle, off, bias):
    n, taken = 20, np.array([0.02, -0.01, 0.03])
    dts = np.linspace(0.003, 0.007, n)
    rates = angle / dts.sum() + np.random.default_rng(4).normal(0, 0.5, (n, 3))
    ours, ahrs = preintegrate_rates(rates, dts, taken, DENSITY), oracle(rates, dts, taken)
    np.testing.assert_allclose(ours.i_R_j, ahrs.deltaRij().matrix(), atol=1e-12)
    assert ours.dt_s == pytest.approx(ahrs.deltaTij())
    # gtsam takes the covariance per step without the right Jacobian, which is the identity to a milliradian
    np.testing.assert_allclose(ours.covariance, ahrs.preintMeasCov(), rtol=0.01, atol=1e-9)

    values = values_of(start, ours.i_R_j @ turn(off), taken + 0.02 * bias)
    on_rotations = gtsam.Values()
    for key in (X, Y):
        on_rotations.insert(key, values.atPose3(key).rotation())
    on_rotations.insert(B, values.atVector(B))
    factor, expected = gyro_factor((X, Y), B, ours, np.eye(3)), gtsam.AHRSFactor(X, Y, B, ahrs)
    # gtsam's residual is the inverse rotation's
    np.testing.assert_allclose(
        factor.unwhitenedError(values), -expected.unwhitenedError(on_rotations), atol=1e-9
    )


@pytest.mark.slow
@given(vectors, vectors)
def test_bias_correction_equals_integrating_again(angle, change):
    n, dts = 40, np.full(40, 0.005)
    rates = angle / 0.2 + np.random.default_rng(4).normal(0, 0.5, (n, 3))
    change = 0.02 * change
    kept = preintegrate_rates(rates, dts, np.zeros(3), DENSITY)
    anew = preintegrate_rates(rates, dts, change, DENSITY)
    corrected = kept.i_R_j @ turn(kept.by_bias @ change)
    left = Rotation.from_matrix(corrected.T @ anew.i_R_j).magnitude()
    assert left < 2 * (np.linalg.norm(change) * 0.2) ** 2 + 1e-12


@pytest.mark.slow
def test_noise_by_simulation():
    rng, n, dt = np.random.default_rng(2), 20, 0.01
    rates = np.array([6.0, -3.0, 4.0]) + rng.normal(0, 2.0, (n, 3))
    mean = preintegrate_rates(rates, np.full(n, dt), np.zeros(3), 0.01)
    errors = []
    for _ in range(800):
        noisy = rates + rng.normal(0, 0.01 / np.sqrt(dt), (n, 3))
        drawn = preintegrate_rates(noisy, np.full(n, dt), np.zeros(3), 0.01)
        errors.append(Rotation.from_matrix(mean.i_R_j.T @ drawn.i_R_j).as_rotvec())
    ratio = np.linalg.solve(mean.covariance, np.cov(np.array(errors).T))
    np.testing.assert_allclose(ratio, np.eye(3), atol=0.2)  # 800 draws know a variance to 5 %


def test_bias_is_estimated_with_the_rotations():
    # three frames of known rotation, a gyro with a bias: the graph gives the bias
    bias, rng = np.array([0.03, -0.02, 0.05]), np.random.default_rng(6)
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    world_R_gyro, keys = np.eye(3), [gtsam.symbol("x", k) for k in range(6)]
    for k, key in enumerate(keys):
        pose = gtsam.Pose3(gtsam.Rot3(world_R_gyro @ MOUNT), np.zeros(3))
        graph.add(gtsam.PriorFactorPose3(key, pose, gtsam.noiseModel.Isotropic.Sigma(6, 1e-4)))
        values.insert(key, pose.retract(rng.normal(0, 0.01, 6)))
        values.insert(gtsam.symbol("b", k), np.zeros(3))
        if k == 0:
            graph.add(gtsam.PriorFactorVector(B, np.zeros(3), gtsam.noiseModel.Isotropic.Sigma(3, 1.0)))
        else:
            graph.add(bias_walk_factor((gtsam.symbol("b", k - 1), gtsam.symbol("b", k)), 0.1, 1e-4))
        if key == keys[-1]:
            break
        rates, dts = rng.normal(0, 1, (20, 3)), np.full(20, 0.005)
        measured = preintegrate_rates(rates + bias, dts, np.zeros(3), DENSITY)
        graph.add(gyro_factor((key, keys[k + 1]), gtsam.symbol("b", k), measured, MOUNT))
        world_R_gyro = world_R_gyro @ preintegrate_rates(rates, dts, np.zeros(3), DENSITY).i_R_j
    found = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    np.testing.assert_allclose(found.atVector(B), bias, atol=1e-3)


def test_the_walk_by_hand():
    values = gtsam.Values()
    values.insert(B, np.array([0.1, 0.2, 0.3]))
    values.insert(C, np.array([0.1, 0.24, 0.3]))
    np.testing.assert_allclose(
        bias_walk_factor((B, C), 4.0, 0.01).whitenedError(values), [0, 2.0, 0], atol=1e-12
    )


@pytest.mark.parametrize(
    ("rates", "dts", "density"),
    [
        (np.zeros((0, 3)), np.zeros(0), 1.0),
        (np.zeros((2, 3)), np.ones(3), 1.0),
        (np.zeros((2, 3)), np.array([1.0, 0.0]), 1.0),
        (np.zeros((2, 3)), np.ones(2), 0.0),
    ],
)
def test_invalid_rates_are_refused(rates, dts, density):
    with pytest.raises(ValueError, match=r"expected|positive"):
        preintegrate_rates(rates, dts, np.zeros(3), density)


def test_mount_must_be_a_rotation():
    with pytest.raises(ValueError, match="expected a rotation matrix"):
        gyro_factor((X, Y), B, rates_of([0.1, 0, 0]), -np.eye(3))
    with pytest.raises(ValueError, match="expected positive numbers"):
        bias_walk_factor((B, C), 0.0, 1.0)
