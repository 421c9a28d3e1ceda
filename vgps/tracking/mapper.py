"""Stage B, Kume 2010: positions of features from their views (19); adding and deleting them by quality."""

import numpy as np

from vgps.camera import undistort
from vgps.config import MappingConfig, TrackingConfig
from vgps.local_map import LocalMap
from vgps.model import Camera, GrayImage, IntArray
from vgps.tracking.corners import new_corners
from vgps.tracking.geometry import largest_angle_rad, rays, triangulate

_REFINE_EVERY = 5
_REFILL_SHARE = 0.85
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
        views = local_map.views[rows]
        seen = np.isfinite(views[..., 0]) & valid
        world_rays = np.einsum("hij,mhj->mhi", poses[:, :3, :3], rays(self._K, np.nan_to_num(views)))
        enough = seen.sum(axis=1) >= _FIRST_VIEWS
        enough[enough] = largest_angle_rad(world_rays[enough], seen[enough]) > np.radians(
            self._config.min_parallax_deg
        )
        # without parallax an earlier position is kept: it may come from a history that was cut
        rows, views, seen = rows[enough], views[enough], seen[enough]
        if len(rows) == 0:
            return
        points, error = triangulate(self._K, poses, views, seen)
        sigma = np.sqrt(np.sum(np.where(seen, error, 0.0) ** 2, axis=1) / seen.sum(axis=1))
        good = (error.max(axis=1) < self._config.max_reprojection_px) & (sigma < self._config.max_sigma_px)
        ids = local_map.ids[rows]
        local_map.set_points(ids[good], points[good], np.maximum(sigma[good], self._config.sigma_floor_px))
        local_map.forget_points(ids[~good])

    def refill(self, local_map: LocalMap, gray: GrayImage) -> None:
        """Add corners (A-1) when too few features are followed."""
        followed = len(local_map.ids)
        if followed >= _REFILL_SHARE * self._tracking.max_features:
            return
        wanted = self._tracking.max_features - followed
        raw = new_corners(gray, local_map.raw_uv_px, wanted, self._tracking, self._rng)
        pixel = raw.astype(int)
        local_map.add_features(raw, undistort(self._camera, raw), gray[pixel[:, 1], pixel[:, 0]])
