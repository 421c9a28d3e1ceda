"""The result of a run, with one camera or with a rig."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vgps.model import Camera, ControlPoints, FloatArray, GeodeticPoint, GpsLog, IntArray
from vgps.solution.fix_table import FixTable
from vgps.solution.landmarks import Landmarks, Observations
from vgps.solution.reports import SensorReport, SolverReport
from vgps.solution.trajectory import FrameState, Trajectory


@dataclass(frozen=True, kw_only=True)
class SolvedCamera:
    """Another camera of a rig, and the landmarks that it observes.

    Attributes:
        name: Its name.
        camera: Its calibration.
        reference_T_camera: (4, 4) its pose on the rig, whose reference is the camera of the Solution.
        sigma: (6,) standard deviations about its own axes [rotation rad; translation m]; 0 if it was held.
        delay_s: (F,) times of its frames after those of the reference; 0 where it has none.
        landmarks, observations: Its map, and the observations in its frames.
    """

    name: str
    camera: Camera
    reference_T_camera: FloatArray
    sigma: FloatArray
    delay_s: FloatArray
    landmarks: Landmarks
    observations: Observations


@dataclass(frozen=True, kw_only=True)
class Solution:
    """The result of a run: everything that a run folder holds.

    Attributes:
        recording: The recording, if known.
        world_origin: Origin of the ENU world frame; None without one.
        t_s: (F,) times of the frames.
        world_T_camera: (F, 4, 4).
        sigma_rotation_rad: (F, 3) about world east, north, up.
        sigma_position_m: (F, 3) east, north, up.
        state: (F,) how each pose was obtained.
        camera: Camera, as given or refined.
        camera_p_antenna: (3,) lever arm, as given or as estimated.
        landmarks, observations: The map, and its observations in the frames.
        gps, fixes: The GPS log and the verdicts on its fixes; None without a log.
        sensors, report: Reports of the sensors and of the optimiser.
        georeferenced: False if no fix or control point tied the run to the world; the origin is then near
            the first camera and the scale is arbitrary.
        seconds: Wall seconds per stage.
        warnings: Warnings for the user.
        config: The resolved configuration.
        video_start_utc: UTC instant of the video's first frame, if the rig gives it.
        world_p_before: (F, 3) camera positions after stages A to C; None in older runs.
        control_points: Control and check points, as read; None without any.
        graph: What :func:`vgps.factor_graph` needs beside the rest, as :mod:`vgps.writers.measurements` lists
            it; None if stage D did not give this result, and in older runs.
        loops: (n, 2) frames that see a place again, and the earlier frames that saw it before.
        camera_source: What was assumed of a camera without a calibration, as a sentence; None with one.
        static_regions: (n, 6) what never moved in the picture and was left out: first and last frame; left,
            top, right and bottom of a rectangle in the original image, pixels.
        moving_regions: (m, 6) boxes around what moved on its own and was left out, likewise.
        cameras: The other cameras of a rig; ``landmarks`` and ``observations`` are those of the reference.
    """

    recording: Path | None
    world_origin: GeodeticPoint | None
    georeferenced: bool
    t_s: FloatArray
    world_T_camera: FloatArray
    sigma_rotation_rad: FloatArray
    sigma_position_m: FloatArray
    state: tuple[FrameState, ...]
    camera: Camera
    camera_p_antenna: FloatArray
    landmarks: Landmarks
    observations: Observations
    gps: GpsLog | None
    fixes: FixTable | None
    sensors: SensorReport
    report: SolverReport
    seconds: Mapping[str, float]
    warnings: tuple[str, ...]
    config: Mapping[str, Any]
    video_start_utc: datetime | None = None
    world_p_before: FloatArray | None = None
    control_points: ControlPoints | None = None
    graph: Mapping[str, npt.NDArray[Any]] | None = None
    camera_source: str | None = None
    loops: IntArray = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))
    static_regions: IntArray = field(default_factory=lambda: np.zeros((0, 6), dtype=np.int64))
    moving_regions: IntArray = field(default_factory=lambda: np.zeros((0, 6), dtype=np.int64))
    cameras: tuple[SolvedCamera, ...] = ()

    @property
    def trajectory(self) -> Trajectory:
        """Times and poses."""
        return Trajectory(self.t_s, self.world_T_camera)

    @property
    def static_share(self) -> FloatArray:
        """(F,) share of each picture that was left out because it never moves."""
        return self._share(self.static_regions)

    @property
    def moving_share(self) -> FloatArray:
        """(F,) share of each picture in boxes around what was left out because it moves on its own."""
        return self._share(self.moving_regions)

    @property
    def left_out(self) -> IntArray:
        """(n + m, 6) all that was left out of the pictures, as ``static_regions``."""
        return np.vstack([self.static_regions, self.moving_regions])

    def _share(self, regions: IntArray) -> FloatArray:
        """Return the share (F,) of each picture that rectangles (n, 6) cover."""
        first, last = regions[:, :2].T
        area = np.zeros(len(self.t_s))
        for begin, end in pairwise(np.unique(np.append(first, last + 1)).tolist()):
            area[begin:end] = _area(regions[(first <= begin) & (begin <= last), 2:])
        return (area / (self.camera.width * self.camera.height)).round(9)

    @property
    def fix_times_s(self) -> FloatArray:
        """(M,) times of the fixes on the video's clock: the log's time stamps without offset and rate."""
        return np.zeros(0) if self.gps is None else self.sensors.clock.on_video(self.gps.t_s)

    @property
    def judged_fixes(self) -> tuple[GpsLog, FixTable] | None:
        """The log and the verdicts on its fixes; None without fixes or verdicts."""
        return (self.gps, self.fixes) if self.gps and self.fixes is not None else None

    @property
    def all_landmarks(self) -> tuple[Landmarks, Observations]:
        """The landmarks of all cameras with their observations, those of the reference first."""
        maps = [(self.landmarks, self.observations), *((c.landmarks, c.observations) for c in self.cameras)]
        first = np.cumsum([0, *(len(landmarks.gray) for landmarks, _ in maps[:-1])])
        seen = [replace(one, landmark=k + one.landmark) for k, (_, one) in zip(first, maps, strict=True)]
        return Landmarks.stacked([landmarks for landmarks, _ in maps]), Observations.stacked(seen)


def _area(boxes: IntArray) -> int:
    """Return the pixels that boxes (n, 4) cover together: left, top, right, bottom."""
    x, y = np.unique(boxes[:, ::2]), np.unique(boxes[:, 1::2])
    left, top, right, bottom = boxes.T[:, :, None]
    columns, rows = (left <= x[:-1]) & (x[:-1] < right), (top <= y[:-1]) & (y[:-1] < bottom)
    covered = (rows[:, :, None] & columns[:, None]).any(axis=0)
    return int(np.diff(y) @ covered @ np.diff(x))
