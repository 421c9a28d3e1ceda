"""Rendering of textured parallelograms: exact homographies, filtered textures, depth, motion blur."""

import math
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from scipy.signal import detrend

from vgps.model import FloatArray
from vgps.simulate.motion import Motion
from vgps.simulate.ripmap import Ripmap
from vgps.simulate.scene import SceneConfig
from vgps.simulate.textures import Image
from vgps.simulate.world import World

Picture = npt.NDArray[np.uint8]  # (H, W, 3) blue, green, red

_NEAR_M = 0.15
_BAND = 1.8  # range of depths (a ratio) drawn from one filtered size of a texture
_COVERED = 120  # alpha; a little below one half, so that there are no gaps between neighbours
_HAZE = np.array([228, 220, 212, 255], np.uint8).view(np.uint32)[0]
_MOTION_DEPTH_M = 4.0
_FEW = 6  # up to this number, instants are drawn at twice the size
_Polygon = list[tuple[float, float, float]]


class _Canvas(NamedTuple):
    """What is drawn on: the image (H, W, 4), inverse depths (H, W), and the calibration matrix."""

    image: Image
    inverse_depth: npt.NDArray[np.float32]
    K: FloatArray


class Renderer:
    """Renders the frames of the scene's camera.

    A frame is the mean, in linear light, of instants spread over its exposure, about one for each pixel of
    image motion, up to ``max_samples``. Each instant draws every visible parallelogram through its
    homography, from a texture filtered for its distance, with a depth buffer. For smooth edges, a few
    instants are drawn at twice the size, many with displacements within the pixel.
    """

    def __init__(self, world: World, motion: Motion, config: SceneConfig, seed: int = 0) -> None:
        self._world, self._motion, self._config, self._seed = world, motion, config, seed
        repeating = set(world.texture[world.repeat > 1].tolist())
        self._textures = [Ripmap(image, k in repeating) for k, image in enumerate(world.textures)]

    @property
    def K(self) -> FloatArray:
        """(3, 3) calibration matrix; pixel centres are at whole coordinates."""
        config = self._config
        f, cx, cy = config.focal_px, (config.width - 1) / 2, (config.height - 1) / 2
        return np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])

    def frame(self, index: int) -> Picture:
        """Render a frame, exposed around its time stamp, with the sensor's noise."""
        t, exposure = index / self._config.fps, self._config.exposure_s
        count = self.samples(t)
        times = t + exposure * ((np.arange(count) + 0.5) / count - 0.5)
        zoom = 2 if count <= _FEW else 1
        size = (self._config.width, self._config.height)
        total = np.zeros((size[1], size[0], 4), np.float32)
        for time, pose, shift in zip(times, self._motion.poses(times), _shifts(count) / zoom, strict=True):
            view = self.view(pose, float(time), shift, zoom)
            cv2.accumulateSquare(cv2.resize(view, size, interpolation=cv2.INTER_AREA), total)  # gamma 2
        rng = np.random.default_rng([self._seed, 7, index])
        grain = rng.standard_normal((size[1], size[0]), dtype=np.float32) * np.float32(
            self._config.noise_levels
        )
        picture = cv2.sqrt(cv2.cvtColor(total, cv2.COLOR_BGRA2BGR) / np.float32(count))
        return np.asarray(
            cv2.add(picture, cv2.cvtColor(grain, cv2.COLOR_GRAY2BGR), dtype=cv2.CV_8U), np.uint8
        )

    def samples(self, t_s: float) -> int:
        """Return the number of instants of the frame at a time, from the image motion in its exposure."""
        config, K = self._config, self.K
        begin, end = self._motion.poses(t_s + config.exposure_s * np.array([-0.5, 0.5]))
        u, v = np.meshgrid([0.0, config.width / 2, config.width], [0.0, config.height / 2, config.height])
        pixels = np.stack([u.ravel(), v.ravel(), np.ones(u.size)])
        points = np.append(_MOTION_DEPTH_M * np.linalg.inv(K) @ pixels, np.ones((1, u.size)), axis=0)
        projected = K @ (np.linalg.inv(end) @ begin @ points)[:3]
        moved = np.hypot(*(projected[:2] / np.maximum(projected[2], 0.5) - pixels[:2])).max()
        return int(np.clip(math.ceil(moved), 1, config.max_samples))

    def view(self, world_T_camera: FloatArray, t_s: float, shift_px: FloatArray, zoom: int) -> Image:
        """Render an instant at ``zoom`` times the size, with rays ``shift_px`` from the pixel centres."""
        width, height = zoom * self._config.width, zoom * self._config.height
        K = np.array([[zoom, 0, (zoom - 1) / 2], [0, zoom, (zoom - 1) / 2], [0, 0, 1]]) @ self.K
        K[:2, 2] -= zoom * shift_px
        frustum = _frustum(K, width, height)
        R, center = world_T_camera[:3, :3], world_T_camera[:3, 3]
        origin, u, v = (self._world.origins(t_s) - center) @ R, self._world.edge_u @ R, self._world.edge_v @ R
        corners = np.stack([origin, origin + u, origin + u + v, origin + v], axis=1)
        facing = np.einsum("qi,qi->q", origin, np.cross(u, v))
        within = corners @ frustum.T > np.array([0, 0, 0, 0, _NEAR_M])
        inside, whole = np.all(np.any(within, axis=1), axis=1), np.all(within, axis=(1, 2))
        drawn = np.flatnonzero(inside & ((facing > 1e-9) | (self._world.two_sided & (np.abs(facing) > 1e-9))))
        texture_h_px = np.linalg.inv(K @ np.stack([u[drawn], v[drawn], origin[drawn]], axis=-1))
        repeat = self._world.repeat[drawn, None]
        texture_h_px[:, 0] *= repeat
        texture_h_px[:, 1] *= repeat
        image = np.full((height, width), _HAZE, np.uint32).view(np.uint8).reshape(height, width, 4)
        canvas = _Canvas(image, np.zeros((height, width), np.float32), K)
        planes = [(float(a), float(b), float(c)) for a, b, c in frustum]
        front_to_back = np.argsort(np.linalg.norm(corners[drawn].mean(axis=1), axis=-1))
        for row, H in zip(drawn[front_to_back], texture_h_px[front_to_back], strict=True):
            polygon = [tuple(corner) for corner in corners[row].tolist()]
            if not whole[row]:
                polygon = _clipped(polygon, planes)
            if polygon:
                _draw(canvas, self._textures[self._world.texture[row]], polygon, H)
        return image


def _draw(canvas: _Canvas, texture: Ripmap, polygon: _Polygon, H: FloatArray) -> None:
    """Draw a convex polygon (camera frame, in view); H maps pixels (u, v, 1) to texture (a, b, 1) / depth."""
    near, far = min(p[2] for p in polygon), max(p[2] for p in polygon)
    bands = max(1, math.ceil(math.log(far / near) / math.log(_BAND)))
    ratio = (far / near) ** (1 / bands)
    for k in range(bands):
        low, high = near * ratio**k, near * ratio ** (k + 1)
        part = polygon
        if k > 0:
            part = _cut(part, (0.0, 0.0, 1.0), low)
        if k < bands - 1:
            part = _cut(part, (0.0, 0.0, -1.0), -high)
        if part:
            limits = (0.0 if k == bands - 1 else 1 / high, math.inf if k == 0 else 1 / low)
            _draw_band(canvas, texture, part, H, limits)


def _draw_band(
    canvas: _Canvas, texture: Ripmap, part: _Polygon, H: FloatArray, limits: tuple[float, float]
) -> None:
    """Draw the part of a parallelogram between two inverse depths, from one size of its texture."""
    image, inverse_depth, K = canvas
    f, cx, cy = K[0, 0], K[0, 2], K[1, 2]
    us, vs = [f * x / z + cx for x, _, z in part], [f * y / z + cy for _, y, z in part]
    left, top = max(0, math.floor(min(us))), max(0, math.floor(min(vs)))
    right, bottom = min(image.shape[1], math.ceil(max(us)) + 1), min(image.shape[0], math.ceil(max(vs)) + 1)
    if right <= left or bottom <= top:
        return
    behind = inverse_depth[top:bottom, left:right]
    if behind.min() > 1 / min(p[2] for p in part):
        return  # hidden
    H = H @ np.array([[1, 0, left], [0, 1, top], [0, 0, 1]])
    size = (right - left, bottom - top)
    patch = texture.warped(H, size, sum(us) / len(us) - left, sum(vs) / len(vs) - top)
    g = H[2].astype(np.float32)
    here = (g[0] * np.arange(size[0], dtype=np.float32))[None, :] + (
        g[1] * np.arange(size[1], dtype=np.float32) + g[2]
    )[:, None]
    visible = here > behind
    visible &= cv2.extractChannel(patch, 3) >= _COVERED
    if limits[0] > 0:
        visible &= here >= limits[0]
    if limits[1] < math.inf:
        visible &= here < limits[1]
    mask = visible.view(np.uint8)
    cv2.copyTo(here, mask, behind)
    cv2.copyTo(patch, mask, image[top:bottom, left:right])


def _shifts(count: int) -> FloatArray:
    """Return (count, 2) offsets that cover a pixel evenly (the R2 sequence), without mean or trend over time.

    A trend would lengthen or shorten the motion blur.
    """
    golden = np.array([0.7548776662466927, 0.5698402909980532])
    shifts = (np.arange(count)[:, None] * golden) % 1.0
    return np.asarray(detrend(shifts, axis=0, type="linear" if count > 2 else "constant"))


def _frustum(K: FloatArray, width: int, height: int) -> FloatArray:
    """Return (5, 3) inward normals of the view's sides, a pixel wider than the image, and the view axis."""
    f, cx, cy = K[0, 0], K[0, 2], K[1, 2]
    return np.array([[f, 0, cx + 1], [-f, 0, width - cx], [0, f, cy + 1], [0, -f, height - cy], [0, 0, 1.0]])


def _clipped(polygon: _Polygon, planes: list[tuple[float, float, float]]) -> _Polygon:
    """Return the part of a polygon within the view."""
    for k, plane in enumerate(planes):
        polygon = _cut(polygon, plane, _NEAR_M if k == len(planes) - 1 else 0.0)
        if not polygon:
            break
    return polygon


def _cut(polygon: _Polygon, normal: tuple[float, float, float], least: float) -> _Polygon:
    """Return the part of a convex polygon with ``normal . p >= least`` (Sutherland and Hodgman 1974)."""
    a, b, c = normal
    heights = [a * x + b * y + c * z - least for x, y, z in polygon]
    kept: _Polygon = []
    for k, (p, h) in enumerate(zip(polygon, heights, strict=True)):
        q, g = polygon[k - 1], heights[k - 1]
        if (h >= 0) != (g >= 0):
            s = g / (g - h)
            kept.append((q[0] + s * (p[0] - q[0]), q[1] + s * (p[1] - q[1]), q[2] + s * (p[2] - q[2])))
        if h >= 0:
            kept.append(p)
    return kept
