"""The start of a map by exact observations of a room, up to the scale that no image shows."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from textured_room import CAMERA, CONFIG, followed_map, moved, path, roll_shutter

from vgps.tracking.bootstrap import TwoViewInitialiser

POSES = path(6)


def initialise(local_map, camera=CAMERA, **start):
    config = CONFIG.start.model_copy(update=start)
    rng = np.random.default_rng(0)
    return TwoViewInitialiser(camera, config, CONFIG.tracking, rng).initialise(local_map)


def views(poses=POSES):
    """A map without poses or positions, its points, and the length of its baseline."""
    local_map, points = followed_map(poses, positions=False)
    return local_map, points, float(np.linalg.norm(poses[-1][:3, 3] - poses[0][:3, 3]))


def test_views_are_posed_and_features_positioned_up_to_scale():
    local_map, points, baseline_m = views()
    local_map.apply(initialise(local_map))
    np.testing.assert_allclose(local_map.poses[0], np.eye(4), atol=1e-12)
    assert np.linalg.norm(local_map.poses[-1, :3, 3]) == pytest.approx(1.0)
    in_first = np.linalg.inv(POSES[0]) @ POSES
    in_first[:, :3, 3] /= baseline_m
    np.testing.assert_allclose(local_map.poses, in_first, atol=1e-3)
    assert local_map.positioned.all()
    expected = (points - POSES[0][:3, 3]) @ POSES[0][:3, :3] / baseline_m
    np.testing.assert_allclose(local_map.points[local_map.ids], expected, rtol=0.01, atol=0.01)
    np.testing.assert_array_equal(local_map.sigma_px[local_map.ids], CONFIG.tracking.inlier_px / 2)


def test_views_of_a_rolling_shutter_start_a_map_at_the_true_poses():
    local_map, points, _ = views()
    camera = replace(CAMERA, readout_s=0.09)
    roll_shutter(local_map, points, POSES, camera)
    as_global = copy.deepcopy(local_map)
    as_global.apply(initialise(as_global))
    local_map.apply(initialise(local_map, camera))
    np.testing.assert_allclose(local_map.poses[0], np.eye(4), atol=1e-12)
    assert local_map.positioned.mean() > 0.95
    assert 5 * start_error(local_map) < start_error(as_global)


def start_error(local_map):
    """The largest distance from the true path, in lengths of it."""
    true = (np.linalg.inv(POSES[0]) @ POSES)[:, :3, 3]
    found = local_map.poses[:, :3, 3]
    true, found = (path / np.linalg.norm(path[-1]) for path in (true, found))
    return float(np.abs(true - found).max())


def test_it_waits_until_the_image_has_moved_far_enough():
    """The median of the observations moves by some 5.6 px a frame."""
    for count, starts in ((2, False), (3, False), (4, True)):
        local_map, _, _ = views(POSES[:count])
        flow = np.median(np.linalg.norm(local_map.views[:, -1] - local_map.views[:, -count], axis=1))
        assert (flow > CONFIG.start.min_flow_px) == starts
        assert (initialise(local_map) is not None) == starts


def test_a_camera_that_only_turns_starts_no_map():
    turning = np.stack([moved(POSES[0], 0.0, (0.0, 1.5 * k, 0.0)) for k in range(6)])
    local_map, _, _ = views(turning)
    flow = np.linalg.norm(local_map.views[:, -1] - local_map.views[:, -6], axis=1)
    assert np.median(flow) > 2 * CONFIG.start.min_flow_px
    assert initialise(local_map) is None


def test_two_views_need_parallax():
    """0.6 m between the views and points some 9 m away: about 3 degrees."""
    local_map, points, _ = views()
    a, b = (points - pose[:3, 3] for pose in (POSES[0], POSES[-1]))
    cosine = np.sum(a * b, axis=1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
    parallax_deg = float(np.degrees(np.median(np.arccos(cosine))))
    assert initialise(local_map, min_parallax_deg=0.95 * parallax_deg) is not None
    assert initialise(local_map, min_parallax_deg=1.05 * parallax_deg) is None


def test_the_oldest_view_with_enough_common_features_begins_the_map():
    local_map, points, _ = views()
    local_map.views[0, -6] = np.nan  # not seen in the oldest view
    assert np.isfinite(initialise(local_map, min_inliers=len(points) - 1).poses).all()
    start = initialise(local_map, min_inliers=len(points))
    assert np.isnan(start.poses[0]).all()
    np.testing.assert_allclose(start.poses[1], np.eye(4), atol=1e-12)
    assert np.linalg.norm(start.poses[-1, :3, 3]) == pytest.approx(1.0)


def test_a_later_view_begins_the_map_where_too_many_of_the_oldest_are_wrong():
    local_map, points, _ = views()
    few = len(points) // 3
    local_map.views[few:, -6] = np.nan
    local_map.views[:5, -6] += (40.0, -30.0)
    start = initialise(local_map, min_inliers=few)
    assert np.isnan(start.poses[0]).all()
    np.testing.assert_allclose(start.poses[1], np.eye(4), atol=1e-12)


def test_two_views_need_common_features():
    local_map, points, _ = views()
    local_map.views[0, :-1] = np.nan
    assert initialise(local_map, min_inliers=len(points) - 1) is not None
    assert initialise(local_map, min_inliers=len(points)) is None


def test_mismatches_get_no_position_and_do_no_harm():
    local_map, points, baseline_m = views()
    wrong = np.arange(0, len(points), 5)
    local_map.views[wrong, -1] += np.random.default_rng(0).uniform(15, 40, (len(wrong), 2))
    local_map.apply(initialise(local_map))
    assert np.mean(local_map.positioned[wrong]) < 0.2  # by chance some move along their epipolar line
    right = np.delete(np.arange(len(points)), wrong)
    assert np.mean(local_map.positioned[right]) > 0.9
    expected = (np.linalg.inv(POSES[0]) @ POSES[3])[:3, 3] / baseline_m
    np.testing.assert_allclose(local_map.poses[3, :3, 3], expected, atol=0.02)


def test_a_view_between_that_shows_too_little_holds_the_start_back():
    local_map, _, _ = views()
    local_map.views[CONFIG.tracking.min_inliers - 1 :, -3] = np.nan
    assert initialise(local_map) is None
    local_map, _, _ = views()
    local_map.views[CONFIG.tracking.min_inliers + 3 :, -3] = np.nan
    assert initialise(local_map) is not None
