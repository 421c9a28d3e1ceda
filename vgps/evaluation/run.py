"""A run folder against a truth file."""

import csv
import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vgps.errors import RunFolderError, TrajectoryError
from vgps.evaluation.metrics import Evaluation, evaluate
from vgps.geodesy import enu_R_ecef, to_enu, to_geodetic
from vgps.model import FloatArray, GeodeticPoint
from vgps.readers.calibration import rig_beside
from vgps.readers.run_folder import read_summary
from vgps.readers.trajectory import read_trajectory
from vgps.solution import Trajectory

_SIGMAS = ("sigma_east_m", "sigma_north_m", "sigma_up_m")
_log = logging.getLogger(__name__)


def evaluate_run(run: Path, truth: Path, *, tolerance_s: float | None = None) -> Evaluation:
    """Evaluate ``poses.tum`` of a run folder against a truth file, with the run's own lever arm and sigmas.

    A ``rig.yaml`` beside the truth says on which clock it is (``video_start_s``) and where its ENU frame
    stands (``world_origin``). If the run's stands elsewhere, the truth is expressed in the run's frame, and
    a note says so; nothing is fitted.

    Raises:
        RunFolderError: The run lacks a piece, or one is damaged.
        TrajectoryError: A trajectory is malformed, or they share no time.
        CalibrationError: The ``rig.yaml`` beside the truth is malformed.
    """
    summary = read_summary(run)
    origin, lever, georeferenced = _world_of(summary, run / "solution.json")
    estimate = _poses(run / "poses.tum")
    rig = rig_beside(truth)
    reference = read_trajectory(truth, video_start_s=rig.video_start_s)
    notes = []
    if not georeferenced:
        notes.append("the run is not georeferenced: only the figures after alignment mean anything")
    if origin is not None and rig.world_origin is not None and not _same(origin, rig.world_origin):
        reference = in_world(reference, rig.world_origin, origin)
        notes.append(
            f"the truth's world origin {_text(rig.world_origin)} is not the run's {_text(origin)}: "
            "the truth was expressed in the run's world"
        )
    sigma = _sigma_position_m(run / "poses.csv", len(estimate.t_s))
    try:
        evaluation = evaluate(estimate, reference, lever, sigma_position_m=sigma, tolerance_s=tolerance_s)
    except TrajectoryError as error:
        raise TrajectoryError(
            error.found, file=truth, place=error.place, expected=error.expected, remedy=error.remedy
        ) from error
    for note in notes:
        _log.warning("%s: %s", run, note)
    return replace(evaluation, notes=tuple(notes))


def in_world(trajectory: Trajectory, origin: GeodeticPoint, other: GeodeticPoint) -> Trajectory:
    """The same poses, given in ENU at ``origin``, in ENU at ``other``: a rigid change of frame."""
    poses = trajectory.world_T_camera.copy()
    other_R_origin = enu_R_ecef(*other[:2]) @ enu_R_ecef(*origin[:2]).T
    poses[:, :3, :3] = other_R_origin @ poses[:, :3, :3]
    poses[:, :3, 3] = to_enu(other, *to_geodetic(origin, poses[:, :3, 3]).T)
    return Trajectory(trajectory.t_s, poses)


def _world_of(summary: dict[str, Any], file: Path) -> tuple[GeodeticPoint | None, FloatArray, bool]:
    try:
        origin = summary["world_origin"]
        return (
            None if origin is None else GeodeticPoint(**origin),
            np.array(summary["camera_p_antenna"], dtype=np.float64).reshape(3),
            bool(summary["georeferenced"]),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise RunFolderError(f"is damaged ({error})", file=file, remedy="run vgps smooth again") from error


def _poses(file: Path) -> Trajectory:
    if not file.is_file():
        raise RunFolderError("is missing", file=file, remedy="run vgps smooth again")
    return read_trajectory(file)


def _same(a: GeodeticPoint, b: GeodeticPoint) -> bool:
    return bool(np.abs(to_enu(a, *b)).max() < 1e-3)


def _text(point: GeodeticPoint) -> str:
    return f"({point.latitude_deg:.7f}, {point.longitude_deg:.7f}, {point.height_m:.3f} m)"


def _sigma_position_m(file: Path, frames: int) -> FloatArray | None:
    """(F, 3) from ``poses.csv``, an extra: None where the table is absent or does not fit the poses."""
    if not file.is_file():
        return None
    try:
        with file.open(newline="", encoding="utf-8") as stream:
            rows = [[float(row[name] or "nan") for name in _SIGMAS] for row in csv.DictReader(stream)]
    except (KeyError, TypeError, ValueError):
        return None
    return np.array(rows) if len(rows) == frames else None
