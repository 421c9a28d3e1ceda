"""``measurements.npz``: every array of a Solution, exactly; the graph is rebuilt from it.

=============================== ============ ============================================================
key                             shape        meaning
=============================== ============ ============================================================
schema_version                  ()           of this file
t_s                             (F,)         frame times, seconds since the first frame
world_T_camera                  (F, 4, 4)    poses, world is ENU in metres
sigma_rotation_rad              (F, 3)       about world east, north, up
sigma_position_m                (F, 3)       east, north, up
state                           (F,)         ``tracked`` or ``bridged``
world_p_before                  (F, 3)       camera centres as stages A to C left them
camera_p_antenna                (3,)         lever arm, metres
landmarks.world_p_landmark      (L, 3)       metres
landmarks.sigma_px              (L,)         reliability sigma_j, Eq. (13), Kume 2010, pixels
landmarks.gray                  (L,)         luminance
observations.frame              (N,)         row of the frames
observations.landmark           (N,)         row of the landmarks
observations.uv_px              (N, 2)       in the undistorted (pinhole) image
gps.t_s                         (M,)         times of the fixes on the video's clock, seconds
gps.latitude_deg, longitude_deg (M,)         WGS84
gps.height_m                    (M,)         ellipsoidal
gps.fix_class                   (M,)         ``rtk_fix``, ``rtk_float``, ...
gps.sigma_m                     (M, 3)       the receiver's own, east, north, up
gps.correlation                 (M, 3)       of these: east and north, east and up, north and up
gps.logging_sigma_m             (M, 3)       standard deviations of what logging added to the errors
gps.hdop, satellites            (M,)         NaN where unknown
gps.correction_age_s            (M,)         NaN where unknown
gps.line                        (M,)         line of the log
fixes.world_p_fix               (M, 3)       the fixes in ENU metres
fixes.residual_m                (M, 3)       estimated antenna minus fix, east, north, up
fixes.r_m, fixes.h_m            (M,)         region that the fix was given
fixes.probability               (M,)         that the error is one of its class
fixes.verdict                   (M,)         used, down-classed, rejected, not used
fixes.reason                    (M,)         why or why not
control_points.name             (P,)         mark of each observation of a control or check point
control_points.frame            (P,)         row of the frames
control_points.uv_px            (P, 2)       in the original image
control_points.world_p_point    (P, 3)       ENU metres, or latitude, longitude, ellipsoidal height
control_points.sigma_m          (P, 3)       standard deviations of the mark, east, north, up
control_points.check            (P,)         whether it is a check point
loops                           (n, 2)       frames that see a place again, and the frames that saw it before
static_regions                  (n, 6)       what never moves: first, last frame, left, top, right, bottom px
moving_regions                  (m, 6)       what moves on its own, likewise
cameras.0.reference_T_camera    (4, 4)       pose of the first of a rig's other cameras on the reference
cameras.0.sigma                 (6,)         its standard deviations, about its own axes [rad; m]
cameras.0.delay_s               (F,)         times of its frames after those of the reference
cameras.0.landmarks.*           (L0, ...)    landmarks that it observes, as above, in the graph after others
cameras.0.observations.*        (N0, ...)    its observations, as above, in its own image
graph.offsets                   (K, 3)       the receiver's offsets ``o0..``, east, north, up
graph.c0                        (1,)         change of the time offset, if it is estimated
graph.d0                        (3,)         lever arm, if it is estimated
graph.antenna_velocity          (M, 3)       at the fixes, which c0 moves by it, m/s
graph.h0                        (1,)         height of the camera above the ground, if it is known
graph.held                      (F,)         whether a frame's pose is held
graph.video_sigma_scale         ()           factor of the pixel sigmas
graph.time_offset_s             ()           removed from the times of the fixes
graph.prior_time_offset_s       (2,)         prior of the time offset and its sigma, 0 if not estimated
graph.prior_antenna             (3,)         prior of the lever arm
graph.prior_antenna_sigma_m     ()           its sigma, 0 if not estimated
graph.fixes.t_s                 (M,)         times of the fixes without the time offset
graph.fixes.world_p_fix         (M, 3)       as ``fixes.world_p_fix``
graph.fixes.fix_class           (M,)         class that the fix is taken to be of
graph.fixes.r_m, h_m            (M,)         region of that class
graph.fixes.shape               (M, 2)       semi-axes of its ellipsoid over r and h
graph.fixes.sigma_m             (M, 3)       the receiver's own, NaN if they are not believed
graph.fixes.correlation         (M, 3)       of these, as ``gps.correlation``
graph.fixes.logging_sigma_m     (M, 3)       as ``gps.logging_sigma_m``
graph.fixes.used                (M,)         whether it has a factor, inside the video
graph.fixes.correlation_s       (M,)         time after which its error counts as independent
graph.errors.fix_class          (E,)         classes whose errors were learned from the recording
graph.errors.noise_m, walk_m    (E,)         noise and walk of their errors
graph.errors.rate_lasts_s       (E,)         how long these keep the rate of their change
graph.zero_motions.frame        (Z,)         standing frame without observations
graph.zero_motions.reference    (Z,)         frame with observations that it stands at
graph.zero_motions.pose         (Z, 4, 4)    reference_T_frame
graph.zero_motions.sigma        (Z, 6)       of rotation (rad) and translation (m)
graph.controls.frame            (C,)         row of the frames
graph.controls.uv_px            (C, 2)       control point in the undistorted image
graph.controls.world_p_point    (C, 3)       ENU metres
graph.controls.sigma_m          (C, 3)       of its position
graph.controls.sigma_px         (C,)         of its position and its observation, in the image
graph.frame_rates               (F, 3)       rates of a rolling shutter's frames beside the path's, rad/s
graph.ground.frame              (S,)         frame on each stretch with ground below it
graph.ground.camera_level       (S, 3)       what is level there, in the camera's axes
graph.ground.sigma_rad          (S,)         standard deviation of its elevation
graph.heights.first, last       (H,)         frames at the ends of stretches of a known height
graph.heights.ratio, sigma      (H,)         height over length, and the sigma of its logarithm
graph.heights.prior_m           (2,)         the height and its sigma, as given
graph.imu.t_s                   (I,)         times of the samples of the IMU
graph.imu.rate_rad_s            (I, 3)       in the camera's axes
graph.imu.force_m_s2            (I, 3)       at the camera's centre, acceleration minus gravity
graph.imu.broken                (I - 1,)     whether a gap lies between a sample and the next
graph.imu.gravity_m_s2          ()           size of gravity
graph.imu.gyro_density          ()           white noise, rad/s/sqrt(Hz)
graph.imu.accelerometer_density ()           white noise, m/s^2/sqrt(Hz)
graph.imu.bias                  (6,)         expected bias of force and rates
graph.knots.frame               (J,)         frames with a velocity and a bias
graph.knots.linked              (J - 1,)     whether the IMU covers the time from a knot to the next
graph.knots.velocity            (J, 3)       before the last problem, m/s
graph.knots.bias                (J, 6)       likewise; the preintegration is about it
graph.velocities                (J, 3)       ``v0..`` at the end
graph.biases                    (J, 6)       ``b0..`` at the end
=============================== ============ ============================================================

The ``cameras`` keys are those of a rig of several cameras. The ``gps`` keys are absent without a log, the
``fixes`` keys without verdicts, the ``control_points`` keys without such points; ``schema_version`` and
``world_p_before`` in runs from before version 0.1.0. The ``graph`` keys hold what the last problem of stage D
took beside the rest, for :func:`vgps.factor_graph`: those of a rolling shutter, ground, height and IMU where
there is one, none where stage D was not run or by version 0.1. The intrinsics are in ``solution.json``.
Nothing is pickled.
"""

from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vgps.readers.run_files import SCHEMA_VERSION
from vgps.solution import Solution


def write_measurements(solution: Solution, out: Path) -> None:
    """Write the arrays of a Solution; the same Solution gives the same bytes.

    NumPy stamps its archive members 1980-01-01, whatever the clock says.
    """
    with out.open("wb") as stream:
        np.savez(stream, **dict(_arrays(solution)))  # type: ignore[arg-type]


def _arrays(solution: Solution) -> Iterator[tuple[str, npt.NDArray[Any]]]:
    yield "schema_version", np.array(SCHEMA_VERSION)
    yield from _fields_of(solution, "")
    for name in ("landmarks", "observations", "gps", "fixes", "control_points"):
        part = getattr(solution, name)
        if part is not None:
            yield from _fields_of(part, f"{name}.")
    for k, camera in enumerate(solution.cameras):
        yield from _fields_of(camera, f"cameras.{k}.")
        for name in ("landmarks", "observations"):
            yield from _fields_of(getattr(camera, name), f"cameras.{k}.{name}.")
    for key, array in (solution.graph or {}).items():
        yield f"graph.{key}", array
    yield "state", _words(solution.state)
    if solution.control_points is not None:
        yield "control_points.name", _words(solution.control_points.name)
    if solution.gps is not None:
        yield "gps.fix_class", _words(solution.gps.fix_class)
    if solution.fixes is not None:
        yield "fixes.verdict", _words(solution.fixes.verdict)
        yield "fixes.reason", _words(solution.fixes.reason)


def _fields_of(part: Any, prefix: str) -> Iterator[tuple[str, npt.NDArray[Any]]]:
    for item in fields(part):
        value = getattr(part, item.name)
        if isinstance(value, np.ndarray):
            yield f"{prefix}{item.name}", value


def _words(words: tuple[str, ...]) -> npt.NDArray[np.str_]:
    return np.array([str(word) for word in words], dtype=np.str_)
