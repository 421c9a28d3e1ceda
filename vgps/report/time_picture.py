"""What happened over time: fixes against their regions, standard deviations, features, states of frames."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from vgps.report.facts import Outage, features_per_frame, judged, outages
from vgps.report.path_picture import LOOKS, with_verdict
from vgps.solution import FrameState, Solution
from vgps.writers.page import tidy
from vgps.writers.tables import region_ratios

_AXES = (("east", "#1f4e9c"), ("north", "#d98512"), ("up", "#2a8a5f"))
_LEAST_RATIO = 1e-2  # logarithmic axes have no zero


def time_picture(solution: Solution) -> Figure:
    """One row of axes for each quantity that the run has, all over the same time."""
    rows = [_position_sigmas, _rotation_sigmas, _features]
    if judged(solution) is not None:
        rows = [_horizontal_ratios, _vertical_ratios, *rows]
    figure = Figure(figsize=(10.0, 1.75 * len(rows) + 0.4), layout="constrained")
    silences = outages(solution)
    for draw, axes in zip(rows, np.atleast_1d(figure.subplots(len(rows), 1, sharex=True)), strict=True):
        draw(axes, solution)
        _shade(axes, solution, silences)
        if axes.get_legend_handles_labels()[1]:
            axes.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        tidy(axes)
    axes.set(xlabel="time [s]", xlim=_whole(solution))
    return figure


def _whole(solution: Solution) -> tuple[float, float]:
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
    found = judged(solution)
    if found is None:
        return
    table, t_s = found[1], solution.fix_times_s
    ratio = np.maximum(region_ratios(table)[which], _LEAST_RATIO)
    for verdict, (colour, marker) in LOOKS.items():
        rows = with_verdict(table, verdict) & np.isfinite(ratio)
        if rows.any():
            axes.plot(t_s[rows], ratio[rows], marker, color=colour, ms=5, label=str(verdict))
    axes.axhline(1.0, color="#444444", lw=0.9, ls="--", label="wall of the region")
    axes.set(yscale="log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())


def _position_sigmas(axes: Axes, solution: Solution) -> None:
    _by_axis(axes, solution, solution.sigma_position_m)
    axes.set(ylabel="position\nsigma [m]" if solution.georeferenced else "position\nsigma [units]")


def _rotation_sigmas(axes: Axes, solution: Solution) -> None:
    _by_axis(axes, solution, np.degrees(solution.sigma_rotation_rad), "about ")
    axes.set(ylabel="rotation\nsigma [deg]")


def _by_axis(axes: Axes, solution: Solution, sigma: np.ndarray, before: str = "") -> None:
    if not np.isfinite(sigma).any():
        axes.text(0.5, 0.5, "not known", transform=axes.transAxes, ha="center", va="center", color="#5b6470")
        return
    for column, (name, colour) in enumerate(_AXES):
        axes.plot(solution.t_s, sigma[:, column], color=colour, lw=1.1, label=before + name)
    axes.set(ylim=(0.0, None))


def _features(axes: Axes, solution: Solution) -> None:
    axes.plot(solution.t_s, features_per_frame(solution), color="#1f4e9c", lw=1.0, label="features seen")
    axes.set(ylabel="features\nin a frame", ylim=(0, None))


def _shade(axes: Axes, solution: Solution, silences: list[Outage]) -> None:
    """Grey where no fix took part, pink where frames are bridged; named once, by the frames' own axes."""
    named = axes.get_ylabel().startswith("features")
    for number, silence in enumerate(silences):
        label = "no fix took part" if named and number == 0 else None
        axes.axvspan(silence.begin_s, silence.end_s, color="#8a9099", alpha=0.16, lw=0, label=label)
    bridged = np.array([state is FrameState.BRIDGED for state in solution.state], dtype=bool)
    if bridged.any():
        half = 0.5 * float(np.median(np.diff(solution.t_s))) if len(solution.t_s) > 1 else 0.5
        edges = np.flatnonzero(np.diff(np.concatenate([[False], bridged, [False]]).astype(int)))
        for number, (first, past) in enumerate(edges.reshape(-1, 2)):
            label = "bridged" if named and number == 0 else None
            begin, end = solution.t_s[first] - half, solution.t_s[past - 1] + half
            axes.axvspan(begin, end, color="#c22f3d", alpha=0.2, lw=0, label=label)
