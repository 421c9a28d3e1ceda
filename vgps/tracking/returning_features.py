"""Features that left the picture and are seen again: the camera pans back, a walker looks around.

Each goes on as the feature that it was, so that the frames of both times see one point; as a new one it
would let the path drift between them. It is searched once, where the pose of the newest view shows its
point: if its reference patch is not there, it is hidden or has moved, or the path has drifted, and it is
given up. A feature that was lost within the picture was hidden or mismatched, and is not searched.
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
from vgps.tracking.reference_patches import Patches, ReferencePatches
from vgps.tracking.row_motion import row_shifts

_SEARCHED = -1  # in place of the number of a feature
_FULL = (
    0.75  # share of features still to be searched below which the others' patches are dropped: copying costs
)


class ReturningFeatures:
    """The features of maps that left one camera's picture."""

    def __init__(self, camera: Camera, config: TrackingConfig) -> None:
        self._camera, self._config = camera, config
        self._shift_px = min(config.rematch_px, config.inlier_px)
        self._margin_px = config.window_px / 2  # a feature this near to the border is lost to it
        self._left: WeakKeyDictionary[LocalMap, ReferencePatches] = WeakKeyDictionary()

    def state(self, maps: Sequence[LocalMap]) -> list[tuple[LocalMap, Patches]]:
        """Return the patches of the features that left, for some maps."""
        return [(one, self._left[one].patches) for one in maps if one in self._left]

    def restore(self, state: list[tuple[LocalMap, Patches]]) -> None:
        """Take over a state; see :meth:`state`."""
        for local_map, patches in state:
            self._left[local_map] = ReferencePatches(self._camera, patches)

    def keep(self, local_map: LocalMap, followed: Patches) -> None:
        """Keep the features that were lost in the newest view because they left the picture.

        Only those that fitted the scene for most of their time are kept, not what moves on its own. They are
        forgotten when their patches are too old.

        Args:
            local_map: The map, with its newest view.
            followed: Patches of the features followed until then.
        """
        left = self._left.setdefault(local_map, ReferencePatches(self._camera))
        discarded = local_map.discarded_features
        valid = self._valid(local_map, left.patches)
        if np.count_nonzero(valid) < _FULL * len(valid):
            left.patches = left.patches.rows(np.flatnonzero(valid))
        known = np.concatenate([local_map.ids + discarded, left.patches.ids])
        lost = np.flatnonzero((followed.ids >= discarded) & ~np.isin(followed.ids, known))
        ids = followed.ids[lost] - discarded
        _, inside = self._expected(local_map, ids)
        fitted = np.isfinite(local_map.points[ids, 0]) & (local_map.moving_views[ids] < 0)
        if (gone := fitted & ~inside).any():
            left.patches = left.patches.joined(followed.rows(lost[gone]))

    def search(self, local_map: LocalMap, frame: Frame) -> tuple[MapUpdate, Patches]:
        """Return those that the frame of the newest view shows, and their patches.

        No more are searched than would make as many features as are followed at most.

        Args:
            local_map: The map, after :meth:`keep`; its newest view is posed by features.
            frame: The frame; its mask leaves out what is not the scene.
        """
        left = self._left[local_map]
        ids = np.maximum(left.patches.ids - local_map.discarded_features, 0)
        start, inside = self._expected(local_map, ids)
        rows = np.flatnonzero(inside & self._valid(local_map, left.patches))
        room = max(self._config.max_features - len(local_map.ids), 0)
        rows = rows[is_shown(frame.mask, start[rows])][:room]
        tried = ReferencePatches(self._camera, left.patches.rows(rows))
        if len(rows) == 0:
            return MapUpdate(), tried.patches
        left.patches.ids[rows] = _SEARCHED
        start = start[rows] + self._row_shifts(local_map, ids[rows])
        aligned = tried.align(local_map, local_map.poses[-1], frame.gray, start, self._shift_px)
        uv = undistort(self._camera, aligned.uv_px)
        found = aligned.found & is_shown(frame.mask, aligned.uv_px) & np.isfinite(uv).all(axis=1)
        returned = ReturnedFeatures(ids[rows][found], aligned.uv_px[found], uv[found])
        return MapUpdate(returned=returned), tried.patches.rows(np.flatnonzero(found))

    def _valid(self, local_map: LocalMap, patches: Patches) -> BoolArray:
        """Return which patches are young enough, of frames and features that the map still has."""
        oldest = int(local_map.view_frames[-1]) - self._config.return_frames
        known = patches.ids >= local_map.discarded_features
        return np.asarray(known & (patches.frame >= max(oldest, local_map.first_frame)))

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
