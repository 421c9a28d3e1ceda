"""The HTML page of a run."""

import math
from collections.abc import Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from vgps.crs import CoordinateSystem, coordinate_system
from vgps.evaluation.check_points import Mark, MarkStatistics, mark_statistics, marks_of
from vgps.report.mark_pictures import mark_pictures
from vgps.report.path_plot import VERDICT_STYLES, fixes_outside, path_plot
from vgps.report.summary import distance_m, doubted_fixes, outages, unused_reasons, verdict_counts
from vgps.report.survey_facts import changed_settings, class_spells, datum_facts
from vgps.report.time_plot import time_plot
from vgps.runtime.timing import sequential_seconds
from vgps.solution import FrameState, Solution, Verdict
from vgps.writers.page import embedded, write_page

_STAGES = {
    "decode": "opening the video",
    "start": "initial map",
    "track": "A: tracking",
    "map": "B: mapping",
    "window": "C: sliding window",
    "window beside": "C: sliding window, in parallel",
    "wait": "waiting for C",
    "align": "alignment to the fixes",
    "drift": "drift, verdicts, time offset",
    "drift beside": "drift, verdicts, time offset, in parallel",
    "batch": "D: final optimisation",
    "rest": "the rest: calibration, earlier runs of all stages",
}
_TERMS = {"video": "video: reprojection errors", "poses": "poses: fixes, motion, standstills"}
_MIN_S = 0.05  # shorter stages would be shown as 0.0 s
_MAX_ROWS = 200  # of the table of fixes


class Tile(NamedTuple):
    """A figure at the top of the page."""

    name: str
    value: str
    note: str


def write_report(
    solution: Solution,
    path: Path,
    *,
    crs: str | None = None,
    geoid: str | None = None,
    versions: Mapping[str, str] | None = None,
) -> None:
    """Write a run as one HTML page that needs no other file and no network.

    Args:
        solution: From :func:`vgps.smooth` or :func:`vgps.readers.run_folder.read_run`.
        path: The page; it appears complete or not at all.
        crs, geoid: What coordinates and heights are stated in, as for `coordinate_system`.
        versions: Of the libraries that made the run.

    Raises:
        RunFolderError: ``path`` is a folder, or cannot be written.
        CoordinateSystemError: The coordinate system or geoid is unknown, or lacks its grid.
    """
    doubted, system, marks = doubted_fixes(solution), _system(solution, crs, geoid), marks_of(solution)
    values: dict[str, Any] = {
        "name": "Run" if solution.recording is None else solution.recording.name,
        "solution": solution,
        "model": solution.config.get("gps", {}).get("model", "unknown"),
        "warnings": [*solution.warnings, *_skipped(solution), *_notes(solution, system)],
        "datum": datum_facts(solution, system),
        "spells": class_spells(solution)[:_MAX_ROWS],
        "marks": _mark_rows(solution, marks),
        "mark_groups": _mark_groups(marks),
        "changed": changed_settings(solution.config),
        "versions": versions or {},
        "tiles": list(_tiles(solution)),
        "path": embedded(path_plot(solution)),
        "outside": fixes_outside(solution),
        "over_time": embedded(time_plot(solution)),
        "verdicts": list(Verdict),
        "colours": {verdict: colour for verdict, (colour, _) in VERDICT_STYLES.items()},
        "counts": verdict_counts(solution),
        "doubted": doubted[:_MAX_ROWS],
        "more_doubted": len(doubted[_MAX_ROWS:]),
        "unused": unused_reasons(solution),
        "outages": outages(solution),
        "time_offset": _time_offset(solution),
        "antenna": _antenna(solution),
        "costs": _costs(solution),
        "terms": _TERMS,
        "seconds": _seconds(solution),
        "config": yaml.safe_dump(dict(solution.config), sort_keys=False, allow_unicode=True),
        "version": _version(),
        "number": _number,
    }
    write_page("vgps.report", values, path)


def _tiles(solution: Solution) -> Iterator[Tile]:
    """Yield the figures at the top of the page."""
    duration_s = float(solution.t_s[-1] - solution.t_s[0])
    unit = "m" if solution.georeferenced else "units"
    bridged = solution.state.count(FrameState.BRIDGED)
    note = f"{bridged:,} of them bridged" if bridged else "all tracked"
    yield Tile("frames with a pose", f"{len(solution.t_s):,}", note)
    length = _number(float(distance_m(solution)[-1]))
    yield Tile("path length", f"{length} {unit}", f"in {duration_s:.1f} s of video")
    if solution.gps is not None and solution.fixes is not None:
        rejected, lowered = map(solution.fixes.verdict.count, (Verdict.REJECTED, Verdict.DOWN_CLASSED))
        used = f"{int(solution.fixes.used.sum()):,} of {len(solution.gps):,}"
        yield Tile("fixes used", used, f"{rejected:,} rejected, {lowered:,} down-classed")
    sigma = solution.sigma_position_m[np.isfinite(solution.sigma_position_m).all(axis=1)]
    if len(sigma):
        horizontal, vertical = np.median(np.hypot(sigma[:, 0], sigma[:, 1])), np.median(sigma[:, 2])
        value = f"{_number(float(horizontal), 2)} / {_number(float(vertical), 2)} {unit}"
        yield Tile("standard deviation", value, "horizontal / vertical, median")
    yield from _scene_tiles(solution)
    if total_s := sequential_seconds(solution.seconds):
        yield Tile("computing time", f"{total_s:.1f} s", f"{duration_s / total_s:.2f} times real time")


def _scene_tiles(solution: Solution) -> Iterator[Tile]:
    """Yield what the pictures show: landmarks, places seen again, and what was left out."""
    landmarks, observations = solution.all_landmarks
    yield Tile("landmarks", f"{len(landmarks.sigma_px):,}", f"{len(observations.frame):,} observations")
    if solution.cameras:
        names = ", ".join(camera.name for camera in solution.cameras)
        yield Tile("cameras", f"{1 + len(solution.cameras)}", f"poses of the first; with {names}")
    if len(solution.loops):
        note = "frames that find landmarks of an earlier visit"
        yield Tile("places seen again", f"{len(solution.loops):,}", note)
    if len(share := solution.static_share[solution.static_share > 0]):
        note = f"of the picture never moves and was left out, in {len(share):,} frames"
        yield Tile("bonnet, text, reflection", f"up to {100 * share.max():.1f} %", note)
    if len(share := solution.moving_share[solution.moving_share > 0]):
        note = f"of the picture in boxes around what moves on its own, left out in {len(share):,} frames"
        yield Tile("moving objects", f"up to {100 * share.max():.1f} %", note)


def _system(solution: Solution, crs: str | None, geoid: str | None) -> CoordinateSystem | None:
    if solution.world_origin is None or not solution.georeferenced:
        return None
    return coordinate_system(solution.world_origin[:2], crs, geoid)


def _notes(solution: Solution, system: CoordinateSystem | None) -> list[str]:
    """Return what was assumed of datums: by the coordinate system, and by that of the control points."""
    points = solution.control_points
    return [*(system.notes if system else ()), *(points.notes if points else ())]


def _mark_rows(solution: Solution, marks: list[Mark]) -> list[tuple[Mark, str | None]]:
    """Return the marks, control points first, with their pictures."""
    pictures = mark_pictures(solution, marks)
    return [(mark, pictures.get(mark.name)) for mark in sorted(marks, key=lambda mark: mark.check)]


def _mark_groups(marks: list[Mark]) -> list[tuple[str, int, MarkStatistics | None]]:
    """Return name, number and statistics of the control points and of the check points."""
    groups = (
        ("control points", [mark for mark in marks if not mark.check]),
        ("check points", [mark for mark in marks if mark.check]),
    )
    return [(name, len(group), mark_statistics(group)) for name, group in groups if group]


def _skipped(solution: Solution) -> list[str]:
    if solution.gps is None:
        return []
    return [f"{solution.gps.source.name}: {note}" for note in solution.gps.skipped]


def _time_offset(solution: Solution) -> str:
    sensors = solution.sensors
    offset_s, sigma_s = sensors.time_offset_s, sensors.time_offset_sigma_s
    text = f"{offset_s:.3f} s (not estimated in stage D)"
    if math.isfinite(sigma_s):
        text = f"{offset_s:.3f} s, standard deviation {sigma_s:.3f} s (estimated)"
    if not sensors.clock_rate:
        return text
    ms, sigma_ms = 1e3 * sensors.clock_rate, 1e3 * sensors.clock_rate_sigma
    sigma = f", standard deviation {sigma_ms:.2f} ms" if math.isfinite(sigma_ms) else " (as given)"
    return f"{text} at the first frame, more by {ms:.2f} ms in each second{sigma}"


def _antenna(solution: Solution) -> str:
    position = ", ".join(f"{value:.3f}" for value in solution.camera_p_antenna)
    sigmas = solution.sensors.antenna_sigma_m
    if all(map(math.isfinite, sigmas)):
        return f"{position} m, standard deviations {', '.join(f'{s:.3f}' for s in sigmas)} m (estimated)"
    return f"{position} m (as given)"


def _costs(solution: Solution) -> list[tuple[str, float, float]]:
    """Return name and cost before and after stage D of every term and of their sum; empty without stage D."""
    before, after = solution.report.cost_before, solution.report.cost_after
    names = list(dict.fromkeys([*before, *after]))
    rows = [(name, before.get(name, math.nan), after.get(name, math.nan)) for name in names]
    return [*rows, ("total", sum(before.values()), sum(after.values()))] if rows else []


def _seconds(solution: Solution) -> list[tuple[str, float, float]]:
    """Return name, seconds and share of the total of every stage, in the order of the method."""
    known = [stage for stage in _STAGES if stage in solution.seconds]
    stages = [*known, *(stage for stage in solution.seconds if stage not in _STAGES)]
    total_s = max(sequential_seconds(solution.seconds), 1e-9)
    return [
        (_STAGES.get(stage, stage), solution.seconds[stage], solution.seconds[stage] / total_s)
        for stage in stages
        if solution.seconds[stage] >= _MIN_S
    ]


def _number(value: float, figures: int = 3) -> str:
    """Format a number with so many significant figures, all digits of its integer part, or a dash for NaN."""
    if not math.isfinite(value):
        return "–"
    digits = 0 if value == 0.0 else figures - 1 - math.floor(math.log10(abs(value)))
    return f"{value:,.{min(max(digits, 0), 6)}f}"


def _version() -> str:
    try:
        return version("vgps")
    except PackageNotFoundError:
        return "(not installed)"
