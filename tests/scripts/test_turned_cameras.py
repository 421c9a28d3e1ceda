"""Recordings as if their camera had been mounted turned."""

import numpy as np
import pytest

import vgps
from scripts.experiments.turned_cameras import turned, turned_poses
from vgps.geometry import project


@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
def test_a_turned_camera_sees_the_same_and_stands_where_it_stood(recording, quarters):
    upright = vgps.open_recording(recording)
    other = turned(upright, quarters)
    picture, seen = next(upright.video.frames()).gray, next(other.video.frames()).gray
    assert seen.shape == (other.camera.height, other.camera.width) == (other.video.height, other.video.width)
    rows, columns = np.mgrid[: picture.shape[0] : 37, : picture.shape[1] : 41].reshape(2, -1)
    rays = np.stack([columns, rows, np.ones(len(rows))]).T @ np.linalg.inv(upright.camera.K).T
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, 3] = [3.0, -2.0, 1.0]
    uv_px, _ = project(other.camera.K, turned_poses(poses, quarters), (rays + poses[0, :3, 3])[:, None])
    column, row = np.round(uv_px[:, 0]).astype(int).T
    np.testing.assert_array_equal(seen[row, column], picture[rows, columns])
    arm = turned_poses(poses, quarters)[0, :3, :3] @ other.rig.camera_p_antenna
    np.testing.assert_allclose(arm, upright.rig.camera_p_antenna, atol=1e-12)
