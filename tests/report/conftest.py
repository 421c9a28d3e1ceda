"""A drive east at 10 m/s with a fix a second: one rejected, one down-classed, none from 20 to 40 s."""

from pathlib import Path

import numpy as np
import pytest

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

FRAMES = 601
T_S = 0.1 * np.arange(FRAMES)
REJECTED, LOWERED, UNUSED = 3, 8, 36
# optical axis to the east, x right to the south, y down
WORLD_R_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
ANTENNA = np.array([0.0, -1.0, 0.5])  # half a metre ahead of the camera and a metre above it


def fix_times():
    times = np.arange(0.05, 62.0)  # the last two are after the video
    return times[(times < 20.0) | (times > 40.0)]


def log_and_table():
    t_s = fix_times()
    count = len(t_s)
    classes = np.array([FixClass.RTK_FLOAT] * count, dtype=object)
    classes[: LOWERED + 1] = FixClass.RTK_FIX
    classes[UNUSED:] = FixClass.UNKNOWN
    r_m, h_m = np.full(count, 2.0), np.full(count, 5.0)
    r_m[:LOWERED], h_m[:LOWERED] = 0.1, 0.05
    r_m[UNUSED:] = h_m[UNUSED:] = np.nan
    residual = np.tile([0.03, -0.04, 0.01], (count, 1))
    residual[REJECTED] = [0.0, -20.0, 0.5]
    residual[t_s > T_S[-1]] = np.nan
    antenna = np.column_stack([10.0 * t_s + 0.5, np.zeros(count), np.ones(count)])
    verdict = [Verdict.USED] * count
    verdict[REJECTED], verdict[LOWERED] = Verdict.REJECTED, Verdict.DOWN_CLASSED
    verdict[UNUSED:] = [Verdict.NOT_USED] * (count - UNUSED)
    reason = [f"{one}: because" for one in verdict]
    reason[REJECTED] = "rejected: <b>far</b> & wrong"
    nan = np.full(count, np.nan)
    log = GpsLog(
        t_s=t_s,
        latitude_deg=np.full(count, 49.0),
        longitude_deg=np.full(count, 8.0),
        height_m=np.full(count, 100.0),
        fix_class=tuple(classes),
        sigma_m=np.full((count, 3), np.nan),
        hdop=nan,
        satellites=nan,
        correction_age_s=nan,
        line=1 + 3 * np.arange(count),
        source=Path("drive/gps.nmea"),
        skipped=("2 damaged lines passed over, first line 7",),
    )
    fixes = FixTable(
        antenna - np.nan_to_num(residual),
        residual,
        r_m,
        h_m,
        np.full(count, 0.875),
        tuple(verdict),
        tuple(reason),
    )
    return log, fixes


@pytest.fixture(scope="session")
def solution() -> Solution:
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    poses[:, :3, :3] = WORLD_R_CAMERA
    poses[:, 0, 3] = 10.0 * T_S
    log, fixes = log_and_table()
    rng = np.random.default_rng(0)
    landmarks = 50
    frame, landmark = (
        np.repeat(np.arange(0, FRAMES, 2), 3),
        rng.integers(0, landmarks, 3 * ((FRAMES + 1) // 2)),
    )
    state = [FrameState.TRACKED] * FRAMES
    state[100:110] = [FrameState.BRIDGED] * 10
    sigma = 0.02 + 0.01 * np.maximum(0.0, 20.0 - np.abs(T_S - 30.0))[:, None] * [1.0, 2.0, 4.0]
    return Solution(
        recording=Path("drives/spring"),
        world_origin=GeodeticPoint(49.0, 8.0, 100.0),
        georeferenced=True,
        t_s=T_S,
        world_T_camera=poses,
        sigma_rotation_rad=np.full((FRAMES, 3), 0.002),
        sigma_position_m=sigma,
        state=tuple(state),
        camera=Camera("pinhole", 640, 480, 500.0, 501.0, 320.0, 240.0),
        camera_p_antenna=ANTENNA,
        landmarks=Landmarks(
            rng.normal(0, 30, (landmarks, 3)), np.ones(landmarks), np.zeros(landmarks, np.uint8)
        ),
        observations=Observations(frame, landmark, np.zeros((len(frame), 2))),
        gps=log,
        fixes=fixes,
        sensors=SensorReport(0.125, 0.014, (0.01, 0.02, 0.03)),
        report=SolverReport(
            {"video": 1000.0, "poses": 50.0}, {"video": 100.0, "poses": 5.0}, 12, "converged"
        ),
        seconds={"track": 20.0, "batch": 10.0},
        warnings=("the clock lags & so on",),
        config={"seed": 0, "gps": {"model": "cylinder"}},
    )
