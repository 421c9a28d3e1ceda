"""Other programs' calibrations, converted to the fields of ``camera.yaml``, recognised by content.

OpenCV's FileStorage (YAML, XML or JSON), Kalibr's ``camchain.yaml`` and COLMAP's ``cameras.txt``. Each file
must have one camera. An OpenCV file is a fisheye's if it has ``fisheye_model: 1`` or a ``distortion_model``
fisheye or equidistant.
"""

import re
from pathlib import Path
from typing import Any

from vgps.errors import CalibrationError
from vgps.readers.calibration.opencv_storage import calibration_fields, camera_from_opencv, is_opencv_storage

_KALIBR = {
    "radtan": "opencv", "equidistant": "fisheye", "none": "pinhole",
}  # fmt: skip
_COLMAP_ROW = re.compile(r"\s*\d+\s+[A-Z][A-Z_0-9]+\s+\d+\s+\d+(\s+\S+)+\s*")
# lens model here, number of focal lengths, and the coefficients after the principal point: given (k) or zero
_COLMAP = {
    "SIMPLE_PINHOLE": ("pinhole", 1, ""),
    "PINHOLE": ("pinhole", 2, ""),
    "SIMPLE_RADIAL": ("opencv", 1, "k000"),
    "RADIAL": ("opencv", 1, "kk00"),
    "OPENCV": ("opencv", 2, "kkkk"),
    "FULL_OPENCV": ("opencv", 2, "kkkkkkkk"),
    "SIMPLE_RADIAL_FISHEYE": ("fisheye", 1, "k000"),
    "RADIAL_FISHEYE": ("fisheye", 1, "kk00"),
    "OPENCV_FISHEYE": ("fisheye", 2, "kkkk"),
}
_COLMAP_CENTRE_PX = 0.5  # the centre of COLMAP's first pixel; OpenCV's is at 0


def camera_from_text(data: bytes, path: Path) -> dict[str, Any] | None:
    """Return the fields of ``camera.yaml`` from OpenCV's or COLMAP's format; None if the file is neither.

    Raises:
        CalibrationError: The file is damaged, has no matrix or size, an unknown lens model or several
            cameras.
    """
    if is_opencv_storage(data):
        return camera_from_opencv(data.decode("utf-8", errors="replace"), path)
    text = data.decode("utf-8", errors="replace")
    rows = [(n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip() and line[0] != "#"]
    if rows and all(_COLMAP_ROW.fullmatch(line) for _, line in rows):
        _check_one([line.split()[0] for _, line in rows], path)
        return _from_colmap(*rows[0], path)
    return None


def camera_from_kalibr(content: dict[str, Any], path: Path) -> dict[str, Any] | None:
    """Return the fields of ``camera.yaml`` from Kalibr's camera chain; None if the mapping is not one.

    Raises:
        CalibrationError: A key is missing or malformed, the lens model unknown, or there are several cameras.
    """
    cameras = [key for key in content if re.fullmatch(r"cam\d+", key)]
    if not cameras:
        return None
    _check_one(cameras, path)
    name, camera = cameras[0], content[cameras[0]]
    if not isinstance(camera, dict):
        raise CalibrationError("no fields", file=path, place=f"key {name}", expected="a camera of Kalibr's")
    for key, known in (("camera_model", ["pinhole"]), ("distortion_model", sorted(_KALIBR))):
        if camera.get(key) not in known:
            raise CalibrationError(
                f"{camera.get(key)!r}",
                file=path,
                place=f"key {name}.{key}",
                expected=" or ".join(known),
            )
    fx, fy, cx, cy = _numbers(camera, name, "intrinsics", 4, path)
    width, height = _numbers(camera, name, "resolution", 2, path)
    model = _KALIBR[camera["distortion_model"]]
    distortion = [] if model == "pinhole" else _numbers(camera, name, "distortion_coeffs", 4, path)
    return calibration_fields(model, (width, height), (fx, fy, cx, cy), distortion)


def _numbers(camera: dict[str, Any], name: str, key: str, count: int, path: Path) -> list[float]:
    values = camera.get(key)
    good = isinstance(values, list) and len(values) == count
    if not good or not all(isinstance(value, int | float) for value in values or []):
        raise CalibrationError(
            f"{values!r}", file=path, place=f"key {name}.{key}", expected=f"a list of {count} numbers"
        )
    return list(values or [])


def _check_one(cameras: list[str], path: Path) -> None:
    if len(cameras) > 1:
        raise CalibrationError(
            f"{len(cameras)} cameras ({', '.join(cameras[:5])}{', ...' if len(cameras) > 5 else ''})",
            file=path,
            expected="one",
            remedy="keep only the camera of this video",
        )


def _from_colmap(number: int, line: str, path: Path) -> dict[str, Any]:
    _, name, width, height, *rest = line.split()
    if name not in _COLMAP:
        raise CalibrationError(
            f"camera model {name}", file=path, place=f"line {number}", expected=", ".join(_COLMAP)
        )
    model, focals, pattern = _COLMAP[name]
    count = focals + 2 + pattern.count("k")
    try:
        values = [float(part) for part in rest]
    except ValueError:
        values = []
    if len(values) != count:
        raise CalibrationError(
            f"{' '.join(rest)!r}", file=path, place=f"line {number}", expected=f"{count} numbers for {name}"
        )
    focal, centre, k = values[:focals], values[focals : focals + 2], iter(values[focals + 2 :])
    pinhole = (focal[0], focal[-1], *(c - _COLMAP_CENTRE_PX for c in centre))
    distortion = [next(k) if letter == "k" else 0.0 for letter in pattern]
    return calibration_fields(model, (float(width), float(height)), pinhole, distortion)
