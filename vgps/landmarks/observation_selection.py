"""Selection of the landmarks of a run, and of the observations of them that become views of a database."""

from dataclasses import dataclass

import numpy as np

from vgps.config import Frames, LandmarksConfig
from vgps.geometry import project
from vgps.landmarks.farthest_point_sampling import ViewMetric, sample_farthest
from vgps.landmarks.patches import patch_in_image
from vgps.landmarks.position_uncertainty import position_sigmas_m
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.rolling_shutter import row_poses
from vgps.solution import FrameState, Solution


@dataclass(frozen=True, kw_only=True)
class LandmarkObservations:
    """Observations of landmarks in frames, sorted by landmark.

    Attributes:
        landmark, frame: (N,) rows of the run's landmarks and frames.
        world_T_camera: (N, 4, 4) pose of the frame, or of the row of a rolling shutter.
        world_p_landmark: (N, 3) metres.
        uv_px: (N, 2) projection of the landmark, undistorted.
        depth_m: (N,) depth of the landmark.
        error_px: (N,) distance between projection and observation.
    """

    landmark: IntArray
    frame: IntArray
    world_T_camera: FloatArray
    world_p_landmark: FloatArray
    uv_px: FloatArray
    depth_m: FloatArray
    error_px: FloatArray

    def take(self, rows: IntArray | BoolArray) -> "LandmarkObservations":
        """Return the observations in ``rows``."""
        return LandmarkObservations(**{name: values[rows] for name, values in vars(self).items()})


def collect_observations(solution: Solution) -> LandmarkObservations:
    """Return every observation of a run with the projection of its landmark."""
    observed = solution.observations
    order = np.lexsort((observed.frame, observed.landmark))
    landmark, frame = observed.landmark[order], observed.frame[order]
    uv_px, points = observed.uv_px[order], solution.landmarks.world_p_landmark[landmark]
    poses = row_poses(solution.camera, solution.t_s, solution.world_T_camera, frame, uv_px)
    uv, depth = project(solution.camera.K, poses, points[:, None])
    return LandmarkObservations(
        landmark=landmark,
        frame=frame,
        world_T_camera=poses,
        world_p_landmark=points,
        uv_px=uv[:, 0],
        depth_m=depth[:, 0],
        error_px=np.linalg.norm(uv[:, 0] - uv_px, axis=1),
    )


def template_frames(solution: Solution, frames: Frames) -> BoolArray:
    """Return which frames (F,) may give templates: those selected and tracked."""
    tracked = np.array([state is FrameState.TRACKED for state in solution.state], bool)
    parity = np.arange(len(tracked)) % 2
    selected = {"even": parity == 0, "odd": parity == 1, "all": parity >= 0}
    return np.asarray(tracked & selected[frames])


def reliable_landmarks(
    solution: Solution, observations: LandmarkObservations, config: LandmarksConfig
) -> tuple[BoolArray, FloatArray]:
    """Return which landmarks (L,) are reliable, and the standard deviation (L,) of each position, metres."""
    total = len(solution.landmarks.sigma_px)
    sigma_m, nearest_m = np.full(total, np.inf), np.full(total, np.nan)
    if len(observations.landmark):
        start = np.flatnonzero(np.diff(observations.landmark, prepend=-1))
        owner, count = np.unique(observations.landmark, return_counts=True)
        # a track drifts as a whole: many observations constrain the position no better than their mean
        sigma_px = solution.landmarks.sigma_px[owner] * np.sqrt(count)
        poses, points = observations.world_T_camera, observations.world_p_landmark
        sigma_m[owner] = position_sigmas_m(solution.camera.K, poses, points, start, sigma_px)
        nearest_m[owner] = np.minimum.reduceat(observations.depth_m, start)
    often = np.bincount(observations.landmark, minlength=total) >= config.min_observations
    precise = (solution.landmarks.sigma_px <= config.max_sigma_px) & (nearest_m > 0)
    return often & precise & (sigma_m <= config.max_relative_sigma * nearest_m), sigma_m


def select_views(
    solution: Solution, observations: LandmarkObservations, frames: Frames, config: LandmarksConfig
) -> LandmarkObservations:
    """Select the observations that become views, spread in direction and scale.

    Args:
        solution: The run.
        observations: Of reliable landmarks.
        frames: Frames that may give templates.
        config: Number of views per landmark, and how they must differ.
    """
    usable = template_frames(solution, frames)[observations.frame]
    usable &= (observations.depth_m > 0) & (observations.error_px <= config.max_error_px)
    usable &= patch_in_image(observations.uv_px, solution.camera, config.patch_px)
    candidates = observations.take(usable)
    to_camera = candidates.world_T_camera[:, :3, 3] - candidates.world_p_landmark
    direction = to_camera / np.linalg.norm(to_camera, axis=1, keepdims=True)
    metric = ViewMetric(config.angle_unit_deg, config.octave_unit)
    place = metric.coordinates(direction, np.log2(candidates.depth_m))
    error = candidates.error_px / config.error_unit_px
    selected = sample_farthest(
        candidates.landmark, place, error, config.max_views, config.min_view_difference
    )
    return candidates.take(selected)
