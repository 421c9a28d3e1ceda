"""Where a path comes back to a place, within its standard deviations."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from vgps.config.loops import LoopsConfig
from vgps.geometry import travelled
from vgps.model import Camera, FloatArray, IntArray
from vgps.solution import Observations

_MOST = 1000  # earlier frames among which the index of words chooses, the nearest; bounds time and memory


@dataclass(frozen=True, kw_only=True)
class PosedVideo:
    """A video with poses and landmarks.

    Attributes:
        poses: (F, 4, 4) world_T_camera.
        sigma_m: (F,) largest standard deviation of each position.
        points: (L, 3) landmarks.
        observations: Of these landmarks.
        camera: The camera by which they are undistorted.
        run: (F,) number of the run of each frame, ascending; by default all are of one. Of several runs only
            frames of different ones are compared.
    """

    poses: FloatArray
    sigma_m: FloatArray
    points: FloatArray
    observations: Observations
    camera: Camera
    run: IntArray | None = None

    @cached_property
    def travelled(self) -> FloatArray:
        """(F,) distance along the path."""
        return travelled(self.poses[:, :3, 3])

    @cached_property
    def depth(self) -> FloatArray:
        """(F,) median depth of the landmarks that each frame observes, NaN where it observes none."""
        frame, landmark = self.observations.frame, self.observations.landmark
        pose = self.poses[frame]
        away = np.einsum("ni,ni->n", self.points[landmark] - pose[:, :3, 3], pose[:, :3, 2])
        order = np.lexsort((away, frame))
        seen, first, count = np.unique(frame[order], return_index=True, return_counts=True)
        depth = np.full(len(self.poses), np.nan)
        depth[seen] = away[order][first + count // 2]
        return depth


def revisits(video: PosedVideo, config: LoopsConfig) -> IntArray:
    """Return pairs (n, 2) of frames, the later one first, that may show the same place on different visits.

    Visits of one video are different if much of the path lies between them.

    Pairs are in order of the later frame, and for it the nearest earlier frame comes first.
    """
    frames = spaced_frames(video, config.spacing)
    if len(frames) < 2:
        return np.zeros((0, 2), np.int64)
    tree = cKDTree(video.poses[frames, :3, 3])
    found = [_candidates(video, frames, tree, late, config) for late in range(len(frames))]
    late = np.repeat(np.arange(len(frames)), [len(early) for early in found])
    return np.stack([frames[late], np.concatenate(found)], axis=1)


def _candidates(
    video: PosedVideo, frames: IntArray, tree: cKDTree, late: int, config: LoopsConfig
) -> IntArray:
    """Return the earlier frames (n,) that may show what a frame shows, the nearest first.

    Args:
        video: Poses and their standard deviations.
        frames: (k,) the frames that are compared.
        tree: Their positions.
        late: Row of the frame in ``frames``.
        config: Limits.
    """
    frame, sigma_m = int(frames[late]), video.sigma_m
    reach = config.reach * video.depth[frame]
    most = reach + config.path_sigmas * float(np.hypot(sigma_m[frame], sigma_m[frames].max()))
    rows = np.array(tree.query_ball_point(video.poses[frame, :3, 3], most), dtype=np.int64)
    early = frames[rows[rows < late]]
    distance = np.linalg.norm(video.poses[early, :3, 3] - video.poses[frame, :3, 3], axis=1)
    near = distance < reach + config.path_sigmas * np.hypot(sigma_m[frame], sigma_m[early])
    aligned = video.poses[early, :3, 2] @ video.poses[frame, :3, 2] > np.cos(np.radians(config.max_angle_deg))
    if video.run is None:
        between = video.travelled[frame] - video.travelled[early]
        apart = between > config.apart * np.maximum(video.depth[frame], video.depth[early])
    else:
        apart = video.run[early] != video.run[frame]
    kept = np.flatnonzero(near & aligned & apart)
    return np.asarray(early[kept[np.argsort(distance[kept], kind="stable")][:_MOST]])


def allowed(
    pose: FloatArray, by_path: FloatArray, sigma_m: float, depth_m: float, config: LoopsConfig
) -> bool:
    """Whether a frame may have a pose (4, 4) by landmarks of an earlier visit; further off is a look-alike.

    Args:
        pose: By the landmarks.
        by_path: (4, 4) by the path.
        sigma_m: Standard deviation of the difference of their positions.
        depth_m: Median depth of the frame's landmarks.
        config: Limits.
    """
    off_m = np.linalg.norm(pose[:3, 3] - by_path[:3, 3])
    turned = pose[:3, 2] @ by_path[:3, 2]
    near = off_m < config.path_sigmas * sigma_m + config.slack * depth_m
    return bool(near and turned > np.cos(np.radians(config.max_angle_deg)))


def spaced_frames(video: PosedVideo, spacing: float) -> IntArray:
    """Return frames that lie at least a share of the depth apart along the path; all with observations."""
    usable = np.flatnonzero(np.isfinite(video.depth) & np.isfinite(video.sigma_m) & (video.depth > 0))
    frames: list[int] = []
    next_m = -np.inf
    for frame in usable.tolist():
        if video.travelled[frame] >= next_m:
            frames.append(frame)
            next_m = video.travelled[frame] + spacing * video.depth[frame]
    return np.array(frames, np.int64)
