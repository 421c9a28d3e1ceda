"""The local map that stages A to C share: poses, features and positions of unbroken tracking."""

import copy

import numpy as np

from vgps.mapping.feature_table import FeatureTable
from vgps.mapping.growing_array import GrowingArray, read_only
from vgps.mapping.map_update import MapUpdate, NewFeatures, NewFrame, NewView, ReturnedFeatures, Similarity
from vgps.mapping.observation_log import ObservationLog
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.solution import Observations

_ID_STEP = 100  # ids are renumbered by whole steps, not at every frame


class LocalMap:
    """Poses of consecutive frames, features followed through them and positions of the features.

    Until the map is aligned its world is its first camera and its unit is arbitrary. Arrays over all
    features ever followed are indexed by feature id; ``ids`` are the features still followed, the rows of
    ``raw_uv_px`` and ``views``. Only :meth:`apply` changes poses, positions and observations, and only
    :meth:`discard_before` discards old ones.

    Attributes:
        first_frame: Index of the frame of ``poses[0]``.
        discarded_features: Total by which feature ids were lowered.
        aligned: Whether the map's world is the world of the GPS fixes.
        ids: (N,) followed features, ``raw_uv_px`` (N, 2) their last observation in the distorted image.
        views: (N, H, 2) undistorted observations in the frames ``view_frames`` (H,), newest last; NaN where
            a feature was not observed.
    """

    def __init__(self, first_frame: int, history: int) -> None:
        self.first_frame = first_frame
        self.discarded_features = 0
        self.aligned = False
        self.ids: IntArray = np.zeros(0, dtype=np.int64)
        self.raw_uv_px = np.zeros((0, 2))
        self.views = np.full((0, history, 2), np.nan)
        self.view_frames: IntArray = np.full(history, -1, dtype=np.int64)
        self._zero_motions: dict[int, ZeroMotion] = {}
        self._bridged: set[int] = set()
        self._poses, self._t_s = GrowingArray((4, 4)), GrowingArray()
        self._odometry = GrowingArray((3,))
        self._features = FeatureTable()
        self._log = ObservationLog()

    @property
    def poses(self) -> FloatArray:
        """(n, 4, 4) world_T_camera of the frames from ``first_frame`` on, NaN where unknown; read-only."""
        return read_only(self._poses.values)

    @property
    def t_s(self) -> FloatArray:
        """(n,) times of these frames; read-only."""
        return read_only(self._t_s.values)

    @property
    def odometry(self) -> FloatArray:
        """(n, 3) tracked displacement from the previous frame, in its axes, NaN where unknown; read-only."""
        return read_only(self._odometry.values)

    @property
    def zero_motions(self) -> tuple[ZeroMotion, ...]:
        """Zero-motion constraints, one per frame that stood still."""
        return tuple(self._zero_motions.values())

    @property
    def bridged(self) -> frozenset[int]:
        """Frames without observations, posed by interpolation."""
        return frozenset(self._bridged)

    @property
    def next_frame(self) -> int:
        """Index of the frame after the last one."""
        return self.first_frame + len(self._poses)

    @property
    def first_posed(self) -> int:
        """Index of the first frame with a pose; ``next_frame`` if none has one."""
        posed = np.isfinite(self.poses[:, 0, 0])
        return self.first_frame + (int(posed.argmax()) if posed.any() else len(posed))

    @property
    def feature_count(self) -> int:
        """Number of features ever followed."""
        return len(self._features)

    @property
    def points(self) -> FloatArray:
        """(T, 3) position of every feature ever followed, NaN where it has none; read-only."""
        return read_only(self._features.points)

    @property
    def sigma_px(self) -> FloatArray:
        """(T,) reliability sigma_j (13) of every feature, NaN where it has no position; read-only."""
        return read_only(self._features.sigma_px)

    @property
    def gray(self) -> np.ndarray:
        """(T,) luminance of every feature in its first observation."""
        return self._features.gray

    @property
    def moving_views(self) -> IntArray:
        """(T,) number of views in which each feature fitted no static point, less those in which it did."""
        return self._features.moving_views

    @property
    def positioned(self) -> BoolArray:
        """(N,) whether each followed feature has a position."""
        return np.asarray(np.isfinite(self.points[self.ids, 0]))

    @property
    def last_uv_px(self) -> FloatArray:
        """(N, 2) newest undistorted observations of the followed features."""
        return self.views[:, -1]

    def pose(self, frame: int) -> FloatArray:
        """Return the pose (4, 4) of a frame of this map."""
        return np.asarray(self.poses[frame - self.first_frame])

    def view_poses(self) -> tuple[FloatArray, BoolArray]:
        """Return the poses (H, 4, 4) of the views and whether each view exists and is posed (H,)."""
        row = self.view_frames - self.first_frame
        poses = self.poses[np.clip(row, 0, len(self._poses) - 1)]
        valid = (self.view_frames >= 0) & np.isfinite(poses[:, 0, 0])
        return np.where(valid[:, None, None], poses, np.eye(4)), valid

    def observations(self, since_frame: int = 0) -> Observations:
        """Return every observation from a frame on; ``landmark`` is the feature id."""
        return self._log.since(since_frame)

    def snapshot(self) -> "LocalMap":
        """Return a copy that can be updated while this map grows."""
        twin = copy.copy(self)
        twin._poses, twin._t_s = GrowingArray.of(self._poses.values), GrowingArray.of(self._t_s.values)
        twin._odometry = GrowingArray.of(self._odometry.values)
        twin._features, twin._log = self._features.copy(), self._log.copy()
        twin._zero_motions, twin._bridged = self._zero_motions.copy(), self._bridged.copy()
        return twin

    def apply(self, update: MapUpdate) -> None:
        """Change the map; stages A to C write nowhere else."""
        if (seen := update.undistorted) is not None:
            self._log.move(seen)
            self.views = seen(self.views.reshape(-1, 2)).reshape(self.views.shape)
        if update.similarity is not None:
            self._transform(update.similarity)
        self.aligned = self.aligned or update.aligned
        for frame in update.frames:
            self._append(frame)
        if update.poses is not None:
            row = update.first_frame - self.first_frame
            self._poses.values[row : row + len(update.poses)] = update.poses
        if update.view is not None:
            self._push(update.view)
        if update.returned is not None:
            self._follow(update.returned, self._log.tracks(update.returned.ids, self.view_frames))
        if update.positions is not None:
            self._features.place(update.positions)
        if update.more_moving_views is not None:
            self._features.moving_views[self.ids] += update.more_moving_views
        if update.renew_full_tracks:
            self._renew_full_tracks()
        if update.features is not None:
            self._start(update.features)
        self._zero_motions |= {motion.frame: motion for motion in update.zero_motions}

    def _transform(self, to_world: Similarity) -> None:
        scale = to_world.scale
        self._poses.values[:] = to_world.poses(self._poses.values)
        self._features.transform(to_world)
        self._odometry.values[:] *= scale
        self._zero_motions = {frame: motion.scaled(scale) for frame, motion in self._zero_motions.items()}

    def _append(self, frame: NewFrame) -> None:
        previous = self._poses.values[-1] if len(self._poses) else np.full((4, 4), np.nan)
        if frame.bridged:
            self._bridged.add(self.next_frame)
        self._odometry.append(previous[:3, :3].T @ (frame.world_T_camera[:3, 3] - previous[:3, 3]))
        self._poses.append(frame.world_T_camera)
        self._t_s.append(frame.t_s)

    def _push(self, view: NewView) -> None:
        found = view.found
        self.ids, self.raw_uv_px = self.ids[found], view.raw_uv_px[found]
        self.views = np.concatenate([self.views[found, 1:], view.uv_px[found, None]], axis=1)
        self.view_frames = np.append(self.view_frames[1:], view.frame)
        self._log.append(view.frame, self.ids, view.uv_px[found])

    def _start(self, features: NewFeatures) -> None:
        ids = self._features.add(features.gray)
        views = np.full((len(ids), self.views.shape[1], 2), np.nan)
        self._follow(ReturnedFeatures(ids, features.raw_uv_px, features.uv_px), views)

    def _follow(self, features: ReturnedFeatures, views: FloatArray) -> None:
        """Follow features from the newest view on, which earlier views (n, H, 2) may have shown."""
        views[:, -1] = features.uv_px
        self.ids = np.append(self.ids, features.ids)
        self.raw_uv_px = np.concatenate([self.raw_uv_px, features.raw_uv_px])
        self.views = np.concatenate([self.views, views])
        self._log.append(int(self.view_frames[-1]), features.ids, features.uv_px)

    def _renew_full_tracks(self) -> None:
        """Continue features whose history is full as new ones at the same position, from the newest view."""
        full = np.isfinite(self.views[..., 0]).all(axis=1)
        if not full.any():
            return
        new = self._features.add_copies(self.ids[full])
        self.ids = self.ids.copy()
        self.ids[full] = new
        self.views[full, :-1] = np.nan
        self._log.append(int(self.view_frames[-1]), new, self.views[full, -1])

    def discard_before(self, frame: int, view_frame: int) -> FloatArray:
        """Discard poses before one frame and observations before another; the newest view always stays.

        Feature ids are lowered by a multiple of 100, so that what stage B schedules by id does not change.

        Args:
            frame: First frame that keeps its pose; at most ``view_frame``.
            view_frame: First frame that keeps its observations and its zero-motion constraint.

        Returns:
            (n, 4, 4) the discarded poses, from the previous ``first_frame`` on.
        """
        view_frame = min(view_frame, int(self.view_frames[-1]))
        frame = max(min(frame, view_frame), self.first_frame)
        self._log.discard_before(view_frame)
        kept = (m for m in self.zero_motions if m.frame >= view_frame and m.reference >= frame)
        self._zero_motions = {motion.frame: motion for motion in kept}
        discarded = self.view_frames < frame
        self.view_frames = np.where(discarded, -1, self.view_frames)
        self.views[:, discarded] = np.nan
        self._bridged = {bridged for bridged in self._bridged if bridged >= frame}
        self._discard_features()
        count = frame - self.first_frame
        old = self._poses.values[:count].copy()
        self._poses, self._t_s, self._odometry = (
            GrowingArray.of(rows.values[count:]) for rows in (self._poses, self._t_s, self._odometry)
        )
        self.first_frame = frame
        return old

    def _discard_features(self) -> None:
        smallest = self._log.smallest_id(int(self.ids.min(initial=self.feature_count)))
        if (count := smallest // _ID_STEP * _ID_STEP) == 0:
            return
        self._features.drop_first(count)
        self.discarded_features += count
        self.ids = self.ids - count
        self._log.lower_ids(count)
