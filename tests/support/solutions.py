"""Solutions made by hand: one builder, and the runs that several tests look at.

Every value that a test does not care about has a default; the rest is given by keyword.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.camera import undistort
from vgps.geometry import project
from vgps.model import Camera, ControlPoints, FixClass, GeodeticPoint, GpsLog
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
    SubmapReport,
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


def make_control_points() -> ControlPoints:
    """A control and a check point in two frames each."""
    return ControlPoints(
        name=("A", "A", "Bö", "Bö"),
        frame=np.array([0, 1, 0, 2]),
        uv_px=np.arange(8.0).reshape(4, 2) * 17.5,
        world_p_point=np.repeat([[49.0111, 8.4166, 165.5], [49.0112, 8.4167, 166.25]], 2, axis=0),
        sigma_m=np.repeat([[0.01, 0.02, 0.03], [0.0, 0.0, 0.0]], 2, axis=0),
        check=np.array([False, False, True, True]),
        geodetic=True,
        source=Path("rec/gcp_list.txt"),
        notes=("a note on the datum",),
    )


def make_graph_arrays() -> dict[str, np.ndarray]:
    """Input of stage D for four frames, two fixes, one standing frame and one control point."""
    rng = np.random.default_rng(7)
    fixes = {"t_s": (2,), "r_m": (2,), "h_m": (2,), "shape": (2, 2)}
    fixes |= dict.fromkeys(("world_p_fix", "sigma_m", "correlation"), (2, 3))
    controls = {"uv_px": (1, 2), "world_p_point": (1, 3), "sigma_m": (1, 3), "sigma_px": (1,)}
    return {
        "offsets": rng.normal(size=(2, 3)),
        "c0": np.array([0.015]),
        "d0": np.array([0.055, -0.935, -0.325]),
        "held": np.array([True, False, False, True]),
        "video_sigma_scale": np.array(8.5),
        "time_offset_s": np.array(0.11),
        "prior_time_offset_s": np.array([0.105, 0.5]),
        "prior_antenna": np.array([0.06, -0.94, -0.33]),
        "prior_antenna_sigma_m": np.array(0.35),
        **{f"fixes.{name}": rng.normal(size=shape) for name, shape in fixes.items()},
        "fixes.used": np.array([True, False]),
        "fixes.correlation_s": np.array([10.5, np.nan]),
        "fixes.fix_class": np.array(["rtk_fix", "rtk_float"]),
        "zero_motions.frame": np.array([2]),
        "zero_motions.reference": np.array([1]),
        "zero_motions.pose": rng.normal(size=(1, 4, 4)),
        "zero_motions.sigma": rng.uniform(size=(1, 6)),
        "controls.frame": np.array([3]),
        **{f"controls.{name}": rng.normal(size=shape) for name, shape in controls.items()},
    }


def distinct_values() -> Solution:
    """Four frames, three landmarks (one never observed), two fixes (one unused): no value occurs twice.

    Some values are NaN, one name has an umlaut.
    """
    positions = [[1.0, 2.0, 3.0], [1.25, -2.5, 3.125], [1.5, 2e-10, -3.0], [1e5, 2.0, 0.1]]
    rotations = [EAST_R_CAMERA, *Rotation.random(3, random_state=3).as_matrix()]
    return make_solution(
        t_s=np.array([0.0, 0.1, 0.2, 1 / 3]),
        world_T_camera=make_poses(np.array(positions), np.array(rotations)),
        recording=Path("rec/wälk"),
        world_origin=GeodeticPoint(49.011, 8.4165, 163.0),
        sigma_rotation_rad=np.radians(np.arange(1.0, 13.0).reshape(4, 3)),
        sigma_position_m=np.vstack([np.arange(1.0, 10.0).reshape(3, 3) / 100, [[np.nan] * 3]]),
        state=(FrameState.TRACKED, FrameState.BRIDGED, FrameState.TRACKED, FrameState.TRACKED),
        camera=replace(PINHOLE, model="tsai", distortion=(1e-3, 2e-5), pixel_mm=(0.0075, 0.0071)),
        camera_p_antenna=np.array([0.05, -0.93, -0.32]),
        landmarks=Landmarks(
            np.array([[1.0, 2.0, 30.0], [4.0, 5.0, 1 / 7], [7.0, 8.0, 9.0]]),
            np.array([0.5, 0.25, 1.5]),
            np.array([7, 128, 255], dtype=np.uint8),
        ),
        observations=Observations(
            np.array([0, 0, 1, 3]), np.array([0, 2, 0, 2]), np.arange(8.0).reshape(4, 2) * np.pi
        ),
        gps=make_gps_log(
            np.array([0.03, 1.03]),
            (FixClass.RTK_FIX, FixClass.RTK_FLOAT),
            latitude_deg=np.array([49.011, 49.0111]),
            longitude_deg=np.array([8.4165, 8.4166]),
            height_m=np.array([163.5, np.nan]),
            sigma_m=np.array([[0.01, 0.02, 0.03], [np.nan] * 3]),
            correlation=np.array([[0.5, -0.25, 0.125], [0.0] * 3]),
            hdop=np.array([0.8, np.nan]),
            satellites=np.array([12.0, 11.0]),
            correction_age_s=np.array([1.0, np.nan]),
            line=np.array([1, 4]),
            source=Path("drive/gps.nmea"),
            skipped=("line 7: truncated",),
        ),
        fixes=FixTable(
            world_p_fix=np.array([[0.5, 0.25, 1.0], [10.0, 11.0, 12.0]]),
            residual_m=np.array([[0.03, -0.04, 0.1], [np.nan] * 3]),
            r_m=np.array([0.1, 2.4]),
            h_m=np.array([0.05, 6.5]),
            probability=np.array([0.99, np.nan]),
            verdict=(Verdict.USED, Verdict.NOT_USED),
            reason=("inside its region", "outside the video, after its end"),
        ),
        sensors=SensorReport(0.125, NAN, (0.01, 0.02, NAN), imu={"gyro_rad_s": [0.01, -0.02, 0.005]}),
        report=SolverReport(
            {"video": 12.5, "gps": 3.0},
            {"video": 1.25, "gps": NAN},
            7,
            "cost no longer decreases",
            SubmapReport((2, 3), (0, 1), 99.5),
        ),
        seconds={"tracking": 1.5, "batch": 0.25},
        warnings=("frame 1 has too few features; für Frame 1 gilt die Brücke",),
        control_points=make_control_points(),
        world_p_before=np.arange(12.0).reshape(4, 3) / 7,
        config={"gps": {"model": "cylinder", "n": 4, "omega": 1e-8, "limit": None}, "names": ["a", "b"]},
        graph=make_graph_arrays(),
        static_regions=np.array([[1, 2, 0, 0, 320, 480]]),
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
