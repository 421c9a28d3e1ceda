"""Fixes of a recording in chronological order, with their assessment and time offset."""

import copy

import numpy as np

from vgps.config import Config
from vgps.gps.fixes import Fixes
from vgps.gps.outlier_detection import FixAssessment, detect_outliers, detects_outliers
from vgps.gps.sensors import Sensors
from vgps.gps.time_offset import update_time_offset
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.solution import Trajectory


class FixBuffer:
    """All fixes so far, in chronological order whatever the order in which they arrived.

    Attributes:
        fixes: Fixes at the times of their time stamps.
        number: (M,) sequence number in order of arrival; it identifies a fix when rows move.
        assessment: Assessment of all fixes, NaN before the first one.
        sensors: Time offset estimated so far, and lever arm.
    """

    def __init__(self, fixes: Fixes, camera_p_antenna: FloatArray, config: Config) -> None:
        self._config = config
        self.fixes = fixes
        self.number: IntArray = np.arange(len(fixes))
        self.assessment = FixAssessment.unassessed(len(fixes))
        self.sensors = Sensors.from_config(camera_p_antenna, config.sensors)
        self._added = len(fixes)
        self._late = False
        self._discarded = False

    def add(self, more: Fixes, now_s: float) -> None:
        """Add fixes of any time; those of positions from before ``now_s`` count as late."""
        self.fixes, order = self.fixes.merged(more)
        self.number = np.append(self.number, self._added + np.arange(len(more)))[order]
        self._added += len(more)
        self.assessment = self.assessment.merged(FixAssessment.unassessed(len(more)), order)
        self._late |= bool((more.used & (self.sensors.clock.on_video(more.t_s) <= now_s)).any())

    def discard_before(self, before_s: float) -> None:
        """Discard older fixes and their assessment."""
        keep: BoolArray = self.fixes.t_s >= before_s
        if keep.all():
            return
        self.fixes, self.number = self.fixes.where(keep), self.number[keep]
        self.assessment = self.assessment.where(keep)
        self._discarded = True

    def snapshot(self) -> "FixBuffer":
        """Return a copy that can be assessed while fixes are added to this one."""
        return copy.copy(self)

    def update_from(self, snapshot: "FixBuffer") -> None:
        """Take over a snapshot's time offset, and its assessment of the fixes that this buffer still
        holds."""
        self.sensors = snapshot.sensors
        self.update_assessment(snapshot.number, snapshot.assessment)

    def update_assessment(self, number: IntArray, assessment: FixAssessment) -> None:
        """Take over the assessment of the fixes with sequence numbers (M,) that this buffer still holds."""
        newer = FixAssessment.unassessed(len(self.number))
        _, row, other_row = np.intersect1d(self.number, number, return_indices=True)
        newer.nominal[row], newer.lower[row] = assessment.nominal[other_row], assessment.lower[other_row]
        self.assessment = self.assessment.updated(newer)

    def has_new(self, since_s: float, until_s: float) -> bool:
        """Return whether the position of a usable fix is of (``since_s``, ``until_s``], or one arrived late
        since the last call."""
        t_s = self.corrected.t_s
        has_new = self._late or bool((self.fixes.used & (t_s > since_s) & (t_s <= until_s)).any())
        self._late = False
        return has_new

    def usable(self, until_s: float) -> Fixes:
        """Return the fixes until a time with their verdicts applied, at the times of their positions."""
        return self.assessment.applied(self.corrected).until(until_s)

    @property
    def corrected(self) -> Fixes:
        """All fixes, at the times of their positions."""
        return self.fixes.on_video_clock(self.sensors)

    def update_time_offset(self, path: Trajectory) -> None:
        """Estimate the time offset from the odometry of a path.

        If there are fixes from before the path, the offset estimated from them is kept until enough fixes are
        within the path: a few, as after an outage, agree with some offset by chance.
        """
        config = self._config.sensors
        if self._discarded or bool((self.fixes.used & (self.fixes.t_s < path.t_s[0])).any()):
            inside = self.fixes.used & (self.fixes.t_s >= path.t_s[0]) & (self.fixes.t_s <= path.t_s[-1])
            if inside.sum() < config.time_offset.min_fixes:
                return
            config = config.model_copy(update={"time_offset_s": self.sensors.time_offset_s})
        assessed = self.assessment.applied(self.fixes).without_clock_rate(self.sensors)
        self.sensors, _ = update_time_offset(self.sensors, path, assessed, config)

    def detect_outliers(self, path: Trajectory, used_until_s: float = -np.inf) -> float:
        """Assess all fixes along a path again: later fixes and frames may reverse a verdict.

        Args:
            path: The path so far.
            used_until_s: Time until which fixes have been used before.

        Returns:
            Time of the first fix by ``used_until_s`` that is now rejected and was not before; infinity if
            there is none.
        """
        if not detects_outliers(self._config):
            return np.inf
        fixes, before = self.corrected, self.assessment.rejected
        newer = detect_outliers(path, fixes, self.sensors.camera_p_antenna, self._config)
        self.assessment = self.assessment.updated(newer)
        newly_rejected = self.assessment.rejected & ~before & (fixes.t_s <= used_until_s)
        return float(fixes.t_s[newly_rejected].min(initial=np.inf))
