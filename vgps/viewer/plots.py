"""Plots along the run, and the verdicts on the fixes as a log."""

import numpy as np
import rerun as rr

from vgps.model import BoolArray, FloatArray, GpsLog
from vgps.solution import FixTable, Solution, Verdict
from vgps.viewer import colours
from vgps.viewer.residuals import (
    ReprojectedObservations,
    gps_terms,
    reprojection_errors,
    video_terms,
)
from vgps.viewer.run_stream import RunStream

PLOTS, VERDICTS = "plots", "verdicts"
ERROR, COUNT, ENERGY, RATIO, SIGMA, SIGMA_ROTATION = (
    f"{PLOTS}/{name}"
    for name in ("reprojection_px", "features", "energy", "residual_over_region", "sigma_m", "sigma_deg")
)
MAX_RATIO = 3.0
"""Residual ratios of rejected fixes are clipped to this in the plot; the verdicts state them in full."""
AXES = (("east", (255, 90, 90, 255)), ("north", (90, 220, 90, 255)), ("up", (90, 150, 255, 255)))


def log_plots(stream: RunStream, solution: Solution, observations: ReprojectedObservations) -> None:
    """Log numbers of every frame, and of every fix at its time less the time offset."""
    rms, largest = reprojection_errors(observations)
    features = observations.per_frame.astype(float)
    _log_line(stream, f"{ERROR}/rms", rms, (60, 220, 90, 255), "rms")
    _log_line(stream, f"{ERROR}/largest", largest, (255, 90, 60, 255), "largest")
    _log_line(stream, f"{COUNT}/seen", features, colours.PATH, "features used in stage D")
    terms = video_terms(solution, observations)
    _log_line(stream, f"{ENERGY}/video", terms, colours.PATH, "video: Phi of a frame, Eq. (12)")
    for k, (name, colour) in enumerate(AXES):
        _log_line(stream, f"{SIGMA}/{name}", solution.sigma_position_m[:, k], colour, name)
        sigma = np.degrees(solution.sigma_rotation_rad[:, k])
        _log_line(stream, f"{SIGMA_ROTATION}/{name}", sigma, colour, f"about {name}")
    if solution.judged_fixes is not None:
        log, table = solution.judged_fixes
        _log_fix_plots(stream, solution, table)
        _log_verdicts(stream, solution.fix_times_s, log, table)


def _log_fix_plots(stream: RunStream, solution: Solution, table: FixTable) -> None:
    t_s = solution.fix_times_s
    rejected: BoolArray = np.array([verdict is Verdict.REJECTED for verdict in table.verdict], bool)
    ratio_r, ratio_h = table.region_ratios
    used = table.used
    _log_dots(stream, f"{RATIO}/r", (60, 220, 90, 255), "horizontal / r")
    stream.send_series(f"{RATIO}/r", ratio_r[used], t_s[used])
    _log_dots(stream, f"{RATIO}/h", (90, 150, 255, 255), "vertical / h")
    stream.send_series(f"{RATIO}/h", ratio_h[used], t_s[used])
    _log_dots(stream, f"{RATIO}/rejected", colours.REJECTED, f"rejected: the larger, at most {MAX_RATIO:g}")
    larger = np.minimum(np.maximum(ratio_r, ratio_h), MAX_RATIO)
    stream.send_series(f"{RATIO}/rejected", larger[rejected], t_s[rejected])
    _log_line(
        stream, f"{RATIO}/border", np.ones(len(solution.t_s)), (150, 150, 150, 255), "edge of the region"
    )
    _log_dots(stream, f"{ENERGY}/gps", (250, 190, 40, 255), "GPS: omega Psi of a fix")
    stream.send_series(f"{ENERGY}/gps", gps_terms(solution), t_s)


def _log_verdicts(stream: RunStream, t_s: FloatArray, log: GpsLog, table: FixTable) -> None:
    levels = {Verdict.REJECTED: "ERROR", Verdict.DOWN_CLASSED: "WARN", Verdict.NOT_USED: "DEBUG"}
    stream.send_times(
        VERDICTS,
        t_s,
        rr.TextLog.columns(
            text=[f"fix {row}, {log.fix_class[row]}: {reason}" for row, reason in enumerate(table.reason)],
            level=[levels.get(verdict, "INFO") for verdict in table.verdict],
        ),
    )


def _log_line(stream: RunStream, path: str, values: FloatArray, colour: colours.Colour, name: str) -> None:
    """Log a line over the frames (F,)."""
    stream.log_static(path, rr.SeriesLines(colors=[colour], names=[name], widths=[1.5]))
    stream.send_series(path, values)


def _log_dots(stream: RunStream, path: str, colour: colours.Colour, name: str) -> None:
    """Log the look of a series of dots."""
    stream.log_static(
        path, rr.SeriesPoints(colors=[colour], names=[name], markers="circle", marker_sizes=[3.0])
    )
