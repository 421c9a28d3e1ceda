"""How far a pose may be off as it comes: the covariance of what is wrong with the newest end of the path.

A camera alone gets place, scale and rotation wrong slowly, and fixes say how much; so a Kalman filter carries
the covariance of seven errors along the path, place (3), log scale, rotation (3), and nothing but it:

- a **step** ``s`` of the path is wrong by ``scale * s + rotation x s``: place errors grow with the way;
- **scale and rotation** walk at random as ``drift`` of the configuration says, by frames that move;
- a **fix** errs as its class's region says, of which it leaves a twentieth outside, and its error stays alike
  for the class's correlation time: a Gauss-Markov process, (3) more errors for each such time. So many fixes
  of one minute are no better than one of them.

That filter makes the best of the fixes; stage C, to which they are silent within their regions, may not. A
correction of more than one sigma shows that the sigmas were too small: they grow by as much, and this fades
with the fixes' correlation time.

Fixes count once stage C has seen them and moved the pose, with the verdicts of that moment. A frame without
features of its own is off besides by what ``motion`` of the configuration allows since the last one with any.
What is not seen: a wrong lag, lever arm or calibration.
"""

from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vgps.config import Config
from vgps.mapping.local_map import LocalMap
from vgps.model import FloatArray
from vgps.online.error_propagation import OWN, PLACE, TURN, fix_rows, level, seen, transitions, unknown
from vgps.online.pose_publisher import PublishedPose
from vgps.pipeline.frame_pipeline import FramePipeline
from vgps.smoothing.covariance import region_sigmas


@dataclass(frozen=True)
class Sigmas:
    """Of a pose, (3,) each: ``position_m`` east, north, up, ``rotation_rad`` about them."""

    position_m: FloatArray
    rotation_rad: FloatArray


UNKNOWN = Sigmas(np.full(3, np.nan), np.full(3, np.nan))


class _At(NamedTuple):
    """The covariance (n, n) of all errors at a frame."""

    frame: int
    covariance: FloatArray


class PathErrors:
    """Carries the covariance from frame to frame, and anew through the window whenever stage C moved it.

    Args:
        frame_pipeline: Whose newest map is followed.
        config: Regions, drift, motion, and what is believed of a camera's level.
    """

    def __init__(self, frame_pipeline: FramePipeline, config: Config) -> None:
        self._frame_pipeline, self._config = frame_pipeline, config
        self._correlation_s = np.unique([region.correlation_s for region in config.gps.regions.values()])
        self._errors = OWN + 3 * len(self._correlation_s)
        # times of the fixes by their own clock, as stage C saw them when it began what is used now
        self._offered_s = deque([np.zeros(0)], maxlen=config.window.delay_frames + 1)
        self._map: LocalMap | None = None
        self._excess = np.ones(2)  # variance factors of rotation and place
        self._lasting_s = float(self._correlation_s[-1])
        self._known: deque[_At] = deque(maxlen=config.window.length_frames + config.window.every_frames)

    def offer(self) -> None:
        """Once a frame: stage C may begin now, and sees the fixes so far."""
        self._offered_s.append(self._frame_pipeline.fix_buffer.fixes.t_s)

    def follow(self, followed: PublishedPose) -> Sigmas:
        """Of the newest frame, as it was published."""
        current = self._frame_pipeline.current
        if current is None or not np.isfinite(followed.global_T_camera[0, 0]):
            return UNKNOWN
        self._fade()
        if current is not self._map:
            self._map, self._excess = current, np.ones(2)
            self._known.clear()
        if followed.moved is not None:
            self._doubt(followed.moved)
            oldest = [at for at in self._known if at.frame >= current.first_frame][:1]
            self._known.clear()
            self._known.extend(oldest)
        anew = followed.moved is not None or not self._known
        if not self._known:
            self._known.append(_At(current.first_posed, self._beginning(current)))
            while len(self._offered_s) > 1:  # alignment is waited for
                self._offered_s.popleft()
        self._carry(current, with_fixes=anew)
        return self._sigmas(current)

    def _fade(self) -> None:
        t_s = self._frame_pipeline.t_s[-2:]
        kept = np.exp(-float(np.ptp(t_s)) / self._lasting_s)
        self._excess = 1.0 + kept * (self._excess - 1.0)

    def _doubt(self, moved: FloatArray) -> None:
        """What a correction (6,), turn and shift, says about the sigmas before it."""
        if not self._known:
            return
        variance = np.diagonal(self._known[-1].covariance)
        turned = np.mean(moved[:3] ** 2 / variance[TURN])
        shifted = np.mean(moved[3:] ** 2 / variance[PLACE])
        self._excess = np.maximum(self._excess, [turned, shifted])

    def _carry(self, current: LocalMap, with_fixes: bool) -> None:
        """To the map's end; ``with_fixes`` through what stage C made use of."""
        frame, covariance = self._known[-1]
        t_s = self._frame_pipeline.t_s[frame : current.next_frame]
        poses = current.poses[frame - current.first_frame :]
        standing = {tie.frame for tie in current.zero_motions}
        moving = np.array([row not in standing for row in range(frame + 1, current.next_frame)], dtype=bool)
        steps = np.diff(poses[:, :3, 3], axis=0)
        F, grown = transitions(steps, np.diff(t_s), moving, self._config.drift, self._correlation_s)
        rows = self._rows_of_fixes(poses, t_s) if with_fixes else {}
        for row in range(len(F)):
            covariance = F[row] @ covariance @ F[row].T
            covariance.flat[:: len(covariance) + 1] += grown[row]
            for H in rows.get(row + 1, ()):
                covariance = seen(covariance, H, self._config.gps.min_sigma_m)
            self._known.append(_At(frame + row + 1, covariance))

    def _rows_of_fixes(self, poses: FloatArray, t_s: FloatArray) -> dict[int, list[FloatArray]]:
        """By the first frame after a fix: what each says, of those that count."""
        fixes = self._frame_pipeline.fix_buffer.believed(float(t_s[-1]))
        offered = np.isin(fixes.t_s, self._offered_s[0] - self._frame_pipeline.sensors.time_offset_s)
        fixes = fixes.where(offered & fixes.used & (fixes.t_s > t_s[0]))
        sigma_m, slot = region_sigmas(fixes), np.searchsorted(self._correlation_s, fixes.correlation_s)
        if len(fixes):
            self._lasting_s = float(fixes.correlation_s[-1])
        antenna, rows = self._frame_pipeline.sensors.camera_p_antenna, dict[int, list[FloatArray]]()
        for k, row in enumerate(np.searchsorted(t_s, fixes.t_s).tolist()):
            arm = poses[row, :3, :3] @ antenna
            rows.setdefault(row, []).append(fix_rows(self._errors, arm, sigma_m[k], int(slot[k])))
        return rows

    def _beginning(self, current: LocalMap) -> FloatArray:
        """Anywhere, of any scale and heading, but upright as alignment takes it to be."""
        covariance, start = unknown(len(self._correlation_s)), self._config.start
        x, z = current.poses[current.first_posed - current.first_frame :, :3, [0, 2]].mean(axis=0).T
        covariance = level(covariance, x, float(np.radians(start.level_sigma_deg)))
        return level(covariance, z, float(np.radians(start.pitch_sigma_deg)))

    def _sigmas(self, current: LocalMap) -> Sigmas:
        variance = np.diagonal(self._known[-1].covariance)[:OWN].copy()
        variance[TURN] *= self._excess[0]
        variance[PLACE] *= self._excess[1]
        t_s, last, motion = self._frame_pipeline.t_s, current.next_frame - 1, self._config.motion
        away_s = float(t_s[-1] - t_s[last])
        variance[PLACE] += motion.translation_density**2 * away_s**3 / 3.0
        variance[TURN] += motion.rotation_density**2 * away_s**3 / 3.0
        return Sigmas(np.sqrt(variance[PLACE]), np.sqrt(variance[TURN]))
