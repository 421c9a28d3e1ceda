"""Stage B, Kume 2010: triangulate features (19), add and delete them by their quality."""

import numpy as np

from vgps.camera import undistort
from vgps.config import MappingConfig, TrackingConfig
from vgps.geometry import largest_angle_rad, triangulate, world_rays
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, NewFeatures, Positions
from vgps.model import BoolArray, Camera, FloatArray, GrayImage, IntArray
from vgps.tracking.corners import new_corners

_REFINE_EVERY = 5
_REFILL_SHARE = 0.75
_FIRST_VIEWS = 2


class Mapper:
    """Stage B for one camera."""

    def __init__(
        self, camera: Camera, tracking: TrackingConfig, mapping: MappingConfig, rng: np.random.Generator
    ) -> None:
        self._camera, self._K = camera, camera.K
        self._tracking, self._config = tracking, mapping
        self._rng = rng

    def triangulate_due(self, local_map: LocalMap) -> MapUpdate:
        """Return the positions of features new enough to get one, and of those whose turn it is (19).

        Features whose history is full go on as new ones afterwards.
        """
        age = np.isfinite(local_map.views[..., 0]).sum(axis=1)
        fresh = ~local_map.positioned & (age >= _FIRST_VIEWS)
        due = local_map.positioned & (
            local_map.ids % _REFINE_EVERY == local_map.view_frames[-1] % _REFINE_EVERY
        )
        positions = self.triangulate(local_map, np.flatnonzero(fresh | due))
        return MapUpdate(positions=positions, renew_full_tracks=True)

    def triangulate(self, local_map: LocalMap, rows: IntArray) -> Positions | None:
        """Return the positions of followed features by all their views; NaN where that fails."""
        poses, valid = local_map.view_poses()
        seen = np.isfinite(local_map.views[rows, :, 0]) & valid
        often = seen.sum(axis=1) >= _FIRST_VIEWS
        rows, seen = self._with_parallax(local_map, rows[often], seen[often], poses)
        if len(rows) == 0:
            return None
        feature, view = np.nonzero(seen)
        start = np.searchsorted(feature, np.arange(len(rows)))
        points, error = triangulate(self._K, poses[view], local_map.views[rows][seen], start)
        sigma = np.sqrt(np.add.reduceat(np.minimum(error, 1e6) ** 2, start) / seen.sum(axis=1))
        largest = np.maximum.reduceat(error, start)
        good = (largest < self._config.max_reprojection_px) & (sigma < self._config.max_sigma_px)
        sigma = np.maximum(sigma, self._config.sigma_floor_px)
        return Positions(
            local_map.ids[rows], np.where(good[:, None], points, np.nan), np.where(good, sigma, np.nan)
        )

    def _with_parallax(
        self, local_map: LocalMap, rows: IntArray, seen: BoolArray, poses: FloatArray
    ) -> tuple[IntArray, BoolArray]:
        """Return the features whose rays differ enough.

        The others keep an earlier position, if they have one: it may come from a history that was cut.
        """
        if len(rows) == 0:
            return rows, seen
        feature, view = np.nonzero(seen)
        directions = world_rays(self._K, poses[view], local_map.views[rows][seen])
        start = np.searchsorted(feature, np.arange(len(rows)))
        enough = largest_angle_rad(directions, start) > np.radians(self._config.min_parallax_deg)
        return rows[enough], seen[enough]

    def new_features(self, local_map: LocalMap, gray: GrayImage) -> MapUpdate:
        """Return new corners (A-1) of the newest view when too few features are followed."""
        followed = len(local_map.ids)
        if followed >= _REFILL_SHARE * self._tracking.max_features:
            return MapUpdate()
        wanted = self._tracking.max_features - followed
        raw = new_corners(gray, local_map.raw_uv_px, wanted, self._tracking, self._rng)
        uv = undistort(self._camera, raw)
        seen = np.isfinite(uv).all(axis=1)
        raw, uv = raw[seen], uv[seen]
        pixel = raw.astype(int)
        return MapUpdate(features=NewFeatures(raw, uv, gray[pixel[:, 1], pixel[:, 0]]))
