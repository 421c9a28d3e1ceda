"""Poses as a table with chosen columns, in a coordinate system: CSV."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from vgps.errors import RunFolderError
from vgps.model import FloatArray
from vgps.writers.columns import QUATERNION, enu, named, numbers, write_columns
from vgps.writers.export_job import ExportJob
from vgps.writers.tum import quaternion

_USUAL = (
    *("image", "t_s", "utc", "x", "y", "height", "heading_deg", "pitch_deg", "roll_deg"),
    *("sigma_east_m", "sigma_north_m", "sigma_up_m", "state", "crs"),
)


def write_csv(job: ExportJob, out: Path) -> None:
    """Write a row per frame with the columns of the options; the name of the heights says their datum.

    Raises:
        RunFolderError: There is no such column, or the run is not georeferenced.
    """
    columns = _columns(job)
    chosen = [_renamed(name, job) for name in job.options.columns or _USUAL]
    unknown = [name for name in chosen if name not in columns]
    if unknown:
        raise RunFolderError(f"no column {unknown[0]}", expected="of " + ", ".join(columns))
    if job.options.columns is None and job.utc is None:
        chosen.remove("utc")
    write_columns({name: columns[name] for name in chosen}, out)


def attitude_deg(local_R_camera: FloatArray) -> FloatArray:
    """Return (F, 3) heading, pitch and roll [deg] of cameras in east, north, up.

    Heading of the optical axis clockwise from north, pitch of it above the horizon, roll clockwise as the
    camera sees: 0 for a level camera. Straight up or down, the heading is that of the image's top or bottom
    and the roll is 0.
    """
    right, down, forward = np.moveaxis(local_R_camera, -1, 0)
    heading = np.degrees(np.arctan2(forward[:, 0], forward[:, 1]))
    pitch = np.degrees(np.arctan2(forward[:, 2], np.hypot(forward[:, 0], forward[:, 1])))
    # roll 0: right is level
    roll = np.degrees(np.arctan2(-right[:, 2], -down[:, 2]))
    vertical = np.hypot(forward[:, 0], forward[:, 1]) < 1e-9
    top = -down * np.where(forward[:, 2] > 0.0, -1.0, 1.0)[:, None]
    heading = np.where(vertical, np.degrees(np.arctan2(top[:, 0], top[:, 1])), heading) % 360.0
    heading = np.where(heading >= 360.0, 0.0, heading)  # a tiny negative angle rounds up to 360
    return np.column_stack([heading, pitch, np.where(vertical, 0.0, roll)])


def _renamed(name: str, job: ExportJob) -> str:
    axes = job.georeferenced.axes
    return {"x": axes[0], "y": axes[1], "height": job.georeferenced.height_column}.get(name, name)


def _columns(job: ExportJob) -> dict[str, Iterable[object]]:
    """Return all columns that there are, by name."""
    system, solution, utc = job.georeferenced, job.solution, job.utc
    degrees = 10 if system.is_geographic else 4
    return {
        "image": job.image_names,
        "frame": job.frame.tolist(),
        "t_s": numbers(solution.t_s, 9),
        "utc": [""] * len(job.frame) if utc is None else [one.isoformat() for one in utc],
        system.axes[0]: numbers(job.coordinates[:, 0], degrees),
        system.axes[1]: numbers(job.coordinates[:, 1], degrees),
        system.height_column: numbers(job.coordinates[:, 2], 4),
        "crs": [system.name] * len(job.frame),
        **enu("{}_m", solution.world_T_camera[:, :3, 3], 6),
        **named(("heading_deg", "pitch_deg", "roll_deg"), attitude_deg(job.local_R_camera), 6),
        **named(QUATERNION, quaternion(solution.world_T_camera), 12),
        **enu("sigma_{}_m", solution.sigma_position_m, 4),
        **enu("sigma_rot_{}_deg", np.degrees(solution.sigma_rotation_rad), 4),
        "state": [str(state) for state in solution.state],
    }
