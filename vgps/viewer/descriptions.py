"""What is said of frames, landmarks and fixes when they are selected."""

from dataclasses import dataclass

import numpy as np

from vgps.model import FloatArray, IntArray
from vgps.solution import Solution
from vgps.viewer.measures import ReprojectedObservations, fix_placement, judged

_LISTED = 40  # residuals of a landmark that are spelt out


@dataclass(frozen=True)
class Facts:
    """What the selection panel shows of a node, each short enough for a line of it.

    Attributes:
        what: Its name and time.
        factors: How many act on it, or on which frames it acts.
        residual: Theirs; of a fix, antenna minus fix, east, north, up.
        cost: Its term of the energy, or its weight in it; of a fix after the residual over its region.
        verdict: What was made of it.
        details: All of it at length; the panel shows its beginning, and the rest under the pointer.
    """

    what: str
    factors: str
    residual: str
    cost: str
    verdict: str
    details: str


def fix_title(solution: Solution, row: int) -> str:
    """A fix in a line: number, line of the log, time less the lag, class, verdict."""
    log, table = judged(solution)
    place = f"fix {row} (line {log.line[row]}) at {solution.fix_times_s[row]:.2f} s"
    return f"{place}: {log.fix_class[row]}, {table.verdict[row]}"


def fix_facts(solution: Solution, row: int, term: float) -> Facts:
    """Everything about the factor of a fix."""
    log, table = judged(solution)
    east, north, up = table.residual_m[row]
    r_m, h_m = table.r_m[row], table.h_m[row]
    time_offset_s, between = solution.sensors.time_offset_s, int(fix_placement(solution).frame[row])
    over = f"{np.hypot(east, north) / r_m:.2f} r, {abs(up) / h_m:.2f} h"
    details = [
        fix_title(solution, row),
        table.reason[row],
        f"residual, antenna minus fix: east {east:+.3f}, north {north:+.3f}, up {up:+.3f} m",
        f"region: r {r_m:g} m, h {h_m:g} m; residual over region: {over}",
        f"omega Psi = {term:.4g}" if np.isfinite(term) else "no term in the energy",
        f"acts between frames {between} and {between + 1}",
        *(
            [f"its time stamp is {log.t_s[row]:.2f} s, {time_offset_s:+.3f} s of it the clock's lag"]
            if time_offset_s
            else []
        ),
    ]
    return Facts(
        what=f"fix {row}, {solution.fix_times_s[row]:.2f} s",
        factors=f"frames {between}, {between + 1}" if np.isfinite(term) else "none",
        residual=f"{east:+.2f} {north:+.2f} {up:+.2f} m",
        cost=f"{over}: {term:.2g}" if np.isfinite(term) else over,
        verdict=f"{log.fix_class[row]}, {table.verdict[row]}",
        details="\n".join(details),
    )


def pose_facts(solution: Solution, frame: int, errors_px: FloatArray, phi: float, fixes: list[int]) -> Facts:
    """Everything about the factors on the pose of a frame.

    Args:
        solution: The run.
        frame: Which.
        errors_px: (P,) lengths of its reprojection errors.
        phi: Its term Phi_i, Eq. (12), Kume 2010.
        fixes: Fixes whose factors act on this pose.
    """
    east, north, up = solution.world_T_camera[frame, :3, 3]
    sigma = solution.sigma_position_m[frame]
    lines = [
        f"frame {frame} at {solution.t_s[frame]:.3f} s, {solution.state[frame]}",
        f"position: east {east:.3f}, north {north:.3f}, up {up:.3f} m",
        "sigma: "
        + ", ".join(f"{name} {s:.3f}" for name, s in zip(("east", "north", "up"), sigma, strict=True))
        + " m",
    ]
    rms = np.sqrt(np.mean(errors_px**2)) if len(errors_px) else np.nan
    if len(errors_px):
        lines.append(
            f"{len(errors_px)} projection factors: rms {rms:.2f} px, largest {errors_px.max():.2f} px, "
            f"Phi = {phi:.3f}, Eq. (12)"
        )
    return Facts(
        what=f"frame {frame}, {solution.t_s[frame]:.2f} s",
        factors=f"{len(errors_px)} video, {len(fixes)} gps",
        residual=f"rms {rms:.2f} px",
        cost=f"Phi {phi:.3f}",
        verdict=str(solution.state[frame]),
        details="\n".join([*lines, *(fix_title(solution, row) for row in fixes)]),
    )


def landmark_facts(solution: Solution, landmark: int, seen: ReprojectedObservations, rows: IntArray) -> Facts:
    """Everything about the factors on a landmark: ``rows`` are its rows of the observations."""
    east, north, up = solution.landmarks.world_p_landmark[landmark]
    frames, errors = seen.frame[rows], seen.error_px[rows]
    rms = np.sqrt(np.mean(np.sum(errors**2, axis=1)))
    residuals = [
        f"frame {frame}: u {u:+.2f}, v {v:+.2f} px" for frame, (u, v) in zip(frames, errors, strict=True)
    ]
    more = [f"and {len(residuals) - _LISTED} more"] if len(residuals) > _LISTED else []
    sigma_px = solution.landmarks.sigma_px[landmark]
    details = [
        f"landmark {landmark}: east {east:.3f}, north {north:.3f}, up {up:.3f} m",
        f"{len(frames)} projection factors in frames {frames[0]} to {frames[-1]}: rms {rms:.2f} px",
        f"sigma_j = {sigma_px:.2f} px, Eq. (13)",
        *residuals[:_LISTED],
        *more,
    ]
    return Facts(
        what=f"landmark {landmark}",
        factors=f"{len(frames)} in {frames[0]} to {frames[-1]}",
        residual=f"rms {rms:.2f} px",
        cost=f"sigma_j {sigma_px:.2f} px",
        verdict="used",
        details="\n".join(details),
    )
