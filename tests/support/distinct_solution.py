"""A Solution in which no value occurs twice, so that none can stand in another's place."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation
from solutions import EAST_R_CAMERA, NAN, PINHOLE, make_gps_log, make_poses, make_solution

from vgps.model import ControlPoints, FixClass, GeodeticPoint
from vgps.solution import (
    FixTable,
    FrameState,
    Landmarks,
    Observations,
    SensorReport,
    Solution,
    SolverReport,
    SubmapReport,
    Verdict,
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
    fixes |= dict.fromkeys(("world_p_fix", "sigma_m", "correlation", "logging_sigma_m"), (2, 3))
    controls = {"uv_px": (1, 2), "world_p_point": (1, 3), "sigma_m": (1, 3), "sigma_px": (1,)}
    return {
        "offsets": rng.normal(size=(2, 3)),
        "c0": np.array([0.015]),
        "d0": np.array([0.055, -0.935, -0.325]),
        "antenna_velocity": rng.normal(size=(2, 3)),
        "h0": np.array([1.66]),
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
        "errors.fix_class": np.array(["rtk_float"]),
        **{f"errors.{name}": rng.uniform(size=1) for name in ("noise_m", "walk_m", "rate_lasts_s")},
        "frame_rates": rng.normal(size=(4, 3)),
        **make_inertial_arrays(rng),
        "ground.frame": np.array([1]),
        "ground.camera_level": rng.normal(size=(1, 3)),
        "ground.sigma_rad": np.array([0.015]),
        "heights.first": np.array([0]),
        "heights.last": np.array([3]),
        **{f"heights.{name}": rng.uniform(size=1) for name in ("ratio", "sigma")},
        "heights.prior_m": np.array([1.65, 0.05]),
    }


def make_inertial_arrays(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Input and result of an IMU with five samples and two knots."""
    shapes = {"imu.t_s": 5, "imu.rate_rad_s": (5, 3), "imu.force_m_s2": (5, 3), "imu.bias": 6}
    shapes |= {f"imu.{name}": () for name in ("gravity_m_s2", "gyro_density", "accelerometer_density")}
    shapes |= {"knots.velocity": (2, 3), "knots.bias": (2, 6), "velocities": (2, 3), "biases": (2, 6)}
    return {
        **{name: np.asarray(rng.normal(size=shape)) for name, shape in shapes.items()},
        "imu.broken": np.array([False, True, False, False]),
        "knots.frame": np.array([0, 3]),
        "knots.linked": np.array([True]),
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
            logging_sigma_m=np.array([[0.02, 0.03, 0.29], [0.0] * 3]),
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
        moving_regions=np.array([[3, 3, 0, 0, 160, 480]]),
    )
