import numpy as np
import pytest
from angles import apart_deg
from landmark_matches import matched
from scipy.spatial.transform import Rotation

from vgps.config import LocalizationConfig
from vgps.geometry import linearise_projection, project
from vgps.localization.pose import pose_from_matches

K = np.array([[720.0, 0, 320], [0, 700, 150], [0, 0, 1]])
POSE = np.eye(4)
POSE[:3, :3] = Rotation.from_euler("xyz", (0.2, -0.4, 0.1)).as_matrix()
POSE[:3, 3] = (520.0, -340.0, 12.0)

CONFIG = LocalizationConfig(ransac_samples=300, huber_px=1.5)


def scene(count=60, seed=1):
    """Landmarks in view, and their projections."""
    rng = np.random.default_rng(seed)
    uv = rng.uniform((0, 0), (640, 300), (count, 2))
    depth = rng.uniform(5, 60, count)
    rays = np.column_stack([(uv - K[:2, 2]) / (720, 700), np.ones(count)]) * depth[:, None]
    return rays @ POSE[:3, :3].T + POSE[:3, 3], uv


def off(pose):
    return apart_deg(POSE, pose), np.linalg.norm(pose[:3, 3] - POSE[:3, 3])


def solve(points, uv, initial=None, inlier_px=3.0, config=CONFIG):
    """Pose from matches of equal standard deviation."""
    matches = matched(np.arange(len(uv)), points, uv, np.ones(len(uv)))
    return pose_from_matches(K, matches, inlier_px, config, initial)


def test_the_scene_is_in_view():
    points, uv = scene()
    np.testing.assert_allclose(project(K, POSE, points)[0], uv, atol=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.6])
def test_exact_matches_are_separated_from_false_ones(share):
    points, uv = scene()
    false = np.random.default_rng(2).random(len(uv)) < share
    seen = np.where(false[:, None], np.random.default_rng(3).uniform((0, 0), (640, 300), uv.shape), uv)
    found = solve(points, seen)
    assert max(off(found.world_T_camera)) < 1e-3
    np.testing.assert_array_equal(found.inlier, ~false)


def test_a_good_initial_pose_wins_where_samples_fail():
    points, uv = scene()
    seen = np.random.default_rng(3).uniform((0, 0), (640, 300), uv.shape)
    seen[:8] = uv[:8]  # samples of four rarely hit these
    found = solve(points, seen, initial=POSE)
    assert found.inlier[:8].all()
    assert off(found.world_T_camera)[1] < 0.2


@pytest.mark.slow
def test_the_covariance_is_that_of_simulated_errors():
    points, uv = scene()
    rng = np.random.default_rng(5)
    errors, wide = [], CONFIG.model_copy(update={"huber_px": 50.0})
    for _ in range(300):
        seen = uv + rng.normal(size=uv.shape)
        found = solve(points, seen, initial=POSE, inlier_px=50.0, config=wide)
        local = np.linalg.inv(POSE) @ found.world_T_camera
        errors.append([*Rotation.from_matrix(local[:3, :3]).as_rotvec(), *local[:3, 3]])
    expected = np.sqrt(np.diag(found.covariance))
    np.testing.assert_allclose(np.std(errors, axis=0), expected, rtol=0.25)


def test_the_jacobian_is_the_numerical_one():
    points, uv = scene(10)
    _, jacobian = linearise_projection(K, POSE, points, uv)
    step = 1e-6
    for axis in range(6):
        numerical = []
        for sign in (1, -1):
            moved = np.eye(4)
            twist = np.zeros(6)
            twist[axis] = sign * step
            moved[:3, :3] = Rotation.from_rotvec(twist[:3]).as_matrix()
            moved[:3, 3] = twist[3:]
            numerical.append(linearise_projection(K, POSE @ moved, points, uv)[0])
        difference = (numerical[0] - numerical[1]) / (2 * step)
        np.testing.assert_allclose(jacobian[:, :, axis], difference, rtol=1e-4, atol=1e-4)


def test_three_matches_give_no_pose():
    points, uv = scene(3)
    assert solve(points, uv) is None


@pytest.mark.parametrize("spread", [(0, 0, 0), (1, 0, 0)])
def test_coincident_or_collinear_points_raise_nothing(spread):
    points = POSE[:3, 3] + POSE[:3, 2] * 10 + np.linspace(0, 1, 8)[:, None] * spread
    found = solve(points, np.tile([320.0, 150.0], (8, 1)))
    assert found is None or np.isfinite(found.world_T_camera).all()
