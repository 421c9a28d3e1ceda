"""Control and check points of a run: where its images show them, against where they were surveyed."""

from dataclasses import dataclass

import numpy as np

from vgps.camera import distort, undistort
from vgps.geodesy import to_enu
from vgps.geometry import project
from vgps.geometry.projection import MIN_DEPTH, largest_angle_rad, triangulate, world_rays
from vgps.model import FloatArray, IntArray
from vgps.rolling_shutter import row_poses
from vgps.solution import Solution

_STEPS = 10  # of Gauss-Newton, which starts at the point nearest to all rays
_MIN_ANGLE_DEG = 5.0  # between the rays of a mark: an error across them is then at most 12 times that along


@dataclass(frozen=True, kw_only=True)
class Mark:
    """A control or check point and what the run makes of it.

    Attributes:
        name: Its name.
        check: Whether it is a check point.
        world_p_mark: (3,) its surveyed position in the world.
        frame: (V,) the frames that show it.
        uv_px: (V, 2) where they show it, in the original images.
        reprojected_px: (V, 2) where the run projects its surveyed position; NaN behind the camera.
        residual_m: (3,) intersection of the run's rays minus surveyed position, east, north, up; NaN if the
            rays do not determine it.
        angle_deg: The largest angle between its rays.
    """

    name: str
    check: bool
    world_p_mark: FloatArray
    frame: IntArray
    uv_px: FloatArray
    reprojected_px: FloatArray
    residual_m: FloatArray
    angle_deg: float

    @property
    def rms_px(self) -> float:
        """Root mean square of the reprojection errors."""
        return float(np.sqrt(np.mean(np.sum((self.reprojected_px - self.uv_px) ** 2, axis=1))))


@dataclass(frozen=True, kw_only=True)
class MarkStatistics:
    """Residuals of several marks.

    Attributes:
        count: Number of marks with a residual.
        mean_m, rmse_m: (3,) east, north, up.
        rmse_horizontal_m, rmse_3d_m: Of the horizontal and the spatial distance.
        ce90_m, le90_m: Quantiles of 90 % of the horizontal distances and of the absolute heights, of these
            very marks: no distribution is assumed.
    """

    count: int
    mean_m: FloatArray
    rmse_m: FloatArray
    rmse_horizontal_m: float
    rmse_3d_m: float
    ce90_m: float
    le90_m: float


def marks_of(solution: Solution) -> list[Mark]:
    """Return the control and check points of a run in order of their names; none without any."""
    points = solution.control_points
    if points is None:
        return []
    world = points.world_p_point
    if points.geodetic:
        if solution.world_origin is None:
            return []
        world = to_enu(solution.world_origin, *world.T)
    names = np.array(points.name)
    shown = points.frame < len(solution.t_s)
    found = []
    for name in dict.fromkeys(points.name):
        rows = np.flatnonzero((names == name) & shown)
        if len(rows):
            found.append(_mark(solution, name, rows, world[rows[0]]))
    return found


def mark_statistics(marks: list[Mark]) -> MarkStatistics | None:
    """Return the statistics of the marks that have a residual; None if there is none."""
    residual = np.array([mark.residual_m for mark in marks]).reshape(-1, 3)
    residual = residual[np.isfinite(residual).all(axis=1)]
    if not len(residual):
        return None
    horizontal, vertical = np.hypot(residual[:, 0], residual[:, 1]), np.abs(residual[:, 2])
    return MarkStatistics(
        count=len(residual),
        mean_m=residual.mean(axis=0),
        rmse_m=np.sqrt(np.mean(residual**2, axis=0)),
        rmse_horizontal_m=float(np.sqrt(np.mean(horizontal**2))),
        rmse_3d_m=float(np.sqrt(np.mean(np.sum(residual**2, axis=1)))),
        ce90_m=float(np.quantile(horizontal, 0.9)),
        le90_m=float(np.quantile(vertical, 0.9)),
    )


def summary_line(solution: Solution) -> str | None:
    """Return the accuracy at the check points as a sentence; None without check points."""
    checks = [mark for mark in marks_of(solution) if mark.check]
    statistics = mark_statistics(checks)
    if statistics is None:
        return None
    return (
        f"{statistics.count} of {len(checks)} check points: "
        f"RMSE horizontal {statistics.rmse_horizontal_m:.3f} m, vertical {statistics.rmse_m[2]:.3f} m, "
        f"CE90 {statistics.ce90_m:.3f} m, LE90 {statistics.le90_m:.3f} m"
    )


def _mark(solution: Solution, name: str, rows: IntArray, world_p_mark: FloatArray) -> Mark:
    points, camera = solution.control_points, solution.camera
    assert points is not None
    frame, uv = points.frame[rows], points.uv_px[rows]
    undistorted = undistort(camera, uv)
    poses = row_poses(camera, solution.t_s, solution.world_T_camera, frame, undistorted)
    pinhole, depth = project(camera.K, poses, world_p_mark[None])
    pinhole = np.where(depth > MIN_DEPTH, pinhole[:, 0], np.nan)
    position, angle_rad = _intersection(camera.K, poses, undistorted)
    return Mark(
        name=name,
        check=bool(points.check[rows].any()),
        world_p_mark=world_p_mark,
        frame=frame,
        uv_px=uv,
        reprojected_px=distort(camera, pinhole),
        residual_m=position - world_p_mark,
        angle_deg=float(np.degrees(angle_rad)),
    )


def _intersection(K: FloatArray, poses: FloatArray, uv_px: FloatArray) -> tuple[FloatArray, float]:
    """Return the point (3,) with the least reprojection errors, Eq. (19), and the largest angle of its rays.

    Args:
        K: Of the pinhole.
        poses: (V, 4, 4) world_T_camera.
        uv_px: (V, 2) in the undistorted images.
    """
    seen, unknown = np.isfinite(uv_px).all(axis=1), np.full(3, np.nan)
    poses, uv, first = poses[seen], uv_px[seen], np.zeros(1, np.int64)
    if len(uv) < 2:
        return unknown, 0.0
    angle = float(largest_angle_rad(world_rays(K, poses, uv), first)[0])
    points, error = triangulate(K, poses, uv, first, _STEPS)
    determined = angle > np.radians(_MIN_ANGLE_DEG) and np.isfinite(error).all()
    return (points[0] if determined else unknown), angle
