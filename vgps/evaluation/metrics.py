"""Position and rotation errors of one trajectory against another."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.errors import TrajectoryError
from vgps.evaluation.alignment import align
from vgps.evaluation.association import half_interval_s, match_times
from vgps.model import FloatArray
from vgps.solution import Trajectory

_CHI2_3_95 = 7.814727903251179  # 95 % quantile of chi-squared with three degrees of freedom


@dataclass(frozen=True, kw_only=True)
class ErrorStatistics:
    """Statistics of an error's size over the frames; ``std`` is about the mean and divides by N."""

    mean: float
    median: float
    rmse: float
    std: float
    max: float


@dataclass(frozen=True)
class Nees:
    """Normalised estimation error squared of the position, over ``frames`` frames.

    If the stated standard deviations are right, ``mean`` is 3 and ``within_95`` is 0.95. A run states no
    correlations between the axes, so none are used.
    """

    mean: float
    within_95: float
    frames: int


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """Errors of an estimate against a truth, for each of N matched frames and summarised.

    Attributes:
        frames_estimate, frames_truth, frames_matched: Counts; a frame is matched at most once.
        every_frame_posed: Whether every frame of the truth has a pose in the estimate.
        tolerance_s, largest_gap_s: Largest time difference of matched frames, allowed and found. Nothing is
            interpolated.
        t_s: (N,) times of the matched frames of the estimate [s].
        camera_error_m, antenna_error_m: (N, 3) estimate minus truth, east, north, up [m], unaligned.
        rotation_error_deg: (N,) angle between the rotations of estimate and truth, unaligned.
        camera_position_m ... antenna_vertical_m: Statistics of the 3-D, horizontal and vertical errors.
        camera_position_after_se3_m, camera_position_after_sim3_m, sim3_scale: Camera error that remains after
            the rigid motion or similarity that best aligns the estimate to the truth, and the similarity's
            scale; None with fewer than three matched frames or without motion.
        nees: Consistency of the stated standard deviations of the camera position, if there are any.
        notes: Remarks that a user should read before trusting the figures.
    """

    frames_estimate: int
    frames_truth: int
    frames_matched: int
    every_frame_posed: bool
    tolerance_s: float
    largest_gap_s: float
    t_s: FloatArray
    camera_error_m: FloatArray
    antenna_error_m: FloatArray
    rotation_error_deg: FloatArray
    camera_position_m: ErrorStatistics
    camera_horizontal_m: ErrorStatistics
    camera_vertical_m: ErrorStatistics
    antenna_position_m: ErrorStatistics
    antenna_horizontal_m: ErrorStatistics
    antenna_vertical_m: ErrorStatistics
    rotation_deg: ErrorStatistics
    camera_position_after_se3_m: ErrorStatistics | None
    camera_position_after_sim3_m: ErrorStatistics | None
    sim3_scale: float | None
    nees: Nees | None
    notes: tuple[str, ...] = ()


def trajectory_errors(
    estimate: Trajectory,
    truth: Trajectory,
    camera_p_antenna: FloatArray,
    *,
    sigma_position_m: FloatArray | None = None,
    tolerance_s: float | None = None,
) -> Evaluation:
    """Compute the errors of a trajectory against a truth in the same world and on the same clock.

    Args:
        estimate, truth: world_T_camera over seconds; (N, 4, 4) each, N may differ.
        camera_p_antenna: (3,) lever arm [m], used for both.
        sigma_position_m: (N, 3) standard deviations of the estimate, east, north, up [m].
        tolerance_s: Largest time difference of matched frames [s]; by default half the median frame interval
            of the estimate.

    Raises:
        TrajectoryError: A trajectory is empty or not finite, or they do not overlap in time.
    """
    _check(estimate, "the estimate")
    _check(truth, "the truth")
    tolerance = half_interval_s(estimate.t_s) if tolerance_s is None else tolerance_s
    e, t = match_times(estimate.t_s, truth.t_s, tolerance)
    if not len(e):
        raise TrajectoryError(
            f"the estimate covers {_span(estimate.t_s)}, the truth {_span(truth.t_s)}: no frames match",
            expected=f"frames at most {tolerance:.4g} s apart",
            remedy="check that both are on the video's clock (video_start_s in rig.yaml)",
        )
    estimated, true = estimate.world_T_camera[e], truth.world_T_camera[t]
    camera_error = estimated[:, :3, 3] - true[:, :3, 3]
    antenna_error = camera_error + (estimated[:, :3, :3] - true[:, :3, :3]) @ camera_p_antenna
    angle_deg = _angle_deg(estimated, true)
    rigid = align(estimated[:, :3, 3], true[:, :3, 3], with_scale=False)
    similar = align(estimated[:, :3, 3], true[:, :3, 3], with_scale=True)
    return Evaluation(
        frames_estimate=len(estimate.t_s),
        frames_truth=len(truth.t_s),
        frames_matched=len(e),
        every_frame_posed=len(e) == len(truth.t_s),
        tolerance_s=tolerance,
        largest_gap_s=float(np.abs(estimate.t_s[e] - truth.t_s[t]).max()),
        t_s=estimate.t_s[e],
        camera_error_m=camera_error,
        antenna_error_m=antenna_error,
        rotation_error_deg=angle_deg,
        camera_position_m=_statistics(camera_error),
        camera_horizontal_m=_statistics(camera_error[:, :2]),
        camera_vertical_m=_statistics(camera_error[:, 2:]),
        antenna_position_m=_statistics(antenna_error),
        antenna_horizontal_m=_statistics(antenna_error[:, :2]),
        antenna_vertical_m=_statistics(antenna_error[:, 2:]),
        rotation_deg=_statistics(angle_deg),
        camera_position_after_se3_m=None if rigid is None else _statistics(rigid[1]),
        camera_position_after_sim3_m=None if similar is None else _statistics(similar[1]),
        sim3_scale=None if similar is None else similar[0],
        nees=None if sigma_position_m is None else _nees(camera_error, sigma_position_m[e]),
    )


def _check(trajectory: Trajectory, name: str) -> None:
    if not len(trajectory.t_s):
        raise TrajectoryError(f"{name} has no poses", expected="at least one")
    finite = np.isfinite(trajectory.world_T_camera).all(axis=(1, 2)) & np.isfinite(trajectory.t_s)
    if not finite.all():
        row = int(np.argmin(finite))
        raise TrajectoryError(f"{name} is not finite", place=f"pose {row}", expected="numbers")


def _span(t_s: FloatArray) -> str:
    return f"{t_s.min():.3f} to {t_s.max():.3f} s"


def _angle_deg(a: FloatArray, b: FloatArray) -> FloatArray:
    between = Rotation.from_matrix(a[:, :3, :3]).inv() * Rotation.from_matrix(b[:, :3, :3])
    return np.degrees(between.magnitude())


def _statistics(errors: FloatArray) -> ErrorStatistics:
    size = np.linalg.norm(errors, axis=1) if errors.ndim == 2 else errors
    return ErrorStatistics(
        mean=float(size.mean()),
        median=float(np.median(size)),
        rmse=float(np.sqrt(np.mean(size**2))),
        std=float(size.std()),
        max=float(size.max()),
    )


def _nees(error_m: FloatArray, sigma_m: FloatArray) -> Nees | None:
    stated = np.isfinite(sigma_m).all(axis=1) & (sigma_m > 0).all(axis=1)
    if not stated.any():
        return None
    squared = ((error_m[stated] / sigma_m[stated]) ** 2).sum(axis=1)
    return Nees(float(squared.mean()), float((squared <= _CHI2_3_95).mean()), int(stated.sum()))
