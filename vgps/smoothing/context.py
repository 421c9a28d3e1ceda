"""Constant input of stages C and D: the camera, its control points and the settings."""

from dataclasses import dataclass

from vgps.config import Config
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS, ControlObservations
from vgps.model import Camera, FloatArray


@dataclass(frozen=True)
class SmoothingContext:
    """Camera, settings and control points, which no stage changes."""

    camera: Camera
    config: Config
    controls: ControlObservations = NO_CONTROL_OBSERVATIONS

    @property
    def K(self) -> FloatArray:
        """(3, 3) calibration matrix of the undistorted image."""
        return self.camera.K
