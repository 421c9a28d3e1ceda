"""OpenCV's FileStorage (YAML, XML or JSON) with the calibration of one camera.

It is read by hand: ``cv2.FileStorage`` reads beyond its memory in some damaged files, and the process dies.
"""

import json
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from vgps.config.yaml_text import YamlTextError, parse_yaml
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
_MATRIX_TAG = re.compile(r"!!opencv-(nd-)?matrix")


def calibration_fields(
    model: str, size: tuple[float, float], pinhole: tuple[float, ...], distortion: list[float]
) -> dict[str, Any]:
    """Return the fields of ``camera.yaml``."""
    fx, fy, cx, cy = pinhole
    fields: dict[str, Any] = {"model": model, "width": size[0], "height": size[1]}
    return {**fields, "fx": fx, "fy": fy, "cx": cx, "cy": cy, "distortion": distortion}


def is_opencv_storage(data: bytes) -> bool:
    """Whether a file is a FileStorage of OpenCV's: YAML, XML or JSON."""
    head = data.lstrip(b"\xef\xbb\xbf \r\n")[:4096]
    return (
        head.startswith(b"%YAML:")
        or b"<opencv_storage" in head
        or b"!!opencv-" in data
        or (head.startswith(b"{") and b"opencv-matrix" in data)
    )


def camera_from_opencv(text: str, path: Path) -> dict[str, Any]:
    """Return the fields of ``camera.yaml``.

    Raises:
        CalibrationError: The file is damaged, or has no matrix or size.
    """
    try:
        storage = _storage(text)
    except (YamlTextError, ElementTree.ParseError, ValueError, RecursionError) as error:
        found = f"damaged OpenCV storage ({error})"
        raise CalibrationError(found, file=path, remedy="write the calibration again") from error
    K = _matrix(storage, _MATRIX, path)
    coefficients = _matrix(storage, _DISTORTION, path)
    size = _size(storage)
    is_fisheye = _says_fisheye(storage)
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
    return calibration_fields(
        model, size, pinhole, _shortened(distortion) if model == "opencv" else distortion
    )


def _shortened(distortion: list[float]) -> list[float]:
    """Drop zero coefficients that the lens model here does not have (12 or 14 coefficients)."""
    longest = _LENS_LENGTHS[-1]
    return distortion if any(distortion[longest:]) else distortion[:longest]


def _storage(text: str) -> dict[str, Any]:
    """Return the nodes of a storage by name; cv2.FileStorage dies of some damaged ones.

    Raises:
        YamlTextError, ElementTree.ParseError, ValueError: The text is damaged.
    """
    if "<opencv_storage" in text[:4096]:
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise ValueError("a document type")
        return {node.tag: _of_xml(node) for node in ElementTree.fromstring(text.encode())}
    if text.lstrip("\ufeff \r\n").startswith("{"):
        content = json.loads(text)
    else:
        lines = text.lstrip("\ufeff").splitlines()
        first = 1 if lines[0].startswith("%YAML") else 0  # %YAML:1.0, which YAML itself does not know
        content = parse_yaml(_MATRIX_TAG.sub("", "\n".join(lines[first:])))
    if not isinstance(content, dict):
        raise ValueError("no names")
    return content


def _of_xml(node: ElementTree.Element) -> Any:
    if len(node):
        return {inner.tag: inner.text or "" for inner in node}
    words = (node.text or "").split()
    return words[0] if len(words) == 1 else words


def _words(node: Any) -> list[Any]:
    return node.split() if isinstance(node, str) else list(node)


def _matrix(storage: dict[str, Any], names: tuple[str, ...], path: Path) -> FloatArray | None:
    """Return the first matrix among the names; in a truncated file the last name may have no matrix."""
    name = next((name for name in names if name in storage), None)
    if name is None:
        return None
    node = storage[name]
    try:
        data = _words(node["data"])
        shape = tuple(map(int, _words(node["sizes"]) if "sizes" in node else (node["rows"], node["cols"])))
        if not data or min(shape) < 1:
            raise ValueError("no numbers")
        return np.array([float(number) for number in data]).reshape(shape)
    except (ValueError, TypeError, KeyError, OverflowError) as error:
        raise CalibrationError(
            "no matrix", file=path, place=f"key {name}", remedy="write the calibration again"
        ) from error


def _says_fisheye(storage: dict[str, Any]) -> bool:
    named = str(storage.get("distortion_model")).strip('"').lower() in {"fisheye", "equidistant"}
    return named or (_number(storage.get("fisheye_model")) or 0.0) != 0.0


def _size(storage: dict[str, Any]) -> tuple[float, float] | None:
    for name in _SIZE:
        node = storage.get(name)
        if isinstance(node, list) and len(node) == 2:
            width, height = map(_number, node)
            return None if width is None or height is None else (width, height)
    sides = [
        next((side for name in names if (side := _number(storage.get(name))) is not None), None)
        for names in (_WIDTH, _HEIGHT)
    ]
    return None if sides[0] is None or sides[1] is None else (sides[0], sides[1])


def _number(node: Any) -> float | None:
    try:
        return float(node)
    except (TypeError, ValueError, OverflowError):
        return None
