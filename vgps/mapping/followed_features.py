"""The features that are still followed, and where the newest views show them."""

import copy
from collections.abc import Callable

import numpy as np

from vgps.mapping.map_update import NewView, ReturnedFeatures
from vgps.model import BoolArray, FloatArray, IntArray


class FollowedFeatures:
    """Rows of features with a history of H views.

    Attributes:
        ids: (N,) ids of the features.
        raw_uv_px: (N, 2) their last observation in the distorted image.
        views: (N, H, 2) undistorted observations in the frames ``view_frames`` (H,), newest last; NaN where
            a feature was not observed.
        view_frames: (H,) frames of the views, -1 where there is none.
    """

    def __init__(self, history: int) -> None:
        self.ids: IntArray = np.zeros(0, dtype=np.int64)
        self.raw_uv_px = np.zeros((0, 2))
        self.views = np.full((0, history, 2), np.nan)
        self.view_frames: IntArray = np.full(history, -1, dtype=np.int64)

    @property
    def newest(self) -> int:
        """The newest view's frame."""
        return int(self.view_frames[-1])

    @property
    def full(self) -> BoolArray:
        """(N,) features that all views show."""
        return np.asarray(np.isfinite(self.views[..., 0]).all(axis=1))

    def snapshot(self) -> "FollowedFeatures":
        """Return the rows as they are, of which new views will have a copy."""
        return copy.copy(self)

    def push(self, view: NewView) -> None:
        """Add a view; features that it does not show are no longer followed."""
        found = view.found
        self.ids, self.raw_uv_px = self.ids[found], view.raw_uv_px[found]
        self.views = np.concatenate([self.views[found, 1:], view.uv_px[found, None]], axis=1)
        self.view_frames = np.append(self.view_frames[1:], view.frame)

    def follow(self, features: ReturnedFeatures, views: FloatArray | None = None) -> None:
        """Follow features from the newest view on, which earlier views (n, H, 2) may have shown."""
        if views is None:
            views = np.full((len(features.ids), self.views.shape[1], 2), np.nan)
        views[:, -1] = features.uv_px
        self.ids = np.append(self.ids, features.ids)
        self.raw_uv_px = np.concatenate([self.raw_uv_px, features.raw_uv_px])
        self.views = np.concatenate([self.views, views])

    def renew(self, rows: BoolArray, ids: IntArray) -> None:
        """Continue some features (N,) under new ids, from the newest view on."""
        self.ids = self.ids.copy()
        self.ids[rows] = ids
        self.views[rows, :-1] = np.nan

    def undistort_again(self, undistorted: Callable[[FloatArray], FloatArray]) -> None:
        """Give the views another calibration, by a function of undistorted pixels (n, 2)."""
        self.views = undistorted(self.views.reshape(-1, 2)).reshape(self.views.shape)

    def discard_before(self, frame: int) -> None:
        """Discard the views of frames before one."""
        discarded = self.view_frames < frame
        self.view_frames = np.where(discarded, -1, self.view_frames)
        self.views[:, discarded] = np.nan

    def lower_ids(self, count: int) -> None:
        """Lower all ids."""
        self.ids = self.ids - count
