"""Numbers along the run, the verdicts as a log, and the run in words."""

import numpy as np
import rerun as rr

from vgps.model import BoolArray, FloatArray
from vgps.solution import Solution, Verdict
from vgps.viewer import colours
from vgps.viewer.columns import Sheet
from vgps.viewer.measures import ReprojectedObservations, gps_terms, judged, per_frame, video_terms
from vgps.writers.tables import region_ratios

PLOTS, VERDICTS, SUMMARY = "plots", "verdicts", "summary"
ERROR, COUNT, ENERGY, RATIO, SIGMA, SIGMA_ROTATION = (
    f"{PLOTS}/{name}"
    for name in ("reprojection_px", "features", "energy", "residual_over_region", "sigma_m", "sigma_deg")
)
MOST_RATIO = 3.0
"""Residual ratios of rejected fixes are drawn at most this high; their true values are in the verdicts."""
_AXES = (("east", (255, 90, 90, 255)), ("north", (90, 220, 90, 255)), ("up", (90, 150, 255, 255)))


def log_plots(sheet: Sheet, solution: Solution, seen: ReprojectedObservations) -> None:
    """Numbers of every frame, and of every fix at its own time, less the lag."""
    rms, largest = per_frame(seen, len(solution.t_s))
    _line(sheet, f"{ERROR}/rms", rms, (60, 220, 90, 255), "root mean square")
    _line(sheet, f"{ERROR}/largest", largest, (255, 90, 60, 255), "largest")
    _line(sheet, f"{COUNT}/seen", seen.per_frame.astype(float), colours.PATH, "features used in D")
    _line(sheet, f"{ENERGY}/video", video_terms(solution, seen), colours.PATH, "video: Phi of a frame (12)")
    for k, (name, colour) in enumerate(_AXES):
        _line(sheet, f"{SIGMA}/{name}", solution.sigma_position_m[:, k], colour, name)
        sigma = np.degrees(solution.sigma_rotation_rad[:, k])
        _line(sheet, f"{SIGMA_ROTATION}/{name}", sigma, colour, f"about {name}")
    if solution.fixes is not None and solution.gps is not None:
        _log_fix_plots(sheet, solution)
        _log_verdicts(sheet, solution)


def log_summary(sheet: Sheet, solution: Solution, notes: tuple[str, ...]) -> None:
    """The run in words: counts, energies, warnings, what could not be shown, and what the colours mean."""
    sheet.static(SUMMARY, rr.TextDocument(summary(solution, notes), media_type="text/markdown"))


def summary(solution: Solution, notes: tuple[str, ...] = ()) -> str:
    """The run in markdown."""
    report, table = solution.report, solution.fixes
    terms = [
        f"| {term} | {report.cost_before[term]:.6g} | {report.cost_after.get(term, np.nan):.6g} |"
        for term in report.cost_before
    ]
    verdicts = "no GPS" if table is None else ", ".join(f"{table.verdict.count(v)} {v}" for v in Verdict)
    told = [f"- {line}" for line in (*solution.warnings, *notes)] or ["- nothing"]
    return "\n".join(
        [
            f"## {solution.recording or 'a run'}",
            f"{len(solution.t_s)} frames, {len(solution.landmarks.sigma_px)} landmarks, "
            f"{len(solution.observations.frame)} observations; fixes: {verdicts}.",
            "",
            "| term of the energy | before D | after D |",
            "|---|---|---|",
            *terms,
            "",
            f"{report.iterations} iterations; {report.stop_reason}.",
            "",
            "### To know",
            *told,
            "",
            "### Colours",
            "- path: blue; bridged frames: orange; path before D: violet",
            f"- features: green at 0 px of reprojection error, red from {colours.BAD_PX:g} px; "
            "white: where the map puts them",
            f"- landmarks: green at sigma_j = {colours.GOOD_SIGMA_PX:g} px, "
            f"red from {colours.BAD_SIGMA_PX:g} px",
            "- fixes that were used: rtk_fix green, rtk_float yellow, ppp teal, dgps blue, sbas violet, "
            "single pink; rejected: red; down-classed: magenta; not used: grey",
            "- factor graph: x poses, l landmarks, gps fixes; a sample around the time shown; select a node "
            "for its factors and residuals",
        ]
    )


def _line(sheet: Sheet, path: str, values: FloatArray, colour: colours.Colour, name: str) -> None:
    sheet.static(path, rr.SeriesLines(colors=[colour], names=[name], widths=[1.5]))
    sheet.series(path, values)


def _dots(
    sheet: Sheet, path: str, t_s: FloatArray, values: FloatArray, colour: colours.Colour, name: str
) -> None:
    sheet.static(path, rr.SeriesPoints(colors=[colour], names=[name], markers="circle", marker_sizes=[3.0]))
    sheet.series(path, values, t_s)


def _log_fix_plots(sheet: Sheet, solution: Solution) -> None:
    _, table = judged(solution)
    t_s = solution.fix_times_s
    rejected: BoolArray = np.array([verdict is Verdict.REJECTED for verdict in table.verdict], bool)
    of_r, of_h = region_ratios(table)
    used = table.used
    _dots(sheet, f"{RATIO}/r", t_s[used], of_r[used], (60, 220, 90, 255), "horizontal / r")
    _dots(sheet, f"{RATIO}/h", t_s[used], of_h[used], (90, 150, 255, 255), "vertical / h")
    worst = np.minimum(np.maximum(of_r, of_h), MOST_RATIO)[rejected]
    name = f"rejected: the larger, up to {MOST_RATIO:g}"
    _dots(sheet, f"{RATIO}/rejected", t_s[rejected], worst, colours.REJECTED, name)
    _line(sheet, f"{RATIO}/border", np.ones(len(solution.t_s)), (150, 150, 150, 255), "border")
    terms = gps_terms(solution)
    _dots(sheet, f"{ENERGY}/gps", t_s, terms, (250, 190, 40, 255), "GPS: omega Psi of a fix")


def _log_verdicts(sheet: Sheet, solution: Solution) -> None:
    log, table = judged(solution)
    levels = {Verdict.REJECTED: "ERROR", Verdict.DOWN_CLASSED: "WARN", Verdict.NOT_USED: "DEBUG"}
    sheet.at_times(
        VERDICTS,
        solution.fix_times_s,
        rr.TextLog.columns(
            text=[f"fix {row}, {log.fix_class[row]}: {reason}" for row, reason in enumerate(table.reason)],
            level=[levels.get(verdict, "INFO") for verdict in table.verdict],
        ),
    )
