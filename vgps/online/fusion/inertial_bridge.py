"""Live poses of frames without features by the IMU: as it goes on from the path of the map in the world."""

from dataclasses import dataclass

import numpy as np

from vgps.config import Config
from vgps.geometry import cross_matrices
from vgps.imu.camera_imu import CameraImu
from vgps.imu.dead_reckoning import DeadReckoning, PathErrors
from vgps.mapping.map_update import Similarity
from vgps.model import FloatArray
from vgps.online.fusion.fusion_equations import POSITION, ROTATION, SCALE
from vgps.online.fusion.pose_sigmas import Sigmas
from vgps.online.fusion.video_path import VideoPath
from vgps.solution import Trajectory


@dataclass(frozen=True)
class BridgedPose:
    """A pose world_T_camera (4, 4) after the end of a map, and its standard deviations."""

    world_T_camera: FloatArray
    sigmas: Sigmas


class InertialBridge:
    """Poses after the end of a map by the IMU, until they are too uncertain.

    Args:
        imu: Samples at the camera; those after the newest frame do not count.
        config: Errors of the IMU, and how uncertain a pose may become.
    """

    def __init__(self, imu: CameraImu, config: Config) -> None:
        self._reckoning = DeadReckoning(imu, config.imu)
        self._limit_m, self._drift = config.online.bridge_sigma_m, config.drift

    def pose(
        self, path: VideoPath, to_world: Similarity, covariance: FloatArray, t_s: float
    ) -> BridgedPose | None:
        """Return the pose of a frame after the end of a map; None if the IMU does not show it well enough.

        Args:
            path: Of the map, frames that were bridged themselves left out.
            to_world: From its end to the world.
            covariance: (7, 7) of position, log scale and rotation at its end.
            t_s: Time of the frame.
        """
        away_s = t_s - float(path.t_s[-1])
        if len(path.t_s) < 2 or self._reckoning.least_sigma_m(away_s) > self._limit_m:
            return None  # a long gap costs no time
        poses = to_world.poses(path.poses)
        found = self._reckoning.pose(Trajectory(path.t_s, poses), self._errors(path.t_s, covariance), t_s)
        if found is None:
            return None
        lever = cross_matrices(found.world_T_camera[:3, 3] - poses[-1, :3, 3])
        turned = lever @ covariance[ROTATION, ROTATION] @ lever.T
        grown = np.diagonal(found.covariance_m2 + turned)
        if np.sqrt(grown.sum()) > self._limit_m:
            return None
        variance = np.diagonal(covariance)
        sigmas = Sigmas(np.sqrt(variance[POSITION] + grown), np.sqrt(variance[ROTATION] + found.sigma_rad**2))
        return BridgedPose(found.world_T_camera, sigmas)

    def _errors(self, t_s: FloatArray, covariance: FloatArray) -> PathErrors:
        """Return the errors of a path whose frames have times (n,)."""
        sigma = np.sqrt(np.diagonal(covariance))
        frames_per_s = (len(t_s) - 1) / (t_s[-1] - t_s[0])
        walk = self._drift.scale_sigma * np.sqrt(frames_per_s / self._drift.knot_frames)
        return PathErrors(float(sigma[ROTATION][:2].max()), float(sigma[SCALE]), float(walk))
