"""The fixes of a recording as they come: in order of time, with their assessment and their time offset."""

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
    """All fixes so far, in order of time however they came.

    Attributes:
        fixes: By their own clock.
        number: (M,) how many fixes had been added before each: its identity, while rows move.
        assessment: Of all fixes, as far as they have been assessed.
        sensors: The time offset of the fixes as the path so far shows it, and the lever arm.
    """

    def __init__(self, fixes: Fixes, camera_p_antenna: FloatArray, config: Config) -> None:
        self._config = config
        self.fixes = fixes
        self.number: IntArray = np.arange(len(fixes))
        self.assessment = FixAssessment.none(len(fixes))
        self.sensors = Sensors.begin(camera_p_antenna, config.sensors)
        self._added = len(fixes)
        self._late = False
        self._discarded = False

    def add(self, more: Fixes, now_s: float) -> None:
        """Add fixes of any time; those from before ``now_s`` count as late."""
        self.fixes, order = self.fixes.merged(more)
        self.number = np.append(self.number, self._added + np.arange(len(more)))[order]
        self._added += len(more)
        self.assessment = self.assessment.merged(FixAssessment.none(len(more)), order)
        self._late |= bool((more.used & (more.t_s <= now_s)).any())

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
        """Take over what a snapshot found of the time offset and of the fixes that this one still holds."""
        self.sensors = snapshot.sensors
        found = FixAssessment.none(len(self.number))
        _, own, its = np.intersect1d(self.number, snapshot.number, return_indices=True)
        found.own[own], found.lower[own] = snapshot.assessment.own[its], snapshot.assessment.lower[its]
        self.assessment = self.assessment.updated(found)

    def has_new(self, since_s: float, until_s: float) -> bool:
        """Return whether a usable fix lies after ``since_s`` and by ``until_s``, or came late since the
        last call."""
        t_s = self.fixes.t_s
        found = self._late or bool((self.fixes.used & (t_s > since_s) & (t_s <= until_s)).any())
        self._late = False
        return found

    def believed(self, until_s: float) -> Fixes:
        """Return the fixes until a time as they are assessed, in time."""
        return self.assessment.applied(self._in_time).until(until_s)

    @property
    def _in_time(self) -> Fixes:
        return self.fixes.earlier(self.sensors.time_offset_s)

    def update_time_offset(self, path: Trajectory) -> None:
        """Estimate the clock's time offset from a path before the window bends to it.

        Where fixes lie before the path, the offset found by them is kept until many fixes disagree: a few,
        as after an outage, agree with some offset by chance.
        """
        config = self._config.sensors
        if self._discarded or bool((self.fixes.used & (self.fixes.t_s < path.t_s[0])).any()):
            inside = self.fixes.used & (self.fixes.t_s >= path.t_s[0]) & (self.fixes.t_s <= path.t_s[-1])
            if inside.sum() < config.time_offset.min_fixes:
                return
            config = config.model_copy(update={"time_offset_s": self.sensors.time_offset_s})
        believed = self.assessment.applied(self.fixes)
        self.sensors, _ = update_time_offset(self.sensors, path, believed, config)

    def detect_outliers(self, path: Trajectory, used_until_s: float = -np.inf) -> float:
        """Assess all fixes along a path anew: what came later may reverse a verdict.

        Returns:
            Time of the first fix by ``used_until_s`` that was believed and is not any more; infinity if there
            is none.
        """
        if not detects_outliers(self._config):
            return np.inf
        fixes, before = self._in_time, self.assessment.rejected
        found = detect_outliers(path, fixes, self.sensors.camera_p_antenna, self._config)
        self.assessment = self.assessment.updated(found)
        given_up = self.assessment.rejected & ~before & (fixes.t_s <= used_until_s)
        return float(fixes.t_s[given_up].min(initial=np.inf))
