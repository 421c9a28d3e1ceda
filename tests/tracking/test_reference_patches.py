"""Reference patches on images of a room whose poses and points are known exactly."""

import numpy as np
import pytest
from textured_room import CAMERA, LENS, followed_map, image, moved, path, pixels

from vgps.camera import distort
from vgps.mapping.map_update import MapUpdate, NewFrame, NewView, Positions
from vgps.tracking.reference_patches import ReferencePatches

POSES = path(4)
LIMIT_PX = 2.0


def ahead(by_m):
    """The newest pose of the map, moved along its axis."""
    pose = POSES[-1].copy()
    pose[:3, 3] += by_m * pose[:3, 2]
    return pose


def aligned(pose, camera=CAMERA, shown=lambda gray: gray, start_off_px=1.0):
    """Patches of the map's newest view, aligned with a frame, and the true pixels of their points."""
    local_map, points = followed_map(POSES, camera)
    patches = ReferencePatches(camera)
    patches.take(local_map, image(POSES[-1], camera))
    true = distort(camera, pixels(pose, points))
    start = true + start_off_px * np.array([0.6, -0.8])
    found = patches.align(local_map, pose, shown(image(pose, camera)), start, LIMIT_PX)
    return found, true


def errors_px(found, true):
    return np.linalg.norm(found.uv_px - true, axis=1)[found.found]


@pytest.mark.parametrize("camera", [CAMERA, LENS])
@pytest.mark.parametrize("pose", [moved(POSES[-1], 0.3), moved(POSES[-1], 0.0, (0.0, 0.0, 25.0)), ahead(0.5)])
def test_patches_are_found_in_frames_from_elsewhere(pose, camera):
    """Aside, rotated about the optical axis by 25 degrees, and nearer."""
    found, true = aligned(pose, camera)
    assert found.tried.all() and found.found.mean() > 0.7
    assert np.median(errors_px(found, true)) < 0.15


def test_a_change_of_brightness_does_not_move_them():
    found, true = aligned(POSES[-1], shown=lambda gray: (0.6 * gray + 30.0).astype(np.uint8))
    assert found.found.mean() > 0.95 and np.median(errors_px(found, true)) < 0.05


def test_another_texture_is_not_taken_for_the_patch():
    found, _ = aligned(POSES[-1], shown=lambda gray: image(POSES[-1], seed=1))
    assert found.tried.all() and found.found.mean() < 0.05


def test_a_patch_further_away_than_allowed_is_not_found():
    assert aligned(POSES[-1], start_off_px=1.5)[0].found.mean() > 0.9
    assert aligned(POSES[-1], start_off_px=3.0)[0].found.mean() < 0.1


def test_features_without_position_are_not_tried():
    local_map, points = followed_map(POSES)
    unknown = Positions(local_map.ids[:5], np.full((5, 3), np.nan), np.full(5, np.nan))
    local_map.apply(MapUpdate(positions=unknown))
    patches = ReferencePatches(CAMERA)
    patches.take(local_map, image(POSES[-1]))
    start = pixels(POSES[-1], points)
    found = patches.align(local_map, POSES[-1], image(POSES[-1]), start, LIMIT_PX)
    assert not found.tried[:5].any() and not found.found[:5].any() and found.tried[5:].all()
    np.testing.assert_array_equal(found.uv_px[:5], start[:5])


@pytest.mark.parametrize(("by_m", "kept"), [(0.5, True), (3.0, False)])
def test_a_patch_is_kept_until_it_appears_at_another_scale(by_m, kept):
    """A kept patch leads back to where the feature was, however wrong the newest match is; walls are 4 to 11
    m away."""
    local_map, points = followed_map(POSES)
    patches, pose = ReferencePatches(CAMERA), ahead(by_m)
    patches.take(local_map, image(POSES[-1]))
    true, gray = pixels(pose, points), image(pose)
    inside = np.all((true > 15) & (true < (CAMERA.width - 15, CAMERA.height - 15)), axis=1)
    patches.align(local_map, pose, gray, true, LIMIT_PX)
    drifted = true + np.array([0.5, 0.0])
    view = NewView(len(POSES), drifted, drifted, inside)
    local_map.apply(MapUpdate(frames=(NewFrame(0.4, pose),), view=view))
    patches.take(local_map, gray)
    again = patches.align(local_map, pose, gray, drifted[inside], LIMIT_PX)
    expected = true if kept else drifted
    assert np.median(np.linalg.norm(again.uv_px - expected[inside], axis=1)[again.found]) < 0.15


def test_the_patches_follow_the_features_of_the_map():
    """Features that are lost lose their patch, those that start get one; the others keep theirs."""
    local_map, points = followed_map(POSES)
    patches, gray = ReferencePatches(CAMERA), image(POSES[-1])
    patches.take(local_map, gray)
    uv, found = pixels(POSES[-1], points), np.arange(len(points)) % 2 == 0
    local_map.apply(MapUpdate(frames=(NewFrame(0.4, POSES[-1]),), view=NewView(len(POSES), uv, uv, found)))
    local_map.apply(MapUpdate(renew_full_tracks=True))
    patches.take(local_map, gray)
    again = patches.align(local_map, POSES[-1], gray, uv[found], LIMIT_PX)
    assert len(again.found) == found.sum() and again.found.all()
    assert np.linalg.norm(again.uv_px - uv[found], axis=1).max() < 0.05
