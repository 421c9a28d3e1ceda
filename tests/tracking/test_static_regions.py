"""What never moves in the picture, drawn over images of a room, or given as exact tracks."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from room_pipeline import COUNT, errors_m, exact_fixes, fed, room
from textured_room import CAMERA, CONFIG, FPS, followed_map, images, path

from vgps.camera import undistort
from vgps.mapping.map_update import MapUpdate
from vgps.model import Frame
from vgps.tracking.matching import Match
from vgps.tracking.static_regions import StaticRegions, stays_in_picture

BONNET = 170  # its first row: 29 % of the picture
SIDE = CONFIG.tracking.min_distance_px


def with_bonnet(frame):
    """The frame with a bonnet of random texture drawn over its lower part."""
    texture = np.random.default_rng(5).normal(size=frame.gray.shape)
    blobs = cv2.GaussianBlur(texture, (0, 0), 2.0)
    drawn = np.clip(128 + 45 * blobs / blobs.std(), 0, 255).astype(np.uint8)
    drawn[:BONNET] = frame.gray[:BONNET]
    return replace(frame, gray=drawn)


@pytest.mark.slow
def test_a_bonnet_is_left_out_and_the_path_is_as_without_it():
    made = fed(map(with_bonnet, room()), exact_fixes())
    (local_map,) = made.maps
    # without a bonnet 0.03 and 0.011 m; the worst of eight bonnets 0.065 and 0.022 m
    assert errors_m(local_map).max() < 0.09 and np.median(errors_m(local_map)) < 0.03
    first, last, left, top, right, bottom = made.tracker.static.rectangles.T
    assert top.min() >= BONNET - 2 * SIDE
    area = (right - left) * (bottom - np.maximum(top, BONNET)) / (CAMERA.width * (CAMERA.height - BONNET))
    assert area[(first <= 20) & (last >= 20)].sum() > 0.7


@pytest.mark.slow
def test_a_room_without_anything_static_is_left_whole():
    made = fed(room(), exact_fixes())
    assert len(made.tracker.static.rectangles) == 0
    frame = Frame(COUNT, COUNT / FPS, images(1)[0])
    assert made.tracker.static.masked(frame) is frame


@pytest.mark.slow
def test_a_camera_that_stands_makes_nothing_static():
    order = [*range(12), *[12] * 10, *range(13, 18)]
    made = fed(Frame(i, i / FPS, images(COUNT)[k]) for i, k in enumerate(order))
    assert len(made.maps[0].zero_motions) > 5 and len(made.tracker.static.rectangles) == 0


POSES = path(6)
PINNED = 10


@pytest.fixture
def scene():
    """A map of five frames whose first features stay at a pixel, and matches that stay there too."""
    local_map, _ = followed_map(POSES[:-1])
    local_map.views[:PINNED, -5:] = local_map.views[:PINNED, -1:]
    return local_map, Match(local_map.raw_uv_px.copy(), np.ones(len(local_map.ids), bool))


def regions(camera=CAMERA, **mapping):
    config = CONFIG.mapping.model_copy(update=mapping)
    return StaticRegions(camera, CONFIG.tracking, config)


def observe(static, scene, frame, pinned=True, pose=POSES[-1]):
    """Let a frame show the pinned features at their pixels, or none of them."""
    local_map, match = scene
    found = match.found.copy()
    found[:PINNED] = pinned
    found[PINNED:] = False
    match = Match(match.uv_px, found)
    static.masked(Frame(frame, frame / FPS, images(1)[0]))
    static.observe(local_map, match, local_map.last_uv_px, np.zeros_like(found), pose)


def test_features_that_stay_while_the_camera_turns_are_left_out_with_their_surroundings(scene):
    static = regions(min_views=1)
    observe(static, scene, 5)
    shown = static.masked(Frame(6, 0.6, images(1)[0])).mask
    column, row = np.rint(scene[0].raw_uv_px[:PINNED]).astype(int).T
    assert not shown[row, column].any() and 0.5 < shown.mean() < 1.0


def test_features_that_stay_but_are_not_found_again_count_for_nothing(scene):
    static = regions(min_views=1)
    observe(static, scene, 5, pinned=False)
    assert not (static.cells.since >= 0).any()


def test_a_cell_in_which_more_features_move_is_kept(scene):
    local_map, match = scene
    uv = match.uv_px.copy()
    uv[PINNED : 3 * PINNED] = np.repeat(uv[:PINNED], 2, axis=0)  # two come to where each stays
    static, moved = regions(min_views=1), np.arange(len(uv)) // PINNED
    found = Match(uv, moved == 0)
    static.masked(Frame(5, 0.5, images(1)[0]))
    static.observe(local_map, found, local_map.last_uv_px, np.isin(moved, (1, 2)), POSES[-1])
    column, row = (uv[:PINNED] // SIDE).astype(int).T
    alone = np.array([(abs(column - c) <= 1) & (abs(row - r) <= 1) for c, r in zip(column, row, strict=True)])
    alone = alone.sum(axis=1) == 1  # else the static features of neighbours outnumber those that move
    assert alone.any() and not (static.cells.since[row[alone], column[alone]] >= 0).any()
    assert (static.cells.since >= 0).any()  # cells beside them, in which nothing moves


def test_a_mask_that_is_given_counts_beside_it(scene):
    static, given = regions(min_views=1), np.ones((CAMERA.height, CAMERA.width), bool)
    given[:, :50] = False
    observe(static, scene, 5)
    alone = static.masked(Frame(6, 0.6, images(1)[0])).mask
    both = static.masked(Frame(6, 0.6, images(1)[0], given)).mask
    np.testing.assert_array_equal(both, alone & given)


def test_errors_at_the_edge_of_a_fisheye_count_in_the_picture():
    """Features in a corner, 42 degrees off the axis, to 0.4 px: undistorted, it is 0.7 px."""
    camera = replace(CAMERA, model="fisheye", distortion=(0.0,) * 4)
    local_map, _ = followed_map(POSES[:-1], camera)
    corner, error = 14.0 + 0.5 * np.arange(PINNED)[:, None], 0.4 * np.sqrt([0.5, 0.5])
    for view in range(-5, 0):
        local_map.raw_uv_px[:PINNED] = corner + error * (-1) ** view
        local_map.views[:, view] = undistort(camera, local_map.raw_uv_px)
    raw = local_map.raw_uv_px.copy()
    raw[:PINNED] = corner + error
    match = Match(raw, np.arange(len(raw)) < PINNED)
    static = regions(camera, min_views=1)
    static.observe(local_map, match, undistort(camera, raw), np.zeros(len(raw), bool), POSES[-1])
    assert (static.cells.since >= 0).any()


def test_features_that_stay_under_a_camera_that_does_not_turn_may_be_far_away(scene):
    local_map, _ = scene
    poses = local_map.poses.copy()
    poses[:, :3, :3] = POSES[0][:3, :3]
    local_map.apply(MapUpdate(poses=poses))
    static, pose = regions(min_views=1), POSES[-1].copy()
    pose[:3, :3] = POSES[0][:3, :3]
    observe(static, scene, 5, pose=pose)
    assert not (static.cells.since >= 0).any()


def test_each_feature_that_stays_is_judged_though_others_moved_before(scene):
    """Under a camera that does not turn those that stay may be far away, as above."""
    local_map, match = scene
    poses = local_map.poses.copy()
    poses[:, :3, :3] = POSES[0][:3, :3]
    local_map.apply(MapUpdate(poses=poses))
    static, pose = regions(min_views=1), POSES[-1].copy()
    pose[:3, :3] = POSES[0][:3, :3]
    static.masked(Frame(5, 5 / FPS, images(1)[0]))
    assert match.found.all() and len(match.found) > PINNED
    static.observe(local_map, match, local_map.last_uv_px, np.zeros(len(match.found), bool), pose)
    assert not (static.cells.since >= 0).any()


def test_cells_are_forgotten_after_a_track_and_the_next_time_after_twice_as_long(scene):
    static = regions(min_views=1, max_track_frames=6)
    for frame in range(5, 30):
        observe(static, scene, frame, pinned=not (static.cells.since >= 0).any())
    first, last = np.unique(static.rectangles[:, :2], axis=0).T
    np.testing.assert_array_equal(first, [6, 13, 26])
    np.testing.assert_array_equal(last, [11, 24, 29])


def test_rectangles_cover_the_cells_and_end_at_the_border(scene):
    static = regions(min_views=1)
    static.cells.since[-1, -3:], static.cells.frame = 4, 9
    static.cells.since[0, 0] = 7
    columns, rows = (int(np.ceil(size / SIDE)) for size in (CAMERA.width, CAMERA.height))
    left, top = int((columns - 3) * SIDE), int((rows - 1) * SIDE)
    np.testing.assert_array_equal(
        static.rectangles, [[4, 9, left, top, CAMERA.width, CAMERA.height], [7, 9, 0, 0, SIDE, SIDE]]
    )


def test_a_pixel_that_stays():
    none = [np.nan, np.nan]
    views = np.array(
        [
            [[5.0, 5.0], [5.5, 5.0], none, [5.0, 4.5]],
            [none, [5.0, 5.0], [6.5, 5.0], [5.0, 5.0]],
            [none, none, [3.0, 3.0], none],
        ]
    )
    np.testing.assert_array_equal(stays_in_picture(CAMERA, views, 1.0), [True, False, True])
    edge = np.array([[[300.0, 220.0], [301.2, 220.0]]])  # of a lens that undistorting stretches twice
    barrel = replace(CAMERA, model="fisheye", distortion=(0.0,) * 4)
    assert stays_in_picture(barrel, edge, 1.0) and not stays_in_picture(CAMERA, edge, 1.0)
