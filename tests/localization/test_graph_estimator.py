import numpy as np
import pytest
from angles import apart_deg
from landmark_matches import matched
from scipy.spatial.transform import Rotation
from textured_wall import GYRO_R_CAMERA, gyro, pose_at

from vgps.config import LocalizationConfig
from vgps.geometry import project
from vgps.geometry.angular_rates import GyroIntegral
from vgps.localization.graph_estimator import GraphEstimator
from vgps.localization.pose import pose_from_matches

K = np.array([[300.0, 0, 160], [0, 300, 120], [0, 0, 1]])
CONFIG = LocalizationConfig()
NOISE_PX = 0.5


def matches_at(pose, seed, count=25):
    """Noisy matches of random landmarks 5 to 20 m in front of the camera."""
    rng = np.random.default_rng(seed)
    uv, depth = rng.uniform((0, 0), (320, 240), (count, 2)), rng.uniform(5, 20, (count, 1))
    camera_p = np.column_stack([(uv - K[:2, 2]) / 300.0, np.ones(count)]) * depth
    points = camera_p @ pose[:3, :3].T + pose[:3, 3]
    noisy = project(K, pose, points)[0] + NOISE_PX * rng.normal(size=(count, 2))
    return matched(np.arange(count), points, noisy, np.full(count, NOISE_PX))


def run(bias, times, **changes):
    """The estimator after frames at times, and errors of each pose alone and from the graph."""
    mount = GYRO_R_CAMERA
    estimator = GraphEstimator(K, GyroIntegral(gyro(3.0, bias)), mount, LocalizationConfig(**changes))
    alone, graph = [], []
    for k, t_s in enumerate(times):
        true = pose_at(t_s)
        matches = matches_at(true, k)
        estimate = pose_from_matches(K, matches, 3.0, CONFIG, true)
        final = estimator.add(t_s, estimate, matches, restart=k == 0)
        alone.append(apart_deg(estimate.world_T_camera, true))
        graph.append(apart_deg(final.world_T_camera, true))
    return estimator, np.array(alone), np.array(graph)


@pytest.mark.slow
def test_the_graph_is_closer_to_the_truth_than_single_frames():
    _, alone, graph = run((0, 0, 0), np.arange(25) / 10)
    assert graph[5:].mean() < 0.7 * alone[5:].mean()


def test_the_bias_of_the_gyro_is_estimated():
    bias = (0.03, -0.02, 0.01)
    estimator, _, _ = run(bias, np.arange(25) / 10)
    np.testing.assert_allclose(estimator.motion.gyro_bias_rad_s, bias, atol=0.004)


def test_poses_within_the_lag_are_revised():
    estimator, _, _ = run((0, 0, 0), np.arange(25) / 10, lag_s=0.55)
    np.testing.assert_allclose(sorted(estimator.revised()), np.arange(19, 25) / 10)


def test_the_velocity_is_that_of_the_last_two_frames():
    estimator, _, _ = run((0, 0, 0), np.arange(25) / 10)
    poses = estimator.revised()
    last, before = (poses[t_s][:3, 3] for t_s in sorted(poses)[:-3:-1])
    np.testing.assert_allclose(estimator.motion.world_v_camera, (last - before) / 0.1, atol=1e-9)


@pytest.mark.parametrize("restart", [False, True])
def test_a_jump_resets_the_graph_and_keeps_the_bias(restart):
    estimator, _, _ = run((0.03, -0.02, 0.01), np.arange(25) / 10)
    bias = estimator.motion.gyro_bias_rad_s
    true = pose_at(2.5)
    # a rotation that the gyro excludes
    true[:3, :3] = true[:3, :3] @ Rotation.from_euler("y", 20, degrees=True).as_matrix()
    matches = matches_at(true, 99)
    final = estimator.add(2.5, pose_from_matches(K, matches, 3.0, CONFIG, true), matches, restart=restart)
    assert apart_deg(final.world_T_camera, true) < 0.5
    assert list(estimator.revised()) == [2.5]
    np.testing.assert_allclose(estimator.motion.gyro_bias_rad_s, bias, atol=1e-6)
