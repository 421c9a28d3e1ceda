"""Search of a frame for landmarks around a supposed pose, and the pose from the matches; (D) and (E)."""

from dataclasses import dataclass

import numpy as np

from vgps.config import LocalizationConfig
from vgps.geometry import project
from vgps.landmarks.model import LandmarkViews
from vgps.localization.pose import (
    NO_MATCHES,
    LandmarkMatches,
    PoseEstimate,
    pose_from_matches,
)
from vgps.localization.template_matching import match_templates
from vgps.model import Float32Array, FloatArray, IntArray


@dataclass(frozen=True)
class SearchResult:
    """Result of a search.

    Attributes:
        pose: From the matches; None if too few agree on one.
        matches: Those that agree with the pose; all if there is none.
        correlation: Median over all landmarks searched; 0 if there were none.
    """

    pose: PoseEstimate | None
    matches: LandmarkMatches
    correlation: float


@dataclass(frozen=True)
class ExpectedLandmarks:
    """Landmarks to search.

    Attributes:
        views: Of N landmarks.
        templates: (N, M, M), rendered.
        shift_px: (N, 2) how far a rolling shutter shows them from where the middle row's pose does.
    """

    views: LandmarkViews
    templates: Float32Array
    shift_px: FloatArray

    def take(self, rows: IntArray) -> "ExpectedLandmarks":
        """Return the landmarks in ``rows``."""
        return ExpectedLandmarks(self.views.take(rows), self.templates[rows], self.shift_px[rows])


def search_frame(
    image: Float32Array,
    K: FloatArray,
    world_T_camera: FloatArray,
    expected: ExpectedLandmarks,
    radius_px: FloatArray,
    config: LocalizationConfig,
) -> SearchResult:
    """Search for every landmark around its projection and estimate the pose from the matches.

    Args:
        image: (H, W) undistorted grey.
        K: (3, 3).
        world_T_camera: (4, 4) supposed pose.
        expected: N landmarks.
        radius_px: (N,) half sides of the windows.
        config: Settings.
    """
    views = expected.views
    if len(views) == 0:
        return SearchResult(None, NO_MATCHES, 0.0)
    predicted, depth = project(K, world_T_camera, views.world_p_landmark)
    shift = expected.shift_px
    found = match_templates(image, expected.templates, predicted + shift, radius_px, config.min_contrast)
    good = found.correlation >= config.min_correlation
    sigma = match_sigma_px(K, views, depth, config)
    matches = LandmarkMatches(
        landmark=views.landmark,
        world_p_landmark=views.world_p_landmark,
        uv_px=found.uv_px - shift,
        sigma_px=sigma,
        shift_px=shift,
    ).take(good)
    median = float(np.median(found.correlation))
    pose = pose_from_matches(K, matches, config.ransac_px, config, world_T_camera)
    if pose is None or pose.inlier.sum() < required_inliers(len(matches), config):
        return SearchResult(None, matches, median)
    return SearchResult(pose, matches.take(pose.inlier), median)


def required_inliers(matches: int, config: LocalizationConfig) -> int:
    """Return how many matches must agree: six, Matsuda 2007, and a share of all."""
    return max(config.min_inliers, int(np.ceil(config.min_inlier_share * matches)))


def match_sigma_px(
    K: FloatArray, views: LandmarkViews, depth: FloatArray, config: LocalizationConfig
) -> FloatArray:
    """Return standard deviations (N,) of matches: of matching, landmark reliability and landmark position."""
    of_position = K[0, 0] * views.position_sigma_m / np.maximum(depth, 1.0)
    variance = config.match_sigma_px**2 + views.sigma_px**2 + np.nan_to_num(of_position) ** 2
    return np.asarray(np.sqrt(variance))
