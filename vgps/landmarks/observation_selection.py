"""Which landmarks of a run are known well enough for a database, and from where each is kept."""

from dataclasses import dataclass

import numpy as np

from vgps.config import Frames, LandmarksConfig
from vgps.geometry import project
from vgps.landmarks.farthest_point_sampling import ViewMetric, farthest_point_sampling
from vgps.landmarks.patches import patch_in_image
from vgps.landmarks.position_uncertainty import position_sigmas_m
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.solution import FrameState, Solution


@dataclass(frozen=True)
class LandmarkObservations:
    """Landmarks seen in frames, sorted by landmark.

    Attributes:
        landmark, frame: (N,) rows of the run's landmarks and frames.
        world_T_camera: (N, 4, 4), ``world_p_landmark`` (N, 3).
        uv_px: (N, 2) where the landmark projects, undistorted.
        depth_m: (N,), ``error_px`` (N,) from there to where it was seen.
    """

    landmark: IntArray
    frame: IntArray
    world_T_camera: FloatArray
    world_p_landmark: FloatArray
    uv_px: FloatArray
    depth_m: FloatArray
    error_px: FloatArray

    def take(self, rows: IntArray | BoolArray) -> "LandmarkObservations":
        """Some of them."""
        return LandmarkObservations(*(values[rows] for values in vars(self).values()))


def collect_observations(solution: Solution) -> LandmarkObservations:
    """Every observation of a run against where its landmark projects."""
    seen = solution.observations
    order = np.lexsort((seen.frame, seen.landmark))
    landmark, frame = seen.landmark[order], seen.frame[order]
    poses, points = solution.world_T_camera[frame], solution.landmarks.world_p_landmark[landmark]
    uv, depth = project(solution.camera.K, poses, points[:, None])
    error = np.linalg.norm(uv[:, 0] - seen.uv_px[order], axis=1)
    return LandmarkObservations(landmark, frame, poses, points, uv[:, 0], depth[:, 0], error)


def template_frames(solution: Solution, frames: Frames) -> BoolArray:
    """(F,) whether a frame may give templates: one of those asked for, and tracked."""
    tracked = np.array([state is FrameState.TRACKED for state in solution.state], bool)
    parity = np.arange(len(tracked)) % 2
    wanted = {"even": parity == 0, "odd": parity == 1, "all": parity >= 0}
    return np.asarray(tracked & wanted[frames])


def reliable_landmarks(
    solution: Solution, observations: LandmarkObservations, config: LandmarksConfig
) -> tuple[BoolArray, FloatArray]:
    """(L,) which landmarks are known well enough, and (L,) the standard deviation of each position [m]."""
    total = len(solution.landmarks.sigma_px)
    sigma_m, nearest_m = np.full(total, np.inf), np.full(total, np.nan)
    if len(observations.landmark):
        start = np.flatnonzero(np.diff(observations.landmark, prepend=-1))
        owner, count = np.unique(observations.landmark, return_counts=True)
        # a track drifts as a whole: many observations of it tell of the position no more than their mean does
        sigma_px = solution.landmarks.sigma_px[owner] * np.sqrt(count)
        poses, points = observations.world_T_camera, observations.world_p_landmark
        sigma_m[owner] = position_sigmas_m(solution.camera.K, poses, points, start, sigma_px)
        nearest_m[owner] = np.minimum.reduceat(observations.depth_m, start)
    often = np.bincount(observations.landmark, minlength=total) >= config.min_observations
    sure = (solution.landmarks.sigma_px <= config.max_sigma_px) & (nearest_m > 0)
    return often & sure & (sigma_m <= config.max_relative_sigma * nearest_m), sigma_m


def select_views(
    solution: Solution, observations: LandmarkObservations, frames: Frames, config: LandmarksConfig
) -> LandmarkObservations:
    """The observations of known landmarks that become views, spread in direction and scale.

    Args:
        solution: Of a run.
        observations: Of known landmarks.
        frames: Which frames may give templates.
        config: How many views, how different.
    """
    usable = template_frames(solution, frames)[observations.frame]
    usable &= (observations.depth_m > 0) & (observations.error_px <= config.max_error_px)
    usable &= patch_in_image(observations.uv_px, solution.camera, config.patch_px)
    found = observations.take(usable)
    to_camera = found.world_T_camera[:, :3, 3] - found.world_p_landmark
    direction = to_camera / np.linalg.norm(to_camera, axis=1, keepdims=True)
    units = ViewMetric(config.angle_unit_deg, config.octave_unit)
    place = units.coordinates(direction, np.log2(found.depth_m))
    return found.take(
        farthest_point_sampling(
            found.landmark, place, found.error_px, config.max_views, config.least_difference
        )
    )
