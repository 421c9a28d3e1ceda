"""Rendering of textured parallelograms: exact homographies, filtered textures, depth, motion blur."""

import math

import cv2
import numpy as np
import numpy.typing as npt
from scipy.signal import detrend

from vgps.model import FloatArray
from vgps.simulate.canvas import Box, Canvas, depth_bands
from vgps.simulate.faces import faces_in_view, texture_maps
from vgps.simulate.fisheye import Fisheye, ray_grid
from vgps.simulate.motion import Motion, MountedMotion
from vgps.simulate.polygons import Polygon
from vgps.simulate.ripmap import Ripmap
from vgps.simulate.row_rays import KNOTS, draw_rows
from vgps.simulate.scene import SceneConfig
from vgps.simulate.textures import Image
from vgps.simulate.world import World

Picture = npt.NDArray[np.uint8]  # (H, W, 3) blue, green, red

_MOTION_DEPTH_M = 4.0
_FEW = 6  # up to this number, instants are drawn at twice the size


class Renderer:
    """Renders the frames of the scene's camera.

    A frame is the mean, in linear light, of instants spread over its exposure, about one for each pixel of
    image motion, up to ``max_samples``. Each instant draws every visible parallelogram through its
    homography, from a texture filtered for its distance, with a depth buffer. For smooth edges, a few
    instants are drawn at twice the size, many with displacements within the pixel.
    """

    def __init__(
        self, world: World, motion: Motion | MountedMotion, config: SceneConfig, seed: int = 0
    ) -> None:
        self._world, self._motion, self._config, self._seed = world, motion, config, seed
        repeating = set(world.texture[world.repeat > 1].tolist())
        self.fisheye: Fisheye | None = None
        if config.fisheye_deg:
            self.fisheye = Fisheye.of_diagonal(config.fisheye_deg, config.width, config.height)
        self._textures = [Ripmap(image, k in repeating) for k, image in enumerate(world.textures)]

    @property
    def K(self) -> FloatArray:
        """(3, 3) calibration matrix; pixel centres are at whole coordinates."""
        config = self._config
        f = config.focal_px if self.fisheye is None else self.fisheye.focal_px
        cx, cy = (config.width - 1) / 2, (config.height - 1) / 2
        return np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])

    def frame(self, index: int) -> Picture:
        """Render a frame, exposed around its time stamp, with the sensor's noise."""
        t, exposure = index / self._config.fps, self._config.exposure_s
        count = self.samples(t)
        times = t + exposure * ((np.arange(count) + 0.5) / count - 0.5)
        zoom = 2 if count <= _FEW else 1
        size = (self._config.width, self._config.height)
        total = np.zeros((size[1], size[0], 4), np.float32)
        rays = self._config.readout_s != 0.0 or self.fisheye is not None
        render = self.rolling_view if rays else self.view
        for time, shift in zip(times.tolist(), _shifts(count) / zoom, strict=True):
            view = render(time, shift, zoom)
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
        rays = np.linalg.inv(K) @ pixels
        if self.fisheye is not None:
            rays[:2] = self.fisheye.rays(pixels[:2].T).T
        points = np.append(_MOTION_DEPTH_M * rays, np.ones((1, u.size)), axis=0)
        seen = (np.linalg.inv(end) @ begin @ points)[:3]
        projected = K @ seen
        uv = projected[:2] / np.maximum(projected[2], 0.5)
        if self.fisheye is not None:
            uv = self.fisheye.pixels(seen.T).T
        moved = np.hypot(*(uv - pixels[:2])).max()
        return int(np.clip(math.ceil(moved), 1, config.max_samples))

    def view(self, t_s: float, shift_px: FloatArray, zoom: int) -> Image:
        """Render an instant at ``zoom`` times the size, with rays ``shift_px`` from the pixel centres."""
        world_T_camera = self._motion.poses(np.array([t_s]))[0]
        canvas = self._canvas(shift_px, zoom)
        faces = faces_in_view(self._world, canvas, world_T_camera, t_s)
        H = texture_maps(self._world, faces.row, canvas.K, world_T_camera, t_s)
        front_to_back = np.argsort(faces.distance)
        for k in front_to_back.tolist():
            polygon = faces.polygon(k)
            if polygon:
                _draw(canvas, self._textures[self._world.texture[faces.row[k]]], polygon, H[k])
        return canvas.image

    def rolling_view(self, t_s: float, shift_px: FloatArray, zoom: int) -> Image:
        """Render ray by ray, each row at its own time, the middle one at ``t_s``; else as :meth:`view`."""
        canvas = self._canvas(shift_px, zoom)
        height = self._config.height
        rows = (zoom * height - 1) / (zoom * (height - 1))  # from the canvas's first row to its last
        times = t_s + self._config.readout_s * rows * np.linspace(-0.5, 0.5, KNOTS)
        draw_rows(canvas, self._world, self._textures, self._motion.poses(times), times)
        return canvas.image

    def _canvas(self, shift_px: FloatArray, zoom: int) -> Canvas:
        K = np.array([[zoom, 0, (zoom - 1) / 2], [0, zoom, (zoom - 1) / 2], [0, 0, 1]]) @ self.K
        K[:2, 2] -= zoom * shift_px
        size = zoom * self._config.width, zoom * self._config.height
        if self.fisheye is None:
            return Canvas.empty(*size, K)
        grid = ray_grid(zoom * self.fisheye.focal_px, (K[0, 2], K[1, 2]), size)
        return Canvas.empty(*size, np.eye(3), grid)


def _draw(canvas: Canvas, texture: Ripmap, polygon: Polygon, H: FloatArray) -> None:
    """Draw a convex polygon (camera frame, in view); H maps pixels (u, v, 1) to texture (a, b, 1) / depth."""
    for band in depth_bands(min(p[2] for p in polygon), max(p[2] for p in polygon)):
        part = band.part(polygon)
        if part:
            _draw_band(canvas, texture, part, H, band.limits)


def _draw_band(
    canvas: Canvas, texture: Ripmap, part: Polygon, H: FloatArray, limits: tuple[float, float]
) -> None:
    """Draw the part of a parallelogram between two inverse depths, from one size of its texture."""
    image, K = canvas.image, canvas.K
    f, cx, cy = K[0, 0], K[0, 2], K[1, 2]
    us, vs = [f * x / z + cx for x, _, z in part], [f * y / z + cy for _, y, z in part]
    left, top = max(0, math.floor(min(us))), max(0, math.floor(min(vs)))
    right, bottom = min(image.shape[1], math.ceil(max(us)) + 1), min(image.shape[0], math.ceil(max(vs)) + 1)
    if right <= left or bottom <= top:
        return
    box = Box(left, top, right, bottom)
    if canvas.hides(box, min(p[2] for p in part)):
        return
    H = H @ np.array([[1, 0, left], [0, 1, top], [0, 0, 1]])
    size = (right - left, bottom - top)
    patch = texture.warped(H, size, sum(us) / len(us) - left, sum(vs) / len(vs) - top)
    g = H[2].astype(np.float32)
    here = (g[0] * np.arange(size[0], dtype=np.float32))[None, :] + (
        g[1] * np.arange(size[1], dtype=np.float32) + g[2]
    )[:, None]
    canvas.paint(box, patch, here, limits)


def _shifts(count: int) -> FloatArray:
    """Return (count, 2) offsets that cover a pixel evenly (the R2 sequence), without mean or trend over time.

    A trend would lengthen or shorten the motion blur.
    """
    golden = np.array([0.7548776662466927, 0.5698402909980532])
    shifts = (np.arange(count)[:, None] * golden) % 1.0
    return np.asarray(detrend(shifts, axis=0, type="linear" if count > 2 else "constant"))
