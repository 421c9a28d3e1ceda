"""Lenses that see beyond 90 degrees off their axis: where a ray in any direction falls in the picture."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vgps.model import Camera, FloatArray

_AROUND = ("front", "right", "rear", "left")


class WideLens(Protocol):
    """A lens whose picture no single pinhole view holds."""

    @property
    def width(self) -> int:
        """Width of its picture in pixels."""
        ...

    @property
    def height(self) -> int:
        """Height of its picture in pixels."""
        ...

    @property
    def focal_px(self) -> float:
        """Pixels per radian in the middle of the picture."""
        ...

    @property
    def faces(self) -> tuple[str, ...]:
        """Names of the faces of a cube through which it is seen."""
        ...

    def pixels(self, rays: FloatArray) -> FloatArray:
        """Return the pixels (N, 2) of directions (N, 3), NaN where the lens does not see."""
        ...


@dataclass(frozen=True)
class Equirectangular:
    """A picture of the whole sphere: columns are longitudes, rows latitudes, the front in the middle.

    The faces above and below are left out: there are the sky and who carries the camera.
    """

    width: int
    height: int
    faces: tuple[str, ...] = _AROUND

    @property
    def focal_px(self) -> float:
        """Pixels per radian."""
        return self.width / (2.0 * np.pi)

    def pixels(self, rays: FloatArray) -> FloatArray:
        """Return the pixels (N, 2) of directions (N, 3); u is from -0.5 to width - 0.5."""
        x, y, z = rays.T
        longitude, latitude = np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))
        u = (longitude / (2.0 * np.pi) + 0.5) * self.width - 0.5
        v = (latitude / np.pi + 0.5) * self.height - 0.5
        return np.column_stack([u, np.clip(v, 0.0, self.height - 1.0)])


@dataclass(frozen=True)
class WideFisheye:
    """A calibrated fisheye (OpenCV's model, k1..k4): a circle that reaches the farther sides of its picture.

    It ends where the polynomial turns back, if that is nearer. What a fisheye whose circle is larger shows in
    the corners is left out, since most are black there.
    """

    camera: Camera
    faces: tuple[str, ...] = ("front", "right", "left", "up", "down")

    @property
    def width(self) -> int:
        """Width of its picture in pixels."""
        return self.camera.width

    @property
    def height(self) -> int:
        """Height of its picture in pixels."""
        return self.camera.height

    @property
    def focal_px(self) -> float:
        """Pixels per radian on the axis."""
        return self.camera.fx

    def pixels(self, rays: FloatArray) -> FloatArray:
        """Return the pixels (N, 2) of directions (N, 3), NaN outside the picture; OpenCV's fisheye model."""
        camera = self.camera
        across = np.hypot(rays[:, 0], rays[:, 1])
        theta = np.arctan2(across, rays[:, 2])
        scale = _radius(camera, theta) / np.maximum(across, 1e-12)
        uv = rays[:, :2] * scale[:, None] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
        inside = ((uv >= 0.0) & (uv <= (camera.width - 1.0, camera.height - 1.0))).all(axis=1)
        inside &= (theta < _last_angle(camera)) & (scale * across <= _circle(camera))
        return np.where(inside[:, None], uv, np.nan)


def wide_fisheye(camera: Camera) -> WideFisheye | None:
    """Return the lens of a fisheye that sees what is at right angles to its axis, right and left or above
    and below; None for others, which one pinhole view holds but for corners."""
    if camera.model != "fisheye":
        return None
    square = np.pi / 2.0
    if _last_angle(camera) <= square or _radius(camera, np.array([square]))[0] >= _circle(camera):
        return None
    return WideFisheye(camera)


def _circle(camera: Camera) -> float:
    """Return the distance from the axis to the farther sides of the picture, of focal length 1."""
    to_sides = min(camera.cx, camera.width - 1 - camera.cx) / camera.fx
    return max(to_sides, min(camera.cy, camera.height - 1 - camera.cy) / camera.fy)


def _radius(camera: Camera, theta: FloatArray) -> FloatArray:
    """Return the radii on a plane of focal length 1 of angles from the axis."""
    square = theta**2
    polynomial = np.polynomial.polynomial.polyval(square, [1.0, *camera.distortion])
    return np.asarray(theta * polynomial)


def _last_angle(camera: Camera) -> float:
    """Return the angle at which the radius stops growing, at most that of what is behind."""
    slope = [1.0, *(k * (2 * i + 3) for i, k in enumerate(camera.distortion))]
    roots = np.polynomial.Polynomial(slope).roots()
    real = roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)].real
    return float(min(np.sqrt(real.min()), np.pi)) if len(real) else float(np.pi)
