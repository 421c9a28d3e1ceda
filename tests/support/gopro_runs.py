"""Runs of a GoPro's video, compared with what its metadata say."""

from pathlib import Path

import numpy as np
import pytest
from gpmf_bytes import doppler_speeds

import vgps
from vgps.geometry import interpolate_poses
from vgps.pipeline.gyro_agreement import rotation_ratio
from vgps.readers.gopro.gpmf import read_gpmf


def check_length(solution: vgps.Solution, video: Path) -> None:
    """The horizontal path, at 1 Hz, is as long as the receiver's Doppler speeds say."""
    t_s = np.arange(0.0, solution.t_s[-1], 1.0)
    path = np.column_stack(
        [np.interp(t_s, solution.t_s, solution.world_T_camera[:, axis, 3]) for axis in (0, 1)]
    )
    at_s, speeds = doppler_speeds(read_gpmf(video))
    inside = np.linspace(0.0, t_s[-1], 500)
    driven_m = np.trapezoid(np.interp(inside, at_s, speeds[:, 0]), inside)
    sigma_m = 0.05 * t_s[-1]  # u-blox states 0.05 m/s for the speed of its receivers
    found_m = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    assert found_m == pytest.approx(driven_m, abs=0.05 * driven_m + sigma_m)


def check_rotations(solution: vgps.Solution, video: Path) -> None:
    """Rotations are those of its gyro, and the vertical is that of its accelerometer."""
    opened = vgps.open_recording(video)
    ratio = rotation_ratio(solution, opened)
    assert ratio is not None and ratio.value == pytest.approx(1.0, abs=0.02)
    inside = opened.imu.t_s < solution.t_s[-1]
    poses = interpolate_poses(solution.t_s, solution.world_T_camera, opened.imu.t_s[inside])
    up = np.einsum("nij,nj->i", poses[:, :3, :3], opened.imu.force_m_s2[inside])
    assert np.degrees(np.arctan2(np.linalg.norm(up[:2]), up[2])) < 1.0
