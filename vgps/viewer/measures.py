"""What the pictures show, as numbers: reprojections and their errors, the terms of the energy."""

from dataclasses import dataclass

import numpy as np
from pydantic import ValidationError

from vgps.camera import distort
from vgps.config import GpsConfig
from vgps.geometry import project
from vgps.gps.fixes import Fixes, Placement, penalty, place
from vgps.model import FloatArray, GpsLog, IntArray
from vgps.solution import FixTable, Solution

_AT_ONCE = 200_000  # observations projected together: 4x4 poses of all of a long run would not fit


@dataclass(frozen=True)
class ReprojectedObservations:
    """Every observation, sorted by frame.

    Attributes:
        order: (N,) rows of the solution's observations.
        frame, landmark: (N,).
        seen_px, reprojected_px: (N, 2) in the distorted image, as the video shows it.
        error_px: (N, 2) reprojected minus seen, in the undistorted image, as the energy has it.
        per_frame: (F,) how many each frame has.
    """

    order: IntArray
    frame: IntArray
    landmark: IntArray
    seen_px: FloatArray
    reprojected_px: FloatArray
    error_px: FloatArray
    per_frame: IntArray

    @property
    def length_px(self) -> FloatArray:
        """(N,) length of the reprojection error."""
        return np.asarray(np.linalg.norm(self.error_px, axis=1))


def observations(solution: Solution) -> ReprojectedObservations:
    """All observations and their reprojections; what the lens cannot show is NaN in the distorted image."""
    seen = solution.observations
    order = np.argsort(seen.frame, kind="stable")
    frame, landmark, uv_px = seen.frame[order], seen.landmark[order], seen.uv_px[order]
    points = solution.landmarks.world_p_landmark[landmark]
    reprojected = np.full_like(uv_px, np.nan)
    for start in range(0, len(frame), _AT_ONCE):
        rows = slice(start, start + _AT_ONCE)
        uv, depth = project(
            solution.camera.K, solution.world_T_camera[frame[rows]], points[rows, None]
        )  # one point per camera
        reprojected[rows] = np.where(depth > 0, uv[:, 0], np.nan)
    return ReprojectedObservations(
        order,
        frame,
        landmark,
        distort(solution.camera, uv_px),
        distort(solution.camera, reprojected),
        reprojected - uv_px,
        np.bincount(frame, minlength=len(solution.t_s)),
    )


def video_terms(solution: Solution, seen: ReprojectedObservations) -> FloatArray:
    """(F,) Phi_i, Eq. (12), Kume 2010, with mu_j = 1/(2 sigma_j^2), Eq. (13); NaN where nothing is seen.

    As the thesis has it: without the robust loss and the balance with GPS that stage D puts on it.
    """
    mu = 1.0 / (2.0 * solution.landmarks.sigma_px[seen.landmark] ** 2)
    weighted = mu * np.sum(seen.error_px**2, axis=1)
    total = np.bincount(seen.frame, weighted, minlength=len(solution.t_s))
    return np.where(seen.per_frame > 0, total / np.maximum(seen.per_frame, 1), np.nan)


def per_frame(seen: ReprojectedObservations, frames: int) -> tuple[FloatArray, FloatArray]:
    """(F,) root mean square and (F,) largest reprojection error [px]; NaN where nothing is seen."""
    squares = np.bincount(seen.frame, seen.length_px**2, minlength=frames)
    rms = np.sqrt(squares / np.maximum(seen.per_frame, 1))
    largest = np.full(frames, -np.inf)
    np.maximum.at(largest, seen.frame, seen.length_px)
    empty = seen.per_frame == 0
    return np.where(empty, np.nan, rms), np.where(empty, np.nan, largest)


def judged(solution: Solution) -> tuple[GpsLog, FixTable]:
    """The log and its verdicts, of a run that has them."""
    if solution.gps is None or solution.fixes is None:
        raise ValueError("a run without GPS has no fixes to show")
    return solution.gps, solution.fixes


def fix_placement(solution: Solution) -> Placement:
    """Between which frames each fix lies, at its time stamp less the lag."""
    return place(solution.t_s, solution.fix_times_s)


def gps_terms(solution: Solution) -> FloatArray:
    """(M,) omega Psi of each fix that was used, as its GPS model has it, Eq. (14)-(22), Kume 2010; else NaN.

    All are NaN where the run's configuration is of another version.
    """
    table, log = solution.fixes, solution.gps
    if table is None or log is None:
        return np.zeros(0)
    terms = np.full(len(log), np.nan)
    try:
        config = GpsConfig.model_validate(solution.config.get("gps", {}))
    except ValidationError:
        return terms
    unknown = np.full(len(log), np.nan)
    lower = (unknown, unknown)
    sizes = (table.r_m, table.h_m, *lower)
    fixes = Fixes(solution.fix_times_s, table.world_p_fix, *sizes, log.sigma_m, table.used, unknown)
    if config.model == "none":
        return terms
    for row in np.flatnonzero(table.used & np.isfinite(table.residual_m).all(axis=1)):
        terms[row] = penalty(fixes, int(row), config).cost(table.residual_m[row : row + 1])[0]
    return terms
