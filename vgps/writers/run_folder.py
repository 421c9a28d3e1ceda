"""Run folders: every file of a run, written completely or not at all."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from vgps.crs import ELLIPSOIDAL
from vgps.model import ControlPoints
from vgps.readers.run_files import SCHEMA_VERSION
from vgps.runtime.versions import versions
from vgps.solution import FrameState, SensorReport, Solution, SolvedCamera, Trajectory
from vgps.writers.atomic import check_writable, new_folder
from vgps.writers.camera import write_camera
from vgps.writers.measurements import write_measurements
from vgps.writers.ply import write_ply
from vgps.writers.tables import write_gps, write_poses
from vgps.writers.tum import write_tum

__all__ = ["FILES", "check_writable", "write_run"]

FILES = (
    "poses.tum",
    "poses.csv",
    "gps.csv",
    "points.ply",
    "measurements.npz",
    "config.yaml",
    "solution.json",
)
CAMERA_FILE = "camera.yaml"  # only where the calibration was found or refined
CAMERAS = "cameras"  # folder of the poses of a rig's other cameras


def write_run(solution: Solution, out: Path) -> None:
    """Write the run folder ``out``: poses, verdicts, points, measurements, configuration and summary.

    The folder gets its name only when it is complete. Equal Solutions give equal bytes in every file; only
    the seconds per stage, in ``solution.json``, differ between runs of the same recording.

    Raises:
        RunFolderError: ``out`` has something other than an earlier run, or cannot be written.
    """
    with new_folder(out, (*FILES, CAMERA_FILE, CAMERAS)) as folder:
        write_tum(solution.trajectory, folder / "poses.tum")
        write_poses(solution, folder / "poses.csv")
        write_gps(solution.gps, solution.fixes, folder / "gps.csv")
        write_ply(*solution.all_landmarks, solution.world_origin, folder / "points.ply")
        write_measurements(solution, folder / "measurements.npz")
        config = yaml.safe_dump(_plain(solution.config), sort_keys=False, allow_unicode=True)
        (folder / "config.yaml").write_text(config, encoding="utf-8")
        write_summary(summarise(solution), folder / "solution.json")
        if solution.sensors.camera_sigma:
            write_camera(solution, folder / CAMERA_FILE)
        for camera in solution.cameras:
            (folder / CAMERAS / camera.name).mkdir(parents=True)
            poses = solution.world_T_camera @ camera.reference_T_camera
            write_tum(Trajectory(solution.t_s, poses), folder / CAMERAS / camera.name / "poses.tum")


def write_summary(summary: Mapping[str, Any], file: Path) -> None:
    """Write a summary as JSON; numbers that are not finite become null."""
    text = json.dumps(_finite(_plain(summary)), indent=2, ensure_ascii=False, allow_nan=False)
    file.write_text(text + "\n", encoding="utf-8")


def summarise(solution: Solution) -> dict[str, Any]:
    """Return the contents of ``solution.json``: a summary of the run for people and scripts.

    ``schema_versions`` lists all files, since a comment in a CSV file would break its readers.
    """
    return {
        "schema_version": SCHEMA_VERSION,
        "schema_versions": dict.fromkeys(_files(solution), SCHEMA_VERSION),
        "recording": None if solution.recording is None else str(solution.recording),
        "world_origin": solution.world_origin._asdict() if solution.world_origin is not None else None,
        "georeferenced": solution.georeferenced,
        "video_start_utc": None if solution.video_start_utc is None else solution.video_start_utc.isoformat(),
        "counts": _counts(solution),
        "energy": {
            "before": _with_total(solution.report.cost_before),
            "after": _with_total(solution.report.cost_after),
        },
        "iterations": solution.report.iterations,
        "stop_reason": solution.report.stop_reason,
        "static_share": float(solution.static_share.max(initial=0.0)),
        "moving_share": float(solution.moving_share.max(initial=0.0)),
        "submaps": None if solution.report.submaps is None else asdict(solution.report.submaps),
        "seconds": dict(solution.seconds),
        "warnings": list(solution.warnings),
        "camera": asdict(solution.camera),
        "camera_source": solution.camera_source,
        "cameras": [_rig_camera(one) for one in solution.cameras],
        "camera_p_antenna": solution.camera_p_antenna,
        "sensors": _sensors(solution.sensors),
        "gps": None
        if solution.gps is None
        else {"source": str(solution.gps.source), "skipped": list(solution.gps.skipped)},
        "control_points": _control_points(solution.control_points),
        "datum": {"positions": "WGS 84, as the GPS log has it", "heights": ELLIPSOIDAL},
        "versions": versions(),
    }


def _files(solution: Solution) -> tuple[str, ...]:
    camera = (CAMERA_FILE,) if solution.sensors.camera_sigma else ()
    return (*FILES, *camera, *(f"{CAMERAS}/{one.name}/poses.tum" for one in solution.cameras))


def _control_points(points: ControlPoints | None) -> dict[str, Any] | None:
    if points is None:
        return None
    return {
        "source": str(points.source),
        "geodetic": points.geodetic,
        "notes": list(points.notes),
        "control": len(set(np.array(points.name)[~points.check].tolist())),
        "check": len(set(np.array(points.name)[points.check].tolist())),
    }


def _rig_camera(solved: SolvedCamera) -> dict[str, Any]:
    """Return another camera of a rig; its pose in the fields of rig.yaml, for the next recording."""
    return {
        "name": solved.name,
        "camera": asdict(solved.camera),
        "reference_R_camera": solved.reference_T_camera[:3, :3],
        "reference_p_camera": solved.reference_T_camera[:3, 3],
        "rotation_sigma_deg": float(np.degrees(solved.sigma[:3].max())),
        "position_sigma_m": float(solved.sigma[3:].max()),
    }


def _sensors(report: SensorReport) -> dict[str, Any]:
    """Return the sensors' estimates under their first keys, where the time offset is a lag."""
    return {
        "lag_s": report.time_offset_s,
        "lag_sigma_s": report.time_offset_sigma_s,
        "clock_rate": report.clock_rate,
        "clock_rate_sigma": report.clock_rate_sigma,
        "video_speed": report.video_speed,
        "antenna_sigma_m": report.antenna_sigma_m,
        "camera_sigma": report.camera_sigma,
        "fix_errors": report.fix_errors,
        "imu": report.imu,
        "camera_height": report.camera_height,
        "focal_changes": None if report.focal_changes is None else asdict(report.focal_changes),
    }


def _counts(solution: Solution) -> dict[str, int]:
    fixes = 0 if solution.gps is None else len(solution.gps)
    used = 0 if solution.fixes is None else int(np.count_nonzero(solution.fixes.used))
    landmarks, observations = solution.all_landmarks
    return {
        "frames": len(solution.t_s),
        **{f"frames_{state}": solution.state.count(state) for state in FrameState},
        "landmarks": len(landmarks.world_p_landmark),
        "observations": len(observations.frame),
        "submaps": 1 if solution.report.submaps is None else len(solution.report.submaps.places),
        "loops": len(solution.loops),
        "frames_with_static_regions": int(np.count_nonzero(solution.static_share)),
        "frames_with_moving_regions": int(np.count_nonzero(solution.moving_share)),
        "fixes": fixes,
        "fixes_used": used,
        "fixes_unused": fixes - used,
    }


def _with_total(cost: Mapping[str, float]) -> dict[str, Any]:
    return {"terms": dict(cost), "total": sum(cost.values())}


def _plain(value: Any) -> Any:
    """Return the value in the types that JSON and YAML share."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value if value is None or isinstance(value, bool | int | float) else str(value)


def _finite(value: Any) -> Any:
    """Return a plain value with None for numbers that are not finite, which JSON does not have."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
