"""What a GoPro says of its lens: settings in the file's header, and on newer models the lens itself.

From HERO11 on: POLY, coefficients of the angle from the axis as a polynomial of the image radius, which is 1
in the corner and multiplied by ZMPL (https://github.com/gopro/gpmf-parser/issues/190 and 196). From HERO8 on:
ZFOV, the angle from corner to corner [deg]. Before that VFOV, the name of the field of view.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vgps.camera import centred_camera
from vgps.model import Camera, CameraGuess, FloatArray
from vgps.readers.gopro.gpmf import Entry, Telemetry, first_number, numbers, parse
from vgps.readers.video.mp4_boxes import read_box

# Horizontal angles of GoPro's tables for HERO4 to HERO7 (support article "Field of View (FOV) Information")
# in 16:9, and that of wide in 4:3
_WIDTH_DEG = {"W": 118.2, "M": 94.4, "N": 64.4, "L": 86.0}
_WIDE_4_3_DEG = 122.6
_NAMES = {"W": "wide", "M": "medium", "N": "narrow", "L": "linear", "S": "SuperView", "H": "HyperView"}
_STRETCHED = {"S", "H", "X"}
_STABILISED = 0.9  # of the width that stabilisation leaves, by GoPro's specifications
_K1 = 0.03  # of GoPro's wide lenses, as published calibrations of HERO5 to HERO9 have it
_RADII = np.linspace(0.02, 1.0, 50)


def gopro_settings(video: Path) -> dict[str, Entry]:
    """Return the settings in the header of a GoPro's video by key; none of another's, or damaged ones."""
    try:
        data = read_box(video, "moov", "udta", "GPMF") or b""
        found: dict[str, Entry] = {}
        for device in parse(data):
            for entry in parse(device.data) if device.key == "DEVC" else ():
                inner = parse(entry.data) if entry.key == "STRM" else [entry]
                found = {**{one.key: one for one in inner}, **found}
    except (ValueError, OSError):
        return {}
    return found


def gopro_guess(telemetry: Telemetry, size: tuple[int, int]) -> CameraGuess | None:
    """Return what a GoPro's metadata say of its lens; None if the video is not a GoPro's."""
    settings = gopro_settings(telemetry.path)
    if not telemetry.sensors and not settings:
        return None
    view = _text(settings, "VFOV")
    lens = _stated_lens(settings, size) or _stated_angle(settings, size) or _tabled(settings, size)
    name = telemetry.device or _text(settings, "MINF")
    words = [
        f"a GoPro ({name.removeprefix('GoPro ')})" if name not in {"", "Camera"} else "a GoPro",
        lens.source,
    ]
    if view in _NAMES:
        words.insert(1, f"set to {_NAMES[view]}")
    if view in _STRETCHED:
        words.append("which stretches the picture unevenly, as no lens model here describes")
    return CameraGuess(
        camera=centred_camera(
            "opencv" if view == "L" else "fisheye", size, lens.focal_px, (lens.k1, lens.k2)
        ),
        focal_sigma=lens.focal_sigma,
        centre_sigma_px=0.01 * max(size),
        distortion_sigma=(0.05, 0.05),
        source=", ".join(words),
    )


def gopro_readout_s(telemetry: Telemetry) -> float | None:
    """Return the time from the first row to the last, SROT; None if it is unknown or the picture stabilised.

    Stabilisation moves the rows of a picture as if they had been exposed together.
    """
    blocks = telemetry.sensors.get("SROT", [])
    if not blocks or _text(gopro_settings(telemetry.path), "EISE") != "N":
        return None
    return 1e-3 * float(np.median(np.concatenate([block.samples.ravel() for block in blocks])))


def with_readout(camera: Camera, telemetry: Telemetry, quarter_turns: int) -> Camera:
    """Return the camera with a GoPro's readout, if it has none, and with its axis in the upright picture.

    After 1, 2 and 3 counterclockwise quarter turns the sensor's first row is the left column, the last row
    and the right column.
    """
    if quarter_turns % 2:
        camera = replace(camera, readout_axis="columns")
    found_s = gopro_readout_s(telemetry) if camera.readout_s is None else None
    if found_s is None:
        return camera
    return replace(camera, readout_s=-found_s if quarter_turns >= 2 else found_s)


@dataclass(frozen=True, kw_only=True)
class _Lens:
    """Focal length [px] and its sigma (a share of it), radial coefficients, and where they come from."""

    focal_px: float
    focal_sigma: float
    source: str
    k1: float = 0.0
    k2: float = 0.0


def _stated_lens(settings: dict[str, Entry], size: tuple[int, int]) -> _Lens | None:
    multiplier = first_number(settings, "ZMPL", 0.0)
    if "POLY" not in settings or multiplier <= 0.0 or _text(settings, "VFOV") in {*_STRETCHED, "L"}:
        return None
    polynomial = np.polynomial.Polynomial(numbers(settings["POLY"])[0])
    f, k1, k2 = _fisheye(polynomial(_RADII * multiplier))
    corner = float(np.hypot(*size)) / 2
    return _Lens(focal_px=f * corner, focal_sigma=0.03, k1=k1, k2=k2, source="with the lens that it states")


def _stated_angle(settings: dict[str, Entry], size: tuple[int, int]) -> _Lens | None:
    angle_deg, linear = first_number(settings, "ZFOV", 0.0), _text(settings, "VFOV") == "L"
    if not 10.0 < angle_deg < (170.0 if linear else 300.0):
        return None
    source = f"with the angle of {angle_deg:.0f} degrees from corner to corner that it states"
    return _of_angle(float(np.hypot(*size)), angle_deg, linear, 0.08, source)


def _tabled(settings: dict[str, Entry], size: tuple[int, int]) -> _Lens:
    view = _text(settings, "VFOV")
    angle_deg = _WIDTH_DEG.get(view, _WIDTH_DEG["W"])
    if size[0] < 1.5 * size[1] and view in {"", "W"}:
        angle_deg = _WIDE_4_3_DEG
    source, sigma = f"{angle_deg:g} degrees wide by GoPro's tables", 0.10 if view in _WIDTH_DEG else 0.20
    if _text(settings, "EISE") == "Y":
        angle_deg, source = _STABILISED * angle_deg, f"{source} less a tenth for its stabilisation"
    return _of_angle(float(max(size)), angle_deg, view == "L", sigma, source)


def _of_angle(length_px: float, angle_deg: float, linear: bool, sigma: float, source: str) -> _Lens:
    """Return the lens under which a length across the centre fills an angle."""
    half = np.radians(angle_deg) / 2
    radius = np.tan(half) if linear else half + _K1 * half**3
    k1 = 0.0 if linear else _K1
    return _Lens(focal_px=float(length_px / 2 / radius), focal_sigma=sigma, k1=k1, source=source)


def _fisheye(angle: FloatArray) -> tuple[float, float, float]:
    """Fit f, k1 and k2 of r = f (a + k1 a^3 + k2 a^5) to angles at the radii of _RADII."""
    columns = np.stack([angle, angle**3, angle**5], axis=1)
    f, c1, c2 = np.linalg.lstsq(columns, _RADII, rcond=None)[0].tolist()
    return f, c1 / f, c2 / f


def _text(settings: dict[str, Entry], key: str) -> str:
    entry = settings.get(key)
    return "" if entry is None else entry.data.decode("latin-1").strip("\0 ")
