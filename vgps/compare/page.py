"""A comparison as an HTML page, with the plots of Figs 15 and 16, Kume 2010, and as JSON."""

import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vgps.compare.methods import Comparison
from vgps.evaluation import to_json
from vgps.geometry import travelled
from vgps.writers.atomic import check_file, new_file
from vgps.writers.page import embedded, tidy, write_page

# one per method
_COLOURS = ("#9aa0a6", "#c8553d", "#e9a23b", "#5a6acf", "#2a9d8f", "#8e5ea2", "#8ab17d")
_WIDTH = 7.2  # of the path from above, inches, beside its legend
_MAX_VECTORS = 3000  # frames


def comparison_to_json(comparison: Comparison) -> dict[str, Any]:
    """Convert a comparison to JSON types: errors of every method, and ratios of their means to B and C."""
    methods: dict[str, Any] = {}
    for name, evaluation in comparison.evaluations.items():
        methods[name] = {**to_json(evaluation), "seconds": comparison.seconds[name]}
    return {"recording": str(comparison.recording), "methods": methods, "ratios": ratios(comparison)}


def ratios(comparison: Comparison) -> dict[str, dict[str, float]]:
    """Return the mean antenna error of each method over those of B and C, as in the thesis, if these ran."""
    means = {name: e.antenna_position_m.mean for name, e in comparison.evaluations.items()}
    bases = {base: mean for name, mean in means.items() for base in "BC" if name.startswith(f"{base} ")}
    return {
        name: {f"to_{base}": mean / reference for base, reference in bases.items()}
        for name, mean in means.items()
    }


def check_outputs(out: Path) -> None:
    """Check before the work that the comparison can be written into the folder ``out``; change nothing.

    Raises:
        RunFolderError: It cannot.
    """
    for file in _outputs(out):
        check_file(file)


def write_comparison(comparison: Comparison, out: Path) -> tuple[Path, Path]:
    """Write ``comparison.html`` and ``comparison.json`` into the folder ``out`` and return their paths."""
    page, data = _outputs(out)
    values = {
        "recording": comparison.recording.name,
        "rows": [(name, e, comparison.seconds[name]) for name, e in comparison.evaluations.items()],
        "ratios": ratios(comparison),
        "errors": embedded(_plot_errors(comparison)),
        "paths": embedded(_plot_paths(comparison)),
    }
    write_page("vgps.compare", values, page)
    with new_file(data) as scratch:
        scratch.write_text(json.dumps(comparison_to_json(comparison), indent=2) + "\n", encoding="utf-8")
    return page, data


def _outputs(out: Path) -> tuple[Path, Path]:
    return out / "comparison.html", out / "comparison.json"


def _plot_errors(comparison: Comparison) -> Figure:
    figure = Figure(figsize=(10.0, 3.4), layout="constrained")
    axes = figure.subplots()
    for (name, evaluation), colour in zip(
        comparison.evaluations.items(), itertools.cycle(_COLOURS), strict=False
    ):
        error = np.linalg.norm(evaluation.camera_error_m, axis=1)
        axes.plot(evaluation.t_s, error, color=colour, label=name, lw=1.2)
    axes.set(xlabel="time [s]", ylabel="camera error [m]", yscale="log")
    axes.yaxis.set_major_formatter("{x:g}")
    _finish(axes, comparison)
    return figure


def _plot_paths(comparison: Comparison) -> Figure:
    """Plot north over east around the true path, and height over the true distance."""
    true, fixes = comparison.truth.world_T_camera[:, :3, 3], comparison.world_p_fix
    low, high = true[:, :2].min(axis=0), true[:, :2].max(axis=0)
    low, high = low - 0.1 * (high - low).max() - 1.0, high + 0.1 * (high - low).max() + 1.0
    height = float(np.clip(_WIDTH * (high[1] - low[1]) / (high[0] - low[0]), 2.0, 7.0))
    figure = Figure(figsize=(10.0, height + 2.8), layout="constrained")
    above, side = figure.subplots(2, 1, height_ratios=[height, 2.2])
    distance = travelled(true)
    above.plot(true[:, 0], true[:, 1], color="k", lw=2.0, label="truth")
    side.plot(distance, true[:, 2], color="k", lw=2.0, label="truth")
    for (name, evaluation), colour in zip(
        comparison.evaluations.items(), itertools.cycle(_COLOURS), strict=False
    ):
        path = comparison.paths[name]
        above.plot(path[:, 0], path[:, 1], color=colour, lw=1.1, label=name)
        if len(path) == len(evaluation.t_s):
            at = np.interp(evaluation.t_s, comparison.truth.t_s, distance)
            side.plot(at, path[:, 2], color=colour, lw=1.1, label=name)
    above.plot(fixes[:, 0], fixes[:, 1], "+", color="#444444", ms=5, label="fixes", zorder=1)
    above.set(xlabel="east [m]", ylabel="north [m]", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    above.set(aspect="equal", anchor="W")
    side.set(xlabel="distance along the true path [m]", ylabel="up [m]")
    _finish(above, comparison)
    _finish(side, comparison)
    return figure


def _finish(axes: Axes, comparison: Comparison) -> None:
    """Add the legend beside the axes; draw a long recording as pixels, which bounds the page's size."""
    tidy(axes)
    axes.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    if len(comparison.truth.t_s) > _MAX_VECTORS:
        axes.set_rasterization_zorder(10.0)
