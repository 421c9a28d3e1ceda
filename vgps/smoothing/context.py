"""Constant input of stages C and D: the camera, its control points, its IMU and the settings."""

from dataclasses import dataclass

import numpy as np

from vgps.config import Config
from vgps.imu.camera_imu import CameraImu
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS, ControlObservations
from vgps.model import Camera, FloatArray, RigCamera
from vgps.runtime.journal import Journal
from vgps.solution import SolvedCamera

RigMount = RigCamera | SolvedCamera


@dataclass(frozen=True)
class SmoothingContext:
    """Camera, settings, control points, IMU and other cameras of the rig, which no stage changes."""

    camera: Camera
    config: Config
    controls: ControlObservations = NO_CONTROL_OBSERVATIONS
    imu: CameraImu | None = None
    cameras: tuple[RigMount, ...] = ()
    calibrates: bool = False
    """Whether stage C refines the camera now and then, since stage D will not."""
    estimates_readout: bool = False
    """Whether stage D improves the readout of a rolling shutter between its rounds."""
    rough: bool = False
    """Whether only the solution of stage D counts: it then draws no errors, and the sigmas are NaN."""
    journal: Journal | None = None
    """Where stage D keeps its long steps."""

    @property
    def K(self) -> FloatArray:
        """(3, 3) calibration matrix of the undistorted image."""
        return self.camera.K

    @property
    def held_sigmas(self) -> FloatArray:
        """Standard deviations of what all observations share, see :func:`camera_equations.held_coupling`."""
        each = [self.config.intrinsics.held_sigmas] * (1 + len(self.cameras))
        return np.concatenate([*each, *(one.sigma for one in self.cameras)])
