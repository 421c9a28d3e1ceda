"""Standard deviations of the newest pose of the live mode.

Position, scale and rotation of visual odometry drift slowly, and fixes limit the drift. A Kalman filter
propagates the covariance of seven errors along the path, position (3), log scale, rotation (3), without
means:

- a **step** ``s`` of the path has the error ``scale * s + rotation x s``: position errors grow with distance;
- **scale and rotation** change as a random walk with the settings of ``drift``, while the camera moves;
- a **fix** has an error of the size of its class's region, which holds 95 %, and keeps it for the class's
  correlation time: a Gauss-Markov process with (3) more errors for each such time. So many fixes within
  that time are no better than one.

The filter uses the fixes optimally; stage C may not, since a fix has no effect within its region. A
correction of more than one sigma shows that the sigmas were too small: a variance factor raises them
accordingly and decays with the fixes' correlation time.

Fixes count once stage C has used them and corrected the pose, with their verdicts at that time. A frame
without features also has the error that the settings of ``motion`` allow since the last frame with features.
Errors of time offset, lever arm and calibration are not included.
"""

from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vgps.config import Config
from vgps.mapping.local_map import LocalMap
from vgps.model import FloatArray
from vgps.online.error_propagation import (
    PATH_ERRORS,
    POSITION,
    ROTATION,
    fix_measurement,
    transitions,
    unknown_covariance,
    updated,
    with_level_axis,
)
from vgps.online.pose_publisher import PublishedPose
from vgps.pipeline.frame_pipeline import FramePipeline
from vgps.smoothing.covariance import region_sigmas


@dataclass(frozen=True)
class Sigmas:
    """Standard deviations (3,) of a pose: position along, and rotation about, east, north, up."""

    position_m: FloatArray
    rotation_rad: FloatArray


UNKNOWN_SIGMAS = Sigmas(np.full(3, np.nan), np.full(3, np.nan))


class _FrameCovariance(NamedTuple):
    """Covariance (m, m) of all errors at a frame."""

    frame: int
    covariance: FloatArray


class PoseUncertainty:
    """Covariance of the newest pose, propagated by frame, and again through a window that stage C moved.

    Args:
        frame_pipeline: The pipeline whose newest map is read.
        config: Regions, drift, motion, and the prior of a level camera.
    """

    def __init__(self, frame_pipeline: FramePipeline, config: Config) -> None:
        self._frame_pipeline, self._config = frame_pipeline, config
        self._correlation_s = np.unique([region.correlation_s for region in config.gps.regions.values()])
        self._errors = PATH_ERRORS + 3 * len(self._correlation_s)
        # time stamps of the fixes that were available whenever stage C may have started
        self._available_s = deque([np.zeros(0)], maxlen=config.window.delay_frames + 1)
        self._map: LocalMap | None = None
        self._variance_factor = np.ones(2)  # of rotation and position
        self._decay_time_s = float(self._correlation_s[-1])
        self._covariances: deque[_FrameCovariance] = deque(
            maxlen=config.window.length_frames + config.window.every_frames
        )

    def record_fixes(self) -> None:
        """Record the fixes so far, once per frame, since stage C may start now."""
        self._available_s.append(self._frame_pipeline.fix_buffer.fixes.t_s)

    def sigmas(self, published: PublishedPose) -> Sigmas:
        """Return the standard deviations of the newest frame, given its published state."""
        current = self._frame_pipeline.current
        if current is None or not np.isfinite(published.global_T_camera[0, 0]):
            return UNKNOWN_SIGMAS
        self._decay_variance_factor()
        if current is not self._map:
            self._map, self._variance_factor = current, np.ones(2)
            self._covariances.clear()
        if published.correction is not None:
            self._raise_variance_factor(published.correction)
            oldest = [at for at in self._covariances if at.frame >= current.first_frame][:1]
            self._covariances.clear()
            self._covariances.extend(oldest)
        restarted = published.correction is not None or not self._covariances
        if not self._covariances:
            self._covariances.append(_FrameCovariance(current.first_posed, self._initial(current)))
            while len(self._available_s) > 1:  # the alignment used all fixes so far
                self._available_s.popleft()
        self._propagate(current, with_fixes=restarted)
        return self._newest(current)

    def _decay_variance_factor(self) -> None:
        t_s = self._frame_pipeline.t_s[-2:]
        kept = np.exp(-float(np.ptp(t_s)) / self._decay_time_s)
        self._variance_factor = 1.0 + kept * (self._variance_factor - 1.0)

    def _raise_variance_factor(self, correction: FloatArray) -> None:
        """Raise the variance factors where a correction (6,), rotation and translation, exceeds the
        sigmas."""
        if not self._covariances:
            return
        variance = np.diagonal(self._covariances[-1].covariance)
        rotated = np.mean(correction[:3] ** 2 / variance[ROTATION])
        shifted = np.mean(correction[3:] ** 2 / variance[POSITION])
        self._variance_factor = np.maximum(self._variance_factor, [rotated, shifted])

    def _propagate(self, current: LocalMap, with_fixes: bool) -> None:
        """Propagate to the map's end, with or without updates by the fixes that stage C used."""
        frame, covariance = self._covariances[-1]
        t_s = self._frame_pipeline.t_s[frame : current.next_frame]
        poses = current.poses[frame - current.first_frame :]
        standing = {held.frame for held in current.zero_motions}
        moving = np.array([row not in standing for row in range(frame + 1, current.next_frame)], dtype=bool)
        steps = np.diff(poses[:, :3, 3], axis=0)
        F, noise = transitions(steps, np.diff(t_s), moving, self._config.drift, self._correlation_s)
        measurements = self._measurements(poses, t_s) if with_fixes else {}
        for row in range(len(F)):
            covariance = F[row] @ covariance @ F[row].T
            covariance.flat[:: len(covariance) + 1] += noise[row]
            for H in measurements.get(row + 1, ()):
                covariance = updated(covariance, H, self._config.gps.min_sigma_m)
            self._covariances.append(_FrameCovariance(frame + row + 1, covariance))

    def _measurements(self, poses: FloatArray, t_s: FloatArray) -> dict[int, list[FloatArray]]:
        """Return the measurement matrices of the fixes that stage C used, by the first frame after each."""
        fixes = self._frame_pipeline.fix_buffer.usable(float(t_s[-1]))
        available = np.isin(fixes.t_s, self._available_s[0] - self._frame_pipeline.sensors.time_offset_s)
        fixes = fixes.where(available & fixes.used & (fixes.t_s > t_s[0]))
        sigma_m, slot = region_sigmas(fixes), np.searchsorted(self._correlation_s, fixes.correlation_s)
        if len(fixes):
            self._decay_time_s = float(fixes.correlation_s[-1])
        antenna, rows = self._frame_pipeline.sensors.camera_p_antenna, dict[int, list[FloatArray]]()
        for k, row in enumerate(np.searchsorted(t_s, fixes.t_s).tolist()):
            arm = poses[row, :3, :3] @ antenna
            rows.setdefault(row, []).append(fix_measurement(self._errors, arm, sigma_m[k], int(slot[k])))
        return rows

    def _initial(self, current: LocalMap) -> FloatArray:
        """Return the covariance of a path of unknown position, scale and heading, level by the prior."""
        covariance, start = unknown_covariance(len(self._correlation_s)), self._config.start
        x, z = current.poses[current.first_posed - current.first_frame :, :3, [0, 2]].mean(axis=0).T
        covariance = with_level_axis(covariance, x, float(np.radians(start.level_sigma_deg)))
        return with_level_axis(covariance, z, float(np.radians(start.pitch_sigma_deg)))

    def _newest(self, current: LocalMap) -> Sigmas:
        variance = np.diagonal(self._covariances[-1].covariance)[:PATH_ERRORS].copy()
        variance[ROTATION] *= self._variance_factor[0]
        variance[POSITION] *= self._variance_factor[1]
        t_s, last, motion = self._frame_pipeline.t_s, current.next_frame - 1, self._config.motion
        away_s = float(t_s[-1] - t_s[last])
        variance[POSITION] += motion.translation_density**2 * away_s**3 / 3.0
        variance[ROTATION] += motion.rotation_density**2 * away_s**3 / 3.0
        return Sigmas(np.sqrt(variance[POSITION]), np.sqrt(variance[ROTATION]))
