"""Errors of a tracked camera against its truth, and correlations of its templates, as in Matsuda 2007."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from vgps.config import LocalizationConfig
from vgps.geometry import project
from vgps.geometry.angular_rates import GyroIntegral
from vgps.landmarks.database import LandmarkDatabase
from vgps.localization import Localizer
from vgps.localization.prediction import MotionState, exposure_motion_px
from vgps.localization.template_matching import match_templates
from vgps.localization.template_rendering import render_templates
from vgps.localization.tracker import TrackedFrame
from vgps.model import BoolArray, FloatArray, Recording

ALIKE: dict[str, object] = {"max_landmarks": 160}  # for all methods
_PAPER: dict[str, object] = {"estimator": "frame", "blur": "interval"}
NOT_BLURRED = "(2) templates not blurred"
ABLATIONS: dict[str, dict[str, object]] = {
    "Matsuda 2007 (A)-(E)": _PAPER,
    "(1) selected by the last pose": _PAPER | {"select": "last_pose"},
    NOT_BLURRED: _PAPER | {"blur": "none"},
    "(3) one window for all": _PAPER | {"window": "fixed"},
}
"""Settings of the paper's tracker, and of it without one of its parts."""


@dataclass(frozen=True)
class TrackingErrors:
    """Frames of one method with their unaligned errors in position and rotation (F,)."""

    frames: list[TrackedFrame]
    position_m: FloatArray
    rotation_deg: FloatArray

    @property
    def tracked(self) -> BoolArray:
        """(F,) whether a frame was posed by landmarks."""
        return np.array([frame.tracked for frame in self.frames], dtype=bool)

    def figures(self, counted: slice) -> dict[str, Any]:
        """Return errors of the counted frames that were tracked, how many of all were, and the first loss."""
        tracked, lost = self.tracked, np.flatnonzero(~self.tracked)
        good = tracked[counted]
        position, rotation = self.position_m[counted][good], self.rotation_deg[counted][good]
        return {
            "position_mean_m": position.mean(),
            "position_median_m": np.median(position),
            "position_max_m": position.max(),
            "rotation_mean_deg": rotation.mean(),
            "rotation_max_deg": rotation.max(),
            "held": int(tracked.sum()),
            "frames": len(tracked),
            "first_loss": int(lost[0]) if len(lost) else None,
        }


def errors_of(frames: list[TrackedFrame], truth: FloatArray) -> TrackingErrors:
    """Return unaligned errors against the truth (F, 4, 4); NaN where there is not even a prediction."""
    poses = np.array([frame.world_T_camera for frame in frames])
    between = poses[:, :3, :3].transpose(0, 2, 1) @ truth[:, :3, :3]
    cosine = (np.trace(between, axis1=1, axis2=2) - 1) / 2
    position = np.linalg.norm(poses[:, :3, 3] - truth[:, :3, 3], axis=1)
    return TrackingErrors(frames, position, np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def correlations(
    recording: Recording, database: LandmarkDatabase, world_T_camera: FloatArray, every: slice
) -> tuple[FloatArray, FloatArray]:
    """Return the median correlation of each counted frame without and with blur at its pose (F, 4, 4)."""
    config, camera = LocalizationConfig.model_validate(ALIKE), recording.camera
    localizer = Localizer(recording, database, config)
    out = []
    wanted = set(np.arange(len(world_T_camera))[every].tolist())
    for frame in recording.video.frames():
        pose = world_T_camera[frame.index]
        if frame.index not in wanted or np.isnan(pose).any():
            continue
        views = database.views(pose, camera, max_landmarks=config.max_landmarks)
        if not len(views):
            out.append([np.nan, np.nan])
            continue
        motion = MotionState(t_s=frame.t_s, world_T_camera=pose)
        exposure_s = recording.rig.exposure_s or 0.0
        blur = exposure_motion_px(
            camera.K, motion, localizer.rotations, frame.t_s, exposure_s, views.world_p_landmark
        )
        uv, _ = project(camera.K, pose, views.world_p_landmark)
        image, radius = localizer.undistort(frame.gray), np.full(len(views), 3.0)
        medians = []
        for motion_px in (np.zeros_like(blur), blur):
            templates = render_templates(camera.K, pose, views, motion_px, config.template_px)
            medians.append(float(np.median(match_templates(image, templates, uv, radius).correlation)))
        out.append(medians)
    without, with_blur = np.array(out).T
    return without, with_blur


def rates_deg_s(recording: Recording) -> FloatArray:
    """Return (F,) the angular rate of the camera over each exposure."""
    assert recording.gyro is not None
    half = (recording.rig.exposure_s or 0.0) / 2 + 1e-3
    t = recording.video.times_s
    low, high = recording.gyro.t_s[0], recording.gyro.t_s[-1]
    start = np.clip(t - half, low, high - 2e-3)
    mean = GyroIntegral(recording.gyro).mean_rates(start, np.clip(t + half, low + 2e-3, high))
    return np.asarray(np.degrees(np.linalg.norm(mean, axis=1)))
