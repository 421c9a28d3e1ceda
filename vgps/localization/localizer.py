"""The tracker assembled for a recording and a database; takes frames one by one, recorded or live."""

import numpy as np

from vgps.config import LocalizationConfig
from vgps.geometry.angular_rates import GyroIntegral
from vgps.landmarks.database import LandmarkDatabase
from vgps.landmarks.model import LandmarkViews
from vgps.landmarks.rectify import Rectifier
from vgps.localization.diagnostics import sensor_warnings
from vgps.localization.frame_estimator import FrameEstimator
from vgps.localization.graph_estimator import GraphEstimator
from vgps.localization.landmark_predictor import LandmarkPredictor
from vgps.localization.prediction import RotationPredictor
from vgps.localization.recovery import DescriptorRecovery
from vgps.localization.tracker import LandmarkTracker, TrackedFrame
from vgps.model import Float32Array, FloatArray, GrayImage, Recording


class Localizer:
    """Localiser of successive frames.

    Args:
        recording: Its camera, rig and gyro; its video is not read.
        database: Of the place.
        config: Settings.

    Attributes:
        rotations: Of the camera between frames, from the gyro.
        warnings: Sensors that are missing, and the effect.
    """

    def __init__(self, recording: Recording, database: LandmarkDatabase, config: LocalizationConfig) -> None:
        camera, rig = recording.camera, recording.rig
        self.warnings = sensor_warnings(recording, config)
        gyro, mount = None, rig.gyro_R_camera
        if recording.gyro is not None and mount is not None and config.use_gyro:
            gyro = GyroIntegral(recording.gyro)
        self.rotations = RotationPredictor(gyro, mount)
        self._rectifier = Rectifier(camera)
        self._estimator: FrameEstimator | GraphEstimator = FrameEstimator(config.max_velocity_gap_s)
        if config.estimator == "graph":
            self._estimator = GraphEstimator(camera.K, gyro, mount, config)

        def views(world_T_camera: FloatArray, max_landmarks: int) -> LandmarkViews:
            return database.views(world_T_camera, camera, max_landmarks=max_landmarks)

        predictor = LandmarkPredictor(camera, views, self.rotations, rig.exposure_s or 0.0, config)
        recovery = DescriptorRecovery(database.keyframes(), camera.K, config)
        self._tracker = LandmarkTracker(
            camera.K, predictor, self.rotations, self._estimator, recovery, config
        )

    @property
    def gyro_bias_rad_s(self) -> FloatArray:
        """(3,) latest estimate of the bias, in addition to that in the rig."""
        motion = self._estimator.motion
        return np.zeros(3) if motion is None else motion.gyro_bias_rad_s

    def undistort(self, gray: GrayImage) -> Float32Array:
        """Return the image of a pinhole camera with the same K."""
        return self._rectifier(gray)

    def add(self, t_s: float, image: Float32Array) -> TrackedFrame:
        """Localise the next frame, undistorted."""
        return self._tracker.add(t_s, image)

    def revised(self) -> dict[float, FloatArray]:
        """Return poses (4, 4) of the last frames by time, revised by later observations."""
        return self._estimator.revised()
