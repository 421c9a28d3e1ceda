"""Where a path comes back to a place, as far as its standard deviations tell."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from vgps.config.loops import LoopsConfig
from vgps.model import Camera, FloatArray, IntArray
from vgps.solution import Observations


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
        steps = np.linalg.norm(np.diff(self.poses[:, :3, 3], axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

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
    centre, ahead = video.poses[frames, :3, 3], video.poses[frames, :3, 2]
    reach = config.reach * video.depth[frames] + config.path_sigmas * video.sigma_m[frames]
    tree = cKDTree(centre)
    pairs = np.sort(tree.query_pairs(2.0 * float(reach.max()), output_type="ndarray"), axis=1)
    early, late = pairs[:, 0], pairs[:, 1]
    distance = np.linalg.norm(centre[late] - centre[early], axis=1)
    between = video.travelled[frames[late]] - video.travelled[frames[early]]
    allowed = config.reach * video.depth[frames[late]] + config.path_sigmas * np.hypot(
        video.sigma_m[frames[late]], video.sigma_m[frames[early]]
    )
    aligned = np.einsum("ni,ni->n", ahead[late], ahead[early]) > np.cos(np.radians(config.max_angle_deg))
    apart = between > config.apart * np.maximum(video.depth[frames[late]], video.depth[frames[early]])
    if video.run is not None:
        apart = video.run[frames[late]] != video.run[frames[early]]
    kept = np.flatnonzero(aligned & apart & (distance < allowed))
    kept = kept[np.lexsort((distance[kept], late[kept]))]
    return np.asarray(frames[np.stack([late[kept], early[kept]], axis=1)], np.int64).reshape(-1, 2)


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
