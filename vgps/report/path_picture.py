"""The path from above and from the side, among the fixes and their regions."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.figure import Figure

from vgps.model import BoolArray, FloatArray
from vgps.report.facts import antenna_path, judged, way_m
from vgps.solution import FixTable, Solution, Verdict
from vgps.writers.page import tidy

# colour and marker, for who cannot tell the colours apart
LOOKS = {
    Verdict.USED: ("#2a8a5f", "."),
    Verdict.DOWN_CLASSED: ("#d98512", "^"),
    Verdict.REJECTED: ("#c22f3d", "X"),
    Verdict.NOT_USED: ("#8a9099", "+"),
}
_PATH, _ANTENNA, _BEFORE = "#1f4e9c", "#7f9fd6", "#8a63b8"
_WIDE, _LOWEST, _TALLEST = 9.0, 2.8, 8.5  # of the picture from above, inches
_MANY = 3000  # more marks than this are drawn as pixels, lest the page grows without bound


def with_verdict(table: FixTable, verdict: Verdict) -> BoolArray:
    """(M,) which fixes got a verdict and have a place."""
    has = np.array([one is verdict for one in table.verdict], dtype=bool)
    return np.asarray(has & np.isfinite(table.world_p_fix).all(axis=1))


def path_picture(solution: Solution) -> Figure:
    """East-north, and height over the way; fixes with the outline of their cylinders, Eq. (16), Kume 2010."""
    path = solution.world_T_camera[:, :3, 3]
    low, high = _box(solution)
    tall = _WIDE * float((high[1] - low[1]) / (high[0] - low[0]))
    figure = Figure(figsize=(10.0, tall + 3.0), layout="constrained")
    above, side = figure.subplots(2, 1, height_ratios=[tall, 2.4])
    points = solution.landmarks.world_p_landmark
    above.scatter(points[:, 0], points[:, 1], s=0.4, c="#d5d8dc", lw=0, rasterized=True, zorder=0)
    way, antenna = way_m(solution), antenna_path(solution)
    found = judged(solution)
    if found is not None:
        table = found[1]
        if solution.camera_p_antenna.any():
            side.plot(way, antenna[:, 2], color=_ANTENNA, lw=1.2, label="antenna")
        at = np.interp(solution.fix_times_s, solution.t_s, way)
        _fixes_above(above, table)
        _fixes_aside(side, table, at)
    if solution.world_p_before is not None:
        before = solution.world_p_before
        above.plot(before[:, 0], before[:, 1], color=_BEFORE, lw=0.9, ls="--", label="before stage D")
    above.plot(path[:, 0], path[:, 1], color=_PATH, lw=1.6, label="camera", zorder=3)
    above.plot(*path[0, :2], "o", color=_PATH, ms=6, mfc="white", label="start", zorder=4)
    side.plot(way, path[:, 2], color=_PATH, lw=1.6, label="camera", zorder=3)
    unit = "m" if solution.georeferenced else "arbitrary units"
    above.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    above.set(xlabel=f"east [{unit}]", ylabel=f"north [{unit}]")
    side.set(xlabel=f"way [{unit}]", ylabel=f"up [{unit}]", ylim=_heights(solution, antenna))
    for axes in (above, side):
        axes.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    tidy(above, side)
    return figure


def outside_picture(solution: Solution) -> int:
    """How many fixes lie outside the picture from above."""
    found = judged(solution)
    if found is None:
        return 0
    low, high = _box(solution)
    fixes = found[1].world_p_fix[:, :2]
    placed = np.isfinite(fixes).all(axis=1)
    return int((placed & ~((fixes >= low) & (fixes <= high)).all(axis=1)).sum())


def _box(solution: Solution) -> tuple[FloatArray, FloatArray]:
    """Corners (2,) around the path and the fixes that are not far from it, of a shape that suits a page."""
    around = solution.world_T_camera[:, :2, 3]
    low, high = around.min(axis=0), around.max(axis=0)
    reach = max(0.25 * float((high - low).max()), 5.0 if solution.georeferenced else 0.0)
    found = judged(solution)
    if found is not None:
        fixes = found[1].world_p_fix[:, :2]
        near = ((fixes > low - reach) & (fixes < high + reach)).all(axis=1)
        around = np.vstack([around, fixes[near]])
    low, high = around.min(axis=0), around.max(axis=0)
    half = 0.54 * (high - low) + 1e-3
    shape = np.array([max(half[0], half[1] * _WIDE / _TALLEST), max(half[1], half[0] * _LOWEST / _WIDE)])
    middle = 0.5 * (low + high)
    return middle - shape, middle + shape


def _heights(solution: Solution, antenna: FloatArray) -> tuple[float, float]:
    """Limits of heights that show the path, and the fixes unless these are far off."""
    around = solution.world_T_camera[:, 2, 3]
    found = judged(solution)
    if found is not None:
        table = found[1]
        around = np.concatenate([around, antenna[:, 2]])
        used = table.used & np.isfinite(table.world_p_fix[:, 2]) & np.isfinite(table.h_m)
        around = np.concatenate(
            [around, *(table.world_p_fix[used, 2] + sign * table.h_m[used] for sign in (-1.0, 1.0))]
        )
    margin = 0.05 * float(np.ptp(around)) + 1e-3
    return float(around.min()) - margin, float(around.max()) + margin


def _fixes_above(axes: Axes, table: FixTable) -> None:
    for verdict, (colour, marker) in LOOKS.items():
        rows = with_verdict(table, verdict)
        if not rows.any():
            continue
        fixes, size, many = table.world_p_fix[rows], 2.0 * table.r_m[rows], rows.sum() > _MANY
        label = f"{verdict}: {rows.sum()}"
        axes.plot(
            fixes[:, 0], fixes[:, 1], marker, color=colour, ms=5, label=label, zorder=5, rasterized=many
        )
        axes.add_collection(
            EllipseCollection(
                size,
                size,
                np.zeros(len(size)),
                units="xy",
                offsets=fixes[:, :2],
                offset_transform=axes.transData,
                facecolors="none",
                edgecolors=colour,
                linewidths=0.6,
                alpha=0.6,
                rasterized=many,
                zorder=2,
            )
        )
        if verdict in {Verdict.REJECTED, Verdict.DOWN_CLASSED}:
            to_antenna = np.stack([fixes, fixes + table.residual_m[rows]], axis=1)[:, :, :2]
            axes.add_collection(LineCollection(list(to_antenna), colors=colour, linewidths=0.7, zorder=2))


def _fixes_aside(axes: Axes, table: FixTable, way: FloatArray) -> None:
    for verdict, (colour, marker) in LOOKS.items():
        rows = with_verdict(table, verdict) & np.isfinite(table.residual_m).all(axis=1)
        if not rows.any():
            continue
        up, h_m, many = table.world_p_fix[rows, 2], np.nan_to_num(table.h_m[rows]), rows.sum() > _MANY
        axes.vlines(way[rows], up - h_m, up + h_m, color=colour, lw=0.8, alpha=0.45, rasterized=many)
        axes.plot(way[rows], up, marker, color=colour, ms=5, label=str(verdict), rasterized=many, zorder=5)
