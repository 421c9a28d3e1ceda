"""A bundle adjustment problem that vgps and COLMAP can both solve, from a run's observations and fixes."""

from dataclasses import dataclass

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from vgps.config import StartConfig
from vgps.geometry import largest_angle_rad, world_rays
from vgps.gps.fix_errors import region_sigmas
from vgps.gps.regions import INSIDE_LINE, INSIDE_PLANE
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.smoothing.alignment.alignment_sigmas import alignment_sigmas
from vgps.smoothing.alignment.similarity import Correspondences, align
from vgps.solution import Solution
from vgps.solver.cost import reprojection_errors
from vgps.solver.problem import BundleProblem

MIN_ANGLE_DEG = 1.5  # as COLMAP's mapper filters points (filter_min_tri_angle)


@dataclass(frozen=True)
class Priors:
    """Prior positions of cameras: ``frame`` (M,), ``world_p_camera`` (M, 3), ``sigma_m`` (M, 3)."""

    frame: IntArray
    world_p_camera: FloatArray
    sigma_m: FloatArray

    def first(self, frames: int) -> "Priors":
        """Return those of the first frames."""
        rows = self.frame < frames
        return Priors(self.frame[rows], self.world_p_camera[rows], self.sigma_m[rows])

    def graph(self) -> gtsam.NonlinearFactorGraph:
        """Return the same priors as Gaussian factors."""
        graph = gtsam.NonlinearFactorGraph()
        for frame, position, sigma in zip(self.frame, self.world_p_camera, self.sigma_m, strict=True):
            graph.add(gtsam.GPSFactor(X(int(frame)), position, gtsam.noiseModel.Diagonal.Sigmas(sigma)))
        return graph


def sigmas_of(run: Solution) -> FloatArray:
    """Return (M, 3) the receiver's sigmas of the fixes, or those that their regions stand for, metres."""
    assert run.gps is not None and run.fixes is not None
    return np.where(np.isfinite(run.gps.sigma_m), run.gps.sigma_m, region_sigmas(run.fixes))


def nearest(times_s: FloatArray, at_s: FloatArray) -> IntArray:
    """Return the rows of the times nearest to each of ``at_s``."""
    return np.asarray(np.abs(times_s[None] - at_s[:, None]).argmin(axis=1), np.int64)


def centre_priors(run: Solution, every: int = 1, *, all_fixes: bool = False) -> Priors:
    """Return fixes as positions of the camera at the nearest of every n-th frame, one per frame.

    Their residuals are those in the run; lever arm and motion between a fix's time and the frame's are the
    run's too, since COLMAP has neither.

    Args:
        run: A run with a GPS log.
        every: Take every n-th frame.
        all_fixes: Rejected ones too.
    """
    assert run.gps is not None and run.fixes is not None
    residual = run.fixes.residual_m
    rows = np.flatnonzero((run.fixes.used | all_fixes) & np.isfinite(residual).all(axis=1))
    frame, first = np.unique(every * nearest(run.t_s[::every], run.fix_times_s[rows]), return_index=True)
    rows = rows[first]
    return Priors(frame, run.world_T_camera[frame, :3, 3] - residual[rows], sigmas_of(run)[rows])


def drifted(
    poses: FloatArray, points: FloatArray, first: IntArray, seed: int
) -> tuple[FloatArray, FloatArray]:
    """Return poses and points with an odometry's drift, 0.01 deg and 0.01 m per frame.

    Points also scatter by 1 % of their distance from the frame ``first`` that observed them first.
    """
    rng = np.random.default_rng(seed)
    slip = rng.normal(size=(len(poses), 6)) * ([np.deg2rad(0.01)] * 3 + [0.01] * 3)
    motions = np.linalg.inv(poses[:-1]) @ poses[1:]
    moved = [poses[0]]
    for motion, d in zip(motions, slip, strict=False):
        moved.append(moved[-1] @ motion @ gtsam.Pose3.Expmap(d).matrix())
    out = np.stack(moved)
    local = np.einsum("nji,nj->ni", poses[first, :3, :3], points - poses[first, :3, 3])
    local *= 1.0 + rng.normal(0.0, 0.01, (len(points), 1))
    return out, np.einsum("nij,nj->ni", out[first, :3, :3], local) + out[first, :3, 3]


def aligned(poses: FloatArray, points: FloatArray, priors: Priors) -> tuple[FloatArray, FloatArray]:
    """Return poses and points aligned with the priors, as vgps and COLMAP do before they adjust."""
    config = StartConfig()
    seen = Correspondences(
        map_T_camera=poses[priors.frame],
        world_p_fix=priors.world_p_camera,
        region_m=priors.sigma_m * [INSIDE_PLANE, INSIDE_PLANE, INSIDE_LINE],
        camera_p_antenna=np.zeros(3),
    )
    found = align(seen, config)
    if found is None:
        print("warning: the camera does not move, so that the start cannot be aligned with the fixes")
        return poses, points
    errors = priors.sigma_m.T[:, :, None] ** 2 * np.eye(len(seen))
    sigmas = alignment_sigmas(seen, found, errors, config)
    if not sigmas.within(config) or np.degrees(sigmas.tilt_rad) > config.level_sigma_deg / np.sqrt(2.0):
        print(f"warning: the fixes do not determine the minimum ({sigmas}): take more frames")
    R, out = found.scale * found.world_R_map, poses.copy()
    out[:, :3, :3] = found.world_R_map @ poses[:, :3, :3]
    out[:, :3, 3] = poses[:, :3, 3] @ R.T + found.world_p_map
    return out, points @ R.T + found.world_p_map


def well_observed(run: Solution, frames: int) -> BoolArray:
    """Return (L,) which landmarks three or more of the first frames observe, on rays some degrees apart."""
    observed = run.observations
    rows = np.flatnonzero(observed.frame < frames)
    rows = rows[np.lexsort((observed.frame[rows], observed.landmark[rows]))]
    rays = world_rays(run.camera.K, run.world_T_camera[observed.frame[rows]], observed.uv_px[rows])
    owner, start, count = np.unique(observed.landmark[rows], return_index=True, return_counts=True)
    well = np.zeros(len(run.landmarks.sigma_px), dtype=bool)
    well[owner] = (count > 2) & (largest_angle_rad(rays, start) >= np.radians(MIN_ANGLE_DEG))
    return well


def make_problem(run: Solution, priors: Priors, frames: int, sigma_px: float, seed: int) -> BundleProblem:
    """Return the first frames of a run and the landmarks well observed in them, at a drifted start.

    COLMAP's own mapper drops points of nearly parallel rays: some of them would end behind its cameras.
    """
    observed, c = run.observations, run.camera
    inside = well_observed(run, frames)[observed.landmark] & (observed.frame < frames)
    frame, uv = observed.frame[inside], observed.uv_px[inside]
    kept, landmark = np.unique(observed.landmark[inside], return_inverse=True)
    first = np.full(len(kept), frames)
    np.minimum.at(first, landmark, frame)
    poses, points = drifted(run.world_T_camera[:frames], run.landmarks.world_p_landmark[kept], first, seed)
    poses, points = aligned(poses, points, priors)
    sigma = np.full(len(frame), sigma_px)
    K = (c.fx, c.fy, c.cx, c.cy)
    problem = BundleProblem(
        K=K,
        world_T_camera=poses,
        world_p_landmark=points,
        frame=frame,
        landmark=landmark,
        uv_px=uv,
        sigma_px=sigma,
        pose_graph=priors.graph(),
    )
    if reprojection_errors(problem)[1].any():
        print("warning: the start has points behind cameras, which the two cost functions treat differently")
    return problem
