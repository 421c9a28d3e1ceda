"""The local map that stages A to C share: poses, features and positions of unbroken tracking."""

import copy

import numpy as np

from vgps.mapping.feature_table import FeatureTable
from vgps.mapping.followed_features import FollowedFeatures
from vgps.mapping.growing_array import read_only
from vgps.mapping.map_path import MapPath
from vgps.mapping.map_update import MapUpdate, NewFeatures, ReturnedFeatures, Similarity
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
        discarded_features: Total by which feature ids were lowered.
        aligned: Whether the map's world is the world of the GPS fixes.
    """

    def __init__(self, first_frame: int, history: int) -> None:
        self.discarded_features = 0
        self.aligned = False
        self._followed = FollowedFeatures(history)
        self._zero_motions: dict[int, ZeroMotion] = {}
        self._path = MapPath(first_frame)
        self._features = FeatureTable()
        self._log = ObservationLog()

    @property
    def first_frame(self) -> int:
        """Index of the frame of ``poses[0]``."""
        return self._path.first_frame

    @property
    def poses(self) -> FloatArray:
        """(n, 4, 4) world_T_camera of the frames from ``first_frame`` on, NaN where unknown; read-only."""
        return self._path.poses

    @property
    def t_s(self) -> FloatArray:
        """(n,) times of these frames; read-only."""
        return self._path.t_s

    @property
    def odometry(self) -> FloatArray:
        """(n, 3) tracked displacement from the previous frame, in its axes, NaN where unknown; read-only."""
        return self._path.odometry

    @property
    def bending(self) -> FloatArray:
        """(n,) variance, rad^2 about each axis, by which a rotation may err more than the one before, by the
        covariance of stage C; NaN where that says nothing; read-only.
        """
        return self._path.bending

    @property
    def zero_motions(self) -> tuple[ZeroMotion, ...]:
        """Zero-motion constraints, one per frame that stood still."""
        return tuple(self._zero_motions.values())

    @property
    def moving(self) -> BoolArray:
        """(n,) whether the camera moved since the frame before; during a stop nothing drifts."""
        standing = np.array(list(self._zero_motions), dtype=np.int64)
        return ~np.isin(self.first_frame + np.arange(len(self._path)), standing)

    def last_moving(self, count: int) -> int:
        """Return the first of the last ``count`` frames in which the camera moved; of all if fewer did."""
        rows = np.flatnonzero(self.moving)[-count:]
        return self.first_frame + (int(rows[0]) if len(rows) else 0)

    @property
    def bridged(self) -> frozenset[int]:
        """Frames without observations, posed by interpolation."""
        return self._path.bridged

    @property
    def next_frame(self) -> int:
        """Index of the frame after the last one."""
        return self._path.next_frame

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
    def ids(self) -> IntArray:
        """(N,) ids of the followed features."""
        return self._followed.ids

    @property
    def raw_uv_px(self) -> FloatArray:
        """(N, 2) their last observations in the distorted image."""
        return self._followed.raw_uv_px

    @property
    def views(self) -> FloatArray:
        """(N, H, 2) their undistorted observations, newest last; NaN where one was not observed."""
        return self._followed.views

    @property
    def view_frames(self) -> IntArray:
        """(H,) frames of the views, -1 where there is none."""
        return self._followed.view_frames

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
        poses = self.poses[np.clip(row, 0, len(self._path) - 1)]
        valid = (self.view_frames >= 0) & np.isfinite(poses[:, 0, 0])
        return np.where(valid[:, None, None], poses, np.eye(4)), valid

    def observations(self, since_frame: int = 0) -> Observations:
        """Return every observation from a frame on; ``landmark`` is the feature id."""
        return self._log.since(since_frame)

    def snapshot(self) -> "LocalMap":
        """Return a copy that can be updated while this map grows."""
        twin = copy.copy(self)
        twin._path, twin._followed = self._path.snapshot(), self._followed.snapshot()
        twin._features, twin._log = self._features.copy(), self._log.copy()
        twin._zero_motions = self._zero_motions.copy()
        return twin

    def apply(self, update: MapUpdate) -> None:
        """Change the map; stages A to C write nowhere else."""
        if (seen := update.undistorted) is not None:
            self._log.move(seen)
            self._followed.undistort_again(seen)
        if update.similarity is not None:
            self._transform(update.similarity)
        self.aligned = self.aligned or update.aligned
        if update.end is not None:
            self._path = self._path.part(self.first_frame, update.end)
            self._zero_motions = {f: motion for f, motion in self._zero_motions.items() if f < update.end}
        for frame in update.frames:
            self._path.append(frame)
        if update.poses is not None:
            self._path.replace(update.first_frame, update.poses, update.bending)
        if (view := update.view) is not None:
            self._followed.push(view)
            self._log.append(view.frame, self.ids, view.uv_px[view.found])
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
        self._path.transform(to_world)
        self._features.transform(to_world)
        motions = self._zero_motions.items()
        self._zero_motions = {frame: motion.scaled(to_world.scale) for frame, motion in motions}

    def _start(self, features: NewFeatures) -> None:
        ids = self._features.add(features.gray)
        self._follow(ReturnedFeatures(ids, features.raw_uv_px, features.uv_px))

    def _follow(self, features: ReturnedFeatures, views: FloatArray | None = None) -> None:
        self._followed.follow(features, views)
        self._log.append(self._followed.newest, features.ids, features.uv_px)

    def _renew_full_tracks(self) -> None:
        """Continue features whose history is full as new ones at the same position, from the newest view."""
        full = self._followed.full
        if full.any():
            new = self._features.add_copies(self.ids[full])
            self._followed.renew(full, new)
            self._log.append(self._followed.newest, new, self.last_uv_px[full])

    def discard_before(self, frame: int, view_frame: int) -> FloatArray:
        """Discard poses before one frame and observations before another; the newest view always stays.

        Feature ids are lowered by a multiple of 100, so that what stage B schedules by id does not change.

        Args:
            frame: First frame that keeps its pose; at most ``view_frame``.
            view_frame: First frame that keeps its observations.

        Returns:
            (n, 4, 4) the discarded poses, from the previous ``first_frame`` on.
        """
        view_frame = min(view_frame, self._followed.newest)
        frame = max(min(frame, view_frame), self.first_frame)
        self._log.discard_before(view_frame)
        kept = (m for m in self.zero_motions if m.frame >= frame)
        self._zero_motions = {motion.frame: motion for motion in kept}
        self._followed.discard_before(frame)
        self._discard_features()
        old = self.poses[: frame - self.first_frame].copy()
        self._path = self._path.part(frame, self.next_frame)
        return old

    def _discard_features(self) -> None:
        smallest = self._log.smallest_id(int(self.ids.min(initial=self.feature_count)))
        if (count := smallest // _ID_STEP * _ID_STEP) == 0:
            return
        self._features.drop_first(count)
        self.discarded_features += count
        self._followed.lower_ids(count)
        self._log.lower_ids(count)
