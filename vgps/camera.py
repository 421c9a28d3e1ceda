"""Lens models: distorted pixels to pinhole pixels of the same K, and back.

The front end undistorts observations once; every later stage has a pinhole. Four models: ``pinhole``,
``opencv`` (radial and tangential, 4, 5 or 8 coefficients), ``fisheye`` (OpenCV's, k1..k4) and ``tsai``, whose
polynomial maps distorted to undistorted radii, Eq. (5)(6), Kume 2010.
"""

from functools import lru_cache
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from vgps.model import Camera, FloatArray, LensModel

WIDEST_DEG = 85.0
"""Angle from the axis of a fisheye beyond which nothing is used."""

_CRITERIA = (3, 100, 1e-12)  # iterations and epsilon; the default stops some hundredths of a pixel away
_ROUND_TRIP_PX = 0.01  # a point that misses itself by more after a round trip is outside the model's range


def undistort(camera: Camera, uv_px: npt.ArrayLike) -> FloatArray:
    """Return the pinhole pixels of distorted pixels; Eq. (5), Kume 2010, for ``tsai``.

    Args:
        camera: Intrinsics; the pinhole image has the same K.
        uv_px: (N, 2) distorted pixels.

    Returns:
        (N, 2) pinhole pixels; NaN where the lens model has no inverse (beyond its turning point).
    """
    uv = _pixels(uv_px)
    if camera.model == "pinhole" or len(uv) == 0:
        return uv
    if camera.model == "tsai":
        mm = _to_mm(camera, uv)
        factor, slope = _tsai(camera, np.hypot(*mm.T))
        return np.where((slope > 0)[:, None], _from_mm(camera, mm * factor[:, None]), np.nan)
    return _undistort_opencv(camera, uv)


def distort(camera: Camera, uv_px: npt.ArrayLike) -> FloatArray:
    """Return the distorted pixels of pinhole pixels: the inverse of `undistort`.

    Args:
        camera: Intrinsics.
        uv_px: (N, 2) pinhole pixels.

    Returns:
        (N, 2) distorted pixels; NaN where the lens model has no image.
    """
    uv = _pixels(uv_px)
    if camera.model == "pinhole" or len(uv) == 0:
        return uv
    if camera.model == "tsai":
        return _distort_tsai(camera, uv)
    rays = (uv - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    distorted = _distort_rays(camera, rays)
    return np.where((np.hypot(*rays.T) < turning_radius(camera))[:, None], distorted, np.nan)


def in_pinhole(uv_px: FloatArray, before: Camera, after: Camera) -> FloatArray:
    """Return undistorted pixels (N, 2) of one camera as those of the same rays in another."""
    rays = (uv_px - (before.cx, before.cy)) / (before.fx, before.fy)
    return np.asarray(rays * (after.fx, after.fy) + (after.cx, after.cy))


def project(camera: Camera, camera_p_points: npt.ArrayLike) -> FloatArray:
    """Return the distorted pixels of points in the camera frame; Eq. (4), Kume 2010, in OpenCV's axes.

    Args:
        camera: Intrinsics.
        camera_p_points: (N, 3) metres, x right, y down, z forward.

    Returns:
        (N, 2) pixels; NaN for points that are not in front of the camera.
    """
    points = np.asarray(camera_p_points, float).reshape(-1, 3)
    depth = np.where(points[:, 2] > 0, points[:, 2], np.nan)
    uv = points[:, :2] / depth[:, None] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    valid = np.isfinite(uv).all(axis=1)
    uv[valid], uv[~valid] = distort(camera, uv[valid]), np.nan
    return uv


@lru_cache(maxsize=64)
def turning_radius(camera: Camera) -> float:
    """Return the pinhole radius (tangent of the angle from the axis) of the largest image radius, or inf.

    Beyond it an ``opencv`` or ``fisheye`` polynomial folds back and maps points from outside into the image.
    A fisheye ends at :data:`WIDEST_DEG`: a pinhole image of what is at right angles to the axis has no end.
    """
    if camera.model in {"pinhole", "tsai"}:
        return np.inf
    roots = _radial_slope(camera).roots()
    real = roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)].real
    if camera.model == "opencv":
        return float(np.sqrt(real.min())) if len(real) else np.inf
    theta = np.sqrt(real.min()) if len(real) else np.inf
    return float(np.tan(min(theta, np.radians(WIDEST_DEG))))


def unused_share(camera: Camera) -> float:
    """Return the share of the picture that no ray belongs to, in which no features are used."""
    u, v = (np.arange(0.5, 64.0) / 64 * np.array([[camera.width], [camera.height]])) - 0.5
    u, v = np.meshgrid(u, v)
    return float(np.isnan(undistort(camera, np.column_stack([u.ravel(), v.ravel()]))[:, 0]).mean())


def centred_camera(
    model: LensModel, size: tuple[int, int], focal_px: float, radial: tuple[float, float] = (0.0, 0.0)
) -> Camera:
    """Return a camera with square pixels, its axis through the middle of the image, and k1 and k2.

    Args:
        model: ``opencv`` or ``fisheye``.
        size: Width and height, pixels.
        focal_px: Focal length.
        radial: k1 and k2.
    """
    width, height = size
    return Camera(
        model=model,
        width=width,
        height=height,
        fx=focal_px,
        fy=focal_px,
        cx=(width - 1) / 2,
        cy=(height - 1) / 2,
        distortion=(*radial, 0.0, 0.0),
    )


def row_shares(camera: Camera, uv_px: FloatArray) -> FloatArray:
    """Return the places (N,) of undistorted pixels (N, 2) in the readout: -1/2 first row, 1/2 last row.

    With ``readout_axis`` ``columns`` the sensor's rows are columns of the picture, the first one on the left.
    """
    axis, size = (0, camera.width) if camera.readout_axis == "columns" else (1, camera.height)
    v = distort(camera, uv_px)[:, axis]
    share = np.where(np.isfinite(v), v, uv_px[:, axis]) / max(size - 1.0, 1.0) - 0.5
    return np.asarray(np.clip(share, -0.5, 0.5))


def camera_fields(camera: Camera) -> dict[str, Any]:
    """Return the fields of ``camera.yaml`` for a camera."""
    names = ("model", "width", "height", "fx", "fy", "cx", "cy")
    fields: dict[str, Any] = {name: getattr(camera, name) for name in names}
    if camera.distortion:
        fields["distortion"] = list(camera.distortion)
    if camera.pixel_mm is not None:
        fields["pixel_mm"] = list(camera.pixel_mm)
    if camera.readout_s is not None:
        fields["readout_s"] = camera.readout_s
    if camera.readout_axis != "rows":
        fields["readout_axis"] = camera.readout_axis
    return fields


def _pixels(uv_px: npt.ArrayLike) -> FloatArray:
    return np.array(uv_px, np.float64).reshape(-1, 2)


def _undistort_opencv(camera: Camera, uv: FloatArray) -> FloatArray:
    K, coefficients = camera.K, np.array(camera.distortion, np.float64)
    invert = cv2.fisheye.undistortPoints if camera.model == "fisheye" else cv2.undistortPoints
    flat = invert(uv[:, None], K, coefficients, R=np.eye(3), P=K, criteria=_CRITERIA).reshape(-1, 2)
    rays = (flat - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    valid = np.isfinite(flat).all(axis=1) & (np.hypot(*rays.T) < turning_radius(camera))
    back = np.full_like(flat, np.inf)
    if valid.any():
        back[valid] = _distort_rays(camera, rays[valid])
    valid &= np.hypot(*(back - uv).T) < _ROUND_TRIP_PX
    return np.where(valid[:, None], flat, np.nan)


def _distort_rays(camera: Camera, rays: FloatArray) -> FloatArray:
    """Return the distorted pixels (N, 2) of rays (x / z, y / z), by OpenCV's models."""
    coefficients = np.array(camera.distortion, np.float64)
    if camera.model == "fisheye":
        return np.asarray(
            cv2.fisheye.distortPoints(rays[:, None], camera.K, coefficients), np.float64
        ).reshape(-1, 2)
    # by hand: OpenCV computes the derivatives too, which takes several times as long
    k1, k2, p1, p2, k3, k4, k5, k6 = (*camera.distortion, *(0.0,) * (8 - len(camera.distortion)))
    x, y = np.ascontiguousarray(rays.T)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        q, xy = x * x + y * y, 2.0 * x * y
        factor = 1.0 + q * (k1 + q * (k2 + q * k3))
        if k4 or k5 or k6:
            factor /= 1.0 + q * (k4 + q * (k5 + q * k6))
        u = x * factor + p1 * xy + p2 * (q + 2.0 * x * x)
        v = y * factor + p1 * (q + 2.0 * y * y) + p2 * xy
    return np.stack([camera.fx * u + camera.cx, camera.fy * v + camera.cy], axis=1)


def _radial_slope(camera: Camera) -> np.polynomial.Polynomial:
    """Return the numerator of d(distorted radius)/d(radius or angle) as a polynomial of its square."""
    if camera.model == "fisheye":
        return np.polynomial.Polynomial([1.0, *(k * (2 * i + 3) for i, k in enumerate(camera.distortion))])
    k1, k2, _, _, k3, k4, k5, k6 = (*camera.distortion, *(0.0,) * (8 - len(camera.distortion)))
    above, below = np.polynomial.Polynomial([1, k1, k2, k3]), np.polynomial.Polynomial([1, k4, k5, k6])
    q = np.polynomial.Polynomial([0, 1])
    return above * below + 2 * q * (above.deriv() * below - above * below.deriv())


def _to_mm(camera: Camera, uv: FloatArray) -> FloatArray:
    return (uv - (camera.cx, camera.cy)) * _pixel_mm(camera)


def _from_mm(camera: Camera, mm: FloatArray) -> FloatArray:
    return np.asarray(mm / _pixel_mm(camera) + (camera.cx, camera.cy), np.float64)


def _pixel_mm(camera: Camera) -> FloatArray:
    assert camera.pixel_mm is not None, "a tsai camera has pixel_mm"
    return np.array(camera.pixel_mm)


def _tsai(camera: Camera, rho_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the factor 1 + k1 rho^2 + k2 rho^4 of Eq. (5) and the slope of the undistorted radius."""
    k1, k2 = camera.distortion
    q = rho_mm**2
    return 1 + k1 * q + k2 * q**2, 1 + 3 * k1 * q + 5 * k2 * q**2


def _distort_tsai(camera: Camera, uv: FloatArray) -> FloatArray:
    """Solve rho (1 + k1 rho^2 + k2 rho^4) = undistorted radius by Newton's method."""
    mm = _to_mm(camera, uv)
    target = np.hypot(*mm.T)
    rho = target.copy()
    for _ in range(50):
        factor, slope = _tsai(camera, rho)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            rho = rho - (rho * factor - target) / slope
    factor, slope = _tsai(camera, rho)
    valid = (np.abs(rho * factor - target) < 1e-9 * (1 + target)) & (slope > 0) & (factor > 0)
    scale = np.where(valid, 1 / np.where(valid, factor, 1), np.nan)
    return _from_mm(camera, mm * scale[:, None])
