"""Stage B on exact observations of a room, disturbed where a gate is to close."""

from dataclasses import replace

import numpy as np
import pytest
from textured_room import CAMERA, CONFIG, LENS, followed_map, image, moved, path, pixels, roll_shutter

from vgps.camera import undistort
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, NewFeatures, NewFrame, NewView, Positions
from vgps.model import Frame
from vgps.tracking.mapper import Mapper

FRAMES = 8
POSES = path(FRAMES)


def mapper(camera=CAMERA, **mapping):
    config = CONFIG.mapping.model_copy(update=mapping)
    return Mapper(camera, CONFIG.tracking, config, np.random.default_rng(0))


def unpositioned(poses=POSES):
    """A map whose features have exact observations and no positions, and their points."""
    local_map, points = followed_map(poses)
    forget_positions(local_map, np.arange(len(points)))
    return local_map, points


def forget_positions(local_map, rows):
    n = len(rows)
    local_map.apply(
        MapUpdate(positions=Positions(local_map.ids[rows], np.full((n, 3), np.nan), np.full(n, np.nan)))
    )


def disturb(local_map, row, view, by_px):
    """Move one observation of a feature."""
    local_map.views[row, view] += by_px


def all_rows(local_map):
    return np.arange(len(local_map.ids))


def test_exact_observations_give_the_true_positions():
    local_map, points = unpositioned()
    positions = mapper().triangulate(local_map, all_rows(local_map))
    np.testing.assert_array_equal(positions.ids, local_map.ids)
    np.testing.assert_allclose(positions.points, points, atol=1e-6)
    np.testing.assert_array_equal(positions.sigma_px, 0.3)  # the floor


@pytest.mark.slow
def test_a_rolling_shutters_observations_give_the_true_positions():
    local_map, points = unpositioned()
    camera = replace(CAMERA, readout_s=0.9 * float(np.diff(local_map.t_s).min()))
    exact = local_map.views.copy()
    roll_shutter(local_map, points, POSES, camera)
    assert np.nanmax(np.abs(local_map.views - exact)) > 1.0
    positions = mapper(camera).triangulate(local_map, all_rows(local_map))
    np.testing.assert_allclose(positions.points, points, atol=1e-5)
    blurred = mapper().triangulate(local_map, all_rows(local_map))
    assert np.nanmedian(np.linalg.norm(blurred.points - points, axis=1)) > 1e-3


def test_a_reliability_is_the_root_mean_square_of_the_reprojection_errors():
    local_map, _ = unpositioned()
    disturb(local_map, 0, -1, [1.2, 0.0])
    disturb(local_map, 0, -4, [0.0, 1.0])
    positions = mapper(sigma_floor_px=0.01).triangulate(local_map, np.array([0, 1]))
    observed = local_map.views[0, -FRAMES:]
    errors = [pixels(pose, positions.points[:1])[0] - uv for pose, uv in zip(POSES, observed, strict=True)]
    assert positions.sigma_px[0] == pytest.approx(np.sqrt(np.mean(np.sum(np.square(errors), axis=1))))
    assert positions.sigma_px.tolist() == [pytest.approx(0.5, abs=0.1), 0.01]


def step_aside(baseline_m):
    """Two views, one beside the other."""
    pose = POSES[0]
    return unpositioned(np.stack([pose, moved(pose, baseline_m)]))


def test_features_need_parallax():
    """Two cameras side by side: the angle at a point is that between the lines to both."""
    local_map, points = step_aside(0.05)
    lines = [points - POSES[0][:3, 3], points - moved(POSES[0], 0.05)[:3, 3]]
    cosine = np.sum(lines[0] * lines[1], axis=1) / np.prod([np.linalg.norm(x, axis=1) for x in lines], axis=0)
    angle_deg = np.degrees(np.arccos(cosine))
    limit_deg = float(np.median(angle_deg)) + 1e-4
    positions = mapper(min_parallax_deg=limit_deg).triangulate(local_map, all_rows(local_map))
    assert positions.ids.tolist() == local_map.ids[angle_deg > limit_deg].tolist()
    assert mapper(min_parallax_deg=10.0).triangulate(local_map, all_rows(local_map)) is None


def test_a_feature_without_parallax_keeps_its_position():
    local_map, points = step_aside(0.05)
    known = Positions(local_map.ids[:1], points[:1] + 1.0, np.array([0.7]))
    local_map.apply(MapUpdate(positions=known))
    local_map.apply(mapper(min_parallax_deg=10.0).triangulate_due(local_map))
    np.testing.assert_array_equal(local_map.points[local_map.ids[0]], points[0] + 1.0)


def test_one_view_that_disagrees_takes_the_position_away():
    local_map, _ = unpositioned()
    disturb(local_map, 2, -3, [6.0, 0.0])
    rows = np.array([1, 2])
    strict = mapper(max_reprojection_px=2.0, max_sigma_px=100.0).triangulate(local_map, rows)
    assert np.isfinite(strict.points[0]).all() and np.isnan(strict.points[1]).all()
    assert np.isnan(strict.sigma_px).tolist() == [False, True]
    lenient = mapper(max_reprojection_px=100.0, max_sigma_px=100.0).triangulate(local_map, rows)
    assert np.isfinite(lenient.points).all()


def test_a_feature_of_low_reliability_is_deleted():
    """6 px off in one of eight views: an rms error of about 2 px."""
    local_map, _ = unpositioned()
    disturb(local_map, 2, -3, [6.0, 0.0])
    rows = np.array([1, 2])
    sigma_px = mapper(max_reprojection_px=100.0, max_sigma_px=100.0).triangulate(local_map, rows).sigma_px[1]
    assert sigma_px == pytest.approx(2.0, abs=0.5)
    for limit_px, deleted in ((sigma_px - 0.1, True), (sigma_px + 0.1, False)):
        found = mapper(max_reprojection_px=100.0, max_sigma_px=limit_px).triangulate(local_map, rows)
        assert np.isnan(found.points[1, 0]) == deleted and np.isfinite(found.points[0, 0])


def test_a_point_behind_the_cameras_is_rejected():
    """Its pixel moves to the wrong side as the camera moves to the right."""
    local_map, _ = step_aside(0.2)
    u, v = local_map.views[0, -2]
    local_map.views[0, -1] = u + 20.0, v
    positions = mapper().triangulate(local_map, all_rows(local_map))
    assert np.isnan(positions.points[0]).all() and np.isfinite(positions.points[1:]).all()


def test_features_of_one_view_and_frames_without_pose_are_left_out():
    local_map, points = unpositioned()
    local_map.views[0, :-1] = np.nan
    positions = mapper().triangulate(local_map, all_rows(local_map))
    assert positions.ids.tolist() == local_map.ids[1:].tolist()
    # an unknown pose takes its observations out, wrong as they may be
    local_map.views[:, -3] += 50.0
    poses = local_map.poses.copy()
    poses[-3] = np.nan
    local_map.apply(MapUpdate(poses=poses))
    positions = mapper().triangulate(local_map, all_rows(local_map)[1:])
    np.testing.assert_allclose(positions.points, points[1:], atol=1e-6)


def test_due_are_features_without_position_and_every_fifth_with_one():
    local_map, _ = followed_map(POSES)
    forget_positions(local_map, np.array([0, 1]))
    update = mapper().triangulate_due(local_map)
    newest = FRAMES - 1
    expected = [i for i in local_map.ids.tolist() if i in (0, 1) or i % 5 == newest % 5]
    assert update.positions.ids.tolist() == expected


def test_a_full_track_goes_on_as_a_new_feature_at_the_same_place():
    history = CONFIG.mapping.max_track_frames
    local_map, points = followed_map(path(history))
    before, last_uv = local_map.ids.copy(), local_map.last_uv_px.copy()
    local_map.apply(mapper().triangulate_due(local_map))
    assert not set(local_map.ids) & set(before)
    np.testing.assert_allclose(local_map.points[local_map.ids], points, atol=1e-6)
    np.testing.assert_array_equal(local_map.last_uv_px, last_uv)
    assert np.isfinite(local_map.views[..., 0]).sum(axis=1).tolist() == [1] * len(before)


def test_a_feature_whose_views_disagree_gathers_evidence_that_it_moves():
    history = CONFIG.mapping.max_track_frames
    local_map, _ = followed_map(path(history))
    disturb(local_map, 0, -1, [30.0, 30.0])
    forget_positions(local_map, np.array([0]))
    for count in range(1, history + 3):
        update = mapper().triangulate_due(local_map)
        local_map.apply(replace(update, renew_full_tracks=False))
        evidence = local_map.moving_views[local_map.ids]
        assert evidence[0] == min(count, history) and set(evidence[1:]) == {-min(count, history)}
    local_map.apply(MapUpdate(renew_full_tracks=True))
    np.testing.assert_array_equal(local_map.moving_views[local_map.ids], evidence)


def empty_map():
    local_map = LocalMap(0, 5)
    nothing = np.zeros((0, 2))
    view = NewView(0, nothing, nothing, np.zeros(0, dtype=bool))
    local_map.apply(MapUpdate(frames=(NewFrame(0.0, np.eye(4)),), view=view))
    return local_map


@pytest.mark.parametrize("camera", [CAMERA, LENS], ids=["pinhole", "lens"])
def test_new_features_are_corners_of_the_newest_view(camera):
    local_map, gray = empty_map(), image(POSES[0], camera)
    local_map.apply(mapper(camera).new_features(local_map, Frame(0, 0.0, gray)))
    assert len(local_map.ids) == CONFIG.tracking.max_features
    np.testing.assert_allclose(local_map.last_uv_px, undistort(camera, local_map.raw_uv_px))
    pixel = local_map.raw_uv_px.astype(int)
    np.testing.assert_array_equal(local_map.gray, gray[pixel[:, 1], pixel[:, 0]])
    assert not local_map.positioned.any() and local_map.observations().frame.tolist() == [0] * 150


def test_features_are_added_when_fewer_than_three_quarters_are_followed():
    gray = image(POSES[0])
    for followed, added in ((112, 38), (113, 0)):  # of 150
        local_map, rng = empty_map(), np.random.default_rng(0)
        uv = rng.uniform(20, 30, (followed, 2))
        local_map.apply(MapUpdate(features=NewFeatures(uv, uv, np.zeros(followed, dtype=np.uint8))))
        local_map.apply(mapper().new_features(local_map, Frame(0, 0.0, gray)))
        assert len(local_map.ids) == followed + added
