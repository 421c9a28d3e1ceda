"""Faults against GPS models: unaligned errors, wrong fixes caught, and good ones rejected."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from matplotlib.figure import Figure

from scripts.common.markdown import table
from scripts.experiments.fault_matrix.faults import Fault, Faulty
from vgps.compare.methods import METHODS, Method, check_origin, front_ends
from vgps.config import Config
from vgps.errors import GeometryError, GpsLogError, VgpsError
from vgps.evaluation import evaluate
from vgps.model import Recording
from vgps.pipeline.offline import optimise_all
from vgps.readers.calibration.rig_file import rig_beside
from vgps.readers.trajectory import read_trajectory
from vgps.runtime.progress import Progress
from vgps.solution import FixTable, Verdict
from vgps.writers.page import tidy

MODELS = tuple(method for method in METHODS if method.model != "none")
_COLOURS = ("#c8553d", "#e9a23b", "#5a6acf", "#2a9d8f", "#8e5ea2")
_WITHOUT_DETECTION = "cauchy"
_NO_RESULT = (GeometryError, GpsLogError)  # what a fault may lead to


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One model under one fault.

    Attributes:
        mean_m, max_m: Unaligned error of the camera centre over all frames.
        wrong, caught: Fixes that are not what their class says; those of them rejected or down-classed.
        good, rejected: The other fixes within the video; those of them rejected. All four are 0 for a model
            without outlier detection.
        failed: Why there is no result, or empty.
    """

    mean_m: float
    max_m: float
    wrong: int
    caught: int
    good: int
    rejected: int
    failed: str = ""

    @classmethod
    def of_failure(cls, error: VgpsError) -> "Cell":
        """Return the cell of a run that gave no result."""
        return cls(mean_m=np.nan, max_m=np.nan, wrong=0, caught=0, good=0, rejected=0, failed=str(error))


Row = Mapping[str, Cell]


def run_fault(
    fault: Fault, recording: Recording, truth: Path, config: Config, progress: Progress, seed: int = 0
) -> Row:
    """Run every model on one front end run that saw the fault.

    Stage C fits its window to the fixes, corrects drift by them and estimates the time offset: a front end
    that saw good fixes would hide much of a fault. Each fault has its own, made with the model of
    ``config``, and the models share it, as in :func:`vgps.compare.compare`.

    Args:
        fault: Its random numbers depend on its name and the seed alone.
        recording: With a good log.
        truth: TUM file in ENU; a ``rig.yaml`` beside it names its origin and clock.
        config: Settings of everything but the GPS model of stage D.
        progress: Where progress is reported.
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
        for front, method, settings in front_ends(faulty.recording, config, progress, MODELS):
            check_origin(front.origin, rig.world_origin, truth)
            progress.stage(f"{fault.name}, stage D: {method.name}")
            try:
                solution = optimise_all(front, settings)
            except _NO_RESULT as error:
                row[method.name] = Cell.of_failure(error)
                continue
            found = evaluate(solution, true).camera_position_m
            row[method.name] = Cell(
                mean_m=found.mean, max_m=found.max, **_counts(solution.fixes, faulty, method)
            )
    except _NO_RESULT as error:
        row |= {method.name: Cell.of_failure(error) for method in MODELS if method.name not in row}
    return row


def _counts(fixes: FixTable | None, faulty: Faulty, method: Method) -> dict[str, Any]:
    """Return wrong fixes, those caught, good fixes, those rejected."""
    if fixes is None or method.model == _WITHOUT_DETECTION:
        return dict.fromkeys(("wrong", "caught", "good", "rejected"), 0)
    verdict = np.array(fixes.verdict, dtype=object)
    used = verdict != Verdict.NOT_USED
    wrong, good = used & faulty.wrong, used & ~faulty.wrong
    doubted = (verdict == Verdict.REJECTED) | (verdict == Verdict.DOWN_CLASSED)
    rejected = good & (verdict == Verdict.REJECTED)
    counted = {"wrong": wrong, "caught": wrong & doubted, "good": good, "rejected": rejected}
    return {name: int(rows.sum()) for name, rows in counted.items()}


def as_markdown(rows: Mapping[str, Row], faults: Sequence[Fault]) -> str:
    """Return errors in metres, wrong fixes caught and good ones rejected; below it what has no result."""
    words = {fault.name: fault.description for fault in faults}
    names = [method.name for method in MODELS]
    cells = (
        [f"**{fault}**: {words[fault]}", *(_cell(row[name]) for name in names)] for fault, row in rows.items()
    )
    lines = [
        "Mean / maximum unaligned error of the camera centre [m]; wrong fixes caught, of how many; good "
        "fixes rejected. Cauchy has no outlier detection.",
        "",
        table(["fault", *names], cells),
    ]
    failures = [f"- {name}: {'; '.join(_failures(row))}" for name, row in rows.items() if _failures(row)]
    return "\n".join([*lines, *(["", "Without a result:", "", *failures] if failures else [])]) + "\n"


def _failures(row: Row) -> list[str]:
    """Return why models have no result, each reason once."""
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
        parts.append(f"{100.0 * cell.rejected / cell.good:.0f} %")
    return "; ".join(parts)


def matrix_picture(rows: Mapping[str, Row]) -> Figure:
    """Draw a line of dots per fault: mean and maximum error, and the share of good fixes rejected."""
    figure = Figure(figsize=(10.0, 1.2 + 0.55 * len(rows)), layout="constrained")
    error, rejected = figure.subplots(1, 2, width_ratios=[3, 1], sharey=True)
    at = np.arange(len(rows))
    for number, method in enumerate(MODELS):
        cells = [row[method.name] for row in rows.values()]
        y = at + 0.13 * (number - (len(MODELS) - 1) / 2)
        mean, most = np.array([cell.mean_m for cell in cells]), np.array([cell.max_m for cell in cells])
        colour = _COLOURS[number]
        error.hlines(y, mean, most, color=colour, lw=1.2, alpha=0.5)
        error.plot(mean, y, "o", color=colour, ms=5, label=method.name)
        if method.model != _WITHOUT_DETECTION:
            share = np.array([100.0 * cell.rejected / cell.good if cell.good else np.nan for cell in cells])
            rejected.plot(share, y, "o", color=colour, ms=5)
    error.set(xscale="log", xlabel="unaligned camera error [m]: mean, and whisker to the maximum")
    error.xaxis.set_major_formatter("{x:g}")
    error.set_yticks(at, list(rows))
    error.invert_yaxis()
    rejected.set(xlabel="good fixes rejected [%]", xlim=(-0.5, max(10.0, rejected.get_xlim()[1])))
    figure.legend(
        *error.get_legend_handles_labels(), loc="outside upper center", ncols=3, fontsize=8, frameon=False
    )
    tidy(error, rejected)
    return figure
