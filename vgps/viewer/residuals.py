"""The numbers behind the pictures: reprojection errors and the terms of the energy."""

from dataclasses import dataclass

import numpy as np
from pydantic import ValidationError

from vgps.camera import distort
from vgps.config import GpsConfig
from vgps.geometry import project
from vgps.gps.antenna_path import Placement, place
from vgps.gps.fix_factors import penalty
from vgps.gps.fixes import CLASSES, Fixes
from vgps.gps.regions import ellipsoid_shapes, lower_class
from vgps.model import FloatArray, GpsLog, IntArray
from vgps.rolling_shutter import row_poses
from vgps.solution import FixTable, Solution, Verdict

_CHUNK = 200_000  # observations projected together: 4x4 poses of all of a long run would not fit in memory


@dataclass(frozen=True, kw_only=True)
class ReprojectedObservations:
    """All observations and the reprojections of their landmarks, sorted by frame.

    Attributes:
        order: (N,) rows of the solution's observations.
        frame, landmark: (N,).
        observed_px, reprojected_px: (N, 2) in the distorted image, as the video shows it.
        error_px: (N, 2) reprojected minus observed in the undistorted image, as the energy uses it.
        per_frame: (F,) number of observations in each frame.
    """

    order: IntArray
    frame: IntArray
    landmark: IntArray
    observed_px: FloatArray
    reprojected_px: FloatArray
    error_px: FloatArray
    per_frame: IntArray

    @property
    def length_px(self) -> FloatArray:
        """(N,) length of the reprojection error."""
        return np.asarray(np.linalg.norm(self.error_px, axis=1))


def reproject(solution: Solution) -> ReprojectedObservations:
    """Reproject all observed landmarks; NaN in the distorted image where the lens cannot show them."""
    observations, camera = solution.observations, solution.camera
    order = np.argsort(observations.frame, kind="stable")
    frame, landmark = observations.frame[order], observations.landmark[order]
    uv_px = observations.uv_px[order]
    points = solution.landmarks.world_p_landmark[landmark]
    reprojected = np.full_like(uv_px, np.nan)
    for start in range(0, len(frame), _CHUNK):
        rows = slice(start, start + _CHUNK)
        poses = row_poses(camera, solution.t_s, solution.world_T_camera, frame[rows], uv_px[rows])
        uv, depth = project(camera.K, poses, points[rows, None])  # one point per camera
        reprojected[rows] = np.where(depth > 0, uv[:, 0], np.nan)
    return ReprojectedObservations(
        order=order,
        frame=frame,
        landmark=landmark,
        observed_px=distort(camera, uv_px),
        reprojected_px=distort(camera, reprojected),
        error_px=reprojected - uv_px,
        per_frame=np.bincount(frame, minlength=len(solution.t_s)),
    )


def reprojection_errors(observations: ReprojectedObservations) -> tuple[FloatArray, FloatArray]:
    """Return the rms (F,) and the largest (F,) reprojection error of each frame [px]; NaN without any."""
    per_frame = observations.per_frame
    squares = np.bincount(observations.frame, observations.length_px**2, minlength=len(per_frame))
    rms = np.sqrt(squares / np.maximum(per_frame, 1))
    largest = np.full(len(per_frame), -np.inf)
    np.maximum.at(largest, observations.frame, observations.length_px)
    empty = per_frame == 0
    return np.where(empty, np.nan, rms), np.where(empty, np.nan, largest)


def video_terms(solution: Solution, observations: ReprojectedObservations) -> FloatArray:
    """Return (F,) Phi_i, Eq. (12), Kume 2010, with mu_j = 1/(2 sigma_j^2), Eq. (13); NaN without features.

    This is the term of the thesis, without the robust loss and the weight that stage D applies to it.
    """
    mu = 1.0 / (2.0 * solution.landmarks.sigma_px[observations.landmark] ** 2)
    weighted = mu * np.sum(observations.error_px**2, axis=1)
    total = np.bincount(observations.frame, weighted, minlength=len(solution.t_s))
    per_frame = observations.per_frame
    return np.where(per_frame > 0, total / np.maximum(per_frame, 1), np.nan)


def gps_results(solution: Solution) -> tuple[GpsLog, FixTable]:
    """Return the GPS log and the verdicts of a run that has both."""
    if solution.judged_fixes is None:
        raise ValueError("a run without GPS has no fixes to show")
    return solution.judged_fixes


def fix_placement(solution: Solution) -> Placement:
    """Return the frames between which each fix lies, at its time stamp less the time offset."""
    return place(solution.t_s, solution.fix_times_s)


def gps_terms(solution: Solution) -> FloatArray:
    """Return (M,) omega Psi of each fix that was used, by its GPS model, Eq. (14)-(22), Kume 2010; else NaN.

    All are NaN if the run's configuration is that of an incompatible version.
    """
    if solution.judged_fixes is None:
        return np.zeros(0)
    log, table = solution.judged_fixes
    terms = np.full(len(log), np.nan)
    try:
        config = GpsConfig.model_validate(solution.config.get("gps", {}))
    except ValidationError:
        return terms
    if config.model == "none":
        return terms
    unknown = np.full(len(log), np.nan)
    verdicts = zip(log.fix_class, table.verdict, strict=True)
    regions = [lower_class(name) if one is Verdict.DOWN_CLASSED else name for name, one in verdicts]
    shape = ellipsoid_shapes(regions, config)
    fixes = Fixes(
        t_s=solution.fix_times_s,
        world_p_fix=table.world_p_fix,
        r_m=table.r_m,
        h_m=table.h_m,
        lower_r_m=unknown,
        lower_h_m=unknown,
        shape=shape,
        lower_shape=shape,
        sigma_m=log.sigma_m,
        correlation=np.zeros((len(log), 3)) if log.correlation is None else log.correlation,
        logging_sigma_m=log.logging_sigma,
        used=table.used,
        correlation_s=unknown,
        fix_class=np.array([CLASSES.index(name) for name in regions], dtype=np.int64),
    )
    for row in np.flatnonzero(table.used & np.isfinite(table.residual_m).all(axis=1)):
        terms[row] = penalty(fixes, int(row), config).cost(table.residual_m[row : row + 1])[0]
    return terms
