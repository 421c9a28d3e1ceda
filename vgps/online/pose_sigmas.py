"""Standard deviations of a pose as it comes: the covariance of the errors at the newest end of the path.

Position, scale and rotation of a camera alone drift slowly, and fixes limit the drift; so a Kalman filter
propagates the covariance of seven errors along the path, position (3), log scale, rotation (3), without
means:

- a **step** ``s`` of the path has the error ``scale * s + rotation x s``: position errors grow with distance;
- **scale and rotation** change as a random walk with the settings of ``drift``, in frames that move;
- a **fix** has an error of the size of its class's region, which holds 95 %, and keeps it for the class's
  correlation time: a Gauss-Markov process, (3) more errors for each such time. So many fixes of one minute
  are no better than one of them.

That filter makes optimal use of the fixes; stage C, where they are silent within their regions, may not. A
correction of more than one sigma shows that the sigmas were too small: they grow by as much, and this decays
with the fixes' correlation time.

Fixes count once stage C has used them and moved the pose, with the verdicts of that moment. A frame without
features of its own has in addition the error that ``motion`` of the settings allows since the last one with
features. Not included: a wrong time offset, lever arm or calibration.
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
    """Standard deviations of a pose, (3,) each: ``position_m`` east, north, up, ``rotation_rad`` about
    them."""

    position_m: FloatArray
    rotation_rad: FloatArray


UNKNPATH_ERRORS = Sigmas(np.full(3, np.nan), np.full(3, np.nan))


class _At(NamedTuple):
    """The covariance (n, n) of all errors at a frame."""

    frame: int
    covariance: FloatArray


class PoseUncertainty:
    """Propagates the covariance from frame to frame, and again through the window when stage C moved it.

    Args:
        frame_pipeline: Its newest map is read.
        config: Regions, drift, motion, and the prior of a level camera.
    """

    def __init__(self, frame_pipeline: FramePipeline, config: Config) -> None:
        self._frame_pipeline, self._config = frame_pipeline, config
        self._correlation_s = np.unique([region.correlation_s for region in config.gps.regions.values()])
        self._errors = PATH_ERRORS + 3 * len(self._correlation_s)
        # times of the fixes by their own clock that stage C had when it started what is used now
        self._offered_s = deque([np.zeros(0)], maxlen=config.window.delay_frames + 1)
        self._map: LocalMap | None = None
        self._excess = np.ones(2)  # variance factors of rotation and place
        self._lasting_s = float(self._correlation_s[-1])
        self._known: deque[_At] = deque(maxlen=config.window.length_frames + config.window.every_frames)

    def note_fixes(self) -> None:
        """Note the fixes so far, once a frame: stage C may start now, with these."""
        self._offered_s.append(self._frame_pipeline.fix_buffer.fixes.t_s)

    def sigmas(self, published: PublishedPose) -> Sigmas:
        """Return the standard deviations of the newest frame, given what was published of it."""
        current = self._frame_pipeline.current
        if current is None or not np.isfinite(published.global_T_camera[0, 0]):
            return UNKNPATH_ERRORS
        self._decay_excess()
        if current is not self._map:
            self._map, self._excess = current, np.ones(2)
            self._known.clear()
        if published.moved is not None:
            self._raise_excess(published.moved)
            oldest = [at for at in self._known if at.frame >= current.first_frame][:1]
            self._known.clear()
            self._known.extend(oldest)
        anew = published.moved is not None or not self._known
        if not self._known:
            self._known.append(_At(current.first_posed, self._initial(current)))
            while len(self._offered_s) > 1:  # alignment is waited for
                self._offered_s.popleft()
        self._propagate(current, with_fixes=anew)
        return self._newest(current)

    def _decay_excess(self) -> None:
        t_s = self._frame_pipeline.t_s[-2:]
        kept = np.exp(-float(np.ptp(t_s)) / self._lasting_s)
        self._excess = 1.0 + kept * (self._excess - 1.0)

    def _raise_excess(self, moved: FloatArray) -> None:
        """Raise the sigmas where a correction (6,), rotation and translation, shows that they were too
        small."""
        if not self._known:
            return
        variance = np.diagonal(self._known[-1].covariance)
        rotated = np.mean(moved[:3] ** 2 / variance[ROTATION])
        shifted = np.mean(moved[3:] ** 2 / variance[POSITION])
        self._excess = np.maximum(self._excess, [rotated, shifted])

    def _propagate(self, current: LocalMap, with_fixes: bool) -> None:
        """Propagate to the map's end; ``with_fixes`` through the fixes that stage C used."""
        frame, covariance = self._known[-1]
        t_s = self._frame_pipeline.t_s[frame : current.next_frame]
        poses = current.poses[frame - current.first_frame :]
        standing = {held.frame for held in current.zero_motions}
        moving = np.array([row not in standing for row in range(frame + 1, current.next_frame)], dtype=bool)
        steps = np.diff(poses[:, :3, 3], axis=0)
        F, grown = transitions(steps, np.diff(t_s), moving, self._config.drift, self._correlation_s)
        measurements = self._measurements(poses, t_s) if with_fixes else {}
        for row in range(len(F)):
            covariance = F[row] @ covariance @ F[row].T
            covariance.flat[:: len(covariance) + 1] += grown[row]
            for H in measurements.get(row + 1, ()):
                covariance = updated(covariance, H, self._config.gps.min_sigma_m)
            self._known.append(_At(frame + row + 1, covariance))

    def _measurements(self, poses: FloatArray, t_s: FloatArray) -> dict[int, list[FloatArray]]:
        """Return the measurement matrices of the fixes that count, by the first frame after each."""
        fixes = self._frame_pipeline.fix_buffer.believed(float(t_s[-1]))
        offered = np.isin(fixes.t_s, self._offered_s[0] - self._frame_pipeline.sensors.time_offset_s)
        fixes = fixes.where(offered & fixes.used & (fixes.t_s > t_s[0]))
        sigma_m, slot = region_sigmas(fixes), np.searchsorted(self._correlation_s, fixes.correlation_s)
        if len(fixes):
            self._lasting_s = float(fixes.correlation_s[-1])
        antenna, rows = self._frame_pipeline.sensors.camera_p_antenna, dict[int, list[FloatArray]]()
        for k, row in enumerate(np.searchsorted(t_s, fixes.t_s).tolist()):
            arm = poses[row, :3, :3] @ antenna
            rows.setdefault(row, []).append(fix_measurement(self._errors, arm, sigma_m[k], int(slot[k])))
        return rows

    def _initial(self, current: LocalMap) -> FloatArray:
        """Return the covariance of a path anywhere, of any scale and heading, but upright by the prior."""
        covariance, start = unknown_covariance(len(self._correlation_s)), self._config.start
        x, z = current.poses[current.first_posed - current.first_frame :, :3, [0, 2]].mean(axis=0).T
        covariance = with_level_axis(covariance, x, float(np.radians(start.level_sigma_deg)))
        return with_level_axis(covariance, z, float(np.radians(start.pitch_sigma_deg)))

    def _newest(self, current: LocalMap) -> Sigmas:
        variance = np.diagonal(self._known[-1].covariance)[:PATH_ERRORS].copy()
        variance[ROTATION] *= self._excess[0]
        variance[POSITION] *= self._excess[1]
        t_s, last, motion = self._frame_pipeline.t_s, current.next_frame - 1, self._config.motion
        away_s = float(t_s[-1] - t_s[last])
        variance[POSITION] += motion.translation_density**2 * away_s**3 / 3.0
        variance[ROTATION] += motion.rotation_density**2 * away_s**3 / 3.0
        return Sigmas(np.sqrt(variance[POSITION]), np.sqrt(variance[ROTATION]))
