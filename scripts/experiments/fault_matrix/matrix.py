"""Faults against GPS models: unaligned errors, and how many fixes are refused rightly and wrongly."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from zlib import crc32

import numpy as np
from matplotlib.figure import Figure

from scripts.experiments.fault_matrix.faults import Fault, Faulty
from vgps.compare.methods import METHODS, Method, check_world, front_ends
from vgps.config import Config
from vgps.errors import GeometryError, GpsLogError, VgpsError
from vgps.evaluation import evaluate
from vgps.model import Recording
from vgps.pipeline.offline import optimise_all
from vgps.readers.calibration import rig_beside
from vgps.readers.trajectory import read_trajectory
from vgps.runtime.progress import Progress
from vgps.solution import FixTable, Verdict
from vgps.writers.page import tidy

MODELS = tuple(method for method in METHODS if method.model != "none")
_COLOURS = ("#c8553d", "#e9a23b", "#5a6acf", "#2a9d8f", "#8e5ea2")
_UNJUDGED = "cauchy"
_NO_RESULT = (
    GeometryError,
    GpsLogError,
)  # what a fault may lead to; a truth of another recording is a mistake


@dataclass(frozen=True)
class Cell:
    """One model under one fault.

    Attributes:
        mean_m, max_m: Of the unaligned error of the camera centre over all frames.
        wrong, caught: Fixes that are not what their class says, and those of them that were not taken at it.
        good, refused: The others within the video, and those of them that were rejected; zeros for a model
            that judges none.
        failed: Why there is no result, if there is none.
    """

    mean_m: float
    max_m: float
    wrong: int
    caught: int
    good: int
    refused: int
    failed: str = ""

    @classmethod
    def of_failure(cls, error: VgpsError) -> "Cell":
        """What a run that could not be finished leaves."""
        return cls(np.nan, np.nan, 0, 0, 0, 0, str(error))


Row = Mapping[str, Cell]


def run_fault(
    fault: Fault, recording: Recording, truth: Path, config: Config, progress: Progress, seed: int = 0
) -> Row:
    """Every model on one front end run that saw the fault.

    Stage C bends its window to the fixes, takes drift out by them and settles the clock's lag, so a front end
    that saw good fixes would hide much of a fault: each fault has its own, made with the model of ``config``,
    and the models share it, as in :func:`vgps.compare.compare`. The truth is used for evaluation alone.

    Args:
        fault: Which; its random numbers depend on its name and the seed alone.
        recording: With a good log.
        truth: TUM file in ENU; a ``rig.yaml`` beside it names its origin and clock.
        config: Of everything but the GPS model of stage D.
        progress: Shows how far it is.
        seed: Of the fault.

    Raises:
        TrajectoryError: The truth cannot be read, or is of another recording.
        CalibrationError: The ``rig.yaml`` beside it is malformed.
    """
    rig = rig_beside(truth)
    true = read_trajectory(truth, video_start_s=rig.video_start_s)
    rng = np.random.default_rng([seed, crc32(fault.name.encode())])
    row: dict[str, Cell] = {}
    try:
        faulty = fault.into(recording, rng)
        for front, method in front_ends(faulty.recording, config, progress, MODELS):
            check_world(front.origin, rig.world_origin, truth)
            progress.say(f"{fault.name}, stage D: {method.name}")
            try:
                solution = optimise_all(front, config.with_gps(method.model))
            except _NO_RESULT as error:
                row[method.name] = Cell.of_failure(error)
                continue
            found = evaluate(solution, true).camera_position_m
            counts = _counts(solution.fixes, faulty, method)
            row[method.name] = Cell(found.mean, found.max, *counts)
    except _NO_RESULT as error:
        row |= {method.name: Cell.of_failure(error) for method in MODELS if method.name not in row}
    return row


def _counts(table: FixTable | None, faulty: Faulty, method: Method) -> tuple[int, int, int, int]:
    """Wrong fixes, those caught, good fixes, those refused."""
    if table is None or method.model == _UNJUDGED:
        return 0, 0, 0, 0
    verdict = np.array(table.verdict, dtype=object)
    asked = verdict != Verdict.NOT_USED
    wrong, good = asked & faulty.wrong, asked & ~faulty.wrong
    doubted = (verdict == Verdict.REJECTED) | (verdict == Verdict.DOWN_CLASSED)
    refused = good & (verdict == Verdict.REJECTED)
    return int(wrong.sum()), int((wrong & doubted).sum()), int(good.sum()), int(refused.sum())


def as_markdown(rows: Mapping[str, Row], faults: Sequence[Fault]) -> str:
    """The matrix: errors in metres, wrong fixes caught, good ones refused; under it, what has no result."""
    words = {fault.name: fault.what for fault in faults}
    lines = [
        "Mean / maximum unaligned error of the camera centre [m]; wrong fixes caught, of how many; good "
        "fixes refused. Cauchy judges no fix.",
        "",
        "| fault | " + " | ".join(method.name for method in MODELS) + " |",
        "|---" * (1 + len(MODELS)) + "|",
    ]
    for name, row in rows.items():
        cells = " | ".join(_cell(row[method.name]) for method in MODELS)
        lines.append(f"| **{name}**: {words[name]} | {cells} |")
    failures = [f"- {name}: {'; '.join(_failures(row))}" for name, row in rows.items() if _failures(row)]
    return "\n".join([*lines, *(["", "Without a result:", "", *failures] if failures else [])]) + "\n"


def _failures(row: Row) -> list[str]:
    """Why models have no result, each reason once."""
    reasons = dict.fromkeys(cell.failed for cell in row.values() if cell.failed)
    models = {why: [name for name, cell in row.items() if cell.failed == why] for why in reasons}
    return [why if len(of) == len(row) else f"{', '.join(of)}: {why}" for why, of in models.items()]


def _cell(cell: Cell) -> str:
    if cell.failed:
        return "no result"
    parts = [f"{cell.mean_m:.3f} / {cell.max_m:.2f}"]
    if cell.wrong:
        parts.append(f"{cell.caught} of {cell.wrong}")
    if cell.good:
        parts.append(f"{100.0 * cell.refused / cell.good:.0f} %")
    return "; ".join(parts)


def matrix_picture(rows: Mapping[str, Row]) -> Figure:
    """A line of dots per fault: mean error, a whisker to the maximum, and the share of good fixes refused."""
    figure = Figure(figsize=(10.0, 1.2 + 0.55 * len(rows)), layout="constrained")
    error, refused = figure.subplots(1, 2, width_ratios=[3, 1], sharey=True)
    at = np.arange(len(rows))
    for number, method in enumerate(MODELS):
        cells = [row[method.name] for row in rows.values()]
        y = at + 0.13 * (number - (len(MODELS) - 1) / 2)
        mean, most = np.array([cell.mean_m for cell in cells]), np.array([cell.max_m for cell in cells])
        colour = _COLOURS[number]
        error.hlines(y, mean, most, color=colour, lw=1.2, alpha=0.5)
        error.plot(mean, y, "o", color=colour, ms=5, label=method.name)
        if method.model != _UNJUDGED:
            share = np.array([100.0 * cell.refused / cell.good if cell.good else np.nan for cell in cells])
            refused.plot(share, y, "o", color=colour, ms=5)
    error.set(xscale="log", xlabel="unaligned camera error [m]: mean, and whisker to the maximum")
    error.xaxis.set_major_formatter("{x:g}")
    error.set_yticks(at, list(rows))
    error.invert_yaxis()
    refused.set(xlabel="good fixes refused [%]", xlim=(-0.5, max(10.0, refused.get_xlim()[1])))
    figure.legend(
        *error.get_legend_handles_labels(), loc="outside upper center", ncols=3, fontsize=8, frameon=False
    )
    tidy(error, refused)
    return figure
