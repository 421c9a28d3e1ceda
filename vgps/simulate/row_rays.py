"""Views in which every row has its own pose: a rolling shutter, rendered ray by ray.

The map of a parallelogram from pixels to its texture changes smoothly from row to row. It is computed
exactly for some rows and interpolated between them; every pixel then samples the texture along the ray of its
own row.
"""

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from vgps.model import FloatArray
from vgps.simulate.canvas import Box, Canvas, depth_bands
from vgps.simulate.faces import faces_in_view, texture_maps
from vgps.simulate.polygons import Polygon
from vgps.simulate.ripmap import Ripmap
from vgps.simulate.world import World

KNOTS = 33  # rows with exact maps; at 4000 deg/s^2 the others are off by less than 0.01 px
_MARGIN_PX = 4  # by which a parallelogram may exceed the boxes around it at the first, middle and last row


def draw_rows(
    canvas: Canvas, world: World, textures: Sequence[Ripmap], poses: FloatArray, t_s: FloatArray
) -> None:
    """Draw everything in view, each row as seen at its own time.

    Args:
        canvas: An empty canvas.
        world: The parallelograms.
        textures: Their textures.
        poses: (KNOTS, 4, 4) world_T_camera at evenly spaced rows, the first to the last.
        t_s: (KNOTS,) their times.
    """
    views = [faces_in_view(world, canvas, poses[k], float(t_s[k])) for k in (0, KNOTS // 2, KNOTS - 1)]
    polygons: dict[int, list[Polygon]] = {}
    nearest: dict[int, float] = {}
    for view in views:
        for k, (row, distance) in enumerate(zip(view.row.tolist(), view.distance.tolist(), strict=True)):
            polygons.setdefault(row, []).append(view.polygon(k))
            nearest[row] = min(distance, nearest.get(row, np.inf))
    rows = np.array(sorted(polygons, key=nearest.__getitem__), dtype=np.int64)
    maps = [texture_maps(world, rows, canvas.K, poses[k], float(t_s[k])) for k in range(KNOTS)]
    for row, H in zip(rows.tolist(), np.stack(maps, axis=1), strict=True):
        _draw(canvas, textures[world.texture[row]], [p for p in polygons[row] if p], H)


def _draw(canvas: Canvas, texture: Ripmap, polygons: Sequence[Polygon], H: FloatArray) -> None:
    """Draw a parallelogram, in view as these polygons at some rows, with maps (KNOTS, 3, 3) of rows."""
    depths = [p[2] for polygon in polygons for p in polygon]
    if not depths:
        return
    for band in depth_bands(min(depths), max(depths)):
        corners = np.array([p for polygon in polygons for p in band.part(polygon)]).reshape(-1, 3)
        if not len(corners):
            continue
        uv = canvas.K[0, 0] * corners[:, :2] / corners[:, 2:] + canvas.K[:2, 2]
        box = _box(uv, canvas)
        if box.right <= box.left or box.bottom <= box.top or canvas.hides(box, corners[:, 2].min()):
            continue
        a, b, inverse_depth = _rays(H, box, len(canvas.image))
        middle = H[round((KNOTS - 1) * float(np.clip(uv[:, 1].mean() / (len(canvas.image) - 1), 0, 1)))]
        patch = texture.looked_up(a, b, texture.density(middle, *uv.mean(axis=0).tolist())[2])
        canvas.paint(box, patch, inverse_depth, band.limits)


def _box(uv: FloatArray, canvas: Canvas) -> Box:
    height, width = canvas.inverse_depth.shape
    left, top = np.maximum(np.floor(uv.min(axis=0)).astype(int) - _MARGIN_PX, 0).tolist()
    right, bottom = np.minimum(np.ceil(uv.max(axis=0)).astype(int) + _MARGIN_PX + 1, (width, height)).tolist()
    return Box(left, top, right, bottom)


def _rays(H: FloatArray, box: Box, height: int) -> tuple[npt.NDArray[np.float32], ...]:
    """Return texture coordinates a, b and inverse depths of the pixels of a box."""
    v = np.arange(box.top, box.bottom)
    at = v * ((KNOTS - 1.0) / (height - 1.0))
    before = np.minimum(at.astype(np.int64), KNOTS - 2)
    share = (at - before)[:, None, None]
    G = (1.0 - share) * H[before] + share * H[before + 1]
    along = G[..., 0].astype(np.float32)
    start = (G[..., 1] * v[:, None] + G[..., 2] + G[..., 0] * box.left).astype(np.float32)
    u = np.arange(box.right - box.left, dtype=np.float32)
    a, b, inverse_depth = (along[:, i, None] * u + start[:, i, None] for i in range(3))
    depth = 1.0 / np.maximum(inverse_depth, np.float32(1e-6))
    return cv2.multiply(a, depth), cv2.multiply(b, depth), inverse_depth
