"""Stage B, Kume 2010: triangulate features (19), add new ones and delete those of low quality."""

import numpy as np

from vgps.camera import undistort
from vgps.config import MappingConfig, TrackingConfig
from vgps.geometry import largest_angle_rad, triangulate, world_rays
from vgps.lens_jacobian import lens_jacobian
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, NewFeatures, Positions
from vgps.model import BoolArray, Camera, FloatArray, Frame, IntArray
from vgps.rolling_shutter import row_poses
from vgps.tracking.corners import new_corners
from vgps.tracking.moving_regions import MovingRegions

MIN_VIEWS = 2
"""Views needed to triangulate a feature."""


def agreed_positions(
    camera: Camera, config: MappingConfig, of_row: FloatArray, uv_px: FloatArray, start: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return the positions (M, 3) of features (19) and their reliabilities (M,), NaN where views disagree.

    Args:
        camera: Intrinsics.
        config: How well the views have to agree.
        of_row: (N, 4, 4) the pose of each observation.
        uv_px: (N, 2) the observations, sorted by feature.
        start: (M,) first row of each feature.
    """
    points, error = triangulate(camera.K, of_row, uv_px, start, lens=lens_jacobian(camera, uv_px))
    count = np.diff(np.append(start, len(uv_px)))
    sigma = np.sqrt(np.add.reduceat(np.minimum(error, 1e6) ** 2, start) / count)
    largest = np.maximum.reduceat(error, start)
    good = (largest < config.max_reprojection_px) & (sigma < config.max_sigma_px)
    sigma = np.maximum(sigma, config.sigma_floor_px)
    return np.where(good[:, None], points, np.nan), np.where(good, sigma, np.nan)


class Mapper:
    """Stage B for one camera."""

    def __init__(
        self, camera: Camera, tracking: TrackingConfig, mapping: MappingConfig, rng: np.random.Generator
    ) -> None:
        self._camera, self._K = camera, camera.K
        self._tracking, self._config = tracking, mapping
        self._rng = rng

    def triangulate_due(self, local_map: LocalMap) -> MapUpdate:
        """Return first positions of features, and new ones of the features that are due (19).

        Features whose history is full continue as new ones afterwards.
        """
        view_count = np.isfinite(local_map.views[..., 0]).sum(axis=1)
        every = self._config.refine_every
        unpositioned = ~local_map.positioned & (view_count >= MIN_VIEWS)
        due = local_map.positioned & (local_map.ids % every == local_map.view_frames[-1] % every)
        positions = self.triangulate(local_map, np.flatnonzero(unpositioned | due))
        more = self._more_moving_views(local_map, positions)
        return MapUpdate(positions=positions, more_moving_views=more, renew_full_tracks=True)

    def _more_moving_views(self, local_map: LocalMap, positions: Positions | None) -> IntArray:
        """Return +1 for the features (N,) whose views disagree, -1 for those with a position, else 0.

        The evidence is limited to the length of a track.
        """
        more = -local_map.positioned.astype(np.int64)
        if positions is not None:
            disagree = np.isnan(positions.sigma_px)
            more[np.isin(local_map.ids, positions.ids[~disagree])] = -1
            more[np.isin(local_map.ids, positions.ids[disagree])] = 1
        so_far, limit = local_map.moving_views[local_map.ids], self._config.max_track_frames
        return np.asarray(np.clip(so_far + more, -limit, limit) - so_far)

    def triangulate(self, local_map: LocalMap, rows: IntArray) -> Positions | None:
        """Return positions of followed features, by their rows, from all their views (19).

        A feature whose views disagree gets NaN; one without enough views or parallax is left out.
        """
        poses, posed = local_map.view_poses()
        observed = np.isfinite(local_map.views[rows, :, 0]) & posed
        enough = observed.sum(axis=1) >= MIN_VIEWS
        rows, observed = self._with_parallax(local_map, rows[enough], observed[enough], poses)
        if len(rows) == 0:
            return None
        feature, view = np.nonzero(observed)
        start = np.searchsorted(feature, np.arange(len(rows)))
        uv_px = local_map.views[rows][observed]
        of_row = self._row_poses(local_map, view, uv_px)
        return Positions(
            local_map.ids[rows], *agreed_positions(self._camera, self._config, of_row, uv_px, start)
        )

    def _row_poses(self, local_map: LocalMap, view: IntArray, uv_px: FloatArray) -> FloatArray:
        """Return the pose (N, 4, 4) of each observation in posed views (N,): that of its row."""
        poses, posed = local_map.view_poses()
        t_s = local_map.t_s[local_map.view_frames[posed] - local_map.first_frame]
        number = np.cumsum(posed) - 1
        return row_poses(self._camera, t_s, poses[posed], number[view], uv_px)

    def _with_parallax(
        self, local_map: LocalMap, rows: IntArray, observed: BoolArray, poses: FloatArray
    ) -> tuple[IntArray, BoolArray]:
        """Return the features (n,) with enough parallax and their views (n, H).

        The others keep an earlier position: it may come from views that were discarded since.
        """
        if len(rows) == 0:
            return rows, observed
        feature, view = np.nonzero(observed)
        directions = world_rays(self._K, poses[view], local_map.views[rows][observed])
        start = np.searchsorted(feature, np.arange(len(rows)))
        enough = largest_angle_rad(directions, start) > np.radians(self._config.min_parallax_deg)
        return rows[enough], observed[enough]

    def new_features(
        self, local_map: LocalMap, frame: Frame, moving: MovingRegions | None = None
    ) -> MapUpdate:
        """Return new corners (A-1) of the newest view's frame, if too few features are followed.

        Features of what moves on its own do not count, and none starts there.
        """
        followed = len(local_map.ids)
        if moving is not None:
            followed -= int(np.count_nonzero(moving.holds(local_map)))
            frame = moving.masked(frame)
        if followed >= self._tracking.refill_share * self._tracking.max_features:
            return MapUpdate()
        count = self._tracking.max_features - followed
        raw = new_corners(frame.gray, local_map.raw_uv_px, count, self._tracking, self._rng, frame.mask)
        uv = undistort(self._camera, raw)
        valid = np.isfinite(uv).all(axis=1)
        raw, uv = raw[valid], uv[valid]
        pixel = raw.astype(int)
        return MapUpdate(features=NewFeatures(raw, uv, frame.gray[pixel[:, 1], pixel[:, 0]]))
