"""What stages A to C share: one unbroken stretch of tracking with its poses, features and positions."""

import copy

import numpy as np

from vgps.mapping.growing_array import GrowingArray
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.solution import Observations

_GROWTH = 4096
_ROUND = 100


class LocalMap:
    """Poses of consecutive frames, features followed through them and positions of the features.

    Until it is aligned the map's world is its first camera and its unit is arbitrary. Arrays over all
    features ever seen are indexed by feature id; ``ids`` names those still followed, and rows of
    ``raw_uv_px`` and ``views`` belong to them.

    Attributes:
        first_frame: Index of the frame of ``poses[0]``.
        forgotten_features: By how much ids of features were lowered in all.
        aligned: Whether the world is the world of the GPS fixes.
        ids: (N,) features followed, ``raw_uv_px`` (N, 2) their last observation in the distorted image.
        views: (N, H, 2) undistorted observations in the frames ``view_frames`` (H,), newest last; NaN:
            unseen.
    """

    def __init__(self, first_frame: int, history: int) -> None:
        self.first_frame = first_frame
        self.forgotten_features = 0
        self._poses = GrowingArray((4, 4))
        self._steps = GrowingArray((3,))
        self.aligned = False
        self.ids: IntArray = np.zeros(0, dtype=np.int64)
        self.raw_uv_px = np.zeros((0, 2))
        self.views = np.full((0, history, 2), np.nan)
        self.view_frames: IntArray = np.full(history, -1, dtype=np.int64)
        self.zero_motions: list[ZeroMotion] = []
        self.bridged: set[int] = set()
        self._points = np.full((_GROWTH, 3), np.nan)
        self._sigma_px = np.full(_GROWTH, np.nan)
        self._gray = np.zeros(_GROWTH, dtype=np.uint8)
        self._count = 0
        self._log: list[tuple[int, IntArray, FloatArray]] = []

    @property
    def poses(self) -> FloatArray:
        """(n, 4, 4) world_T_camera of the frames from ``first_frame`` on, NaN where not known; writable."""
        return self._poses.values

    @property
    def steps(self) -> FloatArray:
        """(n, 3) way to each pose from the one before, in its axes, as seen when the frame came, before
        any fix of its time bent it; NaN where not known."""
        return self._steps.values

    @property
    def next_frame(self) -> int:
        """Index of the frame that comes after the last one posed."""
        return self.first_frame + len(self.poses)

    @property
    def first_posed(self) -> int:
        """Index of the first frame with a pose; ``next_frame`` if none has one."""
        known = np.isfinite(self.poses[:, 0, 0])
        return self.first_frame + (int(known.argmax()) if known.any() else len(self.poses))

    @property
    def feature_count(self) -> int:
        """Features ever followed."""
        return self._count

    @property
    def points(self) -> FloatArray:
        """(T, 3) position of every feature ever followed, NaN where it has none."""
        return self._points[: self._count]

    @property
    def sigma_px(self) -> FloatArray:
        """(T,) reliability sigma_j (13) of every feature ever followed, NaN where it has none."""
        return self._sigma_px[: self._count]

    @property
    def gray(self) -> np.ndarray:
        """(T,) luminance of every feature where it was first seen."""
        return self._gray[: self._count]

    @property
    def positioned(self) -> BoolArray:
        """(N,) whether each followed feature has a position."""
        return np.asarray(np.isfinite(self._points[self.ids, 0]))

    @property
    def last_uv_px(self) -> FloatArray:
        """(N, 2) newest undistorted observation of the followed features."""
        return self.views[:, -1]

    def snapshot(self) -> "LocalMap":
        """A copy whose poses and positions may be changed while this map goes on growing."""
        twin = copy.copy(self)
        twin._poses, twin._steps = GrowingArray.of(self.poses), GrowingArray.of(self.steps)
        twin._points, twin._sigma_px = self._points.copy(), self._sigma_px.copy()
        twin.zero_motions, twin.bridged, twin._log = self.zero_motions[:], set(self.bridged), self._log[:]
        return twin

    def append_pose(self, world_T_camera: FloatArray) -> None:
        """The pose of the next frame; NaN if it is not known yet."""
        before = self.poses[-1] if len(self.poses) else np.full((4, 4), np.nan)
        self._steps.append(before[:3, :3].T @ (world_T_camera[:3, 3] - before[:3, 3]))
        self._poses.append(world_T_camera)

    def push_view(self, frame: int, raw_uv_px: FloatArray, uv_px: FloatArray, found: BoolArray) -> None:
        """A frame in which the followed features were seen again (``found`` (N,)); the others are let go."""
        self.ids, self.raw_uv_px = self.ids[found], raw_uv_px[found]
        self.views = np.concatenate([self.views[found, 1:], uv_px[found, None]], axis=1)
        self.view_frames = np.append(self.view_frames[1:], frame)
        self._log.append((frame, self.ids, uv_px[found]))

    def add_features(self, raw_uv_px: FloatArray, uv_px: FloatArray, gray: np.ndarray) -> None:
        """Begin to follow new features, seen in the frame pushed last."""
        ids = self._new_ids(len(uv_px))
        self._gray[ids] = gray
        views = np.full((len(ids), self.views.shape[1], 2), np.nan)
        views[:, -1] = uv_px
        self.ids, self.raw_uv_px = np.append(self.ids, ids), np.concatenate([self.raw_uv_px, raw_uv_px])
        self.views = np.concatenate([self.views, views])
        frame = int(self.view_frames[-1])
        self._log.append((frame, ids, uv_px))

    def renew_full_tracks(self) -> None:
        """Go on with features whose history is full as new ones, at the same place, from the newest view."""
        full = np.isfinite(self.views[:, 0, 0])
        if not full.any():
            return
        old, new = self.ids[full], self._new_ids(int(full.sum()))
        self._points[new], self._sigma_px[new] = self._points[old], self._sigma_px[old]
        self._gray[new] = self._gray[old]
        self.ids = self.ids.copy()
        self.ids[full] = new
        self.views[full, :-1] = np.nan
        self._log.append((int(self.view_frames[-1]), new, self.views[full, -1]))

    def _new_ids(self, count: int) -> IntArray:
        ids = np.arange(self._count, self._count + count)
        self._count += count
        while self._count > len(self._gray):
            more = max(len(self._gray), _GROWTH)
            self._points = np.concatenate([self._points, np.full((more, 3), np.nan)])
            self._sigma_px = np.concatenate([self._sigma_px, np.full(more, np.nan)])
            self._gray = np.concatenate([self._gray, np.zeros(more, dtype=np.uint8)])
        return ids

    def set_points(self, ids: IntArray, points: FloatArray, sigma_px: FloatArray) -> None:
        """Positions (n, 3) and reliabilities (n,) of features."""
        self._points[ids], self._sigma_px[ids] = points, sigma_px

    def forget_points(self, ids: IntArray) -> None:
        """Features whose position is not to be trusted go on without one."""
        self._points[ids], self._sigma_px[ids] = np.nan, np.nan

    def pose(self, frame: int) -> FloatArray:
        """(4, 4) pose of a frame of this map."""
        return np.asarray(self.poses[frame - self.first_frame])

    def pose_standing_frames(self) -> None:
        """Frames that stood still before the map began stand where their view does."""
        for tie in self.zero_motions:
            row = tie.frame - self.first_frame
            if np.isnan(self.poses[row, 0, 0]):
                self.poses[row] = self.pose(tie.key) @ tie.key_T_frame

    def view_poses(self) -> tuple[FloatArray, BoolArray]:
        """(H, 4, 4) poses of the views and (H,) whether each view exists and is posed."""
        row = self.view_frames - self.first_frame
        poses = self.poses[np.clip(row, 0, len(self.poses) - 1)]
        valid = (self.view_frames >= 0) & np.isfinite(poses[:, 0, 0])
        return np.where(valid[:, None, None], poses, np.eye(4)), valid

    def forget(self, before_frame: int, before_view: int) -> FloatArray:
        """Let go of poses before one frame and of observations before another; the newest view always stays.

        Ids of features are counted anew by a round number, so that what is scheduled by id stays.

        Args:
            before_frame: Not after ``before_view``.
            before_view: Ties of standing frames before it go too.

        Returns:
            (n, 4, 4) the poses let go, from ``first_frame`` as it was on.
        """
        newest = int(self.view_frames[-1])
        before_view = min(before_view, newest)
        before_frame = max(min(before_frame, before_view), self.first_frame)
        self._log = [entry for entry in self._log if entry[0] >= before_view]
        self.zero_motions = [
            tie for tie in self.zero_motions if tie.frame >= before_view and tie.key >= before_frame
        ]
        gone = self.view_frames < before_frame
        self.view_frames = np.where(gone, -1, self.view_frames)
        self.views[:, gone] = np.nan
        self.bridged = {frame for frame in self.bridged if frame >= before_frame}
        self._forget_features()
        count = before_frame - self.first_frame
        old = self.poses[:count].copy()
        self._poses, self._steps = GrowingArray.of(self.poses[count:]), GrowingArray.of(self.steps[count:])
        self.first_frame = before_frame
        return old

    def _forget_features(self) -> None:
        followed = [self.ids, *(ids for _, ids, _ in self._log)]
        drop = int(min(ids.min(initial=self._count) for ids in followed)) // _ROUND * _ROUND
        if drop == 0:
            return
        self._points, self._sigma_px = self._points[drop:].copy(), self._sigma_px[drop:].copy()
        self._gray = self._gray[drop:].copy()
        self._count -= drop
        self.forgotten_features += drop
        self.ids = self.ids - drop
        self._log = [(frame, ids - drop, uv) for frame, ids, uv in self._log]

    def observations(self, since_frame: int = 0) -> Observations:
        """Every observation from a frame on; ``landmark`` is the feature id."""
        start = next((k for k in range(len(self._log)) if self._log[k][0] >= since_frame), len(self._log))
        log = self._log[start:]
        if not log:
            empty: IntArray = np.zeros(0, dtype=np.int64)
            return Observations(empty, empty, np.zeros((0, 2)))
        frames = np.concatenate([np.full(len(ids), frame) for frame, ids, _ in log])
        return Observations(
            frames, np.concatenate([ids for _, ids, _ in log]), np.concatenate([uv for _, _, uv in log])
        )

    def transform(self, scale: float, world_R_map: FloatArray, world_p_map: FloatArray) -> None:
        """Move the map into the world by a similarity: ``x_world = scale * R x_map + p``."""
        self.poses[:, :3, 3] = scale * self.poses[:, :3, 3] @ world_R_map.T + world_p_map
        self.poses[:, :3, :3] = world_R_map @ self.poses[:, :3, :3]
        self._points = scale * self._points @ world_R_map.T + world_p_map
        self._steps.values[:] *= scale
        self.zero_motions = [tie.scaled(scale) for tie in self.zero_motions]
