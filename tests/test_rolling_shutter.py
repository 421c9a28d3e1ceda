from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.model import Camera
from vgps.rolling_shutter import row_poses

CAMERA = Camera(
    model="pinhole", width=641, height=481, fx=500.0, fy=500.0, cx=320.0, cy=240.0, readout_s=0.02
)
T_S = np.arange(6) / 10


def pose_at(t: float) -> np.ndarray:
    """Pose of a camera that moves along a cubic polynomial and turns slowly."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec([0.0, 0.1 * t, 0.0]).as_matrix()
    pose[:3, 3] = (t, 2.0 - t**2, 3.0 * t**3)
    return pose


POSES = np.stack([pose_at(t) for t in T_S])
FRAME = np.array([0, 2, 3, 5])
UV_PX = np.array([[10.0, 480.0], [20.0, 0.0], [600.0, 240.0], [640.0, 120.0]])


def test_rows_have_the_poses_of_their_times() -> None:
    # the last row 10 ms late, the first 10 ms early, the middle one in time, the one between 5 ms early
    expected = [pose_at(t) for t in (0.01, 0.19, 0.3, 0.495)]
    np.testing.assert_allclose(row_poses(CAMERA, T_S, POSES, FRAME, UV_PX), expected, atol=1e-8)


def test_columns_count_where_the_picture_was_turned() -> None:
    turned = replace(CAMERA, readout_axis="columns", readout_s=-0.02)
    expected = [pose_at(t) for t in (0.01 * 310 / 320, 0.2 + 0.01 * 300 / 320, 0.3 - 0.01 * 280 / 320, 0.49)]
    np.testing.assert_allclose(row_poses(turned, T_S, POSES, FRAME, UV_PX), expected, atol=1e-8)


def test_a_global_shutter_has_the_poses_of_the_frames() -> None:
    for readout_s in (0.0, None):
        camera = replace(CAMERA, readout_s=readout_s)
        np.testing.assert_array_equal(row_poses(camera, T_S, POSES, FRAME, UV_PX), POSES[FRAME])
