"""Run folders, read back into the Solution from which they were written."""

import math
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from vgps.errors import RunFolderError
from vgps.model import Camera, ControlPoints, FixClass, FocalChanges, GeodeticPoint, GpsLog
from vgps.readers.run_checks import REMEDY, Arrays, check_arrays, check_summary
from vgps.readers.run_files import joined_names, read_arrays, read_settings, read_summary
from vgps.solution import (
    FixTable,
    FrameState,
    Landmarks,
    Observations,
    SensorReport,
    Solution,
    SolvedCamera,
    SolverReport,
    SubmapReport,
    Verdict,
)


def read_run(path: Path) -> Solution:
    """Read a run folder: arrays from ``measurements.npz``, the rest from ``solution.json``, ``config.yaml``.

    The files derived from these (``poses.tum``, ``gps.csv``, ...) are not read.

    Raises:
        RunFolderError: One of the three is missing, damaged, of a later schema, or does not fit the others.
    """
    summary = read_summary(path)
    if parts := joined_names(summary):
        raise RunFolderError("holds several runs", file=path, remedy=f"name one, as {path / parts[0]}")
    file = path / "measurements.npz"
    check_summary(summary, path / "solution.json")
    arrays = read_arrays(file)
    check_arrays(arrays, file)
    for k in range(len(summary.get("cameras", []))):  # of a rig, as those of the first camera
        check_arrays({**arrays, **_part(arrays, f"cameras.{k}")}, file)
    config = read_settings(path / "config.yaml")
    try:
        solution = _assemble(arrays, summary, config)
    except KeyError as error:
        raise RunFolderError(f"{error} is missing", file=path, remedy=REMEDY) from error
    except (AttributeError, TypeError, ValueError, OverflowError) as error:
        raise RunFolderError(f"is damaged ({error})", file=path, remedy=REMEDY) from error
    return solution


def _instant(text: str) -> datetime:
    """Return an instant in UTC; OverflowError if it has none, as beyond the year 9999."""
    instant = datetime.fromisoformat(text)
    return instant.astimezone(UTC) if instant.tzinfo else instant


def _assemble(arrays: Arrays, summary: Mapping[str, Any], config: Mapping[str, Any]) -> Solution:
    origin, start = summary["world_origin"], summary.get("video_start_utc")  # absent in older runs
    return Solution(
        recording=None if summary["recording"] is None else Path(summary["recording"]),
        world_origin=origin and GeodeticPoint(**{name: float(value) for name, value in origin.items()}),
        georeferenced=summary["georeferenced"],
        t_s=arrays["t_s"],
        world_T_camera=arrays["world_T_camera"],
        sigma_rotation_rad=arrays["sigma_rotation_rad"],
        sigma_position_m=arrays["sigma_position_m"],
        state=tuple(map(FrameState, arrays["state"].tolist())),
        camera=_camera(summary["camera"]),
        camera_p_antenna=arrays["camera_p_antenna"],
        landmarks=Landmarks(**_part(arrays, "landmarks")),
        observations=Observations(**_part(arrays, "observations")),
        gps=_gps(arrays, summary),
        fixes=_fixes(arrays),
        sensors=_sensors(summary["sensors"]),
        report=_report(summary),
        seconds=summary["seconds"],
        warnings=tuple(summary["warnings"]),
        config=config,
        video_start_utc=None if start is None else _instant(start),
        world_p_before=arrays.get("world_p_before"),
        control_points=_control_points(arrays, summary.get("control_points")),  # absent in older runs
        graph=_part(arrays, "graph") or None,
        camera_source=summary.get("camera_source"),  # absent in older runs
        **{key: arrays[key] for key in ("loops", "static_regions", "moving_regions") if key in arrays},
        cameras=tuple(_solved_camera(arrays, k, one) for k, one in enumerate(summary.get("cameras", []))),
    )


def _solved_camera(arrays: Arrays, k: int, about: Mapping[str, Any]) -> SolvedCamera:
    return SolvedCamera(
        name=about["name"],
        camera=_camera(about["camera"]),
        reference_T_camera=arrays[f"cameras.{k}.reference_T_camera"],
        sigma=arrays[f"cameras.{k}.sigma"],
        delay_s=arrays[f"cameras.{k}.delay_s"],
        landmarks=Landmarks(**_part(arrays, f"cameras.{k}.landmarks")),
        observations=Observations(**_part(arrays, f"cameras.{k}.observations")),
    )


def _part(arrays: Arrays, name: str) -> dict[str, Any]:
    return {key.removeprefix(f"{name}."): arrays[key] for key in arrays if key.startswith(f"{name}.")}


def _camera(values: Mapping[str, Any]) -> Camera:
    pixel_mm = values["pixel_mm"]
    found = {
        "distortion": tuple(values["distortion"]),
        "pixel_mm": None if pixel_mm is None else tuple(pixel_mm),
        "focal_changes": _focal_changes(values),
    }
    return Camera(**{**values, **found})


def _focal_changes(values: Mapping[str, Any]) -> FocalChanges | None:
    changes = values.get("focal_changes")  # absent in older runs
    return None if changes is None else FocalChanges(**{name: tuple(changes[name]) for name in changes})


def _gps(arrays: Arrays, summary: Mapping[str, Any]) -> GpsLog | None:
    log = summary["gps"]
    if log is None:
        return None
    part = _part(arrays, "gps")
    part["fix_class"] = tuple(map(FixClass, part["fix_class"].tolist()))
    return GpsLog(**part, source=Path(log["source"]), skipped=tuple(log["skipped"]))


def _control_points(arrays: Arrays, about: Mapping[str, Any] | None) -> ControlPoints | None:
    if about is None:
        return None
    part = _part(arrays, "control_points")
    part["name"] = tuple(part["name"].tolist())
    source, notes = Path(about["source"]), tuple(about["notes"])
    return ControlPoints(**part, geodetic=about["geodetic"], source=source, notes=notes)


def _fixes(arrays: Arrays) -> FixTable | None:
    part = _part(arrays, "fixes")
    if not part:
        return None
    part["reason"] = tuple(part["reason"].tolist())
    part["verdict"] = tuple(map(Verdict, part["verdict"].tolist()))
    return FixTable(**part)


def _sensors(values: Mapping[str, Any]) -> SensorReport:
    sigmas = (values["lag_sigma_s"], values.get("clock_rate_sigma"), *values["antenna_sigma_m"])
    lag_sigma, rate_sigma, x, y, z = (math.nan if sigma is None else float(sigma) for sigma in sigmas)
    found = {key: values.get(key, {}) for key in ("camera_sigma", "fix_errors", "imu", "camera_height")}
    rate, speed = values.get("clock_rate", 0.0), values.get("video_speed", 1.0)  # absent in older runs
    changes = _focal_changes(values)
    return SensorReport(
        values["lag_s"], lag_sigma, (x, y, z), rate, rate_sigma, speed, **found, focal_changes=changes
    )


def _report(summary: Mapping[str, Any]) -> SolverReport:
    before, after = (
        {term: math.nan if cost is None else cost for term, cost in summary["energy"][when]["terms"].items()}
        for when in ("before", "after")
    )
    found = summary.get("submaps")
    submaps = None
    if found is not None:
        peak_mb = math.nan if found["peak_memory_mb"] is None else found["peak_memory_mb"]
        submaps = SubmapReport(tuple(found["places"]), tuple(found["separators"]), peak_mb)
    return SolverReport(before, after, summary["iterations"], summary["stop_reason"], submaps)
