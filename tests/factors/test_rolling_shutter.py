import gtsam
import numpy as np
import pytest

from factors import RowTime, poses_at, projection_factor, rolling_projection_factor

K = gtsam.Cal3_S2(700.0, 710.0, 0.0, 320.0, 240.0)
L, READOUT = gtsam.symbol("l", 0), gtsam.symbol("t", 1)
NOISE = gtsam.noiseModel.Isotropic.Sigma(2, 0.5)
POINT = np.array([0.5, -0.7, 6.0])


def values_of(knots: int, readout_s: float | None = None) -> gtsam.Values:
    rng = np.random.default_rng(knots)
    values = gtsam.Values()
    pose = gtsam.Pose3(gtsam.Rot3.Ry(0.2), np.zeros(3))
    for k in range(knots):
        values.insert(k, pose)
        pose = pose.compose(gtsam.Pose3.Expmap(rng.normal(size=6) * [0.05, 0.05, 0.05, 0.2, 0.2, 0.2]))
    values.insert(L, POINT)
    if readout_s is not None:
        values.insert(READOUT, np.array([readout_s]))
    return values


def factor_of(
    knots: int, share: float, readout: int | float, uv=(300.0, 200.0), camera=K
) -> gtsam.CustomFactor:
    knot_s = np.array([0.0, 0.1, 0.21, 0.3])[:knots]
    row = RowTime(knot_s, knot_s[knots // 2], share)
    return rolling_projection_factor(list(range(knots)), L, np.array(uv), row, camera, NOISE, readout)


@pytest.mark.parametrize("knots", [2, 3, 4])
@pytest.mark.parametrize("share", [-0.5, 0.1, 0.45])
def test_jacobians_are_the_derivatives(check_jacobians, knots: int, share: float) -> None:
    check_jacobians(factor_of(knots, share, 0.06), values_of(knots))
    check_jacobians(factor_of(knots, share, READOUT), values_of(knots, 0.06))


def test_a_camera_on_a_rig_sees_from_its_own_place(check_jacobians) -> None:
    mount = gtsam.Pose3(gtsam.Rot3.RzRyRx(0.3, -0.4, 0.2), np.array([0.3, -0.2, 0.5]))
    camera = gtsam.PinholeCameraCal3_S2(mount, K)
    check_jacobians(factor_of(4, 0.45, 0.06, camera=camera), values_of(4))
    check_jacobians(factor_of(4, 0.45, READOUT, camera=camera), values_of(4, 0.06))
    oracle = gtsam.GenericProjectionFactorCal3_S2(np.array([300.0, 200.0]), NOISE, 2, L, K, mount)
    of_middle_row = factor_of(4, 0.0, 0.06, camera=camera)
    assert of_middle_row.error(values_of(4)) == pytest.approx(oracle.error(values_of(4)))


def test_the_middle_row_and_a_global_shutter_are_gtsams_projection() -> None:
    values = values_of(4)
    oracle = projection_factor(2, L, np.array([300.0, 200.0]), K, NOISE)
    A, b = oracle.linearize(values).jacobian()
    for share, readout_s in ((0.0, 0.08), (0.4, 0.0)):
        found, right = factor_of(4, share, readout_s).linearize(values).jacobian()
        np.testing.assert_allclose(right, b, atol=1e-9)
        np.testing.assert_allclose(found[:, 12:18], A[:, :6], atol=1e-9)
        np.testing.assert_allclose(found[:, 24:], A[:, 6:], atol=1e-9)
        assert np.abs(found[:, [*range(12), *range(18, 24)]]).max() < 1e-9


def test_a_row_is_projected_from_its_own_pose() -> None:
    values = values_of(4)
    poses = np.stack([values.atPose3(k).matrix() for k in range(4)])
    at = poses_at(np.array([0.0, 0.1, 0.21, 0.3]), poses, np.array([0.21 + 0.3 * 0.06]), np.array([1]))[0]
    uv = gtsam.PinholeCameraCal3_S2(gtsam.Pose3(at), K).project(POINT)
    assert factor_of(4, 0.3, 0.06, uv).error(values) == pytest.approx(0.0, abs=1e-12)


def test_a_landmark_behind_the_camera_has_gtsams_constant_residual() -> None:
    values = values_of(4)
    values.update(L, np.array([0.0, 0.0, -5.0]))
    A, b = factor_of(4, 0.2, 0.06).linearize(values).jacobian()
    assert not A.any()
    np.testing.assert_allclose(-b * 0.5, [1400.0, 1400.0])
