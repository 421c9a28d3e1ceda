"""One frame searched for landmarks around a supposed pose, and the pose that they give; (C) to (E)."""

from dataclasses import dataclass

import numpy as np

from vgps.config import LocalizationConfig
from vgps.geometry import project
from vgps.landmarks.model import LandmarkViews
from vgps.localization.pose import PoseEstimate, pose_from_matches
from vgps.localization.template_matching import match_templates
from vgps.model import BoolArray, Float32Array, FloatArray, IntArray


@dataclass(frozen=True)
class LandmarkMatches:
    """Landmarks found in a frame.

    Attributes:
        landmark: (N,) ids.
        world_p_landmark: (N, 3).
        uv_px: (N, 2) undistorted.
        sigma_px: (N,) standard deviations, of match and landmark together.
    """

    landmark: IntArray
    world_p_landmark: FloatArray
    uv_px: FloatArray
    sigma_px: FloatArray

    def __len__(self) -> int:
        return len(self.landmark)

    def take(self, rows: BoolArray) -> "LandmarkMatches":
        """Some of them."""
        return LandmarkMatches(
            self.landmark[rows], self.world_p_landmark[rows], self.uv_px[rows], self.sigma_px[rows]
        )


NO_MATCHES = LandmarkMatches(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 2)), np.zeros(0))


@dataclass(frozen=True)
class SearchResult:
    """What a search gave.

    Attributes:
        pose: From the matches; None if too few agree on one.
        observations: Those that agree with the pose; all matches if there is none.
        correlation: Median over these; 0 if there were none.
    """

    pose: PoseEstimate | None
    observations: LandmarkMatches
    correlation: float


@dataclass(frozen=True)
class ExpectedLandmarks:
    """What to look for: ``views`` of N landmarks, and ``templates`` (N, M, M) as the image will show them."""

    views: LandmarkViews
    templates: Float32Array

    def take(self, rows: IntArray) -> "ExpectedLandmarks":
        """Some of it."""
        return ExpectedLandmarks(self.views.take(rows), self.templates[rows])


def search_frame(
    image: Float32Array,
    K: FloatArray,
    world_T_camera: FloatArray,
    expected: ExpectedLandmarks,
    radius_px: FloatArray,
    config: LocalizationConfig,
) -> SearchResult:
    """Look for every landmark around its projection and pose the camera by what is found.

    Args:
        image: (H, W) undistorted grey.
        K: (3, 3).
        world_T_camera: (4, 4) supposed.
        expected: N landmarks.
        radius_px: (N,) half sides of the windows.
        config: Settings.
    """
    views = expected.views
    if len(views) == 0:
        return SearchResult(None, NO_MATCHES, 0.0)
    predicted, depth = project(K, world_T_camera, views.world_p_landmark)
    matches = match_templates(image, expected.templates, predicted, radius_px, config.min_contrast)
    good = matches.correlation >= config.min_correlation
    sigma = match_sigma_px(K, views, depth, config)
    seen = LandmarkMatches(views.landmark, views.world_p_landmark, matches.uv_px, sigma).take(good)
    median = float(np.median(matches.correlation))
    pose = pose_from_matches(
        K,
        seen.world_p_landmark,
        seen.uv_px,
        seen.sigma_px,
        config.ransac_px,
        config,
        guess=world_T_camera,
    )
    if pose is None or pose.inlier.sum() < required_inliers(len(seen), config):
        return SearchResult(None, seen, median)
    return SearchResult(pose, seen.take(pose.inlier), median)


def required_inliers(matches: int, config: LocalizationConfig) -> int:
    """How many matches must agree: six, Matsuda 2007, and a share of all."""
    return max(config.min_inliers, int(np.ceil(config.min_inlier_share * matches)))


def match_sigma_px(
    K: FloatArray, views: LandmarkViews, depth: FloatArray, config: LocalizationConfig
) -> FloatArray:
    """(N,) standard deviation of matches: of matching, of the landmark's picture, of its position."""
    of_position = K[0, 0] * views.position_sigma_m / np.maximum(depth, 1.0)
    variance = config.match_sigma_px**2 + views.sigma_px**2 + np.nan_to_num(of_position) ** 2
    return np.asarray(np.sqrt(variance))
