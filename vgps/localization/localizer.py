"""The tracker put together for a recording and a database; feeds on frames, offline or live."""

import numpy as np

from vgps.config import LocalizationConfig
from vgps.geometry.angular_rates import GyroIntegral
from vgps.landmarks.database import LandmarkDatabase
from vgps.landmarks.descriptors import describe
from vgps.landmarks.model import LandmarkViews
from vgps.landmarks.rectify import Rectifier
from vgps.localization.frame_estimator import FrameEstimator
from vgps.localization.graph_estimator import GraphEstimator
from vgps.localization.prediction import RotationPredictor
from vgps.localization.recovery import DescriptorRecovery
from vgps.localization.tracker import LandmarkTracker, TrackedFrame
from vgps.model import Float32Array, FloatArray, GrayImage, Recording


class Localizer:
    """Poses frames, one after the other.

    Args:
        recording: Its camera, rig and gyro; its video is not touched.
        database: Of the place.
        config: Settings.

    Attributes:
        rotations: The gyro between frames.
        warnings: What is missing, and what is lost by that.
    """

    def __init__(self, recording: Recording, database: LandmarkDatabase, config: LocalizationConfig) -> None:
        camera, rig = recording.camera, recording.rig
        self.warnings = sensor_warnings(recording, config)
        gyro, mount = None, rig.gyro_R_camera
        if recording.gyro is not None and mount is not None and config.use_gyro:
            gyro = GyroIntegral(recording.gyro)
        self.rotations = RotationPredictor(gyro, mount)
        self._rectifier = Rectifier(camera)
        self._estimator: FrameEstimator | GraphEstimator = FrameEstimator(config)
        if config.estimator == "graph":
            self._estimator = GraphEstimator(camera.K, gyro, mount, config)
        recovery = DescriptorRecovery(database.keyframes(), describe, camera.K, config)

        def views(world_T_camera: FloatArray, at_most: int) -> LandmarkViews:
            return database.views(world_T_camera, camera, max_landmarks=at_most)

        exposure_s = rig.exposure_s or 0.0
        self._tracker = LandmarkTracker(
            camera.K, views, self.rotations, self._estimator, recovery, exposure_s, config
        )

    @property
    def gyro_bias_rad_s(self) -> FloatArray:
        """(3,) the bias as last estimated, beyond what the rig says."""
        motion = self._estimator.motion
        return np.zeros(3) if motion is None else motion.gyro_bias_rad_s

    def undistort(self, gray: GrayImage) -> Float32Array:
        """The image as a pinhole of the same K shows it."""
        return self._rectifier(gray)

    def add(self, t_s: float, image: Float32Array) -> TrackedFrame:
        """Track the next frame, undistorted."""
        return self._tracker.add(t_s, image)

    def revised(self) -> dict[float, FloatArray]:
        """Poses (4, 4) by time of the last frames, with what was seen since."""
        return self._estimator.revised()


def sensor_warnings(recording: Recording, config: LocalizationConfig) -> tuple[str, ...]:
    """What is missing in a recording, and what is lost by that."""
    found = []
    rig, gyro = recording.rig, recording.gyro
    lost = (
        "rotation is predicted at constant angular velocity, windows are wider, a quick turn may lose track"
    )
    if not config.use_gyro:
        found.append(f"the gyro is not used (use_gyro: false): {lost}")
    elif gyro is None:
        found.append(f"there is no gyro: {lost}")
    elif rig.gyro_R_camera is None:
        found.append(
            f"rig.yaml has no gyro_R_camera, so the gyro cannot be used: {lost}; run vgps calibrate-gyro"
        )
    elif not (gyro.t_s[0] <= recording.video.times_s[0] and gyro.t_s[-1] >= recording.video.times_s[-1]):
        found.append(f"the gyro's log does not cover the whole video: where it is missing {lost}")
    if config.blur != "none" and not rig.exposure_s:
        found.append(
            "rig.yaml has no exposure_s: templates are not blurred, and blurred frames match them less well"
        )
    return tuple(found)
