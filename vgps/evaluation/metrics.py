"""Errors of one trajectory against another, without aligning one to the other first."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.errors import TrajectoryError
from vgps.model import FloatArray, IntArray
from vgps.solution import Trajectory

CHI2_3_95 = 7.814727903251179  # 95 % quantile of chi-squared with three degrees of freedom


@dataclass(frozen=True)
class Spread:
    """How the size of an error is distributed over the frames; ``std`` is about the mean, over N."""

    mean: float
    median: float
    rmse: float
    std: float
    max: float


@dataclass(frozen=True)
class Nees:
    """Normalised squared position errors: ``mean`` is 3 and ``within_95`` is 0.95 for honest sigmas.

    Correlations between the axes are left out, for a run states standard deviations only.
    """

    mean: float
    within_95: float
    frames: int


@dataclass(frozen=True)
class Evaluation:
    """Errors of an estimate against a truth, frame by frame (N matched frames) and summed up.

    Attributes:
        frames_estimate, frames_truth, frames_matched: Counts; each frame is matched once at most.
        every_frame_posed: Every frame of the truth has a pose in the estimate.
        tolerance_s, largest_gap_s: How far apart in time matched frames may be, and are. Nothing is
            interpolated.
        t_s: (N,) times of the matched frames, of the estimate.
        camera_error_m, antenna_error_m: (N, 3) estimate minus truth, east, north, up, unaligned.
        rotation_error_deg: (N,) angle of the rotation from estimate to truth, unaligned.
        camera_position_m ... antenna_vertical_m: Distances, horizontal and vertical distances.
        camera_position_after_se3_m, camera_position_after_sim3_m, sim3_scale: What is left of the camera's
            error after the best rigid motion, or similarity, of the estimate onto the truth; None with fewer
            than three matched frames or no motion.
        nees: Whether the stated sigmas of the camera position are honest, if any are stated.
        notes: What to know before trusting the figures.
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
    camera_position_m: Spread
    camera_horizontal_m: Spread
    camera_vertical_m: Spread
    antenna_position_m: Spread
    antenna_horizontal_m: Spread
    antenna_vertical_m: Spread
    rotation_deg: Spread
    camera_position_after_se3_m: Spread | None
    camera_position_after_sim3_m: Spread | None
    sim3_scale: float | None
    nees: Nees | None
    notes: tuple[str, ...] = ()


def evaluate(
    estimate: Trajectory,
    truth: Trajectory,
    camera_p_antenna: FloatArray,
    *,
    sigma_position_m: FloatArray | None = None,
    tolerance_s: float | None = None,
) -> Evaluation:
    """Compare two trajectories in the same world and on the same clock, unaligned.

    Args:
        estimate, truth: world_T_camera over seconds; (N, 4, 4) each, N may differ.
        camera_p_antenna: (3,) lever arm in metres, the same for both.
        sigma_position_m: (N, 3) the estimate's own standard deviations east, north, up.
        tolerance_s: How far apart in time matched frames may be; by default half the median frame interval
            of the estimate.

    Raises:
        TrajectoryError: A trajectory is empty or not finite, or they share no time.
    """
    for name, trajectory in (("estimate", estimate), ("truth", truth)):
        _check(trajectory, name)
    if tolerance_s is None:
        tolerance_s = _half_interval_s(estimate.t_s)
    e, t = match(estimate.t_s, truth.t_s, tolerance_s)
    if not len(e):
        raise TrajectoryError(
            f"estimate at {_span(estimate.t_s)} and truth at {_span(truth.t_s)} share no time",
            expected=f"frames at most {tolerance_s:.4g} s apart",
            remedy="check that both are on the video's clock (video_start_s in rig.yaml)",
        )
    found, true = estimate.world_T_camera[e], truth.world_T_camera[t]
    camera_error = found[:, :3, 3] - true[:, :3, 3]
    antenna_error = camera_error + (found[:, :3, :3] - true[:, :3, :3]) @ camera_p_antenna
    angle_deg = _angle_deg(found, true)
    rigid = align(found[:, :3, 3], true[:, :3, 3], with_scale=False)
    similar = align(found[:, :3, 3], true[:, :3, 3], with_scale=True)
    return Evaluation(
        frames_estimate=len(estimate.t_s),
        frames_truth=len(truth.t_s),
        frames_matched=len(e),
        every_frame_posed=len(e) == len(truth.t_s),
        tolerance_s=tolerance_s,
        largest_gap_s=float(np.abs(estimate.t_s[e] - truth.t_s[t]).max()),
        t_s=estimate.t_s[e],
        camera_error_m=camera_error,
        antenna_error_m=antenna_error,
        rotation_error_deg=angle_deg,
        camera_position_m=_spread(camera_error),
        camera_horizontal_m=_spread(camera_error[:, :2]),
        camera_vertical_m=_spread(camera_error[:, 2:]),
        antenna_position_m=_spread(antenna_error),
        antenna_horizontal_m=_spread(antenna_error[:, :2]),
        antenna_vertical_m=_spread(antenna_error[:, 2:]),
        rotation_deg=_spread(angle_deg),
        camera_position_after_se3_m=None if rigid is None else _spread(rigid[1]),
        camera_position_after_sim3_m=None if similar is None else _spread(similar[1]),
        sim3_scale=None if similar is None else similar[0],
        nees=None if sigma_position_m is None else _nees(camera_error, sigma_position_m[e]),
    )


def match(estimate_s: FloatArray, truth_s: FloatArray, tolerance_s: float) -> tuple[IntArray, IntArray]:
    """Rows of the estimate and of the truth that are each other's nearest in time, at most tolerance_s apart.

    Args:
        estimate_s, truth_s: (N,) and (M,) times in any order, at least one each.
        tolerance_s: Largest distance in time.

    Returns:
        Two (K,) arrays of rows, in the order of the estimate.
    """
    to_truth, to_estimate = _nearest(estimate_s, truth_s), _nearest(truth_s, estimate_s)
    rows = np.arange(len(estimate_s))
    mutual = to_estimate[to_truth] == rows
    close = np.abs(estimate_s - truth_s[to_truth]) <= tolerance_s
    chosen = rows[mutual & close]
    return chosen, to_truth[chosen]


def align(source: FloatArray, target: FloatArray, *, with_scale: bool) -> tuple[float, FloatArray] | None:
    """Scale of the best motion of (N, 3) points onto others, and the (N, 3) errors it leaves; Umeyama 1991.

    None where the points do not determine it: fewer than three, or none that differ.
    """
    p, q = source - source.mean(axis=0), target - target.mean(axis=0)
    variance = float((p**2).sum())
    if len(p) < 3 or variance < 1e-12 * len(p):
        return None
    U, singular, Vt = np.linalg.svd(q.T @ p)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    rotation = (U * sign) @ Vt
    scale = float(singular @ sign) / variance if with_scale else 1.0
    return scale, scale * p @ rotation.T - q


def _nearest(times_s: FloatArray, among_s: FloatArray) -> IntArray:
    order = np.argsort(among_s, kind="stable")
    ordered = among_s[order]
    right = np.clip(np.searchsorted(ordered, times_s), 0, len(ordered) - 1)
    left = np.maximum(right - 1, 0)
    nearer_left = times_s - ordered[left] <= ordered[right] - times_s
    return order[np.where(nearer_left, left, right)]


def _check(trajectory: Trajectory, name: str) -> None:
    if not len(trajectory.t_s):
        raise TrajectoryError(f"{name} has no poses", expected="at least one")
    finite = np.isfinite(trajectory.world_T_camera).all(axis=(1, 2)) & np.isfinite(trajectory.t_s)
    if not finite.all():
        row = int(np.argmin(finite))
        raise TrajectoryError(f"{name} is not finite", place=f"pose {row}", expected="numbers")


def _half_interval_s(t_s: FloatArray) -> float:
    intervals = np.diff(np.unique(t_s))
    return float(np.median(intervals)) / 2 if len(intervals) else 1e-3


def _span(t_s: FloatArray) -> str:
    return f"{t_s.min():.3f} to {t_s.max():.3f} s"


def _angle_deg(a: FloatArray, b: FloatArray) -> FloatArray:
    between = Rotation.from_matrix(a[:, :3, :3]).inv() * Rotation.from_matrix(b[:, :3, :3])
    return np.degrees(between.magnitude())


def _spread(errors: FloatArray) -> Spread:
    size = np.linalg.norm(errors, axis=1) if errors.ndim == 2 else errors
    rmse = np.sqrt(np.mean(size**2))
    return Spread(*(float(value) for value in (size.mean(), np.median(size), rmse, size.std(), size.max())))


def _nees(error_m: FloatArray, sigma_m: FloatArray) -> Nees | None:
    stated = np.isfinite(sigma_m).all(axis=1) & (sigma_m > 0).all(axis=1)
    if not stated.any():
        return None
    squared = ((error_m[stated] / sigma_m[stated]) ** 2).sum(axis=1)
    return Nees(float(squared.mean()), float((squared <= CHI2_3_95).mean()), int(stated.sum()))
