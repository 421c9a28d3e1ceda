"""Views in which every row has its own pose: a rolling shutter, rendered ray by ray.

The map of a parallelogram from pixels to its texture changes smoothly from row to row. It is computed
exactly for some rows and interpolated between them; every pixel then samples the texture along the ray of its
own row.
"""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from vgps.model import FloatArray, IntArray
from vgps.simulate.canvas import Box, Canvas, depth_bands
from vgps.simulate.faces import faces_in_view, texture_maps
from vgps.simulate.fisheye import pieces
from vgps.simulate.polygons import Polygon
from vgps.simulate.ripmap import Ripmap
from vgps.simulate.world import World

KNOTS = 33  # rows with exact maps; at 4000 deg/s^2 the others are off by less than 0.01 px
_BEND = 0.1  # by which the edges of a piece may bulge out of the box around its corners, of its size
_GRID_PX = 32  # boxes of pieces lie on such a grid, so that those of several rows coincide
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
        polygons_in_band = [band.part(polygon) for polygon in polygons]
        if canvas.grid is None:
            parts = [[p for polygon in polygons_in_band for p in polygon]]
        else:
            parts = [piece for polygon in polygons_in_band for piece in pieces(polygon)]
        for part in _boxed([part for part in parts if part], canvas):
            _draw_part(canvas, texture, part, band.limits, H)


class _Part(NamedTuple):
    """A box that a part of a parallelogram may fill, the middle of its corners (2,), and its least depth."""

    box: Box
    middle_px: FloatArray
    nearest_m: float


def _boxed(parts: Sequence[Polygon], canvas: Canvas) -> list[_Part]:
    """Return the parts within the canvas; of those that share a box the first."""
    if not parts:
        return []
    corners, counts = np.concatenate(parts), np.array([len(part) for part in parts])
    first = np.cumsum(counts) - counts
    uv = _pixels(canvas, corners)
    boxes = _boxes(np.minimum.reduceat(uv, first), np.maximum.reduceat(uv, first), canvas).tolist()
    middles = np.add.reduceat(uv, first) / counts[:, None]
    nearest = np.minimum.reduceat(corners[:, 2], first).tolist()
    found: dict[Box, _Part] = {}
    for box, middle, depth in zip(map(Box._make, boxes), middles, nearest, strict=True):
        if box.left < box.right and box.top < box.bottom:
            found.setdefault(box, _Part(box, middle, depth))
    return list(found.values())


def _draw_part(
    canvas: Canvas, texture: Ripmap, part: _Part, limits: tuple[float, float], H: FloatArray
) -> None:
    """Draw what lies within limits of inverse depth in the box of a part."""
    if canvas.hides(part.box, part.nearest_m):
        return
    a, b, inverse_depth = _rays(H, part.box, canvas)
    at = part.middle_px
    middle = H[round((KNOTS - 1) * float(np.clip(at[1] / (len(canvas.image) - 1), 0, 1)))]
    if canvas.grid is not None:
        middle = middle @ canvas.grid.flat_at(at)
    patch = texture.looked_up(a, b, texture.density(middle, *at.tolist())[2])
    canvas.paint(part.box, patch, inverse_depth, limits)


def _pixels(canvas: Canvas, camera_p: FloatArray) -> FloatArray:
    if canvas.grid is not None:
        return canvas.grid.lens.pixels(camera_p)
    return np.asarray(canvas.K[0, 0] * camera_p[:, :2] / camera_p[:, 2:] + canvas.K[:2, 2])


def _boxes(low_px: FloatArray, high_px: FloatArray, canvas: Canvas) -> IntArray:
    """Return boxes (n, 4) around parts between lowest and highest pixels (n, 2), as the fields of a Box."""
    height, width = canvas.inverse_depth.shape
    low, high = np.floor(low_px).astype(np.int64), np.ceil(high_px).astype(np.int64)
    margin = np.full((len(low), 1), _MARGIN_PX)
    if canvas.grid is not None:
        margin += ((high - low).max(axis=1, keepdims=True) * _BEND).astype(np.int64)
        low, high = low // _GRID_PX * _GRID_PX, -(-high // _GRID_PX) * _GRID_PX
    return np.hstack([np.maximum(low - margin, 0), np.minimum(high + margin + 1, (width, height))])


def _rays(H: FloatArray, box: Box, canvas: Canvas) -> tuple[npt.NDArray[np.float32], ...]:
    """Return texture coordinates a, b and inverse depths of the pixels of a box."""
    height = len(canvas.image)
    v = np.arange(box.top, box.bottom)
    at = v * ((KNOTS - 1.0) / (height - 1.0))
    before = np.minimum(at.astype(np.int64), KNOTS - 2)
    share = (at - before)[:, None, None]
    G = (1.0 - share) * H[before] + share * H[before + 1]
    if canvas.grid is None:
        along = G[..., 0].astype(np.float32)
        start = (G[..., 1] * v[:, None] + G[..., 2] + G[..., 0] * box.left).astype(np.float32)
        u = np.arange(box.right - box.left, dtype=np.float32)
        a, b, inverse_depth = (along[:, i, None] * u + start[:, i, None] for i in range(3))
    else:
        x, y = canvas.grid.rays[box.top : box.bottom, box.left : box.right].transpose(2, 0, 1)
        by = G.astype(np.float32)[:, :, :, None]
        a, b, inverse_depth = (by[:, i, 0] * x + by[:, i, 1] * y + by[:, i, 2] for i in range(3))
    depth = 1.0 / np.maximum(inverse_depth, np.float32(1e-6))
    return cv2.multiply(a, depth), cv2.multiply(b, depth), inverse_depth
