"""What the renderer draws on, with a depth buffer."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from vgps.model import FloatArray
from vgps.simulate.fisheye import RayGrid
from vgps.simulate.polygons import Polygon, cut, frustum
from vgps.simulate.textures import Image

_BAND = 1.8  # range of depths (a ratio) drawn from one filtered size of a texture
_COVERED = 120  # alpha; a little below one half, so that there are no gaps between neighbours
_HAZE = np.array([228, 220, 212, 255], np.uint8).view(np.uint32)[0]


class Box(NamedTuple):
    """Pixels of a canvas from (left, top) to (right, bottom), exclusive."""

    left: int
    top: int
    right: int
    bottom: int


class DepthBand(NamedTuple):
    """A range of depths by which polygons are cut, and its inverse depths as limits of pixels."""

    low_m: float
    high_m: float
    limits: tuple[float, float]

    def part(self, polygon: Polygon) -> Polygon:
        """Return the part of a polygon within the band."""
        if math.isfinite(self.limits[1]):
            polygon = cut(polygon, (0.0, 0.0, 1.0), self.low_m)
        if self.limits[0] > 0.0:
            polygon = cut(polygon, (0.0, 0.0, -1.0), -self.high_m)
        return polygon


class Canvas(NamedTuple):
    """What is drawn on: the image (H, W, 4), inverse depths (H, W), and the camera.

    ``K`` maps rays (x / z, y / z, 1) to coordinates in which a plane is a homography away: pixels of a
    pinhole; of a fisheye the rays themselves, which ``grid`` has for its pixels.
    """

    image: Image
    inverse_depth: npt.NDArray[np.float32]
    K: FloatArray
    grid: RayGrid | None = None

    @classmethod
    def empty(cls, width: int, height: int, K: FloatArray, grid: RayGrid | None = None) -> "Canvas":
        """Return a canvas of haze."""
        image = np.full((height, width), _HAZE, np.uint32).view(np.uint8).reshape(height, width, 4)
        return cls(image, np.zeros((height, width), np.float32), K, grid)

    def sides(self) -> FloatArray:
        """Return (5, 3) inward normals of the view's sides, and the view axis."""
        height, width = self.inverse_depth.shape
        return frustum(self.K, width, height) if self.grid is None else self.grid.sides()

    def paint(
        self, box: Box, patch: Image, inverse_depth: npt.NDArray[np.float32], limits: tuple[float, float]
    ) -> None:
        """Paint a patch where it is opaque, nearer than what is there, and within limits of inverse depth."""
        behind = self.inverse_depth[box.top : box.bottom, box.left : box.right]
        visible = inverse_depth > behind
        visible &= cv2.extractChannel(patch, 3) >= _COVERED
        if limits[0] > 0:
            visible &= inverse_depth >= limits[0]
        if limits[1] < math.inf:
            visible &= inverse_depth < limits[1]
        mask = visible.view(np.uint8)
        cv2.copyTo(inverse_depth, mask, behind)
        cv2.copyTo(patch, mask, self.image[box.top : box.bottom, box.left : box.right])

    def hides(self, box: Box, nearest_m: float) -> bool:
        """Return whether everything in a box is nearer than this."""
        farthest, *_ = cv2.minMaxLoc(self.inverse_depth[box.top : box.bottom, box.left : box.right])
        return farthest > 1 / nearest_m


def depth_bands(near_m: float, far_m: float) -> Iterator[DepthBand]:
    """Yield bands of depth, each drawn from one filtered size of a texture."""
    bands = max(1, math.ceil(math.log(far_m / near_m) / math.log(_BAND)))
    ratio = (far_m / near_m) ** (1 / bands)
    for k in range(bands):
        low, high = near_m * ratio**k, near_m * ratio ** (k + 1)
        limits = (0.0 if k == bands - 1 else 1 / high, math.inf if k == 0 else 1 / low)
        yield DepthBand(low, high, limits)
