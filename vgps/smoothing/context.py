"""What stages C and D are given for a whole run: the camera, its control points and the settings."""

from dataclasses import dataclass

from vgps.config import Config
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS, ControlObservations
from vgps.model import Camera, FloatArray


@dataclass(frozen=True)
class SmoothingContext:
    """The parts of a problem that no stage estimates."""

    camera: Camera
    config: Config
    controls: ControlObservations = NO_CONTROL_OBSERVATIONS

    @property
    def K(self) -> FloatArray:
        """(3, 3) calibration of the undistorted image."""
        return self.camera.K
