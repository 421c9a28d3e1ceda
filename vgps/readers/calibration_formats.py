"""Other programs' calibrations, converted to the fields of ``camera.yaml``; the content tells the format.

OpenCV's FileStorage (YAML, XML or JSON), Kalibr's ``camchain.yaml`` and COLMAP's ``cameras.txt``. Each file
must have one camera. An OpenCV file is a fisheye's if it has ``fisheye_model: 1`` or a ``distortion_model``
fisheye or equidistant.
"""

import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vgps.errors import CalibrationError
from vgps.model import FloatArray

_MATRIX = (
    "camera_matrix",
    "cameraMatrix",
    "Camera_Matrix",
    "CameraMatrix",
    "intrinsic_matrix",
    "mtx",
    "K",
    "M1",
)
_DISTORTION = (
    "distortion_coefficients", "dist_coeffs", "distCoeffs", "Distortion_Coefficients", "DistCoeffs",
    "distortion", "dist", "D", "D1",
)  # fmt: skip
_WIDTH, _HEIGHT = ("image_width", "image_Width", "width"), ("image_height", "image_Height", "height")
_SIZE = ("image_size", "imageSize", "resolution")
_LENS_LENGTHS = (4, 5, 8)  # of OpenCV's model; longer lists are cut if the rest is zero
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
    if _is_file_storage(data):
        return _from_opencv(data.decode("utf-8", errors="replace"), path)
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
    return _fields(model, (width, height), (fx, fy, cx, cy), distortion)


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


def _fields(
    model: str, size: tuple[float, float], pinhole: tuple[float, ...], distortion: list[float]
) -> dict[str, Any]:
    fx, fy, cx, cy = pinhole
    fields: dict[str, Any] = {"model": model, "width": size[0], "height": size[1]}
    return {**fields, "fx": fx, "fy": fy, "cx": cx, "cy": cy, "distortion": distortion}


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
    return _fields(model, (float(width), float(height)), pinhole, distortion)


def _is_file_storage(data: bytes) -> bool:
    head = data.lstrip(b"\xef\xbb\xbf \r\n")[:4096]
    return (
        head.startswith(b"%YAML:")
        or b"<opencv_storage" in head
        or b"!!opencv-" in data
        or (head.startswith(b"{") and b"opencv-matrix" in data)
    )


def _from_opencv(text: str, path: Path) -> dict[str, Any]:
    storage = cv2.FileStorage()
    try:
        if not storage.open(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY):
            raise CalibrationError("damaged OpenCV storage", file=path, remedy="write the calibration again")
        K = _matrix(storage, _MATRIX, path)
        coefficients = _matrix(storage, _DISTORTION, path)
        size = _size(storage)
        is_fisheye = _says_fisheye(storage)
    except (cv2.error, SystemError) as error:
        reason = str(error).rsplit("error: ", maxsplit=1)[-1]
        raise CalibrationError(f"damaged OpenCV storage ({reason})", file=path) from error
    finally:
        storage.release()
    if K is None or K.shape != (3, 3):
        found = "none" if K is None else f"shape {K.shape}"
        raise CalibrationError(found, file=path, place="key camera_matrix", expected="a 3 x 3 matrix")
    if abs(K[0, 1]) > 1e-9 * abs(K[0, 0]):
        raise CalibrationError(
            f"skew {K[0, 1]:g}", file=path, place="key camera_matrix", expected="square or rectangular pixels"
        )
    if size is None:
        raise CalibrationError(
            "missing", file=path, place="key image_width", remedy="add image_width and image_height"
        )
    distortion = [] if coefficients is None else coefficients.ravel().tolist()
    model = "fisheye" if is_fisheye else "opencv" if distortion else "pinhole"
    pinhole = (float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2]))
    return _fields(model, size, pinhole, _shortened(distortion) if model == "opencv" else distortion)


def _shortened(distortion: list[float]) -> list[float]:
    """Drop zero coefficients that the lens model here does not have (12 or 14 coefficients)."""
    longest = _LENS_LENGTHS[-1]
    return distortion if any(distortion[longest:]) else distortion[:longest]


def _matrix(storage: Any, names: tuple[str, ...], path: Path) -> FloatArray | None:
    """Return the first matrix among the names; in a truncated file the last name may have no matrix."""
    name = next((name for name in names if not storage.getNode(name).empty()), None)
    if name is None:
        return None
    node = storage.getNode(name)
    matrix = node.mat() if node.isMap() else None
    if matrix is None or matrix.size == 0:
        raise CalibrationError(
            "no matrix", file=path, place=f"key {name}", remedy="write the calibration again"
        )
    return np.asarray(matrix, np.float64)


def _says_fisheye(storage: Any) -> bool:
    flag, words = storage.getNode("fisheye_model"), storage.getNode("distortion_model")
    named = words.isString() and words.string().lower() in {"fisheye", "equidistant"}
    return named or (flag.isInt() and flag.real() != 0)


def _size(storage: Any) -> tuple[float, float] | None:
    for name in _SIZE:
        node = storage.getNode(name)
        if node.isSeq() and node.size() == 2:
            return node.at(0).real(), node.at(1).real()
    sides = [
        next((node.real() for name in names if (node := storage.getNode(name)).isInt()), None)
        for names in (_WIDTH, _HEIGHT)
    ]
    return None if sides[0] is None or sides[1] is None else (sides[0], sides[1])
