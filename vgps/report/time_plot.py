"""Quantities over time: residuals over regions, standard deviations, features, states of the frames."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from vgps.report.path_plot import VERDICT_STYLES, bound_size, with_verdict
from vgps.report.summary import Outage, features_per_frame, outages
from vgps.solution import FrameState, Solution
from vgps.writers.page import tidy

_AXES = (("east", "#1f4e9c"), ("north", "#d98512"), ("up", "#2a8a5f"))
_MIN_RATIO = 1e-2  # logarithmic axes have no zero


def time_plot(solution: Solution) -> Figure:
    """Plot one row of axes per quantity of the run over a common time axis."""
    rows = [_position_sigmas, _rotation_sigmas, _features]
    if solution.judged_fixes is not None:
        rows = [_horizontal_ratios, _vertical_ratios, *rows]
    figure = Figure(figsize=(10.0, 1.75 * len(rows) + 0.4), layout="constrained")
    gaps = outages(solution)
    all_axes = np.atleast_1d(figure.subplots(len(rows), 1, sharex=True))
    for draw, axes in zip(rows, all_axes, strict=True):
        draw(axes, solution)
        _shade(axes, solution, gaps, labelled=draw is _features)
        if axes.get_legend_handles_labels()[1]:
            axes.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        bound_size(axes, solution)
        tidy(axes)
    all_axes[-1].set(xlabel="time [s]", xlim=_limits(solution))
    return figure


def _limits(solution: Solution) -> tuple[float, float]:
    begin, end = float(solution.t_s[0]), float(solution.t_s[-1])
    margin = 0.01 * (end - begin) + 1e-3
    return begin - margin, end + margin


def _horizontal_ratios(axes: Axes, solution: Solution) -> None:
    _ratios(axes, solution, 0)
    axes.set(ylabel="horizontal\nresidual / r")


def _vertical_ratios(axes: Axes, solution: Solution) -> None:
    _ratios(axes, solution, 1)
    axes.set(ylabel="vertical\nresidual / h")


def _ratios(axes: Axes, solution: Solution, which: int) -> None:
    table, t_s = solution.fixes, solution.fix_times_s
    if table is None:
        return
    ratio = np.maximum(table.region_ratios[which], _MIN_RATIO)
    for verdict, (colour, marker) in VERDICT_STYLES.items():
        rows = with_verdict(table, verdict) & np.isfinite(ratio)
        if rows.any():
            axes.plot(t_s[rows], ratio[rows], marker, color=colour, ms=5, label=f"fixes {verdict}")
    axes.axhline(1.0, color="#444444", lw=0.9, ls="--", label="edge of the region")
    axes.set(yscale="log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())


def _position_sigmas(axes: Axes, solution: Solution) -> None:
    _by_axis(axes, solution, solution.sigma_position_m)
    axes.set(ylabel=f"position\nstd. dev. [{'m' if solution.georeferenced else 'units'}]")


def _rotation_sigmas(axes: Axes, solution: Solution) -> None:
    _by_axis(axes, solution, np.degrees(solution.sigma_rotation_rad), "about ")
    axes.set(ylabel="rotation\nstd. dev. [deg]")


def _by_axis(axes: Axes, solution: Solution, sigma: np.ndarray, before: str = "") -> None:
    if not np.isfinite(sigma).any():
        axes.text(0.5, 0.5, "unknown", transform=axes.transAxes, ha="center", va="center", color="#5b6470")
        return
    for column, (name, colour) in enumerate(_AXES):
        axes.plot(solution.t_s, sigma[:, column], color=colour, lw=1.1, label=before + name)
    axes.set(ylim=(0.0, None))


def _features(axes: Axes, solution: Solution) -> None:
    axes.plot(solution.t_s, features_per_frame(solution), color="#1f4e9c", lw=1.0, label="features")
    axes.set(ylabel="features\nper frame", ylim=(0, None))


def _shade(axes: Axes, solution: Solution, gaps: list[Outage], *, labelled: bool) -> None:
    """Shade outages grey and bridged frames pink; one plot's legend is enough to name them."""
    for number, gap in enumerate(gaps):
        label = "no fix used" if labelled and number == 0 else None
        axes.axvspan(gap.begin_s, gap.end_s, color="#8a9099", alpha=0.16, lw=0, label=label)
    bridged = np.array([state is FrameState.BRIDGED for state in solution.state], dtype=bool)
    if not bridged.any():
        return
    half = 0.5 * float(np.median(np.diff(solution.t_s))) if len(solution.t_s) > 1 else 0.5
    edges = np.flatnonzero(np.diff(np.concatenate([[False], bridged, [False]]).astype(int)))
    for number, (first, end) in enumerate(edges.reshape(-1, 2)):
        label = "frames bridged" if labelled and number == 0 else None
        begin_s, end_s = solution.t_s[first] - half, solution.t_s[end - 1] + half
        axes.axvspan(begin_s, end_s, color="#c22f3d", alpha=0.2, lw=0, label=label)
