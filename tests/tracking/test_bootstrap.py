"""The start of a map by exact observations of a room, up to the scale that no image shows."""

import copy
from dataclasses import replace

import numpy as np
import pytest
import textured_room
from angles import apart_deg
from scipy.spatial.transform import Rotation
from solutions import NORTH_R_CAMERA, make_poses
from textured_room import CAMERA, CONFIG, followed_map, moved, path, roll_shutter

from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, NewFeatures, NewFrame, NewView
from vgps.tracking.bootstrap import TwoViewInitialiser
from vgps.tracking.planar_motion import poses_over_plane

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


@pytest.mark.slow
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


@pytest.mark.slow
def test_two_views_whose_halves_disagree_start_no_map(monkeypatch):
    """As wrong matches do while a camera turns on the spot, which show any direction."""
    local_map, _, _ = views()
    assert initialise(local_map, max_chance=1e-4, airborne="yes") is not None
    assert initialise(local_map, max_chance=0.0, airborne="yes") is None
    rng = np.random.default_rng(0)
    any_direction = lambda self, first, last: (v := rng.normal(size=(1, 3))) / np.linalg.norm(v)  # noqa: E731
    monkeypatch.setattr(TwoViewInitialiser, "_directions", any_direction)
    assert initialise(local_map, airborne="yes") is None
    assert initialise(local_map, max_chance=1.0, airborne="yes") is not None
    assert initialise(local_map) is not None  # on the ground


def test_a_turn_on_the_spot_shows_no_plane_whatever_the_focal_length():
    rng = np.random.default_rng(0)
    first = rng.uniform((30, 60), (290, 200), (200, 2))
    turned = textured_room.rays(first) @ Rotation.from_euler("yx", (12.0, 4.0), degrees=True).as_matrix().T
    last = turned[:, :2] / turned[:, 2:] * (CAMERA.fx, CAMERA.fy) + (CAMERA.cx, CAMERA.cy)
    last += rng.normal(0.0, 0.2, last.shape)
    for scale in (0.9, 1.0, 1.1):
        assert not poses_over_plane(CAMERA.K @ np.diag([scale, scale, 1.0]), first, last, 1.0)


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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ahead_m", "right_m", "turn_deg"), [(0.0, 3.0, -5.0), (7.0, 0.0, 0.0), (4.0, 4.0, 3.0)]
)
@pytest.mark.parametrize("seed", range(3))
def test_a_drone_above_flat_ground_is_not_taken_for_one_that_falls_along_a_wall(
    ahead_m, right_m, turn_deg, seed
):
    """Two views of a plane allow two motions."""
    down = Rotation.from_euler("x", -35.0, degrees=True).as_matrix()
    yaw = Rotation.from_euler("z", turn_deg * np.linspace(0, 1, 6)[:, None], degrees=True).as_matrix()
    start = np.array([0.0, 0.0, 25.0])
    share = np.linspace(0.0, 1.0, 6)[:, None]
    poses = make_poses(start + share * (right_m, ahead_m, 0.0), yaw @ NORTH_R_CAMERA @ down)
    local_map = ground_map(poses, np.random.default_rng(seed))
    local_map.apply(initialise(local_map))
    true = (np.linalg.inv(poses[0]) @ poses)[-1]
    assert apart_deg(local_map.poses[-1], true) < 1.0
    assert local_map.positioned.mean() > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_map_over_a_plane_waits_for_the_parallax_that_shows_its_motion(seed):
    """As a picture of 4K, which moves by many pixels before the views between the two tell their motions."""
    down = Rotation.from_euler("x", -35.0, degrees=True).as_matrix()
    for ahead_m, count, starts in ((1.5, 6, False), (1.5, 20, True), (9.0, 6, True)):
        share = np.linspace(0.0, 1.0, count)[:, None]
        poses = make_poses(np.array([0.0, 0.0, 25.0]) + share * (0.0, ahead_m, 0.0), NORTH_R_CAMERA @ down)
        local_map = ground_map(poses, np.random.default_rng(seed))
        start = initialise(local_map, min_flow_px=2.0)
        assert (start is not None) == starts
    assert apart_deg(start.poses[-1], np.eye(4)) < 1.0


def ground_map(poses, rng, noise_px=0.1):
    """A map without poses or positions of points of the plane z = 0, seen with some noise."""
    uv = rng.uniform((30, 60), (290, 200), (200, 2))
    ray = textured_room.rays(uv) @ poses[0][:3, :3].T
    points = poses[0][:3, 3] - ray * (poses[0][2, 3] / ray[:, 2])[:, None]
    made = LocalMap(0, CONFIG.mapping.max_track_frames)
    for index, pose in enumerate(poses):
        seen = textured_room.pixels(pose, points) + rng.normal(0.0, noise_px, (len(points), 2))
        known = slice(len(made.ids))
        view = NewView(index, seen[known], seen[known], np.ones(len(made.ids), dtype=bool))
        made.apply(MapUpdate(frames=(NewFrame(index / 10.0, np.full((4, 4), np.nan)),), view=view))
        if index == 0:
            made.apply(MapUpdate(features=NewFeatures(seen, seen, np.zeros(len(points), dtype=np.uint8))))
    return made
