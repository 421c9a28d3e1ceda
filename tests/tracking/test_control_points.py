from dataclasses import replace
from pathlib import Path

import numpy as np
from textured_room import CAMERA, LENS, distance_m, path, pixels, points_at

from vgps.camera import distort
from vgps.mapping.control_observations import ControlObservations
from vgps.model import ControlPoints, GeodeticPoint
from vgps.tracking.control_points import control_poses, world_controls

POSES = path(3)
PIXELS = np.array([[40.0, 60.0], [280.0, 70.0], [150.0, 200.0], [90.0, 180.0], [220.0, 40.0]])
POINTS = points_at(POSES[0], PIXELS)


def observed(frame, count):
    """Exact observations of the first points in a frame."""
    shown = pixels(POSES[frame], POINTS[:count])
    return np.full(count, frame), shown, POINTS[:count], np.zeros((count, 3))


def test_frames_with_four_control_points_are_posed():
    parts = [observed(0, 5), observed(1, 3), observed(2, 4)]
    poses = control_poses(
        ControlObservations(*(np.concatenate(part) for part in zip(*parts, strict=True))), CAMERA.K
    )
    assert list(poses) == [0, 2]
    for frame, pose in poses.items():
        np.testing.assert_allclose(pose, POSES[frame], atol=1e-4)


def test_one_wrong_observation_hardly_moves_the_pose():
    """20 px off: without (18) the camera would be 1.5 m off."""
    uv = np.array([[u, v] for u in (40.0, 160.0, 280.0) for v in (40.0, 120.0, 200.0)])
    points = points_at(POSES[0], uv)
    uv[4] += 20.0
    poses = control_poses(
        ControlObservations(np.zeros(9, dtype=np.int64), uv, points, np.zeros((9, 3))), CAMERA.K
    )
    assert distance_m(poses[0], POSES[0]) < 0.1


def control_points(**changes):
    points = ControlPoints(
        name=tuple("abcde"),
        sigma_m=np.zeros((5, 3)),
        check=np.zeros(5, bool),
        frame=np.zeros(5, dtype=np.int64),
        uv_px=PIXELS,
        world_p_point=POINTS,
        geodetic=False,
        source=Path("c.csv"),
    )
    return replace(points, **changes)


def test_observations_are_undistorted():
    controls = world_controls(control_points(uv_px=distort(LENS, PIXELS)), LENS, None)
    np.testing.assert_allclose(controls.uv_px, PIXELS, atol=1e-6)
    np.testing.assert_array_equal(controls.world_p_point, POINTS)


def test_pixels_beyond_the_fold_of_the_lens_are_left_out():
    """r (1 - 0.15 r^2 + 0.04 r^4 - ...) of a strong barrel: no ray leads to a pixel far outside."""
    barrel = replace(LENS, distortion=(-0.4, 0.0, 0.0, 0.0))
    uv = PIXELS.copy()
    uv[1] = 3000.0, 70.0
    controls = world_controls(control_points(uv_px=uv), barrel, None)
    assert len(controls.frame) == len(controls.uv_px) == 4
    np.testing.assert_array_equal(controls.world_p_point, np.delete(POINTS, 1, axis=0))


def test_geodetic_points_are_moved_into_the_world():
    origin = GeodeticPoint(49.0, 8.4, 160.0)
    degree_m = 111_200.0  # of latitude, at 49 degrees
    place = np.array([[49.0 + 100 / degree_m, 8.4, 160.0 + 0.1 * k] for k in range(5)])
    controls = world_controls(control_points(geodetic=True, world_p_point=place), CAMERA, origin)
    np.testing.assert_allclose(controls.world_p_point[:, 1], 100.0, atol=0.1)
    np.testing.assert_allclose(controls.world_p_point[:, 2], 0.1 * np.arange(5), atol=2e-3)


def test_without_control_points_there_are_no_observations():
    assert world_controls(None, CAMERA, None) is None


def test_check_points_are_left_out_and_sigmas_grow_with_the_views():
    """Four observations of one mark share its error: each weighs a quarter of it."""
    points = control_points(
        name=("a", "a", "a", "a", "b"), check=np.array([0, 0, 0, 0, 1], bool), sigma_m=np.full((5, 3), 0.02)
    )
    controls = world_controls(points, CAMERA, None)
    np.testing.assert_array_equal(controls.world_p_point, POINTS[:4])
    np.testing.assert_allclose(controls.sigma_m, 0.04)
