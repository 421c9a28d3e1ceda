"""What the selection panel shows of a frame, a landmark or a fix."""

from dataclasses import dataclass

import numpy as np

from vgps.solution import Solution
from vgps.viewer.residuals import fix_placement, gps_results
from vgps.viewer.run_index import RunIndex

_LISTED = 40  # residuals of a landmark that are listed


@dataclass(frozen=True, kw_only=True)
class SelectionDetails:
    """Properties of a node, each short enough for a line of the selection panel.

    Attributes:
        what: Its name and time.
        factors: How many factors act on it, or on which frames it acts.
        residual: Their residual; of a fix, antenna minus fix, east, north, up.
        cost: Its term of the energy or its weight; of a fix after the residual over its region.
        verdict: State of the frame, or class and verdict of the fix.
        details: Everything at length; the panel shows its beginning, and the rest under the pointer.
    """

    what: str
    factors: str
    residual: str
    cost: str
    verdict: str
    details: str


def fix_title(solution: Solution, row: int) -> str:
    """Return number, line of the log, time less the time offset, class and verdict of a fix in one line."""
    log, table = gps_results(solution)
    place = f"fix {row} (line {log.line[row]}) at {solution.fix_times_s[row]:.2f} s"
    return f"{place}: {log.fix_class[row]}, {table.verdict[row]}"


def fix_details(run: RunIndex, row: int) -> SelectionDetails:
    """Return the details of the factor of a fix."""
    solution, term = run.solution, float(run.gps_terms[row])
    log, table = gps_results(solution)
    east, north, up = table.residual_m[row]
    r_m, h_m = table.r_m[row], table.h_m[row]
    late_s, before = log.t_s[row] - solution.fix_times_s[row], int(fix_placement(solution).frame[row])
    ratios = f"{np.hypot(east, north) / r_m:.2f} r, {abs(up) / h_m:.2f} h"
    details = [
        fix_title(solution, row),
        table.reason[row],
        f"residual, antenna minus fix: east {east:+.3f}, north {north:+.3f}, up {up:+.3f} m",
        f"region: r {r_m:g} m, h {h_m:g} m; residual over region: {ratios}",
        f"omega Psi = {term:.4g}" if np.isfinite(term) else "no term in the energy",
        f"acts on frames {before} and {before + 1}",
    ]
    if late_s:
        details.append(f"time stamp {log.t_s[row]:.2f} s, of which {late_s:+.3f} s is the time offset")
    return SelectionDetails(
        what=f"fix {row}, {solution.fix_times_s[row]:.2f} s",
        factors=f"frames {before}, {before + 1}" if np.isfinite(term) else "none",
        residual=f"{east:+.2f} {north:+.2f} {up:+.2f} m",
        cost=f"{ratios}: {term:.2g}" if np.isfinite(term) else ratios,
        verdict=f"{log.fix_class[row]}, {table.verdict[row]}",
        details="\n".join(details),
    )


def pose_details(run: RunIndex, frame: int) -> SelectionDetails:
    """Return the details of the pose of a frame and of the factors on it."""
    solution, fixes = run.solution, run.fixes_of_frame.get(frame, [])
    errors_px, phi = run.lengths_px[run.rows_of_frame(frame)], float(run.video_terms[frame])
    east, north, up = solution.world_T_camera[frame, :3, 3]
    sigma_east, sigma_north, sigma_up = solution.sigma_position_m[frame]
    details = [
        f"frame {frame} at {solution.t_s[frame]:.3f} s, {solution.state[frame]}",
        f"position: east {east:.3f}, north {north:.3f}, up {up:.3f} m",
        f"standard deviation: east {sigma_east:.3f}, north {sigma_north:.3f}, up {sigma_up:.3f} m",
    ]
    rms = np.sqrt(np.mean(errors_px**2)) if len(errors_px) else np.nan
    if len(errors_px):
        details.append(
            f"{len(errors_px)} projection factors: rms {rms:.2f} px, largest {errors_px.max():.2f} px, "
            f"Phi = {phi:.3f}, Eq. (12)"
        )
    return SelectionDetails(
        what=f"frame {frame}, {solution.t_s[frame]:.2f} s",
        factors=f"{len(errors_px)} video, {len(fixes)} gps",
        residual=f"rms {rms:.2f} px",
        cost=f"Phi {phi:.3f}",
        verdict=str(solution.state[frame]),
        details="\n".join([*details, *(fix_title(solution, row) for row in fixes)]),
    )


def landmark_details(run: RunIndex, landmark: int) -> SelectionDetails:
    """Return the details of a landmark and of the factors on it."""
    rows, landmarks = run.rows_of_landmark(landmark), run.solution.landmarks
    east, north, up = landmarks.world_p_landmark[landmark]
    frames, errors = run.observations.frame[rows], run.observations.error_px[rows]
    rms = np.sqrt(np.mean(np.sum(errors**2, axis=1)))
    residuals = [
        f"frame {frame}: u {u:+.2f}, v {v:+.2f} px" for frame, (u, v) in zip(frames, errors, strict=True)
    ]
    more = [f"and {len(residuals) - _LISTED} more"] if len(residuals) > _LISTED else []
    sigma_px = landmarks.sigma_px[landmark]
    details = [
        f"landmark {landmark}: east {east:.3f}, north {north:.3f}, up {up:.3f} m",
        f"{len(frames)} projection factors in frames {frames[0]} to {frames[-1]}: rms {rms:.2f} px",
        f"sigma_j = {sigma_px:.2f} px, Eq. (13)",
        *residuals[:_LISTED],
        *more,
    ]
    return SelectionDetails(
        what=f"landmark {landmark}",
        factors=f"{len(frames)} in {frames[0]} to {frames[-1]}",
        residual=f"rms {rms:.2f} px",
        cost=f"sigma_j {sigma_px:.2f} px",
        verdict="used",
        details="\n".join(details),
    )
