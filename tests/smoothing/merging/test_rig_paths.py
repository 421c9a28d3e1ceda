"""Paths of the cameras of a rig, from a path of the rig that turns."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vgps.smoothing.merging.rig_paths import (
    CameraPath,
    fill_from_other_camera,
    metres_per_unit,
    relative_scale,
)

MOUNT = np.eye(4)
MOUNT[:3, :3] = Rotation.from_euler("y", 180, degrees=True).as_matrix()
MOUNT[:3, 3] = [0.1, 0.0, -0.5]
FRAMES = 120


def rig_poses() -> np.ndarray:
    """Poses of the reference camera, which walks 12 m in a winding path and looks ahead."""
    yaw = 0.8 * np.sin(np.arange(FRAMES) / 12.0)
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("y", yaw[:, None]).as_matrix()
    poses[:, :3, 3] = np.cumsum(0.1 * poses[:, :3, 2], axis=0)
    return poses


def path_of(mount: np.ndarray, scale: float = 1.0, lost: slice = slice(0, 0)) -> CameraPath:
    tracked = np.ones(FRAMES, dtype=bool)
    tracked[lost] = False
    return CameraPath(rig_poses() @ mount, tracked, mount).scaled(scale)


def test_the_path_of_the_reference_follows_from_that_of_any_camera() -> None:
    np.testing.assert_allclose(path_of(MOUNT).of_reference, rig_poses(), atol=1e-12)
    np.testing.assert_allclose(path_of(MOUNT).rotation, rig_poses()[:, :3, :3], atol=1e-12)


def test_a_path_at_other_times_is_tracked_where_both_neighbours_are() -> None:
    t_s = np.arange(FRAMES) / 10.0
    between = path_of(np.eye(4), lost=slice(50, 60)).at(t_s, t_s[:-1] + 0.03)
    assert np.flatnonzero(~between.tracked).tolist() == list(range(49, 60))


def test_turns_show_the_distance_of_the_cameras_and_so_the_metre() -> None:
    for unit in (0.4, 2.5):
        scale, sigma = metres_per_unit(path_of(np.eye(4), 1.0 / unit), [path_of(MOUNT, 7.0)])
        assert scale == pytest.approx(unit, rel=1e-6) and sigma < 1e-3


def drifting(path: CameraPath, step: float, rng: np.random.Generator) -> CameraPath:
    """Return the path with an error that walks at random, metres per frame."""
    poses = path.poses.copy()
    poses[:, :3, 3] += np.cumsum(step * rng.standard_normal((FRAMES, 3)), axis=0)
    return CameraPath(poses, path.tracked, path.reference_T_camera)


def scales(mount: np.ndarray, step: float) -> np.ndarray:
    """Return scales and standard deviations (30, 2) of paths that drift."""
    found = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        paths = [drifting(path_of(np.eye(4)), step, rng), drifting(path_of(mount), step, rng)]
        found.append(metres_per_unit(paths[0], paths[1:]))
    return np.array(found)


def test_the_metre_has_the_standard_deviation_of_paths_that_drift() -> None:
    scale, sigma = scales(MOUNT, 0.002).T
    assert 0.7 < np.sqrt(np.mean((np.log(scale) / sigma) ** 2)) < 1.3


def test_a_distance_that_may_be_nothing_shows_no_metre() -> None:
    close = MOUNT.copy()
    close[:3, 3] *= 0.02
    scale, sigma = scales(close, 0.01).T
    assert np.isinf(sigma).all() and (scale < 0.5).all()


def test_cameras_in_one_place_show_no_metre() -> None:
    turned = MOUNT.copy()
    turned[:3, 3] = 0.0
    assert metres_per_unit(path_of(np.eye(4)), [path_of(turned)]) == (1.0, np.inf)


def test_scales_compare_where_both_cameras_are_tracked() -> None:
    near = np.eye(4)
    lost = path_of(near, 3.0, lost=slice(0, 60))
    assert relative_scale(path_of(near), lost) == pytest.approx(1.0 / 3.0)
    assert relative_scale(path_of(near, lost=slice(60, FRAMES)), lost) == 1.0


@pytest.mark.parametrize("lost", [slice(0, 30), slice(40, 90), slice(90, FRAMES)])
def test_where_one_camera_is_lost_the_other_gives_the_motion(lost: slice) -> None:
    poses = rig_poses()
    known = np.ones(FRAMES, dtype=bool)
    known[lost] = False
    poses[lost] = np.eye(4)
    moved = CameraPath(np.linalg.inv(rig_poses()[20]) @ path_of(MOUNT).poses, known | True, MOUNT)
    found, tracked = fill_from_other_camera(poses, known, moved)
    np.testing.assert_allclose(found, rig_poses(), atol=1e-9)
    assert tracked.all()
