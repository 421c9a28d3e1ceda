"""The path from above and its height, with the fixes and their regions."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.figure import Figure

from vgps.model import BoolArray, FloatArray
from vgps.report.summary import antenna_positions, distance_m
from vgps.solution import FixTable, Solution, Verdict
from vgps.writers.page import tidy

# colour and marker, for readers who cannot tell the colours apart
VERDICT_STYLES = {
    Verdict.USED: ("#2a8a5f", "."),
    Verdict.DOWN_CLASSED: ("#d98512", "^"),
    Verdict.REJECTED: ("#c22f3d", "X"),
    Verdict.NOT_USED: ("#8a9099", "+"),
}
_PATH, _ANTENNA, _BEFORE, _REGION = "#1f4e9c", "#7f9fd6", "#8a63b8", "#c9e7d7"
_WIDTH, _MIN_HEIGHT, _MAX_HEIGHT = 7.7, 2.6, 7.4  # of the plot from above, inches, beside its legend
_MAX_VECTORS = 3000  # with more frames or fixes the plots are drawn as pixels, which bounds the page's size
_ALL_LAYERS = 10.0  # above every zorder used here


def path_plot(solution: Solution) -> Figure:
    """Plot north over east, and height over distance; regions of fixes as outlines, Eq. (16), Kume 2010."""
    low, high = _box(solution)
    height = _WIDTH * float((high[1] - low[1]) / (high[0] - low[0]))
    figure = Figure(figsize=(10.0, height + 3.2), layout="constrained")
    above, side = figure.subplots(2, 1, height_ratios=[height, 2.4])
    _plot_above(above, solution)
    _plot_side(side, solution)
    unit = "m" if solution.georeferenced else "arbitrary units"
    above.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", anchor="W")
    above.set(xlabel=f"east [{unit}]", ylabel=f"north [{unit}]")
    side.set(xlabel=f"distance along the path [{unit}]", ylabel=f"up [{unit}]", ylim=_heights(solution))
    for axes in (above, side):
        axes.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        bound_size(axes, solution)
    tidy(above, side)
    return figure


def bound_size(axes: Axes, solution: Solution) -> None:
    """Draw the contents of axes as pixels if the run is long."""
    fixes = 0 if solution.gps is None else len(solution.gps)
    if max(len(solution.t_s), fixes) > _MAX_VECTORS:
        axes.set_rasterization_zorder(_ALL_LAYERS)


def with_verdict(table: FixTable, verdict: Verdict) -> BoolArray:
    """Return (M,) which fixes got a verdict and have a position."""
    matches = np.array([one is verdict for one in table.verdict], dtype=bool)
    return np.asarray(matches & np.isfinite(table.world_p_fix).all(axis=1))


def fixes_outside(solution: Solution) -> int:
    """Count the fixes outside the limits of the plot from above."""
    if solution.fixes is None:
        return 0
    low, high = _box(solution)
    fixes = solution.fixes.world_p_fix[:, :2]
    known = np.isfinite(fixes).all(axis=1)
    return int((known & ~((fixes >= low) & (fixes <= high)).all(axis=1)).sum())


def _plot_above(axes: Axes, solution: Solution) -> None:
    path, points = solution.world_T_camera[:, :3, 3], solution.all_landmarks[0].world_p_landmark
    axes.plot(path[:, 0], path[:, 1], color=_PATH, lw=1.6, label="camera", zorder=3)
    axes.plot(*path[0, :2], "o", color=_PATH, ms=6, mfc="white", label="start", zorder=4)
    if solution.world_p_before is not None:
        before = solution.world_p_before
        axes.plot(before[:, 0], before[:, 1], color=_BEFORE, lw=0.9, ls="--", label="before stage D")
    if solution.fixes is not None:
        _plot_fixes_above(axes, solution.fixes)
    if len(points):
        axes.scatter(points[:, 0], points[:, 1], s=0.4, c="#c3c8ce", lw=0, rasterized=True, zorder=0)
        axes.plot([], [], ".", color="#b9bec5", ms=4, label="landmarks")


def _plot_fixes_above(axes: Axes, table: FixTable) -> None:
    for verdict, (colour, marker) in VERDICT_STYLES.items():
        rows = with_verdict(table, verdict)
        if not rows.any():
            continue
        fixes, diameter = table.world_p_fix[rows], 2.0 * table.r_m[rows]
        label = f"fixes {verdict}: {rows.sum()}"
        axes.plot(fixes[:, 0], fixes[:, 1], marker, color=colour, ms=5, label=label, zorder=5)
        # regions of used fixes often overlap: filled, they merge into a band
        filled = verdict is Verdict.USED
        regions = EllipseCollection(
            diameter,
            diameter,
            np.zeros(len(diameter)),
            units="xy",
            offsets=fixes[:, :2],
            offset_transform=axes.transData,
            facecolors=_REGION if filled else "none",
            edgecolors="none" if filled else colour,
            linewidths=0.6,
            zorder=-1 if filled else 2,
        )
        axes.add_collection(regions)
        if filled:
            axes.plot([], [], "o", color=_REGION, ms=8, label="regions of used fixes")
        if verdict in {Verdict.REJECTED, Verdict.DOWN_CLASSED}:
            to_antenna = np.stack([fixes, fixes + table.residual_m[rows]], axis=1)[:, :, :2]
            axes.add_collection(LineCollection(list(to_antenna), colors=colour, linewidths=0.7, zorder=2))


def _plot_side(axes: Axes, solution: Solution) -> None:
    distance = distance_m(solution)
    axes.plot(distance, solution.world_T_camera[:, 2, 3], color=_PATH, lw=1.6, label="camera", zorder=3)
    table = solution.fixes
    if table is None:
        return
    if solution.camera_p_antenna.any():
        antenna = antenna_positions(solution)
        axes.plot(distance, antenna[:, 2], color=_ANTENNA, lw=1.2, label="antenna")
    fix_distance = np.interp(solution.fix_times_s, solution.t_s, distance)
    for verdict, (colour, marker) in VERDICT_STYLES.items():
        rows = with_verdict(table, verdict) & np.isfinite(table.residual_m).all(axis=1)
        if not rows.any():
            continue
        up, h_m = table.world_p_fix[rows, 2], np.nan_to_num(table.h_m[rows])
        axes.vlines(fix_distance[rows], up - h_m, up + h_m, color=colour, lw=0.8, alpha=0.45)
        axes.plot(fix_distance[rows], up, marker, color=colour, ms=5, label=f"fixes {verdict}", zorder=5)


def _box(solution: Solution) -> tuple[FloatArray, FloatArray]:
    """Return corners (2,) around the path and the regions of the fixes near it, with an aspect ratio that
    suits a page."""
    around = solution.world_T_camera[:, :2, 3]
    low, high = around.min(axis=0), around.max(axis=0)
    reach = max(0.25 * float((high - low).max()), 5.0 if solution.georeferenced else 0.0)
    if solution.fixes is not None:
        fixes = solution.fixes.world_p_fix[:, :2]
        near = ((fixes > low - reach) & (fixes < high + reach)).all(axis=1)
        r_m = np.minimum(np.nan_to_num(solution.fixes.r_m[near, None]), reach)
        around = np.vstack([around, fixes[near] - r_m, fixes[near] + r_m])
    low, high = around.min(axis=0), around.max(axis=0)
    half = 0.54 * (high - low) + 1e-3
    wide = max(half[0], half[1] * _WIDTH / _MAX_HEIGHT)
    tall = max(half[1], half[0] * _MIN_HEIGHT / _WIDTH)
    middle, shape = 0.5 * (low + high), np.array([wide, tall])
    return middle - shape, middle + shape


def _heights(solution: Solution) -> tuple[float, float]:
    """Return limits that show the path and the regions of the used fixes."""
    shown = solution.world_T_camera[:, 2, 3]
    if (table := solution.fixes) is not None:
        used = table.used & np.isfinite(table.world_p_fix[:, 2]) & np.isfinite(table.h_m)
        up, h_m = table.world_p_fix[used, 2], table.h_m[used]
        shown = np.concatenate([shown, antenna_positions(solution)[:, 2], up - h_m, up + h_m])
    margin = 0.05 * float(np.ptp(shown)) + 1e-3
    return float(shown.min()) - margin, float(shown.max()) + margin
