"""Compact records of every frame and every fix for the run folder, about 100 bytes each."""

from pathlib import Path

import numpy as np

from vgps.gps.outlier_detection import FixAssessment
from vgps.mapping.growing_array import GrowingArray
from vgps.mapping.retention import RetiredPoses
from vgps.model import BoolArray, FixClass, FloatArray, GpsLog
from vgps.online.fusion.pose_sigmas import Sigmas
from vgps.readers.gps_formats.fixes import Fix
from vgps.readers.gps_formats.last_digits import LastDigits
from vgps.solution import FrameState

_CLASSES = tuple(FixClass)


class FrameArchive:
    """Poses of all frames: as published first, later as they were when the map discarded them.

    The standard deviations remain those published, since later corrections do not make a pose worse.
    """

    def __init__(self) -> None:
        self._sigmas = GrowingArray((2, 3))
        self._poses = GrowingArray((3, 4))
        self._tracked = GrowingArray()

    def append(self, world_T_camera: FloatArray, sigmas: Sigmas, tracked: bool) -> None:
        """Append the next frame; its pose is NaN if it has none in the world."""
        self._sigmas.append([sigmas.position_m, sigmas.rotation_rad])
        self._poses.append(world_T_camera[:3])
        self._tracked.append(tracked)

    def update(self, part: RetiredPoses) -> None:
        """Replace poses by their final ones, if their map is aligned."""
        if not part.aligned:
            return
        known = np.flatnonzero(np.isfinite(part.poses[:, 0, 0]))
        rows = known + part.first_frame
        self._poses.values[rows] = part.poses[known, :3]
        self._tracked.values[rows] = [row not in part.bridged for row in rows.tolist()]

    @property
    def known(self) -> BoolArray:
        """(F,) whether each frame has a pose in the world."""
        return np.asarray(np.isfinite(self._poses.values[:, 0, 0]))

    def poses(self) -> FloatArray:
        """Return world_T_camera (F, 4, 4), NaN where unknown."""
        out = np.tile(np.eye(4), (len(self._poses), 1, 1))
        out[:, :3] = self._poses.values
        return out

    def sigmas(self) -> Sigmas:
        """Return standard deviations, (F, 3) each, NaN for frames that had no pose when they came."""
        return Sigmas(self._sigmas.values[:, 0].copy(), self._sigmas.values[:, 1].copy())

    def states(self) -> tuple[FrameState, ...]:
        """Return the state of each frame (F,)."""
        states = FrameState.BRIDGED, FrameState.TRACKED
        return tuple(states[int(tracked)] for tracked in self._tracked.values)


class FixArchive:
    """All fixes in order of arrival, and the newest assessment of each."""

    def __init__(self) -> None:
        self._rows = GrowingArray((15,))
        self._assessed = GrowingArray((2,))
        self._last_digits = LastDigits()

    def __len__(self) -> int:
        return len(self._rows)

    def append(self, fix: Fix) -> None:
        """Append a fix; its time is on the video's clock."""
        numbers = (fix.hdop, fix.satellites, fix.correction_age_s, fix.line, _CLASSES.index(fix.fix_class))
        self._last_digits.add(*np.array(fix[1:4])[:, None] - [[0.0], [0.0], [fix.geoid_m]])
        known = np.isfinite(fix.logging_sigma_m)
        added_m = np.where(known, fix.logging_sigma_m, self._last_digits.rounding_m)
        self._rows.append([*fix[:4], *fix.sigma_m, *numbers, *added_m])
        self._assessed.append(np.nan)

    def times_s(self, since: int) -> FloatArray:
        """Return the times of the fixes from row ``since`` on."""
        return self._rows.values[since:, 0]

    def fix_class(self, row: int) -> FixClass:
        """Return the class of a fix."""
        return _CLASSES[int(self._rows.values[row, 11])]

    def set_assessment(self, number: np.ndarray, assessment: FixAssessment) -> None:
        """Store the newest assessment of the fixes with sequence numbers (M,)."""
        self._assessed.values[number] = np.stack([assessment.nominal, assessment.lower], axis=1)

    def log(self, source: Path, rows: slice | np.ndarray = slice(None)) -> GpsLog:
        """Return the fixes of ``rows``, in that order, as a log."""
        table = self._rows.values[rows]
        return GpsLog(
            t_s=table[:, 0].copy(),
            latitude_deg=table[:, 1].copy(),
            longitude_deg=table[:, 2].copy(),
            height_m=table[:, 3].copy(),
            fix_class=tuple(_CLASSES[int(code)] for code in table[:, 11]),
            sigma_m=table[:, 4:7].copy(),
            hdop=table[:, 7].copy(),
            satellites=table[:, 8].copy(),
            correction_age_s=table[:, 9].copy(),
            line=table[:, 10].astype(np.int64),
            source=source,
            logging_sigma_m=table[:, 12:].copy(),
        )

    def in_time_order(self) -> np.ndarray:
        """Return the rows (M,) in chronological order."""
        return np.argsort(self._rows.values[:, 0], kind="stable")

    def assessment(self, rows: np.ndarray) -> FixAssessment:
        """Return the assessment of the fixes ``rows`` (M,)."""
        nominal, lower = self._assessed.values[rows].T
        return FixAssessment(nominal.copy(), lower.copy())
