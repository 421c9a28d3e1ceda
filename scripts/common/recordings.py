"""Truths of recordings and runs."""

from pathlib import Path

import numpy as np

from vgps.errors import RunFolderError, TrajectoryError
from vgps.evaluation.run import change_origin
from vgps.geometry import interpolate_poses
from vgps.model import FloatArray, GpsLog
from vgps.readers.calibration.rig_file import rig_beside
from vgps.readers.trajectory import read_trajectory
from vgps.solution import Solution, Trajectory


def read_truth(file: Path) -> Trajectory:
    """Return a truth on the clock of the video, as the ``rig.yaml`` beside it says.

    Args:
        file: ``truth.tum``, or the recording's folder that holds it.

    Raises:
        TrajectoryError: There is none, or it is malformed.
    """
    file = file / "truth.tum" if file.is_dir() else file
    return read_trajectory(file, video_start_s=rig_beside(file).video_start_s)


def without_fixes(log: GpsLog, start_s: float, end_s: float) -> GpsLog:
    """Return a log without the fixes between two times."""
    return log.rows((log.t_s < start_s) | (log.t_s >= end_s))


def true_poses(run: Solution, folder: Path, truth: Path | None = None) -> FloatArray:
    """Return (F, 4, 4) the true poses of a run's frames, in the run's world.

    Args:
        run: The run.
        folder: Where it was read.
        truth: TUM file; by default ``truth.tum`` of the recording that the run names.

    Raises:
        RunFolderError: The run does not name its recording.
        TrajectoryError: There is no truth, it is malformed, or it does not span the run.
    """
    if truth is None:
        if run.recording is None:
            raise RunFolderError("does not name its recording", file=folder, remedy="give --truth")
        truth = run.recording / "truth.tum"
    found, origin = read_truth(truth), rig_beside(truth).world_origin
    half_frame_s = 0.5 * float(np.median(np.diff(run.t_s)))
    if run.t_s[0] < found.t_s[0] - half_frame_s or run.t_s[-1] > found.t_s[-1] + half_frame_s:
        raise TrajectoryError(
            f"runs from {found.t_s[0]:.2f} to {found.t_s[-1]:.2f} s",
            file=truth,
            expected=f"poses for the run's frames, {run.t_s[0]:.2f} to {run.t_s[-1]:.2f} s",
        )
    if origin is not None and run.world_origin is not None and origin != run.world_origin:
        found = change_origin(found, origin, run.world_origin)
    return interpolate_poses(found.t_s, found.world_T_camera, run.t_s)
