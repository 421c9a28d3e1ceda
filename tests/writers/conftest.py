"""A small Solution in which every value differs from every other."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

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

FRAMES, LANDMARKS, FIXES = 4, 3, 2


def _poses() -> np.ndarray:
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    # frame 0: optical axis to the east, x right to the south, y down
    poses[0, :3, :3] = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    poses[1:, :3, :3] = Rotation.random(FRAMES - 1, random_state=3).as_matrix()
    poses[:, :3, 3] = [[1.0, 2.0, 3.0], [1.25, -2.5, 3.125], [1.5, 2e-10, -3.0], [1e5, 2.0, 0.1]]
    return poses


def _gps() -> GpsLog:
    return GpsLog(
        t_s=np.array([0.03, 1.03]),
        latitude_deg=np.array([49.011, 49.0111]),
        longitude_deg=np.array([8.4165, 8.4166]),
        height_m=np.array([163.5, np.nan]),
        fix_class=(FixClass.RTK_FIX, FixClass.RTK_FLOAT),
        sigma_m=np.array([[0.01, 0.02, 0.03], [np.nan] * 3]),
        hdop=np.array([0.8, np.nan]),
        satellites=np.array([12.0, 11.0]),
        correction_age_s=np.array([1.0, np.nan]),
        line=np.array([1, 4]),
        source=Path("drive/gps.nmea"),
        skipped=("line 7: truncated",),
    )


def _fixes() -> FixTable:
    return FixTable(
        world_p_fix=np.array([[0.5, 0.25, 1.0], [10.0, 11.0, 12.0]]),
        residual_m=np.array([[0.03, -0.04, 0.1], [np.nan] * 3]),
        r_m=np.array([0.1, 2.4]),
        h_m=np.array([0.05, 6.5]),
        probability=np.array([0.99, np.nan]),
        verdict=(Verdict.USED, Verdict.NOT_USED),
        reason=("inside its region", "outside the video, after its end"),
    )


@pytest.fixture
def solution() -> Solution:
    """Four frames, three landmarks (one never seen), two fixes (one unused), an ü, and NaN here and there."""
    return Solution(
        recording=Path("rec/wälk"),
        world_origin=GeodeticPoint(49.011, 8.4165, 163.0),
        georeferenced=True,
        t_s=np.array([0.0, 0.1, 0.2, 1 / 3]),
        world_T_camera=_poses(),
        sigma_rotation_rad=np.radians(np.arange(1.0, 13.0).reshape(FRAMES, 3)),
        sigma_position_m=np.vstack([np.arange(1.0, 10.0).reshape(3, 3) / 100, [[np.nan] * 3]]),
        state=(FrameState.TRACKED, FrameState.BRIDGED, FrameState.TRACKED, FrameState.TRACKED),
        camera=Camera("tsai", 720, 480, 900.0, 901.0, 359.5, 240.5, (1e-3, 2e-5), (0.0075, 0.0071)),
        camera_p_antenna=np.array([0.05, -0.93, -0.32]),
        landmarks=Landmarks(
            np.array([[1.0, 2.0, 30.0], [4.0, 5.0, 1 / 7], [7.0, 8.0, 9.0]]),
            np.array([0.5, 0.25, 1.5]),
            np.array([7, 128, 255], dtype=np.uint8),
        ),
        observations=Observations(
            np.array([0, 0, 1, 3]), np.array([0, 2, 0, 2]), np.arange(8.0).reshape(4, 2) * np.pi
        ),
        gps=_gps(),
        fixes=_fixes(),
        sensors=SensorReport(0.125, float("nan"), (0.01, 0.02, float("nan"))),
        report=SolverReport(
            {"video": 12.5, "gps": 3.0}, {"video": 1.25, "gps": float("nan")}, 7, "cost no longer decreases"
        ),
        seconds={"tracking": 1.5, "batch": 0.25},
        warnings=("frame 1 has too few features; für Frame 1 gilt die Brücke",),
        world_p_before=np.arange(12.0).reshape(FRAMES, 3) / 7,
        config={"gps": {"model": "cylinder", "n": 4, "omega": 1e-8, "limit": None}, "names": ["a", "b"]},
    )
