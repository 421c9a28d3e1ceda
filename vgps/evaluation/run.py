"""Evaluation of a run, in memory or in a folder, against a truth."""

import csv
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vgps.crs import coordinate_system
from vgps.crs.frames import poses_in_world
from vgps.errors import RunFolderError, TrajectoryError
from vgps.evaluation.metrics import Evaluation, trajectory_errors
from vgps.geodesy import enu_R_ecef, to_enu, to_geodetic
from vgps.model import FloatArray, GeodeticPoint
from vgps.readers.calibration.rig_file import rig_beside
from vgps.readers.run_files import read_summary
from vgps.readers.trajectory import read_trajectory
from vgps.solution import Solution, Trajectory

_SIGMAS = ("sigma_east_m", "sigma_north_m", "sigma_up_m")
_REMEDY = "run vgps smooth again"
_SAME_ORIGIN_M = 1e-3  # origins closer than this are one


def evaluate(
    run: Solution | Trajectory | Path | str,
    truth: Trajectory | Path | str,
    *,
    tolerance_s: float | None = None,
    crs: str | None = None,
    geoid: str | None = None,
) -> Evaluation:
    """Evaluate a run against a truth, without aligning one to the other.

    Frames are matched by time and not interpolated. Where the world origins of run and truth are known and
    differ, the truth is expressed in the run's world and a note says so. Reads files, writes nothing.

    Args:
        run: A solution, a run folder (its ``poses.tum``, ``poses.csv`` and ``solution.json``), or bare poses,
            which have no standard deviations and whose antenna is taken to be the camera.
        truth: TUM file of world_T_camera in ENU, beside which a ``rig.yaml`` may name its clock
            (``video_start_s``) and origin (``world_origin``); or poses in the run's world and on its clock.
        tolerance_s: Largest time difference of matched frames [s]; by default half the median frame interval
            of the run.
        crs, geoid: What the coordinates of a truth file are in, if not ENU, as for `coordinate_system`:
            easting, northing and height, and rotations about these axes.

    Raises:
        CoordinateSystemError: The coordinate system or geoid is unknown, or lacks its grid.
        RunFolderError: A file of the run folder is missing or damaged.
        TrajectoryError: A trajectory is malformed, or run and truth do not overlap in time.
        CalibrationError: The ``rig.yaml`` beside the truth is malformed.
    """
    estimate = _estimate(run)
    if isinstance(truth, Trajectory):
        true, notes = truth, estimate.notes
    else:
        true, notes = _true_poses(Path(truth), estimate, (crs, geoid))
    try:
        evaluation = trajectory_errors(
            estimate.poses,
            true,
            estimate.camera_p_antenna,
            sigma_position_m=estimate.sigma_position_m,
            tolerance_s=tolerance_s,
        )
    except TrajectoryError as error:
        raise TrajectoryError(
            error.found,
            file=None if isinstance(truth, Trajectory) else truth,
            place=error.place,
            expected=error.expected,
            remedy=error.remedy,
        ) from error
    return replace(evaluation, notes=notes)


def change_origin(trajectory: Trajectory, old: GeodeticPoint, new: GeodeticPoint) -> Trajectory:
    """Express poses given in ENU at ``old`` in ENU at ``new``, a rigid change of frame."""
    poses = trajectory.world_T_camera.copy()
    new_R_old = enu_R_ecef(*new[:2]) @ enu_R_ecef(*old[:2]).T
    poses[:, :3, :3] = new_R_old @ poses[:, :3, :3]
    poses[:, :3, 3] = to_enu(new, *to_geodetic(old, poses[:, :3, 3]).T)
    return Trajectory(trajectory.t_s, poses)


@dataclass(frozen=True, kw_only=True)
class _Estimate:
    """The part of a run that is evaluated; (3,) and (F, 3) metres."""

    poses: Trajectory
    camera_p_antenna: FloatArray
    sigma_position_m: FloatArray | None = None
    world_origin: GeodeticPoint | None = None
    georeferenced: bool = True

    @property
    def notes(self) -> tuple[str, ...]:
        if self.georeferenced:
            return ()
        return ("the run is not georeferenced: only the errors after alignment are meaningful",)


def _estimate(run: Solution | Trajectory | Path | str) -> _Estimate:
    if isinstance(run, Trajectory):
        return _Estimate(poses=run, camera_p_antenna=np.zeros(3))
    if isinstance(run, Solution):
        return _Estimate(
            poses=run.trajectory,
            camera_p_antenna=run.camera_p_antenna,
            sigma_position_m=run.sigma_position_m,
            world_origin=run.world_origin,
            georeferenced=run.georeferenced,
        )
    return _read_estimate(Path(run))


def _read_estimate(run: Path) -> _Estimate:
    summary = read_summary(run)
    file = run / "poses.tum"
    if not file.is_file():
        raise RunFolderError("is missing", file=file, remedy=_REMEDY)
    poses = read_trajectory(file)
    try:
        origin = summary["world_origin"]
        return _Estimate(
            poses=poses,
            camera_p_antenna=np.array(summary["camera_p_antenna"], dtype=np.float64).reshape(3),
            sigma_position_m=_read_sigmas(run / "poses.csv", len(poses.t_s)),
            world_origin=None if origin is None else GeodeticPoint(**origin),
            georeferenced=bool(summary["georeferenced"]),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise RunFolderError(f"is damaged ({error})", file=run / "solution.json", remedy=_REMEDY) from error


def _read_sigmas(file: Path, frames: int) -> FloatArray | None:
    """Read (F, 3) standard deviations from ``poses.csv``; None if it is absent or does not fit the poses."""
    if not file.is_file():
        return None
    try:
        with file.open(newline="", encoding="utf-8") as stream:
            rows = [[float(row[name] or "nan") for name in _SIGMAS] for row in csv.DictReader(stream)]
    except (KeyError, TypeError, ValueError):
        return None
    return np.array(rows) if len(rows) == frames else None


def _true_poses(
    truth: Path, estimate: _Estimate, system: tuple[str | None, str | None]
) -> tuple[Trajectory, tuple[str, ...]]:
    """Return the truth in the world of the estimate, and the notes."""
    rig = rig_beside(truth)
    true = read_trajectory(truth, video_start_s=rig.video_start_s)
    origin = estimate.world_origin
    if any(system):
        return _from_system(true, truth, estimate, system)
    if origin is None or rig.world_origin is None or _same(origin, rig.world_origin):
        return true, estimate.notes
    note = (
        f"the truth's world_origin {_text(rig.world_origin)} is not the run's {_text(origin)}: "
        "the truth was expressed in the run's world"
    )
    return change_origin(true, rig.world_origin, origin), (*estimate.notes, note)


def _from_system(
    true: Trajectory, truth: Path, estimate: _Estimate, system: tuple[str | None, str | None]
) -> tuple[Trajectory, tuple[str, ...]]:
    """Return a truth given in a coordinate system in the world of the estimate, and the notes."""
    origin, (crs, geoid) = estimate.world_origin, system
    if crs is None or origin is None:
        raise TrajectoryError(
            "a geoid without a coordinate system" if crs is None else "a run without a world origin",
            file=truth,
            remedy="name the truth's system with --crs EPSG:NNNN" if crs is None else "omit --crs",
        )
    converter = coordinate_system(origin[:2], crs, geoid)
    poses = poses_in_world(converter, origin, true.world_T_camera)
    note = f"the truth is in {converter.description}"
    return Trajectory(true.t_s, poses), (*estimate.notes, note, *converter.notes)


def _same(a: GeodeticPoint, b: GeodeticPoint) -> bool:
    return bool(np.abs(to_enu(a, *b)).max() < _SAME_ORIGIN_M)


def _text(point: GeodeticPoint) -> str:
    return f"({point.latitude_deg:.7f}, {point.longitude_deg:.7f}, {point.height_m:.3f} m)"
