"""A comparison as one HTML page, JSON, and the plots of Figs 15 and 16, Kume 2010."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vgps.compare.methods import Comparison
from vgps.evaluation import to_json
from vgps.writers.atomic import check_file, new_file
from vgps.writers.page import embedded, tidy, write_page

_COLOURS = ("#9aa0a6", "#c8553d", "#e9a23b", "#5a6acf", "#2a9d8f", "#8e5ea2")


def as_json(comparison: Comparison) -> dict[str, Any]:
    """Errors of every method, and the ratios of their means to methods B and C."""
    methods: dict[str, Any] = {}
    for name, evaluation in comparison.evaluations.items():
        methods[name] = {**to_json(evaluation), "seconds": comparison.seconds[name]}
    return {"recording": str(comparison.recording), "methods": methods, "ratios": ratios(comparison)}


def ratios(comparison: Comparison) -> dict[str, dict[str, float]]:
    """Mean antenna error, which the thesis has, of each method over that of B and of C, where these ran."""
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
        "errors": embedded(_errors(comparison)),
        "paths": embedded(_paths(comparison)),
    }
    write_page("vgps.compare", values, page)
    with new_file(data) as scratch:
        scratch.write_text(json.dumps(as_json(comparison), indent=2) + "\n", encoding="utf-8")
    return page, data


def _outputs(out: Path) -> tuple[Path, Path]:
    return out / "comparison.html", out / "comparison.json"


def _coloured(comparison: Comparison) -> list[tuple[str, str]]:
    return [(name, _COLOURS[k % len(_COLOURS)]) for k, name in enumerate(comparison.evaluations)]


def _errors(comparison: Comparison) -> Figure:
    figure = Figure(figsize=(9.5, 3.6), layout="constrained")
    axes = figure.subplots()
    for name, colour in _coloured(comparison):
        evaluation = comparison.evaluations[name]
        error = np.linalg.norm(evaluation.camera_error_m, axis=1)
        axes.plot(evaluation.t_s, error, color=colour, label=name, lw=1.2)
    axes.set(xlabel="time [s]", ylabel="camera error, unaligned [m]", yscale="log")
    tidy(axes)
    axes.legend(fontsize=8)
    return figure


def _paths(comparison: Comparison) -> Figure:
    figure = Figure(figsize=(9.5, 8.0), layout="constrained")
    above, side = figure.subplots(2, 1, height_ratios=[3, 1])
    true = comparison.truth.world_T_camera[:, :3, 3]
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(true, axis=0), axis=1))])
    at = np.interp(next(iter(comparison.evaluations.values())).t_s, comparison.truth.t_s, way)
    _line(above, true, "truth", "k", 2.0)
    side.plot(way, true[:, 2], color="k", lw=2.0)
    fixes = comparison.world_p_fix
    above.plot(fixes[:, 0], fixes[:, 1], "+", color="#444444", ms=6, label="fixes")
    for name, colour in _coloured(comparison):
        path = comparison.paths[name]
        _line(above, path, name, colour, 1.1)
        if len(path) == len(at):
            side.plot(at, path[:, 2], color=colour, lw=1.1)
    above.set(xlabel="east [m]", ylabel="north [m]", aspect="equal")
    above.legend(fontsize=8)
    side.set(xlabel="way [m]", ylabel="up [m]")
    tidy(above, side)
    return figure


def _line(axes: Axes, path: np.ndarray, name: str, colour: str, width: float) -> None:
    axes.plot(path[:, 0], path[:, 1], color=colour, lw=width, label=name)
