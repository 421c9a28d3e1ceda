"""Constant input of stages C and D: the camera, its control points, its IMU and the settings."""

from dataclasses import dataclass

from vgps.config import Config
from vgps.imu.camera_imu import CameraImu
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS, ControlObservations
from vgps.model import Camera, FloatArray


@dataclass(frozen=True)
class SmoothingContext:
    """Camera, settings, control points and IMU, which no stage changes."""

    camera: Camera
    config: Config
    controls: ControlObservations = NO_CONTROL_OBSERVATIONS
    imu: CameraImu | None = None
    estimates_readout: bool = False
    """Whether stage D improves the readout of a rolling shutter between its rounds."""

    @property
    def K(self) -> FloatArray:
        """(3, 3) calibration matrix of the undistorted image."""
        return self.camera.K
