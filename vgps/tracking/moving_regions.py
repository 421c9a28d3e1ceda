"""Groups of features that move on their own, such as a lorry ahead or a bus that is overtaken.

A feature of such a group fits no static point: the rays of its views miss each other, and the more so the
longer it is followed. One alone may be a mismatch; many side by side, which move in the picture as one rigid
plane does and among which hardly any feature fits the scene, are an object. Where features that fit no
point are all over the picture, the path is wrong, and not the scene: then no object is found, but one that is
known stays one as long as it fits no point. Else it would pose the camera just when the scene hardly does.
"""

from collections.abc import Sequence
from weakref import WeakKeyDictionary

import cv2
import numpy as np

from vgps.camera import distort
from vgps.config import MappingConfig, TrackingConfig
from vgps.geometry import in_picture
from vgps.lens_jacobian import lens_jacobian
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.model import BoolArray, Camera, FloatArray, Frame, IntArray
from vgps.tracking.picture_cells import PictureCells

_NEIGHBOURS = 5  # side of the square of cells whose features are compared
_VIEWS_BACK = 10  # views over which a group is seen to move as one
_FITTING = 10  # features that must fit the scene outside all groups, for each that does not
_MIN_PAIRS = 4  # of a homography


class MovingRegions:
    """The groups in the newest view of a map.

    Args:
        camera: The camera.
        tracking, mapping: Settings of stages A and B, whose limits hold here too: as few features as pose a
            camera make a group.
    """

    def __init__(self, camera: Camera, tracking: TrackingConfig, mapping: MappingConfig) -> None:
        self._camera = camera
        self._cells = PictureCells((camera.height, camera.width), tracking.min_distance_px)
        self._min_features, self._min_views = max(tracking.min_inliers, _MIN_PAIRS), mapping.min_views
        self._limit_px = mapping.max_reprojection_px
        self._region: BoolArray = np.zeros(self._cells.shape, dtype=bool)
        self._boxes: list[IntArray] = [np.zeros((0, 6), dtype=np.int64)]
        self._ids: WeakKeyDictionary[LocalMap, IntArray] = WeakKeyDictionary()  # of a map's whole time

    @property
    def boxes(self) -> IntArray:
        """(n, 6) a box around each group in each frame: the frame twice; left, top, right, bottom, pixels."""
        return np.concatenate(self._boxes)

    def state(self, maps: Sequence[LocalMap]) -> tuple[IntArray, list[tuple[LocalMap, IntArray]]]:
        """Return what the next frames of maps depend on."""
        return self.boxes, [(one, self._ids[one]) for one in maps if one in self._ids]

    def restore(self, state: tuple[IntArray, list[tuple[LocalMap, IntArray]]]) -> None:
        """Take over a state; see :meth:`state`."""
        self._boxes = [state[0]]
        self._ids.update(state[1])

    def holds(self, local_map: LocalMap) -> BoolArray:
        """Return which followed features (N,) belonged to a group in the newest view."""
        ids = self._ids.get(local_map)
        if ids is None or not len(ids):
            return np.zeros(len(local_map.ids), dtype=bool)
        return np.isin(local_map.ids + local_map.discarded_features, ids)

    def leave_out(self, local_map: LocalMap) -> MapUpdate:
        """Find the groups in a map's newest view, and return an update that takes their positions away.

        They are followed further, without a position, as long as they move on their own.
        """
        views = local_map.moving_views[local_map.ids]
        moving, static = views >= self._min_views, views < 0
        known = self.holds(local_map) & moving
        self._region = np.zeros_like(self._region)
        self._ids.pop(local_map, None)
        if not known.any() and np.count_nonzero(moving) < self._min_features:
            return MapUpdate()
        members, alike = (found | known for found in self._groups(local_map, moving, static))
        if not members.any():
            return MapUpdate()
        region = self._most(local_map, members, static & ~alike)
        inside = known | (region[self._cells.of(local_map.raw_uv_px)] & alike)
        seen = self._around(local_map, static) > 0.0
        stray, fitting = (np.count_nonzero(some & ~inside) for some in (moving, static))
        if _FITTING * stray > fitting or np.count_nonzero(region) > np.count_nonzero(seen & ~region):
            inside, region = known, self._most(local_map, known, static)  # the path is wrong
        if not inside.any():
            return MapUpdate()
        self._region = region
        self._ids[local_map] = local_map.ids[inside] + local_map.discarded_features
        self._add_boxes(int(local_map.view_frames[-1]))
        ids = local_map.ids[inside & local_map.positioned]
        return MapUpdate(positions=Positions(ids, np.full((len(ids), 3), np.nan), np.full(len(ids), np.nan)))

    def masked(self, frame: Frame) -> Frame:
        """Return the frame of the newest view with the groups left out of its mask."""
        return self._cells.without(frame, self._region)

    def predict(self, local_map: LocalMap, search_uv: FloatArray) -> FloatArray:
        """Return where to search (N, 2) in the distorted image; a group moves on as it did.

        Args:
            local_map: Features observed in the newest view.
            search_uv: (N, 2) where they would be in a static scene.
        """
        own = self.holds(local_map)
        if not own.any():
            return search_uv
        own &= np.isfinite(local_map.views[:, -2, 0])
        step = local_map.raw_uv_px[own] - distort(self._camera, local_map.views[own, -2])
        search_uv = search_uv.copy()
        search_uv[own] = local_map.raw_uv_px[own] + step
        return search_uv

    def _groups(
        self, local_map: LocalMap, moving: BoolArray, static: BoolArray
    ) -> tuple[BoolArray, BoolArray]:
        """Return which features (N,) make the groups, and which others move as the group around them does."""
        members, alike = np.zeros_like(moving), np.zeros_like(moving)
        region = self._most(local_map, moving, static)
        count, part = cv2.connectedComponents(region.astype(np.uint8), connectivity=4)
        part = part[self._cells.of(local_map.raw_uv_px)]
        for number in range(1, count):
            group = (part == number) & moving
            fits = (part == number) & self._moves_with(local_map, group)
            if np.count_nonzero(fits & group) >= self._min_features:
                members |= fits & group
                alike |= fits
        return members, alike

    def _moves_with(self, local_map: LocalMap, group: BoolArray) -> BoolArray:
        """Return which features (N,) move in the picture as a group does, by the homography of most of it.

        A feature that is younger than the group is one of them until it is old enough.
        """
        views = local_map.views
        common = np.count_nonzero(np.isfinite(views[group, -1 - _VIEWS_BACK : -1, 0]), axis=0)
        enough = np.flatnonzero(common >= self._min_features)
        if not len(enough):
            return np.zeros_like(group)
        before, now = views[:, enough[0] - len(common) - 1], views[:, -1]
        old = np.isfinite(before[:, 0])
        pairs = before[old & group], now[old & group]
        homography, _ = cv2.findHomography(*pairs, cv2.RANSAC, self._limit_px)
        if homography is None:
            return np.zeros_like(group)
        moved = cv2.perspectiveTransform(before[old][:, None], homography)[:, 0]
        error = in_picture(lens_jacobian(self._camera, now[old]), (moved - now[old]).T)
        fits = ~old
        fits[old] = np.hypot(error[0], error[1]) < self._limit_px
        return np.asarray(fits)

    def _around(self, local_map: LocalMap, chosen: BoolArray) -> FloatArray:
        """Return (R, C) how many of some features (N,) lie around each cell."""
        return self._cells.summed(self._cells.counts(local_map.raw_uv_px[chosen]), _NEIGHBOURS)

    def _most(self, local_map: LocalMap, some: BoolArray, others: BoolArray) -> BoolArray:
        """Return (R, C) whether there are more of some features (N,) around a cell than of others (N,)."""
        return np.asarray(self._around(local_map, some) > self._around(local_map, others))

    def _add_boxes(self, frame: int) -> None:
        _, _, stats, _ = cv2.connectedComponentsWithStats(self._region.astype(np.uint8), connectivity=4)
        column, row, width, height = stats[1:, :4].T
        first = np.stack([row, column], axis=1)
        boxes = self._cells.boxes(first, first + np.stack([height, width], axis=1))
        self._boxes.append(np.hstack([np.full((len(boxes), 2), frame), boxes]))
