"""A straight drive of six frames in which every number is known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vgps.camera import undistort
from vgps.geometry import project
from vgps.model import Camera, FixClass, GeodeticPoint, GpsLog
from vgps.solution import (
    FixTable,
    FrameState,
    Landmarks,
    Observations,
    SensorReport,
    Solution,
    SolverReport,
    Verdict,
)

FRAMES = 6
PLANTED_PX = np.array([0.6, -0.8])  # on the first observation, of landmark 0 in frame 0: one pixel long
CAMERA = Camera("opencv", 64, 48, 50.0, 50.0, 31.5, 23.5, (-0.2, 0.03, 0.0, 0.0))
_CLASSES = (FixClass.RTK_FIX, FixClass.RTK_FLOAT, FixClass.RTK_FIX, FixClass.RTK_FIX, FixClass.UNKNOWN)
_VERDICTS = (Verdict.USED, Verdict.USED, Verdict.DOWN_CLASSED, Verdict.REJECTED, Verdict.NOT_USED)


def _poses() -> np.ndarray:
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    poses[:, :3, :3] = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # looks north
    poses[:, 1, 3] = np.arange(FRAMES)
    return poses


def _observations(poses: np.ndarray, points: np.ndarray) -> Observations:
    uv, _ = project(CAMERA.K, poses, points)
    frame, landmark = (grid.ravel() for grid in np.indices(uv.shape[:2]))
    seen = uv.reshape(-1, 2)
    seen[0] += PLANTED_PX
    return Observations(frame[::-1].copy(), landmark[::-1].copy(), seen[::-1].copy())


def _gps() -> GpsLog:
    count = len(_CLASSES)
    nan = np.full(count, np.nan)
    return GpsLog(
        t_s=np.array([0.03, 0.13, 0.23, 0.33, 0.43]),
        latitude_deg=np.full(count, 49.0),
        longitude_deg=np.full(count, 8.0),
        height_m=np.full(count, 100.0),
        fix_class=_CLASSES,
        sigma_m=np.full((count, 3), np.nan),
        hdop=nan,
        satellites=nan,
        correction_age_s=nan,
        line=np.arange(1, count + 1) * 3,
        source=Path("gps.nmea"),
    )


def _fixes() -> FixTable:
    fix = np.array([[0.0, 0.3, 0.0], [1.0, 1.3, 0.0], [0.0, 2.3, 0.0], [30.0, 3.3, 0.0], [0.0, 4.3, 9.0]])
    return FixTable(
        world_p_fix=fix,
        residual_m=np.array([[0.1, 0, 0], [-1.2, 0, 3.0], [0, 0, 0.5], [-30.0, 0, 0], [np.nan] * 3]),
        r_m=np.array([0.1, 2.4, 2.4, 0.1, np.nan]),
        h_m=np.array([0.05, 6.0, 6.0, 0.05, np.nan]),
        probability=np.array([1.0, 1.0, 0.2, 0.0, np.nan]),
        verdict=_VERDICTS,
        reason=tuple(f"{verdict}: because {k}" for k, verdict in enumerate(_VERDICTS)),
    )


@pytest.fixture
def late(solution: Solution) -> Solution:
    """The same run with time stamps that are 0.25 s late, and known to be."""
    gps = replace(solution.gps, t_s=solution.gps.t_s + 0.25)
    return replace(solution, gps=gps, sensors=replace(solution.sensors, time_offset_s=0.25))


@pytest.fixture
def solution() -> Solution:
    poses = _poses()
    points = np.array([[-1.0, 12.0, 1.0], [1.0, 14.0, -1.0], [2.0, 16.0, 0.5]])
    assert np.isfinite(undistort(CAMERA, [[0.0, 0.0], [63.0, 47.0]])).all()
    return Solution(
        recording=None,
        world_origin=GeodeticPoint(49.0, 8.0, 100.0),
        georeferenced=True,
        t_s=np.arange(FRAMES) / 10,
        world_T_camera=poses,
        sigma_rotation_rad=np.radians(np.full((FRAMES, 3), 0.25)),
        sigma_position_m=np.full((FRAMES, 3), 0.125),
        state=(FrameState.TRACKED,) * 3 + (FrameState.BRIDGED,) + (FrameState.TRACKED,) * 2,
        camera=CAMERA,
        camera_p_antenna=np.zeros(3),
        landmarks=Landmarks(points, np.array([0.5, 0.3, 1.5]), np.full(3, 100, np.uint8)),
        observations=_observations(poses, points),
        gps=_gps(),
        fixes=_fixes(),
        sensors=SensorReport(0.0, float("nan"), (float("nan"),) * 3),
        report=SolverReport({"video": 10.0, "poses": 4.0}, {"video": 2.0, "poses": 1.0}, 3, "converged"),
        seconds={"batch": 1.0},
        warnings=("the roll is a belief",),
        config={"gps": {"model": "cylinder", "n": 2, "omega": 0.5}},
        world_p_before=poses[:, :3, 3] + (0.0, 0.0, 1.0),
    )
