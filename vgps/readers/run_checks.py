"""Checks of a run folder's files before they are believed: types, shapes, sizes."""

import math
import zipfile
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, Field, FiniteFloat, ValidationError, model_validator

from vgps.errors import RunFolderError
from vgps.readers.gps_formats.fixes import HIGHEST_M

REMEDY = "run vgps smooth again"
Arrays = Mapping[str, npt.NDArray[Any]]

_UNPACKED = 20  # times the size of the archive, which vgps writes uncompressed
_ORTHOGONAL = 1e-3  # tolerance of a rotation
_PER_FIX = "t_s", "latitude_deg", "longitude_deg", "height_m", "hdop", "satellites", "correction_age_s"
_FLOATS: dict[str, tuple[str | int, ...]] = {
    "t_s": ("frames",),
    "world_T_camera": ("frames", 4, 4),
    "sigma_rotation_rad": ("frames", 3),
    "sigma_position_m": ("frames", 3),
    "world_p_before": ("frames", 3),
    "camera_p_antenna": (3,),
    "reference_T_camera": (4, 4),
    "sigma": (6,),
    "delay_s": ("frames",),
    "landmarks.world_p_landmark": ("landmarks", 3),
    "landmarks.sigma_px": ("landmarks",),
    "observations.uv_px": ("observations", 2),
    **{f"gps.{name}": ("fixes",) for name in _PER_FIX},
    **{f"gps.{name}": ("fixes", 3) for name in ("sigma_m", "correlation")},
    "fixes.world_p_fix": ("fixes", 3),
    "fixes.residual_m": ("fixes", 3),
    **{f"fixes.{name}": ("fixes",) for name in ("r_m", "h_m", "probability")},
    "graph.offsets": ("offsets", 3),
    "graph.c0": (1,),
    "graph.antenna_velocity": ("fixes", 3),
    "graph.prior_time_offset_s": (2,),
    **{f"graph.{name}": (3,) for name in ("d0", "prior_antenna")},
    **{f"graph.{name}": () for name in ("video_sigma_scale", "time_offset_s", "prior_antenna_sigma_m")},
    **{f"graph.fixes.{name}": ("fixes",) for name in ("t_s", "r_m", "h_m", "correlation_s")},
    **{f"graph.fixes.{name}": ("fixes", 3) for name in ("world_p_fix", "sigma_m", "correlation")},
    "graph.fixes.shape": ("fixes", 2),
    "graph.frame_rates": ("frames", 3),
    "graph.zero_motions.pose": ("zero motions", 4, 4),
    "graph.zero_motions.sigma": ("zero motions", 6),
    "graph.controls.uv_px": ("controls", 2),
    "graph.controls.world_p_point": ("controls", 3),
    "graph.controls.sigma_m": ("controls", 3),
    "graph.controls.sigma_px": ("controls",),
}
_INTEGERS = {
    "observations.frame": "observations",
    "observations.landmark": "observations",
    "landmarks.gray": "landmarks",
    "gps.line": "fixes",
    "graph.zero_motions.frame": "zero motions",
    "graph.zero_motions.reference": "zero motions",
    "graph.controls.frame": "controls",
}
_PAIRS = {"loops": ("loops", 2)}
_FLAGS = {"graph.held": "frames", "graph.fixes.used": "fixes"}
_WORDS = {
    "state": "frames",
    **dict.fromkeys(("gps.fix_class", "fixes.verdict", "fixes.reason", "graph.fixes.fix_class"), "fixes"),
}
_SHAPES = {**_FLOATS, **_PAIRS, **{key: (name,) for key, name in (_INTEGERS | _FLAGS | _WORDS).items()}}
_KINDS = {
    **dict.fromkeys(_FLOATS, "f"),
    **dict.fromkeys((*_INTEGERS, *_PAIRS), "iu"),
    **dict.fromkeys(_FLAGS, "b"),
    **dict.fromkeys(_WORDS, "U"),
}
_POINTERS = {
    "observations.landmark": "landmarks",
    **dict.fromkeys(
        (
            "observations.frame",
            "loops",
            "graph.zero_motions.frame",
            "graph.zero_motions.reference",
            "graph.controls.frame",
        ),
        "frames",
    ),
}


class _Origin(BaseModel):
    latitude_deg: Annotated[FiniteFloat, Field(ge=-90, le=90)]
    longitude_deg: Annotated[FiniteFloat, Field(ge=-360, le=360)]
    height_m: Annotated[FiniteFloat, Field(ge=-HIGHEST_M, le=HIGHEST_M)]


class _FocalChanges(BaseModel):
    t_s: Annotated[list[FiniteFloat], Field(min_length=1)]
    log_ratio: Annotated[list[Annotated[FiniteFloat, Field(ge=-5, le=5)]], Field(min_length=1)]
    centre_px: tuple[FiniteFloat, FiniteFloat]

    @model_validator(mode="after")
    def _match(self) -> Self:
        if len(self.t_s) != len(self.log_ratio) or np.any(np.diff(self.t_s) <= 0.0):
            raise ValueError("expected ascending t_s and as many values of log_ratio")
        return self


class _Camera(BaseModel):
    model: Literal["pinhole", "opencv", "fisheye", "tsai"]
    width: Annotated[int, Field(gt=0, le=1_000_000)]
    height: Annotated[int, Field(gt=0, le=1_000_000)]
    fx: Annotated[FiniteFloat, Field(gt=0)]
    fy: Annotated[FiniteFloat, Field(gt=0)]
    cx: FiniteFloat
    cy: FiniteFloat
    distortion: Annotated[list[FiniteFloat], Field(max_length=8)]
    pixel_mm: tuple[FiniteFloat, FiniteFloat] | None
    readout_s: FiniteFloat | None = None
    readout_axis: Literal["rows", "columns"] = "rows"
    focal_changes: _FocalChanges | None = None


class _RigCamera(BaseModel):
    name: str
    camera: _Camera


class _Sensors(BaseModel):
    lag_s: FiniteFloat
    lag_sigma_s: FiniteFloat | None
    antenna_sigma_m: tuple[FiniteFloat | None, FiniteFloat | None, FiniteFloat | None]
    camera_sigma: dict[str, FiniteFloat | None] = {}
    fix_errors: dict[str, dict[str, FiniteFloat]] = {}
    imu: dict[str, tuple[FiniteFloat, FiniteFloat, FiniteFloat]] = {}
    camera_height: dict[str, FiniteFloat] = {}
    focal_changes: _FocalChanges | None = None


class _Cost(BaseModel):
    terms: dict[str, FiniteFloat | None]


class _Energy(BaseModel):
    before: _Cost
    after: _Cost


class _Gps(BaseModel):
    source: str
    skipped: list[str]


class _Summary(BaseModel):
    recording: str | None
    world_origin: _Origin | None
    georeferenced: bool
    camera: _Camera
    camera_source: str | None = None
    cameras: list[_RigCamera] = []
    sensors: _Sensors
    energy: _Energy
    iterations: int
    stop_reason: str
    seconds: dict[str, FiniteFloat]
    warnings: list[str]
    gps: _Gps | None
    video_start_utc: datetime | None = None


def check_summary(summary: Mapping[str, Any], file: Path) -> None:
    """Check the contents of ``solution.json``; unknown keys are of a later version.

    Raises:
        RunFolderError: A key is missing or has a value of another kind.
    """
    try:
        _Summary.model_validate(summary, strict=False)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        found = "is missing" if first["type"] == "missing" else f"is damaged ({first['msg']})"
        place = f"key {'.'.join(str(part) for part in first['loc'])}"
        raise RunFolderError(found, file=file, place=place, remedy=REMEDY) from error


def check_archive(archive: zipfile.ZipFile, file_bytes: int) -> None:
    """Check what an archive of arrays says it holds, before it is unpacked.

    Raises:
        ValueError: It would unpack to far more than it is, or an array would be larger than its values.
    """
    for member in archive.infolist():
        if member.file_size > _UNPACKED * file_bytes:
            raise ValueError(f"{member.filename} unpacks to {member.file_size} bytes")
        with archive.open(member) as stream:
            read = np.lib.format.read_array_header_2_0
            if np.lib.format.read_magic(stream) == (1, 0):
                read = np.lib.format.read_array_header_1_0
            shape, _, dtype = read(stream)
        if math.prod(shape) * max(dtype.itemsize, 1) > member.file_size:
            raise ValueError(f"{member.filename} has fewer values than its shape {shape} needs")


def check_arrays(arrays: Arrays, file: Path) -> None:
    """Check types and shapes of the arrays, and that observations name frames and landmarks that exist.

    Raises:
        RunFolderError: An array does not fit, or has impossible values.
    """
    sizes: dict[str, int] = {}
    for key, names in _SHAPES.items():
        if key not in arrays:
            continue
        array = arrays[key]
        if array.ndim == len(names):  # the first array of a kind sets the number
            for name, size in zip(names, array.shape, strict=True):
                sizes.setdefault(str(name), size)
        expected = tuple(name if isinstance(name, int) else sizes.get(name, 0) for name in names)
        if array.shape != expected:
            raise _damaged(f"shape {array.shape}", key, file, f"shape {expected}")
        if array.dtype.kind not in _KINDS[key]:
            expected_type = "floats" if _KINDS[key] == "f" else None
            raise _damaged(f"values of type {array.dtype}", key, file, expected_type)
        if key in _WORDS and not "".join(array.tolist()).isprintable():
            raise _damaged("text with control characters", key, file)
    for key, name in _POINTERS.items():
        rows = arrays.get(key, np.zeros(0, np.int64))
        if rows.size and not 0 <= rows.min() <= rows.max() < sizes.get(name, 0):
            raise _damaged(f"points at row {rows.max()} of {sizes.get(name, 0)}", key, file)
    _check_poses(arrays, file)


def _check_poses(arrays: Arrays, file: Path) -> None:
    t_s, poses = arrays.get("t_s"), arrays.get("world_T_camera")
    if t_s is None or poses is None:
        return  # reported by name when the solution is assembled
    if not np.isfinite(t_s).all() or (np.diff(t_s) <= 0).any():
        raise _damaged("times are not in order", "t_s", file)
    R = poses[:, :3, :3]
    possible = bool((np.abs(poses) <= HIGHEST_M).all())
    if not possible or (np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)) > _ORTHOGONAL).any():
        raise _damaged("poses without a rotation", "world_T_camera", file)
    if (np.linalg.det(R) < 0).any():
        raise _damaged("poses with a reflection", "world_T_camera", file)


def _damaged(found: str, key: str, file: Path, expected: str | None = None) -> RunFolderError:
    return RunFolderError(found, file=file, place=f"key {key}", expected=expected, remedy=REMEDY)
