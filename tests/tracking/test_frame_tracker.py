"""Stage A on images of a room whose poses and points are known exactly."""

from dataclasses import replace

import numpy as np
import pytest
from angles import apart_deg
from scipy.spatial.transform import Rotation
from textured_room import (
    CAMERA,
    CONFIG,
    LENS,
    distance_m,
    followed_map,
    image,
    images,
    moved,
    path,
    pixels,
)

from vgps.mapping.map_update import MapUpdate, Positions
from vgps.model import Frame
from vgps.tracking.frame_tracker import FrameTracker
from vgps.tracking.matching import Match
from vgps.tracking.pose import Prediction

LAST = 4  # newest frame of the maps
TRUE = path(LAST + 2)


def tracker(camera=CAMERA, **tracking):
    config = CONFIG.tracking.model_copy(update=tracking)
    return FrameTracker(camera, config, CONFIG.mapping, np.random.default_rng(0))


@pytest.fixture
def scene():
    """A map of five frames with exact positions, and its points."""
    return followed_map(TRUE[:-1])


def last_two():
    """The image of the newest view, and the frame after it."""
    before, after = images(LAST + 2)[LAST:]
    return before, Frame(LAST + 1, 0.1 * (LAST + 1), after)


def track(scene, gray=None, predicted=TRUE[LAST], **tracking):
    """The next frame, tracked by default from the pose of the one before."""
    before, after = last_two()
    after = after if gray is None else replace(after, gray=gray)
    return tracker(**tracking).track(scene[0], before, after, Prediction(predicted))


def errors_px(result, points):
    """Distance of every feature that was found from where it is."""
    return np.linalg.norm(result.uv_px - pixels(TRUE[-1], points), axis=1)[result.found]


def move_points(local_map, rows, by_m):
    """Make the positions of some features wrong."""
    ids = local_map.ids[rows]
    positions = Positions(ids, local_map.points[ids] + by_m, np.full(len(ids), 0.3))
    local_map.apply(MapUpdate(positions=positions))


def test_features_are_followed_to_where_their_points_project(scene):
    local_map, points = scene
    result = tracker().follow(local_map, *last_two())
    assert result.found.mean() > 0.9 and result.world_T_camera is None
    assert np.median(errors_px(result, points)) < 0.1
    assert np.quantile(errors_px(result, points), 0.95) < 0.5


def test_a_frame_is_posed_and_its_observations_fit(scene):
    result = track(scene)
    assert result.world_T_camera is not None
    assert distance_m(result.world_T_camera, TRUE[-1]) < 0.01
    assert apart_deg(result.world_T_camera, TRUE[-1]) < 0.05
    assert result.found.mean() > 0.9 and np.quantile(errors_px(result, scene[1]), 0.95) < 0.5


def test_a_poor_prediction_does_no_harm(scene):
    """The features are predicted some 20 px from where they are."""
    predicted = moved(TRUE[LAST], 0.3, (2.0, -3.0, 2.0))
    result = track(scene, predicted=predicted)
    assert result.world_T_camera is not None and distance_m(result.world_T_camera, TRUE[-1]) < 0.01


def test_a_lens_is_taken_out_of_the_observations():
    local_map, points = followed_map(TRUE[:-1], LENS)
    before, after = (image(pose, LENS) for pose in TRUE[LAST:])
    result = tracker(LENS).track(local_map, before, Frame(LAST + 1, 0.5, after), Prediction(TRUE[LAST]))
    assert result.world_T_camera is not None and distance_m(result.world_T_camera, TRUE[-1]) < 0.01
    assert np.quantile(errors_px(result, points), 0.95) < 0.5
    assert np.linalg.norm(result.raw_uv_px - result.uv_px, axis=1).max() > 2.0


def test_features_without_position_are_followed_too(scene):
    local_map, points = scene
    rows = np.arange(0, len(points), 3)
    move_points(local_map, rows, np.nan)
    result = track(scene, predicted=moved(TRUE[LAST], 0.1))
    assert result.found[rows].mean() > 0.9 and np.quantile(errors_px(result, points), 0.95) < 0.5


@pytest.mark.parametrize("shown", ["black", "another room"])
def test_a_frame_that_does_not_show_the_map_gets_no_pose(scene, shown):
    gray = np.zeros_like(images(1)[0]) if shown == "black" else image(TRUE[-1], seed=1)
    assert track(scene, gray).world_T_camera is None


def test_fewer_features_than_needed_give_no_pose(scene):
    result = track(scene, min_inliers=len(scene[1]) + 1)
    assert result.world_T_camera is None and result.found.mean() > 0.9


def test_half_as_many_features_pose_a_frame_whose_rotation_a_gyro_gives(scene):
    local_map, _ = scene
    ids = local_map.ids[7:]
    nowhere = Positions(ids, np.full((len(ids), 3), np.nan), np.full(len(ids), np.nan))
    local_map.apply(MapUpdate(positions=nowhere))
    before, after = last_two()
    turned = TRUE[LAST].copy()
    turned[:3, :3] = TRUE[-1][:3, :3]
    alone, by_gyro = (
        tracker().track(local_map, before, after, Prediction(turned, sigma_rad))
        for sigma_rad in (np.inf, 1e-4)
    )
    assert alone.world_T_camera is None
    assert distance_m(by_gyro.world_T_camera, TRUE[-1]) < 0.03


def test_too_small_a_share_of_inliers_gives_no_pose(scene):
    """A quarter of the positions is wrong by some pixels: these are found, and disagree."""
    local_map, points = scene
    move_points(local_map, np.arange(0, len(points), 4), np.array([0.0, 0.0, 0.2]))
    assert track(scene, min_inlier_share=0.7).world_T_camera is not None
    assert track(scene, min_inlier_share=0.8).world_T_camera is None


def test_matches_that_disagree_with_the_pose_are_dropped(scene):
    local_map, points = scene
    wrong = np.arange(0, len(points), 4)
    move_points(local_map, wrong, np.array([0.0, 0.0, 1.0]))
    result = track(scene)
    assert not result.found[wrong].any()
    assert np.delete(result.found, wrong).mean() > 0.9
    assert distance_m(result.world_T_camera, TRUE[-1]) < 0.01


class SearchRecorder:
    """Finds nothing, and remembers where it was to search."""

    def match(self, previous, current, uv_px, predicted_uv_px):
        self.predicted_uv_px = predicted_uv_px
        return Match(uv_px.copy(), np.zeros(len(uv_px), dtype=bool))


def test_features_are_searched_where_the_predicted_pose_puts_them(scene):
    """Without a position: at the median depth of the others; out of view: where they were."""
    local_map, points = scene
    unpositioned = np.arange(0, len(points), 3)
    depth = (points - TRUE[LAST][:3, 3]) @ TRUE[LAST][:3, 2]
    move_points(local_map, unpositioned, np.nan)
    predicted = moved(TRUE[LAST], 0.5, (0.0, 12.0, 0.0))
    stage_a = tracker()
    stage_a._matcher = matcher = SearchRecorder()
    stage_a.track(local_map, *last_two(), Prediction(predicted))
    assumed = points.copy()
    lines = (points[unpositioned] - TRUE[LAST][:3, 3]) / depth[unpositioned, None]
    median = np.median(np.delete(depth, unpositioned))
    # depth along the ray: a unit ray times the median depth
    assumed[unpositioned] = TRUE[LAST][:3, 3] + median * lines / np.linalg.norm(lines, axis=1)[:, None]
    expected = pixels(predicted, assumed)
    outside = ~np.all((expected > 0) & (expected < (CAMERA.width, CAMERA.height)), axis=1)
    expected[outside] = local_map.raw_uv_px[outside]
    assert 5 < outside.sum() < 60
    np.testing.assert_allclose(matcher.predicted_uv_px, expected, atol=1e-6)


class PoorMatcher:
    """Loses or mismatches every third feature."""

    def __init__(self, matcher):
        self._matcher = matcher

    def match(self, previous, current, uv_px, predicted_uv_px):
        match = self._matcher.match(previous, current, uv_px, predicted_uv_px)
        match.uv_px[::6] += 15.0
        match.found[3::6] = False
        return match


def test_lost_and_mismatched_features_are_matched_again_near_the_tentative_pose(scene):
    local_map, points = scene
    stage_a = tracker()
    stage_a._matcher = PoorMatcher(stage_a._matcher)
    result = stage_a.track(local_map, *last_two(), Prediction(TRUE[LAST]))
    assert distance_m(result.world_T_camera, TRUE[-1]) < 0.01
    assert result.found[::3].mean() > 0.9
    assert np.quantile(errors_px(result, points), 0.95) < 0.5


def test_reliable_features_give_a_pose_with_smaller_sigmas(scene):
    local_map, points = scene
    sigmas = []
    for sigma_px in (0.5, 1.0):
        positions = Positions(local_map.ids, points, np.full(len(points), sigma_px))
        local_map.apply(MapUpdate(positions=positions))
        sigmas.append(track(scene).pose_sigma)
    np.testing.assert_allclose(sigmas[1], 2 * sigmas[0], rtol=0.1)
    # 0.5 px at 255 px is 2 mrad of one feature; some 80 of them, spread over the image, share out the pose
    assert np.all(sigmas[0][:3] < 0.002) and np.all(sigmas[0][:3] > 0.0001)


def test_reliabilities_weigh_the_features(scene):
    """One half of the points is 5 cm too high: the pose follows the half that counts as reliable."""
    local_map, points = scene
    half = np.arange(len(points)) % 2 == 0
    heights = []
    for reliable in (half, ~half):
        positions = points + np.where(half, 0.05, 0.0)[:, None] * [0.0, 0.0, 1.0]
        sigma_px = np.where(reliable, 0.3, 3.0)
        local_map.apply(MapUpdate(positions=Positions(local_map.ids, positions, sigma_px)))
        heights.append(track(scene).world_T_camera[2, 3] - TRUE[-1][2, 3])
    assert heights[0] == pytest.approx(0.05, abs=0.01) and heights[1] == pytest.approx(0.0, abs=0.01)


def test_features_are_searched_where_a_gyro_turned_them(scene):
    local_map, _ = scene
    turn = Rotation.from_rotvec([0.0, 0.25, 0.0]).as_matrix()
    turned = TRUE[LAST].copy()
    turned[:3, :3] = turned[:3, :3] @ turn
    before, after = images(LAST + 1)[LAST], image(turned)
    blind = tracker().follow(local_map, before, Frame(1, 0.1, after))
    led = tracker().follow(local_map, before, Frame(1, 0.1, after), turn)
    assert led.found.sum() > 2 * blind.found.sum()


def test_features_that_a_mask_hides_are_not_found(scene):
    local_map, _ = scene
    before, after = last_two()
    mask = np.ones(after.gray.shape, dtype=bool)
    mask[:, : mask.shape[1] // 2] = False
    plain = tracker().track(local_map, before, after, Prediction(TRUE[LAST]))
    masked = tracker().track(local_map, before, replace(after, mask=mask), Prediction(TRUE[LAST]))
    left = plain.raw_uv_px[:, 0] < mask.shape[1] // 2 - 1
    assert plain.found[left].sum() > 10 and not masked.found[left].any()
    assert masked.found[~left].sum() > 10 and masked.world_T_camera is not None
