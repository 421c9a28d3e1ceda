"""One cell: a recording with the errors of one source and seed, under every GPS model."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

import vgps
from scripts.common.drives import Drive
from scripts.common.replayed_errors import Errors
from vgps.compare.methods import ALL_METHODS, Method, front_ends
from vgps.config import Config
from vgps.errors import GeometryError, GpsLogError
from vgps.evaluation.association import half_interval_s, match_times
from vgps.gps.regions import region_sizes
from vgps.model import BoolArray, FixClass, FloatArray, GpsLog
from vgps.pipeline.offline import optimise_all
from vgps.runtime.progress import Progress
from vgps.simulate.receiver_errors import fit_gauss_markov
from vgps.solution import Solution, Trajectory, Verdict

DEFAULT = "cylinder"
MODELS = tuple(
    sorted((one for one in ALL_METHODS if one.model != "none"), key=lambda one: one.key != DEFAULT)
)
SIGMAS, SIZES = 5.0, 3.0  # errors beyond these are those of wrong fixes


class Task(NamedTuple):
    """What a cell is of."""

    recording: str
    source: str
    seed: int


@dataclass(frozen=True, kw_only=True)
class Counts:
    """Verdicts on good and wrong fixes."""

    good_rtk_fix: int = 0
    good_rtk_fix_refused: int = 0
    good_other: int = 0
    good_other_refused: int = 0
    wrong: int = 0
    wrong_missed: int = 0


@dataclass(frozen=True, kw_only=True)
class Cell:
    """Results of one recording, source and seed; ``mean_m``, ``max_m`` and ``stage_d_s`` by GPS model.

    Attributes:
        recording, source, seed: What was run.
        receiver: Whose errors; ``seen`` if the default regions were chosen by them.
        mixed: Whether the log holds RTK-fixes and others.
        duration_s, fixes: Length of the video, and number of fixes.
        fixes_mean_m, fixes_max_m: Error of the fixes themselves.
        mean_m, max_m: Unaligned error of the camera centre; a model without a result is missing.
        nees: Mean squared error over variance of the default, per axis: 1 if its sigmas are right.
        samples: How many independent errors that mean is of.
        failed: Why models have no result, or empty.
    """

    recording: str
    source: str
    seed: int
    receiver: str
    seen: bool
    mixed: bool
    duration_s: float
    fixes: int
    fixes_mean_m: float
    fixes_max_m: float
    mean_m: dict[str, float] = field(default_factory=dict)
    max_m: dict[str, float] = field(default_factory=dict)
    nees: float = np.nan
    samples: float = 0.0
    counts: Counts = Counts()
    stage_d_s: dict[str, float] = field(default_factory=dict)
    failed: str = ""

    @property
    def better_m(self) -> float:
        """Error of the better of the fixes themselves and ``gaussian-receiver``."""
        return min(self.fixes_mean_m, self.mean_m.get("gaussian-receiver", np.inf))

    @property
    def ratio(self) -> float:
        """Error of the default over that; infinite without a result."""
        return self.mean_m.get(DEFAULT, np.inf) / self.better_m


def run_cell(drive: Drive, errors: Errors, task: Task, models: Sequence[Method], progress: Progress) -> Cell:
    """Run models on one front end, as in :func:`vgps.compare.compare`."""
    size = np.linalg.norm(drive.errors(errors.log), axis=1)
    cell = Cell(
        recording=drive.name,
        source=task.source,
        seed=task.seed,
        receiver=errors.receiver,
        seen=errors.seen,
        mixed=errors.mixed,
        duration_s=drive.duration_s,
        fixes=len(errors.log),
        fixes_mean_m=float(size.mean()) if len(size) else np.nan,
        fixes_max_m=float(size.max()) if len(size) else np.nan,
    )
    recording, config = replace(drive.recording, gps=errors.log), vgps.Config(seed=task.seed)
    try:
        for front, method, settings in front_ends(recording, config, progress, models):
            progress.stage(f"stage D: {method.key}")
            try:
                solution = optimise_all(front, settings)
            except GeometryError as error:
                cell = replace(cell, failed=f"{method.key}: {error.found}")
                continue
            cell = _with_model(cell, method.key, solution, drive, errors)
    except (GeometryError, GpsLogError) as error:  # what errors of fixes may lead to
        return replace(cell, failed=error.found)
    return cell


def _with_model(cell: Cell, model: str, solution: Solution, drive: Drive, errors: Errors) -> Cell:
    """Return the cell with the results of one model."""
    error_m, sigma_m = position_errors(solution, drive.truth)
    size = np.linalg.norm(error_m, axis=1)
    more: dict[str, Any] = {
        "mean_m": {**cell.mean_m, model: float(size.mean())},
        "max_m": {**cell.max_m, model: float(size.max())},
        "stage_d_s": {**cell.stage_d_s, model: solution.seconds["batch"]},
    }
    if model == DEFAULT:
        assert solution.fixes is not None
        good, wrong = good_and_wrong(errors.log, drive.errors(errors.log, errors.late_s))
        more["counts"] = count_verdicts(errors.log, solution.fixes.verdict, good, wrong)
        stated = (sigma_m > 0.0).all(axis=1)  # NaN is not
        if stated.sum() >= 3:
            ratio = error_m[stated] / sigma_m[stated]
            more["nees"] = float(np.mean(ratio**2))
            more["samples"] = independent_samples(solution.t_s[stated], ratio)
    return replace(cell, **more)


def position_errors(solution: Solution, truth: Trajectory) -> tuple[FloatArray, FloatArray]:
    """Return errors and standard deviations (F, 3) of the camera centre, unaligned."""
    e, t = match_times(solution.t_s, truth.t_s, half_interval_s(solution.t_s))
    error_m = solution.world_T_camera[e, :3, 3] - truth.world_T_camera[t, :3, 3]
    return error_m, solution.sigma_position_m[e]


def independent_samples(t_s: FloatArray, ratio: FloatArray) -> float:
    """Return the duration over the correlation time of errors (F, 3), averaged over the axes; at least 1."""
    correlation_s = np.mean([fit_gauss_markov(t_s, ratio[:, axis]).correlation_s for axis in range(3)])
    return max(float((t_s[-1] - t_s[0]) / correlation_s), 1.0)


def good_and_wrong(log: GpsLog, error_m: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Return which fixes (N,) are good and which are wrong; some are neither.

    Wrong is an error beyond three times the default region of its class, in the plane or in height, and
    beyond five stated sigmas on an axis, if there are any: the receiver did not admit it. Good is an error
    within three times the region.
    """
    r_m, h_m = region_sizes(log.fix_class, Config().gps)
    known = np.isfinite(r_m) & np.isfinite(error_m).all(axis=1)
    beyond = (np.hypot(error_m[:, 0], error_m[:, 1]) > SIZES * r_m) | (np.abs(error_m[:, 2]) > SIZES * h_m)
    unknown = ~np.isfinite(log.sigma_m).all(axis=1)
    unadmitted = unknown | (np.abs(error_m) > SIGMAS * np.nan_to_num(log.sigma_m)).any(axis=1)
    return known & ~beyond, known & beyond & unadmitted


def count_verdicts(log: GpsLog, verdict: tuple[Verdict, ...], good: BoolArray, wrong: BoolArray) -> Counts:
    """Count good fixes refused (rejected or down-classed) and wrong ones missed (used as they are)."""
    taken = np.array([one is not Verdict.NOT_USED for one in verdict])
    refused = np.array([one in (Verdict.REJECTED, Verdict.DOWN_CLASSED) for one in verdict])
    fixed = np.array([one is FixClass.RTK_FIX for one in log.fix_class])
    return Counts(
        good_rtk_fix=int((taken & good & fixed).sum()),
        good_rtk_fix_refused=int((refused & good & fixed).sum()),
        good_other=int((taken & good & ~fixed).sum()),
        good_other_refused=int((refused & good & ~fixed).sum()),
        wrong=int((taken & wrong).sum()),
        wrong_missed=int((taken & wrong & ~refused).sum()),
    )
