"""The result of a run: poses, landmarks, verdicts on the fixes, and reports of sensors and optimiser.

Conventions of frames, times and names are those of :mod:`vgps.model`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vgps.model import BoolArray, Camera, ControlPoints, FloatArray, GeodeticPoint, GpsLog, IntArray


@dataclass(frozen=True)
class Trajectory:
    """Poses over time: ``t_s`` (N,), ``world_T_camera`` (N, 4, 4)."""

    t_s: FloatArray
    world_T_camera: FloatArray

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def length_m(self) -> float:
        """Length of the path from frame to frame."""
        return float(np.linalg.norm(np.diff(self.world_T_camera[:, :3, 3], axis=0), axis=1).sum())


class FrameState(StrEnum):
    """How the pose of a frame was obtained."""

    TRACKED = "tracked"  # from features observed in it
    BRIDGED = "bridged"  # no usable features: from neighbouring frames and nearby fixes


@dataclass(frozen=True)
class Observations:
    """Landmarks observed in frames: ``frame`` (N,), ``landmark`` (N,) row of the landmarks, ``uv_px`` (N, 2)
    in the undistorted (pinhole) image."""

    frame: IntArray
    landmark: IntArray
    uv_px: FloatArray


@dataclass(frozen=True)
class Landmarks:
    """Points of the map.

    Attributes:
        world_p_landmark: (L, 3) metres.
        sigma_px: (L,) reliability sigma_j, Eq. (13), Kume 2010, pixels.
        gray: (L,) luminance in the first observation, uint8.
    """

    world_p_landmark: FloatArray
    sigma_px: FloatArray
    gray: npt.NDArray[np.uint8]


class Verdict(StrEnum):
    """Decision of the optimisation about a fix."""

    USED = "used"
    DOWN_CLASSED = "down-classed"  # used with the region of the class below its own
    REJECTED = "rejected"  # it contradicts the video and the other fixes
    NOT_USED = "not used"  # cannot contribute, for example outside the video


@dataclass(frozen=True, kw_only=True)
class FixTable:
    """Verdicts on the fixes of a log, in the same order.

    Attributes:
        world_p_fix: (M, 3) ENU metres (NaN where the fix has no position).
        residual_m: (M, 3) estimated antenna minus fix, east, north, up; NaN outside the video.
        r_m, h_m: (M,) its region: that of its class, or of the class below if it was down-classed.
        probability: (M,) that the error is that of its class; NaN where it was not assessed.
        verdict: (M,) the verdict.
        reason: (M,) its reason, as a sentence.
    """

    world_p_fix: FloatArray
    residual_m: FloatArray
    r_m: FloatArray
    h_m: FloatArray
    probability: FloatArray
    verdict: tuple[Verdict, ...]
    reason: tuple[str, ...]

    @property
    def used(self) -> BoolArray:
        """(M,) whether a fix contributed to the final estimate."""
        return np.array([verdict in {Verdict.USED, Verdict.DOWN_CLASSED} for verdict in self.verdict], bool)


@dataclass(frozen=True)
class SensorReport:
    """Estimates of the GPS's time offset, lever arm and errors, and of the camera's calibration.

    Attributes:
        time_offset_s: By which the positions are older than their time stamps.
        time_offset_sigma_s: Its standard deviation; NaN if it was not estimated.
        antenna_sigma_m: (3,) standard deviations of the lever arm; NaN if it was not estimated.
        camera_sigma: Standard deviations of the calibration by name, ``focal`` as a fraction of fx and fy;
            empty if it was not refined.
        fix_errors: Noise and walk learned from the recording, ``noise_m`` and ``walk_m`` by fix class.
        imu: Biases in the middle of the recording, in the IMU's axes, ``accelerometer_m_s2``, ``gyro_rad_s``,
            and, where known, their standard deviations (``.._sigma_..``); empty without an IMU.
        camera_height: Where it is known, ``m`` above the ground, ``scale_sigma``, the standard deviation of
            log scale by it alone, and ``stretches``, the number of those with a plane; else empty.
    """

    time_offset_s: float
    time_offset_sigma_s: float
    antenna_sigma_m: tuple[float, float, float]
    camera_sigma: Mapping[str, float] = field(default_factory=dict)
    fix_errors: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    imu: Mapping[str, list[float]] = field(default_factory=dict)
    camera_height: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class SubmapReport:
    """Submaps of stage D.

    Attributes:
        places: Frames, and states that stand between them, of each submap.
        separators: Those of each submap that tracks and factors couple with the one before; 0 for the first.
        peak_memory_mb: Most memory that the process held until stage D ended; NaN where it is not known.
    """

    places: tuple[int, ...]
    separators: tuple[int, ...]
    peak_memory_mb: float


@dataclass(frozen=True)
class SolverReport:
    """Optimisation of stage D: cost per term before and after, iterations, and reason for stopping.

    ``submaps`` is None if everything was solved at once.
    """

    cost_before: Mapping[str, float]
    cost_after: Mapping[str, float]
    iterations: int
    stop_reason: str
    submaps: SubmapReport | None = None


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
    cameras: tuple[SolvedCamera, ...] = ()

    @property
    def trajectory(self) -> Trajectory:
        """Times and poses."""
        return Trajectory(self.t_s, self.world_T_camera)

    @property
    def static_share(self) -> FloatArray:
        """(F,) share of each picture that was left out because it never moves."""
        first, last, left, top, right, bottom = self.static_regions.T
        share = (right - left) * (bottom - top) / (self.camera.width * self.camera.height)
        change = [np.bincount(frame, share, len(self.t_s) + 1) for frame in (first, last + 1)]
        return np.cumsum(change[0] - change[1])[:-1].round(9)  # whose zeros are exact

    @property
    def fix_times_s(self) -> FloatArray:
        """(M,) times of the fixes: the log's time stamps minus the time offset."""
        return np.zeros(0) if self.gps is None else self.gps.t_s - self.sensors.time_offset_s

    @property
    def all_landmarks(self) -> tuple[Landmarks, Observations]:
        """The landmarks of all cameras with their observations, those of the reference first."""
        maps = [(self.landmarks, self.observations), *((c.landmarks, c.observations) for c in self.cameras)]
        if len(maps) == 1:
            return maps[0]
        first = np.cumsum([0, *(len(landmarks.sigma_px) for landmarks, _ in maps)])
        return (
            Landmarks(
                np.concatenate([one.world_p_landmark for one, _ in maps]),
                np.concatenate([one.sigma_px for one, _ in maps]),
                np.concatenate([one.gray for one, _ in maps]),
            ),
            Observations(
                np.concatenate([seen.frame for _, seen in maps]),
                np.concatenate(
                    [start + seen.landmark for start, (_, seen) in zip(first, maps, strict=False)]
                ),
                np.concatenate([seen.uv_px for _, seen in maps]),
            ),
        )


@dataclass(frozen=True, kw_only=True)
class JoinedRuns:
    """Several runs in one world.

    Attributes:
        names: Names of the runs.
        solutions: Each run in the world of the first.
        landmarks, observations: All landmarks; frames are counted through all runs.
        ties: (R, R) number of frames of a run (row) that see a place of an earlier one (column).
        warnings: Warnings for the user.
        seconds: Wall seconds by stage.
    """

    names: tuple[str, ...]
    solutions: tuple[Solution, ...]
    landmarks: Landmarks
    observations: Observations
    ties: IntArray
    warnings: tuple[str, ...]
    seconds: Mapping[str, float]
