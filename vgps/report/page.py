"""The page: warnings first, then the result, then what it rests on."""

import math
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from vgps.report.facts import doubts, outages, unused_reasons, verdict_counts, way_m
from vgps.report.path_picture import LOOKS, outside_picture, path_picture
from vgps.report.time_picture import time_picture
from vgps.runtime.timing import sequential_seconds
from vgps.solution import FrameState, Solution, Verdict
from vgps.writers.page import embedded, write_page

_STAGES = {
    "decode": "decoding",
    "start": "start",
    "track": "A, tracking",
    "map": "B, mapping",
    "window": "C, window",
    "window beside": "C, window, beside A and B",
    "wait": "waiting for C",
    "align": "alignment with fixes",
    "drift": "drift, verdicts, clock",
    "drift beside": "the same, beside A and B",
    "batch": "D, everything",
}
_TERMS = {"video": "video", "poses": "on the poses: fixes, motion, standstills"}


class Tile(NamedTuple):
    """A figure that a reader looks for first."""

    name: str
    value: str
    note: str


def write_report(solution: Solution, path: Path) -> None:
    """Write a run as one HTML page that needs no other file and no network.

    Args:
        solution: From :func:`vgps.smooth` or :func:`vgps.readers.run_folder.read_run`.
        path: The page; it appears complete or not at all.

    Raises:
        RunFolderError: ``path`` is a folder, or cannot be written.
    """
    total_s = sequential_seconds(solution.seconds)
    values: dict[str, Any] = {
        "name": "a run" if solution.recording is None else solution.recording.name,
        "solution": solution,
        "model": solution.config.get("gps", {}).get("model", "not known"),
        "warnings": [*solution.warnings, *_skipped(solution)],
        "tiles": _tiles(solution, total_s),
        "path": embedded(path_picture(solution)),
        "outside": outside_picture(solution),
        "over_time": embedded(time_picture(solution)),
        "verdicts": list(Verdict),
        "colours": {verdict: colour for verdict, (colour, _) in LOOKS.items()},
        "counts": verdict_counts(solution),
        "doubts": doubts(solution),
        "unused": unused_reasons(solution),
        "outages": outages(solution),
        "lag": _lag(solution),
        "antenna": _antenna(solution),
        "energy": _energy(solution),
        "terms": _TERMS,
        "seconds": _seconds(solution),
        "config": yaml.safe_dump(dict(solution.config), sort_keys=False, allow_unicode=True),
        "version": _version(),
        "number": _number,
    }
    write_page("vgps.report", values, path)


def _tiles(solution: Solution, total_s: float) -> list[Tile]:
    frames, bridged = len(solution.t_s), solution.state.count(FrameState.BRIDGED)
    long_s = float(solution.t_s[-1] - solution.t_s[0])
    unit = "m" if solution.georeferenced else "units"
    tiles = [
        Tile("frames posed", str(frames), f"{bridged} of them bridged" if bridged else "all tracked"),
        Tile("way", f"{_number(float(way_m(solution)[-1]))} {unit}", f"in {long_s:.1f} s of video"),
    ]
    if solution.gps is not None and solution.fixes is not None:
        rejected, lowered = (
            solution.fixes.verdict.count(one) for one in (Verdict.REJECTED, Verdict.DOWN_CLASSED)
        )
        used = int(solution.fixes.used.sum())
        note = f"{rejected} rejected, {lowered} down-classed"
        tiles.append(Tile("fixes used", f"{used} of {len(solution.gps)}", note))
    sigma = solution.sigma_position_m[np.isfinite(solution.sigma_position_m).all(axis=1)]
    if len(sigma):
        flat, up = np.median(np.hypot(sigma[:, 0], sigma[:, 1])), np.median(sigma[:, 2])
        values = f"{_number(float(flat), 2)} · {_number(float(up), 2)} {unit}"
        tiles.append(Tile("median sigma", values, "horizontal · up, as the run says"))
    tiles.append(
        Tile(
            "landmarks",
            f"{len(solution.landmarks.sigma_px):,}",
            f"{len(solution.observations.frame):,} observations",
        )
    )
    note = f"{long_s / total_s:.2f} times real time" if total_s else ""
    tiles.append(Tile("computed in", f"{total_s:.1f} s", note))
    return tiles


def _skipped(solution: Solution) -> list[str]:
    if solution.gps is None:
        return []
    return [f"{solution.gps.source.name}: {note}" for note in solution.gps.skipped]


def _lag(solution: Solution) -> str:
    time_offset_s, sigma_s = solution.sensors.time_offset_s, solution.sensors.time_offset_sigma_s
    if math.isfinite(sigma_s):
        return f"{time_offset_s:.3f} s, standard deviation {sigma_s:.3f} s (estimated)"
    return f"{time_offset_s:.3f} s (not estimated with the poses)"


def _antenna(solution: Solution) -> str:
    place = " ".join(f"{value:.3f}" for value in solution.camera_p_antenna)
    sigmas = solution.sensors.antenna_sigma_m
    if all(map(math.isfinite, sigmas)):
        return f"{place} m, standard deviations {' '.join(f'{s:.3f}' for s in sigmas)} m (estimated)"
    return f"{place} m (as given)"


def _energy(solution: Solution) -> list[tuple[str, float, float]]:
    before, after = solution.report.cost_before, solution.report.cost_after
    terms = list(dict.fromkeys([*before, *after]))
    rows = [(term, before.get(term, math.nan), after.get(term, math.nan)) for term in terms]
    return [*rows, ("total", sum(before.values()), sum(after.values()))]


def _seconds(solution: Solution) -> list[tuple[str, float, float]]:
    """Name, seconds and share of every stage, in the order of the method."""
    known = [stage for stage in _STAGES if stage in solution.seconds]
    stages = [*known, *(stage for stage in solution.seconds if stage not in _STAGES)]
    total_s = max(sequential_seconds(solution.seconds), 1e-9)
    return [
        (_STAGES.get(stage, stage), solution.seconds[stage], solution.seconds[stage] / total_s)
        for stage in stages
    ]


def _number(value: float, figures: int = 3) -> str:
    """So many figures, more where a number is large, a dash where it is unknown."""
    if not math.isfinite(value):
        return "–"
    digits = 0 if value == 0.0 else figures - 1 - math.floor(math.log10(abs(value)))
    return f"{value:,.{min(max(digits, 0), 6)}f}"


def _version() -> str:
    try:
        return version("vgps")
    except PackageNotFoundError:
        return "not installed"
