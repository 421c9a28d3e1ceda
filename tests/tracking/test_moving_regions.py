"""A plate that moves on its own, drawn over images of a room, or given as exact tracks."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from room_pipeline import COUNT, POSES, errors_m, exact_fixes, fed, room
from textured_room import CAMERA, CONFIG, FPS, LENS, followed_map, images

from vgps.camera import distort
from vgps.mapping.map_update import MapUpdate
from vgps.model import Frame
from vgps.tracking.mapper import Mapper
from vgps.tracking.moving_regions import MovingRegions

TEXELS = 128
CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])


def corners_px(frame):
    """(4, 2) the plate's corners: ahead of the camera, swaying and coming nearer, with the room behind it."""
    centre = np.array([0.5 * np.sin(frame / 4), 0.1, 2.6 - 0.5 * np.sin(frame / 6)])
    return (CORNERS * 0.55 + centre[:2]) / centre[2] * (CAMERA.fx, CAMERA.fy) + (CAMERA.cx, CAMERA.cy)


def to_picture(frame):
    """(3, 3) the homography from the plate's texture to a picture."""
    texture = (CORNERS + 1.0) * TEXELS / 2
    return cv2.getPerspectiveTransform(texture.astype(np.float32), corners_px(frame).astype(np.float32))


def with_plate(frame):
    """The frame with the plate of random texture drawn over it."""
    blobs = cv2.GaussianBlur(np.random.default_rng(5).normal(size=(TEXELS, TEXELS)), (0, 0), 2.0)
    texture = np.clip(128 + 45 * blobs / blobs.std(), 0, 255).astype(np.uint8)
    size, plane = (CAMERA.width, CAMERA.height), to_picture(frame.index)
    drawn = cv2.warpPerspective(texture, plane, size)
    inside = cv2.warpPerspective(np.full_like(texture, 255), plane, size) > 127
    return replace(frame, gray=np.where(inside, drawn, frame.gray))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_a_plate_that_moves_on_its_own_is_left_out(seed):
    """With fewer features the plate has hardly as many as make a group, and the seed decides."""
    tracking = CONFIG.tracking.model_copy(update={"max_features": 500, "min_distance_px": 8.0})
    config = CONFIG.model_copy(update={"tracking": tracking, "seed": seed})
    made = fed(map(with_plate, room()), exact_fixes(), config)
    (local_map,) = made.maps
    assert errors_m(local_map).max() < 0.08
    boxes = made.tracker.moving.boxes
    np.testing.assert_array_equal(boxes[:, 0], boxes[:, 1])
    for frame in range(20, COUNT):
        parts = boxes[boxes[:, 0] == frame, 2:]
        box = np.concatenate([parts[:, :2].min(axis=0), parts[:, 2:].max(axis=0)])
        corners = corners_px(frame)
        common = np.minimum(box[2:], corners[2]) - np.maximum(box[:2], corners[0])
        assert np.prod(common) > 0.5 * np.prod(corners[2] - corners[0])
        assert np.prod(common) > 0.5 * np.prod(box[2:] - box[:2])
    on_plate = np.all(np.abs(local_map.raw_uv_px - corners_px(COUNT - 1).mean(axis=0)) < 40.0, axis=1)
    held = made.tracker.moving.holds(local_map)
    assert held[on_plate].mean() > 0.8 and not local_map.positioned[held].any()


@pytest.mark.slow
def test_a_camera_that_stands_while_a_plate_goes_by_stands():
    order = [*range(12), *[12] * 10, *range(13, 18)]
    gray = images(COUNT)
    frames = [Frame(i, i / FPS, gray[k]) for i, k in enumerate(order)]
    made = fed(with_plate(one) if 12 < one.index < 22 else one for one in frames)
    (local_map,) = made.maps
    assert len(local_map.zero_motions) > 5
    stood = local_map.poses[12:22, :3, 3]
    assert np.ptp(stood, axis=0).max() < 0.02 * np.linalg.norm(local_map.poses[17, :3, 3])


@pytest.mark.slow
def test_a_room_where_nothing_moves_is_left_whole():
    made = fed(room(), exact_fixes())
    moving, frame = made.tracker.moving, Frame(COUNT, COUNT / FPS, images(1)[0])
    assert len(moving.boxes) == 0 and moving.masked(frame) is frame
    assert not moving.holds(made.maps[0]).any()
    search = np.zeros((len(made.maps[0].ids), 2))
    assert moving.predict(made.maps[0], search) is search


VIEWS = 12


def in_the_middle(uv):
    return np.all((uv > (60, 60)) & (uv < (200, 180)), axis=1)


def moving_map(camera=CAMERA, chosen=None, steps=None):
    """A map with features that move by some pixels a view on their own, and which they are (N,)."""
    local_map, _ = followed_map(POSES[:VIEWS], camera)
    uv = local_map.raw_uv_px
    own = (chosen or in_the_middle)(uv)
    steps = np.array([1.5, 1.0]) if steps is None else steps(own.sum())
    back = np.arange(VIEWS - 1, -1, -1.0)[:, None]
    track = local_map.last_uv_px[own][:, None] - back * steps
    local_map.views[own, -VIEWS:] = track
    local_map.apply(MapUpdate(more_moving_views=np.where(own, 3, -3)))
    return local_map, own


def regions(camera=CAMERA, **tracking):
    return MovingRegions(camera, CONFIG.tracking.model_copy(update=tracking), CONFIG.mapping)


def test_a_group_loses_its_positions_and_its_place_in_the_picture():
    local_map, own = moving_map()
    moving = regions()
    update = moving.leave_out(local_map)
    held = moving.holds(local_map)
    assert held[own].mean() > 0.9 and not held[~own].any()
    assert sorted(update.positions.ids) == sorted(local_map.ids[held])
    assert np.isnan(update.positions.points).all() and np.isnan(update.positions.sigma_px).all()
    shown = moving.masked(Frame(VIEWS, VIEWS / FPS, images(1)[0])).mask
    column, row = np.rint(local_map.raw_uv_px).astype(int).T
    assert not shown[row, column][held].any() and shown[row, column][~own].mean() > 0.8


def test_a_group_that_is_known_stays_one_while_the_path_is_wrong():
    local_map, own = moving_map()
    moving = regions()
    local_map.apply(moving.leave_out(local_map))
    known = moving.holds(local_map)
    local_map.apply(MapUpdate(more_moving_views=np.where(own, 0, 6)))
    assert moving.leave_out(local_map).positions.ids.size == 0
    np.testing.assert_array_equal(moving.holds(local_map), known)
    shown = moving.masked(Frame(VIEWS, VIEWS / FPS, images(1)[0])).mask
    column, row = np.rint(local_map.raw_uv_px).astype(int).T
    assert not shown[row, column][known].any() and shown[row, column][~own].any()


def test_a_feature_that_fits_the_scene_again_is_released():
    local_map, _ = moving_map()
    moving = regions()
    moving.leave_out(local_map)
    known = moving.holds(local_map)
    fits = known & (local_map.raw_uv_px[:, 0] < 130)
    assert 0 < fits.sum() < known.sum()
    local_map.apply(MapUpdate(more_moving_views=np.where(fits, -6, np.where(known, 0, 6))))
    moving.leave_out(local_map)
    np.testing.assert_array_equal(moving.holds(local_map), known & ~fits)


def test_it_is_searched_where_it_goes():
    local_map, _ = moving_map(LENS)
    moving = regions(LENS)
    moving.leave_out(local_map)
    held, static = moving.holds(local_map), np.full((len(local_map.ids), 2), 7.0)
    found = moving.predict(local_map, static)
    before = distort(LENS, local_map.views[:, -2])
    np.testing.assert_allclose(found[held], 2 * local_map.raw_uv_px[held] - before[held])
    np.testing.assert_array_equal(found[~held], static[~held])


@pytest.mark.parametrize(
    ("chosen", "steps"),
    [
        (lambda uv: np.arange(len(uv)) % 3 == 0, None),
        (lambda uv: in_the_middle(uv) | (np.arange(len(uv)) % 5 == 0), None),
        (lambda uv: uv[:, 0] > 60, None),
        (None, lambda count: np.random.default_rng(0).normal(0.0, 2.0, (count, 1, 2))),
        (lambda uv: np.arange(len(uv)) < CONFIG.tracking.min_inliers - 1, None),
    ],
    ids=["all over the picture", "and beside a group", "most of the picture", "each on its own", "too few"],
)
def test_features_that_are_no_object_stay(chosen, steps):
    local_map, own = moving_map(CAMERA, chosen, steps)
    moving = regions()
    assert own.any() and moving.leave_out(local_map) == MapUpdate()
    assert not moving.holds(local_map).any() and len(moving.boxes) == 0


def test_three_features_are_no_group_however_few_pose_a_camera():
    def nearest(uv):
        return np.isin(np.arange(len(uv)), np.argsort(np.linalg.norm(uv - (160, 120), axis=1))[:3])

    local_map, own = moving_map(CAMERA, nearest)
    local_map.apply(MapUpdate(more_moving_views=np.where(own, 0, 3)))  # nothing is known of the others
    moving = regions(min_inliers=3)
    assert own.sum() == 3 and moving.leave_out(local_map) == MapUpdate()


def test_a_group_is_known_by_map_and_after_older_features_are_discarded():
    local_map, _ = moving_map()
    moving = regions()
    moving.leave_out(local_map)
    held = moving.holds(local_map)
    again = regions()
    again.restore(moving.state([local_map]))
    local_map.discarded_features += 100
    local_map._followed.lower_ids(100)
    for one in (moving, again):
        np.testing.assert_array_equal(one.holds(local_map), held)
        np.testing.assert_array_equal(one.boxes, moving.boxes)
    assert not moving.holds(followed_map(POSES[:3])[0]).any()


def test_new_features_start_beside_it_and_it_does_not_count():
    local_map, _ = moving_map()
    moving, rng = regions(), np.random.default_rng(0)
    moving.leave_out(local_map)
    held = moving.holds(local_map)
    mapper = Mapper(CAMERA, CONFIG.tracking, CONFIG.mapping, rng)
    frame = Frame(VIEWS - 1, (VIEWS - 1) / FPS, images(VIEWS)[-1])
    new = mapper.new_features(local_map, frame, moving).features
    assert len(new.uv_px) == CONFIG.tracking.max_features - (~held).sum()
    column, row = new.raw_uv_px.astype(int).T
    assert moving.masked(frame).mask[row, column].all()
