"""The start of a map on images of a room."""

from dataclasses import replace

import numpy as np
import pytest
from textured_room import CAMERA, CONFIG, frames, image, path

from vgps.model import Frame
from vgps.pipeline.map_starter import MapStarter
from vgps.tracking.frame_tracker import FrameTracker
from vgps.tracking.mapper import Mapper

POSES = path(8)


def starter(config=CONFIG):
    rng = np.random.default_rng(0)
    stages = (
        FrameTracker(CAMERA, config.tracking, config.mapping, rng),
        Mapper(CAMERA, config.tracking, config.mapping, rng),
    )
    return MapStarter(stages, CAMERA, config, rng, None)


def fed(these):
    """The map after these frames, or after the one that started it."""
    stage, builder = starter(), None
    for frame in these:
        builder = stage.add_frame(builder, frame)
        if builder is not None and builder.started:
            break
    return builder


@pytest.fixture(scope="module")
def moving():
    return list(frames(POSES))


def test_a_map_starts_once_the_image_has_moved_and_poses_all_its_frames(moving):
    builder = fed(moving)
    count = builder.local_map.next_frame
    assert builder.started and 3 <= count <= 6
    assert not fed(moving[: count - 1]).started
    relative = np.linalg.inv(POSES[0]) @ POSES[:count]
    relative[:, :3, 3] /= np.linalg.norm(relative[-1, :3, 3])
    np.testing.assert_allclose(builder.local_map.poses, relative, atol=0.05)
    assert builder.local_map.positioned.sum() > CONFIG.start.min_inliers


def test_the_newest_view_is_the_newest_frame(moving):
    builder = fed(moving[:3])
    np.testing.assert_array_equal(builder.view_image, moving[2].gray)
    assert builder.local_map.view_frames[-3:].tolist() == [0, 1, 2]


def test_frames_of_a_standing_start_are_posed_where_they_stand(moving):
    stop = [Frame(i, 0.1 * i, moving[0].gray) for i in range(3)]
    later = [replace(frame, index=frame.index + 2, t_s=frame.t_s + 0.2) for frame in moving[1:]]
    builder = fed([*stop, *later])
    assert builder.started
    assert [(m.frame, m.reference) for m in builder.local_map.zero_motions] == [(1, 0), (2, 0)]
    assert 1 not in builder.local_map.view_frames and 2 not in builder.local_map.view_frames
    np.testing.assert_allclose(builder.local_map.poses[:3], np.tile(np.eye(4), (3, 1, 1)), atol=1e-12)


def test_an_image_without_corners_begins_no_map():
    black = Frame(0, 0.0, np.zeros((CAMERA.height, CAMERA.width), np.uint8))
    assert starter().add_frame(None, black) is None


def test_a_map_whose_features_are_lost_begins_anew(moving):
    other = Frame(3, 0.3, image(POSES[3], seed=1))
    builder = fed([*moving[:3], other])
    assert builder.local_map.first_frame == 3 and not builder.started
    np.testing.assert_array_equal(builder.view_image, other.gray)
