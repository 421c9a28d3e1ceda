"""Regions that never move in the picture: a bonnet, burnt-in text, a reflection, a stain on the lens.

A feature there stays at its pixel while the camera turns. No point of the scene does: a far one moves with
every rotation, a near one with every translation too, and the two cancel by chance only. So a feature is
static if its pixel stays and no point in front of the camera fits its views. A camera that stands still, or
moves straight towards a far point, shows nothing that contradicts.
"""

from dataclasses import dataclass

import numpy as np

from vgps.camera import distort
from vgps.config import MappingConfig, TrackingConfig
from vgps.geometry import largest_angle_rad, triangulate, world_rays
from vgps.lens_jacobian import lens_jacobian
from vgps.mapping.local_map import LocalMap
from vgps.model import BoolArray, Camera, FloatArray, Frame, IntArray
from vgps.tracking.matching import Match
from vgps.tracking.picture_cells import PictureCells

_NEIGHBOURS = 3  # side of the square of cells whose static features count together


@dataclass
class StaticCells:
    """Evidence in the cells (R, C) of a grid over the picture, and what followed from it.

    Attributes:
        frame, views: Index of the newest frame, and number of views so far.
        static, moving: (R, C) recent matches of static features, and of others that moved.
        until: (R, C) number of views until which a cell is left out.
        span: (R, C) for how many views it is left out next time.
        since: (R, C) first frame in which it is left out now, -1 otherwise.
        released: (n, 4) first and last frame, row and column of cells that were left out earlier.
    """

    frame: int
    views: int
    static: FloatArray
    moving: FloatArray
    until: IntArray
    span: IntArray
    since: IntArray
    released: IntArray


class StaticRegions:
    """What never moves, in the cells in which features start.

    A static cell is left out for as many views as a track may last, then features may start in it again. If
    they are static again, it is left out for twice as long: a bonnet soon counts as one for good, but what
    stayed in the picture for a while, such as a car ahead in a bend, does not.

    Args:
        camera: The camera.
        tracking, mapping: Settings of stages A and B, whose limits hold here too.
    """

    def __init__(self, camera: Camera, tracking: TrackingConfig, mapping: MappingConfig) -> None:
        self._camera = camera
        self._grid = PictureCells((camera.height, camera.width), tracking.min_distance_px)
        self._still_px, self._limit_px = tracking.forward_backward_px, mapping.max_reprojection_px
        self._min_views = mapping.min_views
        self._forget = 0.5 ** (1.0 / mapping.max_track_frames)
        zero, none = np.zeros(self._grid.shape), np.zeros(self._grid.shape, np.int64)
        self.cells = StaticCells(
            frame=-1,
            views=0,
            static=zero,
            moving=zero.copy(),
            until=none,
            span=none + mapping.max_track_frames,
            since=none - 1,
            released=np.zeros((0, 4), np.int64),
        )

    @property
    def rectangles(self) -> IntArray:
        """(n, 6) what was left out: first and last frame; left, top, right, bottom of a rectangle, pixels."""
        cells, now = self.cells, np.argwhere(self.cells.since >= 0)
        since = cells.since[tuple(now.T)]
        rows = np.vstack([cells.released, np.c_[since, np.full_like(since, cells.frame), now]])
        rows = rows[rows[:, 0] <= rows[:, 1]]
        rows = rows[np.lexsort(rows.T[::-1])]
        begins = np.any(np.diff(rows, axis=0, prepend=-2) != (0, 0, 0, 1), axis=1)
        ends = np.append(begins[1:], True)[: len(rows)]
        return np.hstack([rows[begins, :2], self._grid.boxes(rows[begins, 2:], rows[ends, 2:] + 1)])

    def masked(self, frame: Frame) -> Frame:
        """Return the next frame with what never moves left out of its mask."""
        self.cells.frame = frame.index
        return self._grid.without(frame, self.cells.since >= 0)

    def observe(
        self,
        local_map: LocalMap,
        match: Match,
        uv_px: FloatArray,
        fitting: BoolArray,
        world_T_camera: FloatArray,
    ) -> None:
        """Judge the cells by a posed frame.

        Args:
            local_map: The map, without the frame.
            match: Matches of its features (N,) in the frame, before they are judged.
            uv_px: (N, 2) their pixels in the undistorted image.
            fitting: (N,) whether each fits the scene.
            world_T_camera: (4, 4) pose of the frame.
        """
        cells = self.cells
        stays = np.linalg.norm(match.uv_px - local_map.raw_uv_px, axis=1) < self._still_px
        rows = np.flatnonzero(match.found & stays)
        static = rows[self._is_static(local_map, rows, uv_px[rows], world_T_camera)]
        cells.views += 1
        cells.static = self._forget * cells.static + self._grid.counts(match.uv_px[static])
        cells.moving = self._forget * cells.moving + self._grid.counts(match.uv_px[fitting & ~stays])
        self._judge()

    def _is_static(
        self, local_map: LocalMap, rows: IntArray, uv_px: FloatArray, world_T_camera: FloatArray
    ) -> BoolArray:
        """Return (n,) whether the features of some rows stay at their pixels though no point fits."""
        poses, posed = local_map.view_poses()
        poses, posed = np.concatenate([poses, world_T_camera[None]]), np.append(posed, True)
        views = np.concatenate([local_map.views[rows], uv_px[:, None]], axis=1)[:, posed]
        stays = np.isfinite(views[..., 0]).sum(axis=1) >= self._min_views
        stays &= stays_in_picture(self._camera, views, self._still_px)
        if stays.any():
            views = views[stays]
            feature, view = np.nonzero(np.isfinite(views[..., 0]))
            start = np.searchsorted(feature, np.arange(len(views)))
            cameras, uv = poses[posed][view], views[feature, view]
            K, lens = self._camera.K, lens_jacobian(self._camera, uv)
            _, error = triangulate(K, cameras, uv, start, lens=lens)
            turned = largest_angle_rad(world_rays(K, cameras, uv), start) * K[0, 0]
            stays[stays] = (np.maximum.reduceat(error, start) > self._limit_px) & (turned > self._limit_px)
        return np.asarray(stays)

    def _judge(self) -> None:
        cells = self.cells
        static = self._grid.summed(cells.static, _NEIGHBOURS)
        new = (cells.since < 0) & (static >= self._min_views) & (static > cells.moving)
        old = (cells.since >= 0) & (cells.until <= cells.views)
        row, column = np.nonzero(old)
        ended = np.c_[cells.since[old], np.full(len(row), cells.frame), row, column]
        cells.released = np.vstack([cells.released, ended])
        cells.static[new] = cells.moving[new] = 0.0
        cells.until[new] = cells.views + cells.span[new]
        cells.span[new] *= 2
        cells.since[new], cells.since[old] = cells.frame + 1, -1


def stays_in_picture(camera: Camera, views: FloatArray, limit_px: float) -> BoolArray:
    """Return (N,) whether features stay where the picture first shows them.

    Args:
        camera: Intrinsics.
        views: (N, V, 2) their undistorted pixels, NaN if unseen.
        limit_px: Largest motion along either side of the picture.
    """
    raw = distort(camera, views.reshape(-1, 2)).reshape(views.shape)
    first = np.isfinite(raw[..., :1]).argmax(axis=1)[:, None]
    moved = np.abs(raw - np.take_along_axis(raw, first, axis=1))
    return np.asarray(np.fmax.reduce(moved, axis=(1, 2)) < limit_px)
