"""Features that left the picture and are seen again: the camera pans back, a walker looks around.

Each goes on as the feature that it was, so that the frames of both times see one point; as a new one it
would let the path drift between them. Many come back together, or none: a few, as on a drive, hardly tie the
frames of both times. Each is searched where the pose of the newest view shows its point: if its reference
patch is not there, it is hidden or has moved, or the path has drifted, and it is given up. A feature that was
lost within the picture was hidden or mismatched, and is not searched.
"""

from collections.abc import Sequence
from weakref import WeakKeyDictionary

import numpy as np

from vgps.camera import undistort
from vgps.config import TrackingConfig
from vgps.geometry import project
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, ReturnedFeatures
from vgps.model import BoolArray, Camera, FloatArray, Frame, IntArray
from vgps.tracking.corners import is_shown
from vgps.tracking.picture_pixels import to_picture
from vgps.tracking.reference_patches import NO_PATCHES, Patches, ReferencePatches
from vgps.tracking.row_motion import row_shifts

# patches of a map's features that left the picture, and of those lost since the last search; in parts, as few
# searches need them in one piece
_Left = tuple[list[Patches], list[Patches]]

_EVERY = 3  # views from one search to the next: on a drive nothing comes back, and looking costs


class ReturningFeatures:
    """The features of maps that left one camera's picture."""

    def __init__(self, camera: Camera, config: TrackingConfig) -> None:
        self._camera, self._config = camera, config
        self._shift_px = min(config.rematch_px, config.inlier_px)
        self._margin_px = config.window_px / 2  # a feature this near to the border is lost to it
        self._left: WeakKeyDictionary[LocalMap, _Left] = WeakKeyDictionary()

    def state(self, maps: Sequence[LocalMap]) -> list[tuple[LocalMap, _Left]]:
        """Return the patches of the features that left, for some maps."""
        return [(one, self._left[one]) for one in maps if one in self._left]

    def restore(self, state: list[tuple[LocalMap, _Left]]) -> None:
        """Take over a state; see :meth:`state`."""
        self._left.update(state)

    def keep(self, local_map: LocalMap, lost: Patches) -> None:
        """Keep features that were lost in the newest view until a search shows which left the picture.

        Only those that fitted the scene for most of their time are kept, not what moves on its own.

        Args:
            local_map: The map, with its newest view.
            lost: Their patches.
        """
        ids = lost.ids - local_map.discarded_features
        fitted = np.isfinite(local_map.points[ids, 0]) & (local_map.moving_views[ids] < 0)
        _, new = self._left.setdefault(local_map, ([], []))
        new.append(lost.rows(np.flatnonzero(fitted)))

    def search(self, local_map: LocalMap, frame: Frame) -> tuple[MapUpdate, Patches]:
        """Return those that the frame of the newest view shows, and their patches.

        No more are searched than would make as many features as are followed at most. They are forgotten when
        their patches are too old.

        Args:
            local_map: The map, after :meth:`keep`; its newest view is posed by features.
            frame: The frame; its mask leaves out what is not the scene.
        """
        left, new = self._left[local_map]
        if len(new) < _EVERY:
            return MapUpdate(), NO_PATCHES
        self._sort_out(local_map)
        ids = np.concatenate([part.ids for part in left])
        valid = self._valid(local_map, ids, np.concatenate([part.frame for part in left]))
        ids = np.maximum(ids - local_map.discarded_features, 0)
        start, inside = self._expected(local_map, ids)
        room = max(self._config.max_features - len(local_map.ids), 0)
        rows = np.flatnonzero(valid & inside & is_shown(frame.mask, start))[:room]
        if len(rows) < self._config.min_returning:
            return MapUpdate(), NO_PATCHES
        patches = left[0].joined(*left[1:])
        tried = ReferencePatches(self._camera, patches.rows(rows))
        start = start[rows] + self._row_shifts(local_map, ids[rows])
        aligned = tried.align(local_map, local_map.poses[-1], frame.gray, start, self._shift_px)
        uv = undistort(self._camera, aligned.uv_px)
        found = aligned.found & is_shown(frame.mask, aligned.uv_px) & np.isfinite(uv).all(axis=1)
        enough = np.count_nonzero(found) >= self._config.min_returning
        valid[rows] = found & (not enough)
        left[:] = [patches.rows(np.flatnonzero(valid))]
        if not enough:
            return MapUpdate(), NO_PATCHES
        returned = ReturnedFeatures(ids[rows][found], aligned.uv_px[found], uv[found])
        return MapUpdate(returned=returned), tried.patches.rows(np.flatnonzero(found))

    def _sort_out(self, local_map: LocalMap) -> None:
        """Add those of the lost features that left the picture, and drop parts that are too old."""
        left, new = self._left[local_map]
        lost = new[0].joined(*new[1:])
        new.clear()
        _, inside = self._expected(local_map, np.maximum(lost.ids - local_map.discarded_features, 0))
        left.append(lost.rows(np.flatnonzero(~inside)))
        while len(left) > 1 and not self._valid(local_map, left[0].ids, left[0].frame).any():
            del left[0]

    def _valid(self, local_map: LocalMap, ids: IntArray, taken: IntArray) -> BoolArray:
        """Return which patches are young enough, of frames and features that the map still has.

        Args:
            local_map: The map.
            ids, taken: (n,) features, counted from the first one ever followed, and frames of their patches.
        """
        oldest = int(local_map.view_frames[-1]) - self._config.return_frames
        known = ids >= local_map.discarded_features
        return np.asarray(known & (taken >= max(oldest, local_map.first_frame)))

    def _row_shifts(self, local_map: LocalMap, ids: IntArray) -> FloatArray:
        """Return how far a rolling shutter shifts features (n, 2) in the newest view."""
        if not self._camera.readout_s:
            return np.zeros((len(ids), 2))
        knots, points = local_map.poses[-2:], local_map.points[ids]
        return row_shifts(self._camera, local_map.t_s[-2:] - local_map.t_s[-1], knots, knots[-1], points)

    def _expected(self, local_map: LocalMap, ids: IntArray) -> tuple[FloatArray, BoolArray]:
        """Return where the newest view shows features (n, 2), in the distorted image, and whether it does."""
        pose, points = local_map.poses[-1], local_map.points[ids]
        return to_picture(self._camera, *project(self._camera.K, pose, points), self._margin_px)
