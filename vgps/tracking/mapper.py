"""Stage B, Kume 2010: positions of features from their views (19); adding and deleting them by quality."""

import numpy as np

from vgps.camera import undistort
from vgps.config import MappingConfig, TrackingConfig
from vgps.geometry import largest_angle_rad, triangulate, world_rays
from vgps.mapping.local_map import LocalMap
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

    def update(self, local_map: LocalMap, gray: GrayImage) -> None:
        """After the newest view was posed: position, refine, delete, renew and add features."""
        age = np.isfinite(local_map.views[..., 0]).sum(axis=1)
        fresh = ~local_map.positioned & (age >= _FIRST_VIEWS)
        due = local_map.positioned & (
            local_map.ids % _REFINE_EVERY == local_map.view_frames[-1] % _REFINE_EVERY
        )
        self.position(local_map, np.flatnonzero(fresh | due))
        local_map.renew_full_tracks()
        self.refill(local_map, gray)

    def position(self, local_map: LocalMap, rows: IntArray) -> None:
        """Triangulate the followed features ``rows`` over all their views; what fails loses its position."""
        poses, valid = local_map.view_poses()
        seen = np.isfinite(local_map.views[rows, :, 0]) & valid
        often = seen.sum(axis=1) >= _FIRST_VIEWS
        rows, seen = self._with_parallax(local_map, rows[often], seen[often], poses)
        if len(rows) == 0:
            return
        feature, view = np.nonzero(seen)
        start = np.searchsorted(feature, np.arange(len(rows)))
        points, error = triangulate(self._K, poses[view], local_map.views[rows][seen], start)
        sigma = np.sqrt(np.add.reduceat(np.minimum(error, 1e6) ** 2, start) / seen.sum(axis=1))
        largest = np.maximum.reduceat(error, start)
        good = (largest < self._config.max_reprojection_px) & (sigma < self._config.max_sigma_px)
        ids = local_map.ids[rows]
        local_map.set_points(ids[good], points[good], np.maximum(sigma[good], self._config.sigma_floor_px))
        local_map.forget_points(ids[~good])

    def _with_parallax(
        self, local_map: LocalMap, rows: IntArray, seen: BoolArray, poses: FloatArray
    ) -> tuple[IntArray, BoolArray]:
        """Those features whose rays differ enough. The others keep an earlier position, if they have one:
        it may come from a history that was cut."""
        if len(rows) == 0:
            return rows, seen
        feature, view = np.nonzero(seen)
        directions = world_rays(self._K, poses[view], local_map.views[rows][seen])
        start = np.searchsorted(feature, np.arange(len(rows)))
        enough = largest_angle_rad(directions, start) > np.radians(self._config.min_parallax_deg)
        return rows[enough], seen[enough]

    def refill(self, local_map: LocalMap, gray: GrayImage) -> None:
        """Add corners (A-1) when too few features are followed."""
        followed = len(local_map.ids)
        if followed >= _REFILL_SHARE * self._tracking.max_features:
            return
        wanted = self._tracking.max_features - followed
        raw = new_corners(gray, local_map.raw_uv_px, wanted, self._tracking, self._rng)
        uv = undistort(self._camera, raw)
        seen = np.isfinite(uv).all(axis=1)
        raw, uv = raw[seen], uv[seen]
        pixel = raw.astype(int)
        local_map.add_features(raw, uv, gray[pixel[:, 1], pixel[:, 0]])
