"""An IMU on a camera whose motion is known exactly."""

from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from vgps.model import ImuLog, ImuMount
from vgps.simulate import Motion
from vgps.solution import Trajectory

GRAVITY_M_S2 = 9.80665
MOUNT = ImuMount(
    imu_R_camera=Rotation.from_euler("xyz", [20.0, -50.0, 100.0], degrees=True).as_matrix(),
    imu_p_camera=np.array([0.3, -0.1, 0.2]),
)


def swinging_motion(duration_s: float = 10.0) -> Motion:
    """A camera that drives round bends, nods and sways."""
    t = np.arange(-1.0, duration_s + 1.0, 0.2)
    values = np.column_stack(
        [
            6.0 * t + np.sin(t),
            8.0 * np.sin(0.4 * t),
            1.5 + 0.3 * np.sin(1.3 * t),
            0.8 * np.sin(0.5 * t),
            0.15 * np.sin(1.1 * t),
            0.1 * np.sin(0.9 * t + 1.0),
        ]
    )
    return Motion(CubicSpline(t, values))


def path_of(motion: Motion, duration_s: float = 10.0, rate_hz: float = 10.0) -> Trajectory:
    """The camera's poses at the times of the frames."""
    t = np.arange(0.0, duration_s + 1e-9, 1.0 / rate_hz)
    return Trajectory(t, motion.poses(t))


class SplineMotion:
    """A smooth motion through given poses, with the methods of a simulated one."""

    def __init__(self, path: Trajectory) -> None:
        self._rotation = RotationSpline(path.t_s, Rotation.from_matrix(path.world_T_camera[:, :3, :3]))
        self._position = CubicSpline(path.t_s, path.world_T_camera[:, :3, 3])

    def poses(self, t_s: np.ndarray) -> np.ndarray:
        """World_T_camera (N, 4, 4)."""
        poses = np.tile(np.eye(4), (len(t_s), 1, 1))
        poses[:, :3, :3], poses[:, :3, 3] = self._rotation(t_s).as_matrix(), self._position(t_s)
        return poses

    def rates(self, t_s: np.ndarray) -> np.ndarray:
        """Angular rates (N, 3) in the camera's axes."""
        return self._rotation(t_s, 1)


def exact_log(
    motion: Motion | SplineMotion,
    mount: ImuMount = MOUNT,
    duration_s: float = 10.0,
    rate_hz: float = 200.0,
    **errors,
) -> ImuLog:
    """What a perfect IMU logs, plus constant errors ``gyro_bias`` and ``accelerometer_bias`` in its axes.

    The IMU's own path is differentiated, so that this knows nothing of lever arms.
    """
    t, h = np.arange(-0.5, duration_s + 0.5, 1.0 / rate_hz), 1e-3
    camera_p_imu = -mount.imu_R_camera.T @ mount.imu_p_camera
    before, at, after = (
        poses[:, :3, :3] @ camera_p_imu + poses[:, :3, 3] for poses in map(motion.poses, (t - h, t, t + h))
    )
    force = (before - 2.0 * at + after) / h**2 + [0.0, 0.0, GRAVITY_M_S2]
    in_camera = np.einsum("nji,nj->ni", motion.poses(t)[:, :3, :3], force)
    return ImuLog(
        t_s=t,
        rate_rad_s=motion.rates(t) @ mount.imu_R_camera.T + errors.get("gyro_bias", 0.0),
        force_m_s2=in_camera @ mount.imu_R_camera.T + errors.get("accelerometer_bias", 0.0),
        saturated=np.zeros(len(t), dtype=bool),
        source=Path("imu.csv"),
    )
