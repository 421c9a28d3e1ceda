"""Solutions made by hand: one builder, and the runs that several tests look at.

Every value that a test does not care about has a default; the rest is given by keyword.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vgps.camera import undistort
from vgps.geometry import project
from vgps.model import Camera, FixClass, GeodeticPoint, GpsLog
from vgps.readers.recording import open_recording
from vgps.readers.trajectory import read_trajectory
from vgps.solution import (
    FixTable,
    FrameState,
    Landmarks,
    Observations,
    SensorReport,
    Solution,
    SolvedCamera,
    SolverReport,
    Verdict,
)

NAN = float("nan")
# camera axes in the world: optical axis to the east, x right to the south, y down
EAST_R_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
NORTH_R_CAMERA = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])

PINHOLE = Camera(model="pinhole", width=640, height=480, fx=500.0, fy=501.0, cx=320.0, cy=240.0)


def on_a_rig(solution: Solution) -> Solution:
    """The run with another camera, which looks back and observes what the first does."""
    back = np.diag([-1.0, 1.0, -1.0, 1.0])
    back[2, 3] = -0.2
    rear = SolvedCamera(
        name="rear",
        camera=PINHOLE,
        reference_T_camera=back,
        sigma=np.full(6, 0.01),
        delay_s=np.full(len(solution.t_s), 0.005),
        landmarks=solution.landmarks,
        observations=solution.observations,
    )
    return replace(solution, cameras=(rear,))


def make_poses(world_p_camera: np.ndarray, world_R_camera: np.ndarray) -> np.ndarray:
    """(F, 4, 4) poses from positions (F, 3) and rotations, (3, 3) or (F, 3, 3)."""
    poses = np.tile(np.eye(4), (len(world_p_camera), 1, 1))
    poses[:, :3, :3] = world_R_camera
    poses[:, :3, 3] = world_p_camera
    return poses


def make_gps_log(t_s: np.ndarray, fix_class: tuple[FixClass, ...], **changes: Any) -> GpsLog:
    """A log of fixes at one place, without the receiver's own sigmas."""
    count = len(t_s)
    unknown = np.full(count, np.nan)
    log = GpsLog(
        t_s=t_s,
        latitude_deg=np.full(count, 49.0),
        longitude_deg=np.full(count, 8.0),
        height_m=np.full(count, 100.0),
        fix_class=fix_class,
        sigma_m=np.full((count, 3), np.nan),
        hdop=unknown,
        satellites=unknown,
        correction_age_s=unknown,
        line=3 * np.arange(1, count + 1),
        source=Path("gps.nmea"),
    )
    return replace(log, **changes)


def make_landmarks(world_p_landmark: np.ndarray, **changes: Any) -> Landmarks:
    """Grey landmarks with a reliability of one pixel."""
    count = len(world_p_landmark)
    return replace(Landmarks(world_p_landmark, np.ones(count), np.full(count, 128, np.uint8)), **changes)


def make_solution(t_s: np.ndarray, world_T_camera: np.ndarray, **changes: Any) -> Solution:
    """A georeferenced run, all frames tracked, without landmarks and GPS unless they are given."""
    count = len(t_s)
    none = np.zeros(0, dtype=np.int64)
    solution = Solution(
        recording=None,
        world_origin=GeodeticPoint(49.0, 8.0, 100.0),
        georeferenced=True,
        t_s=t_s,
        world_T_camera=world_T_camera,
        sigma_rotation_rad=np.full((count, 3), 0.01),
        sigma_position_m=np.full((count, 3), 0.01),
        state=(FrameState.TRACKED,) * count,
        camera=PINHOLE,
        camera_p_antenna=np.zeros(3),
        landmarks=make_landmarks(np.zeros((0, 3))),
        observations=Observations(none, none, np.zeros((0, 2))),
        gps=None,
        fixes=None,
        sensors=SensorReport(0.0, NAN, (NAN,) * 3),
        report=SolverReport({"video": 1.0}, {"video": 1.0}, 1, "converged"),
        seconds={},
        warnings=(),
        config={},
    )
    return replace(solution, **changes)


def make_fixes(world_p_fix: np.ndarray, **changes: Any) -> FixTable:
    """Used fixes without residuals, of a region of 0.1 m."""
    count = len(world_p_fix)
    table = FixTable(
        world_p_fix=world_p_fix,
        residual_m=np.zeros((count, 3)),
        r_m=np.full(count, 0.1),
        h_m=np.full(count, 0.1),
        probability=np.ones(count),
        verdict=(Verdict.USED,) * count,
        reason=("",) * count,
    )
    return replace(table, **changes)


def exact_run(recording: Path) -> Solution:
    """A simulated recording with its true poses, as a run that found them exactly."""
    truth, opened = read_trajectory(recording / "truth.tum"), open_recording(recording)
    return make_solution(
        truth.t_s,
        truth.world_T_camera,
        recording=recording,
        camera=opened.camera,
        world_origin=opened.rig.world_origin,
        video_start_utc=opened.rig.video_start_utc,
    )


def short_drive() -> Solution:
    """Six frames, 0.1 s and 1 m apart, northwards; five fixes, one of each verdict and one more used.

    Observations are in reverse order and exact, but for one pixel on landmark 0 in frame 0.
    """
    small = replace(PINHOLE, width=64, height=48, fx=50.0, fy=50.0, cx=31.5, cy=23.5)
    camera = replace(small, model="opencv", distortion=(-0.2, 0.03, 0.0, 0.0))
    assert np.isfinite(undistort(camera, [[0.0, 0.0], [63.0, 47.0]])).all()
    poses = make_poses(np.arange(6.0)[:, None] * [0.0, 1.0, 0.0], NORTH_R_CAMERA)
    points = np.array([[-1.0, 12.0, 1.0], [1.0, 14.0, -1.0], [2.0, 16.0, 0.5]])
    uv, _ = project(camera.K, poses, points)
    uv[0, 0] += (0.6, -0.8)
    frame, landmark = (grid.ravel()[::-1].copy() for grid in np.indices(uv.shape[:2]))
    verdict = (Verdict.USED, Verdict.USED, Verdict.DOWN_CLASSED, Verdict.REJECTED, Verdict.NOT_USED)
    fix, flt = FixClass.RTK_FIX, FixClass.RTK_FLOAT
    return make_solution(
        t_s=np.arange(6) / 10,
        world_T_camera=poses,
        sigma_rotation_rad=np.radians(np.full((6, 3), 0.25)),
        sigma_position_m=np.full((6, 3), 0.125),
        state=(FrameState.TRACKED,) * 3 + (FrameState.BRIDGED,) + (FrameState.TRACKED,) * 2,
        camera=camera,
        landmarks=make_landmarks(points, sigma_px=np.array([0.5, 0.3, 1.5])),
        observations=Observations(frame, landmark, uv.reshape(-1, 2)[::-1].copy()),
        gps=make_gps_log(np.array([0.03, 0.13, 0.23, 0.33, 0.43]), (fix, flt, fix, fix, FixClass.UNKNOWN)),
        fixes=FixTable(
            world_p_fix=np.array([[0, 0.3, 0], [1, 1.3, 0], [0, 2.3, 0], [30, 3.3, 0], [0, 4.3, 9]]),
            residual_m=np.array([[0.1, 0, 0], [-1.2, 0, 3.0], [0, 0, 0.5], [-30.0, 0, 0], [np.nan] * 3]),
            r_m=np.array([0.1, 2.4, 2.4, 0.1, np.nan]),
            h_m=np.array([0.05, 6.0, 6.0, 0.05, np.nan]),
            probability=np.array([1.0, 1.0, 0.2, 0.0, np.nan]),
            verdict=verdict,
            reason=tuple(f"{one}: because {k}" for k, one in enumerate(verdict)),
        ),
        report=SolverReport({"video": 10.0, "poses": 4.0}, {"video": 2.0, "poses": 1.0}, 3, "converged"),
        seconds={"batch": 1.0},
        warnings=("the roll is uncertain",),
        config={"gps": {"model": "cylinder", "n": 2, "omega": 0.5}},
        world_p_before=poses[:, :3, 3] + (0.0, 0.0, 1.0),
        static_regions=np.array([[1, 3, 0, 440, 200, 480], [2, 5, 300, 440, 500, 480]]),
        moving_regions=np.array([[2, 2, 100, 100, 200, 240]]),
    )


def minute_drive() -> Solution:
    """A minute eastwards at 10 m/s, ten frames and one fix a second, no fix from 20 to 40 s.

    Fix 3 is rejected, fix 8 down-classed, fixes from the 36th on are not used; time stamps are 0.125 s late.
    """
    rejected, lowered, unused = 3, 8, 36
    t_s = 0.1 * np.arange(601)
    fix_s = np.arange(0.05, 62.0)  # the last two are after the video
    fix_s = fix_s[(fix_s < 20.0) | (fix_s > 40.0)]
    rows = np.arange(len(fix_s))

    def split(before: Any, after: Any, row: int) -> list[Any]:
        return [before if k < row else after for k in rows]

    residual = np.tile([0.03, -0.04, 0.01], (len(rows), 1))
    residual[rejected] = [0.0, -20.0, 0.5]
    residual[fix_s > t_s[-1]] = np.nan
    antenna = np.column_stack([10.0 * fix_s + 0.5, np.zeros(len(rows)), np.ones(len(rows))])
    verdict = split(Verdict.USED, Verdict.NOT_USED, unused)
    verdict[rejected], verdict[lowered] = Verdict.REJECTED, Verdict.DOWN_CLASSED
    reason = [f"{one}: because" for one in verdict]
    reason[rejected] = "rejected: <b>far</b> & wrong"
    classes = split(FixClass.RTK_FIX, FixClass.RTK_FLOAT, lowered + 1)
    classes[unused:] = [FixClass.UNKNOWN] * (len(rows) - unused)
    rng = np.random.default_rng(0)
    frame, landmark = np.repeat(np.arange(0, 601, 2), 3), rng.integers(0, 50, 903)
    return make_solution(
        t_s=t_s,
        world_T_camera=make_poses(10.0 * t_s[:, None] * [1.0, 0.0, 0.0], EAST_R_CAMERA),
        recording=Path("drives/spring"),
        sigma_rotation_rad=np.full((601, 3), 0.002),
        sigma_position_m=0.02 + 0.01 * np.maximum(0.0, 20.0 - np.abs(t_s - 30.0))[:, None] * [1.0, 2.0, 4.0],
        state=tuple(FrameState.BRIDGED if 100 <= k < 110 else FrameState.TRACKED for k in range(601)),
        camera_p_antenna=np.array([0.0, -1.0, 0.5]),  # half a metre ahead of the camera, a metre above it
        landmarks=make_landmarks(rng.normal(0, 30, (50, 3))),
        observations=Observations(frame, landmark, np.zeros((903, 2))),
        gps=make_gps_log(
            fix_s,
            tuple(classes),
            line=1 + 3 * rows,
            source=Path("drive/gps.nmea"),
            skipped=("2 damaged lines skipped, first line 7",),
        ),
        fixes=FixTable(
            world_p_fix=antenna - np.nan_to_num(residual),
            residual_m=residual,
            r_m=np.where(rows < unused, np.where(rows < lowered, 0.1, 2.0), np.nan),
            h_m=np.where(rows < unused, np.where(rows < lowered, 0.05, 5.0), np.nan),
            probability=np.full(len(rows), 0.875),
            verdict=tuple(verdict),
            reason=tuple(reason),
        ),
        sensors=SensorReport(0.125, 0.014, (0.01, 0.02, 0.03)),
        report=SolverReport(
            {"video": 1000.0, "poses": 50.0}, {"video": 100.0, "poses": 5.0}, 12, "converged"
        ),
        seconds={"track": 20.0, "batch": 10.0},
        warnings=("the clock lags & so on",),
        config={"seed": 0, "gps": {"model": "cylinder"}},
    )
