"""A camera that is found again by the features of the last view, in images of a room."""

import numpy as np
import pytest
from angles import apart_deg
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
)

from vgps.mapping.map_update import MapUpdate, Positions
from vgps.tracking.relocaliser import Relocaliser

POSES = path(5)
LATER = moved(POSES[-1], 0.6, (2.0, -6.0, 5.0))


def relocaliser(local_map, camera=CAMERA, view_image=None, **tracking):
    config = CONFIG.tracking.model_copy(update=tracking)
    rng = np.random.default_rng(0)
    view_image = image(POSES[-1], camera) if view_image is None else view_image
    return Relocaliser(camera, config, rng, view_image, local_map)


@pytest.fixture(scope="module")
def local_map():
    return followed_map(POSES)[0]


@pytest.mark.parametrize("camera", [CAMERA, LENS], ids=["pinhole", "lens"])
def test_a_camera_is_found_after_a_gap(camera):
    local_map, _ = followed_map(POSES, camera)
    pose = relocaliser(local_map, camera).locate(image(LATER, camera), POSES[-1])
    assert pose is not None
    assert distance_m(pose, LATER) < 0.1 and apart_deg(pose, LATER) < 1.0
    assert distance_m(POSES[-1], LATER) > 0.5


def test_half_an_image_is_enough(local_map):
    """The other half shows another room: its features must not outvote the right ones."""
    gray = image(LATER)
    gray[:, 160:] = image(LATER, seed=1)[:, 160:]
    pose = relocaliser(local_map).locate(gray, POSES[-1])
    assert pose is not None and distance_m(pose, LATER) < 0.3


def test_a_prediction_that_fits_is_taken(local_map):
    pose = relocaliser(local_map, lmeds_samples=1).locate(images(5)[-1], POSES[-1])
    np.testing.assert_allclose(pose, POSES[-1], atol=0.05)


@pytest.mark.parametrize("shown", ["black", "another room", "the wall behind"])
def test_an_image_of_something_else_gives_no_pose(local_map, shown):
    gray = {
        "black": lambda: np.zeros((CAMERA.height, CAMERA.width), np.uint8),
        "another room": lambda: image(LATER, seed=1),
        "the wall behind": lambda: image(moved(LATER, 0.0, (0.0, 180.0, 0.0))),
    }[shown]()
    assert relocaliser(local_map).locate(gray, POSES[-1]) is None


def test_positions_that_fit_no_pose_give_none(local_map):
    """Every feature is recognised, but the positions have been shuffled."""
    shuffled = local_map.snapshot()
    order = np.random.default_rng(0).permutation(shuffled.ids)
    sigma_px = np.full(len(order), 0.3)
    shuffled.apply(MapUpdate(positions=Positions(shuffled.ids, shuffled.points[order], sigma_px)))
    assert relocaliser(shuffled).locate(images(5)[-1], POSES[-1]) is None


def test_a_map_without_positions_finds_nothing():
    local_map, _ = followed_map(POSES, positions=False)
    assert relocaliser(local_map).locate(images(5)[-1], POSES[-1]) is None


def test_fewer_matches_than_needed_give_no_pose(local_map):
    count = len(local_map.ids)
    assert relocaliser(local_map, min_inliers=count + 1).locate(images(5)[-1], POSES[-1]) is None
