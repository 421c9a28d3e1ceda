"""Stages A, B and C frame by frame, on images of a room with exact truth."""

from dataclasses import replace

import numpy as np
import pytest
from angles import apart_deg
from room_pipeline import COUNT, POSES, another_room, errors_m, exact_fixes, fed, pipeline, room
from textured_room import (
    FPS,
    distance_m,
    frames,
    images,
    moved,
    pixels,
    points_at,
)

from vgps.mapping.control_observations import ControlObservations
from vgps.mapping.retention import RetentionPolicy
from vgps.model import Frame

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def aligned():
    return fed(room(), exact_fixes())


def test_every_frame_is_posed_in_the_world(aligned):
    (local_map,) = aligned.maps
    assert local_map.aligned and aligned.current is local_map
    assert (local_map.first_frame, local_map.next_frame) == (0, COUNT)
    assert errors_m(local_map).max() < 0.05
    # a path as straight as this hardly shows the roll
    assert max(apart_deg(a, b) for a, b in zip(local_map.poses, POSES, strict=True)) < 1.5
    np.testing.assert_allclose(aligned.t_s, np.arange(COUNT) / FPS)
    assert set(aligned.timer.by_stage) >= {"start", "track", "map", "align", "drift", "window"}


def test_its_points_are_those_of_the_room(aligned):
    """As the last camera sees them, to 2 % of their distance, in the median."""
    local_map = aligned.maps[0]
    log = local_map.observations()
    last = log.frame == COUNT - 1
    rows = log.landmark[last]
    known = np.isfinite(local_map.points[rows, 0])
    true = points_at(POSES[-1], log.uv_px[last][known])
    assert known.sum() > 50
    found = (local_map.points[rows][known] - local_map.poses[-1, :3, 3]) @ local_map.poses[-1, :3, :3]
    expected = (true - POSES[-1, :3, 3]) @ POSES[-1, :3, :3]
    assert np.median(np.linalg.norm(found - expected, axis=1) / expected[:, 2]) < 0.02


def test_a_pose_does_not_wait_for_stage_b():
    """It is known before its view is mapped, which happens once: when asked for, or with stage C."""
    *start, first, second = room(14)
    made = fed(start)
    for frame, map_view in ((first, made.map_frame), (second, made.refine)):
        before = made.current.points.copy()
        made.track_frame(frame)
        assert np.isfinite(made.current.poses[-1]).all()
        np.testing.assert_array_equal(made.current.points, before)
        map_view()
        mapped = made.current.points.copy()
        assert len(mapped) > len(before) or not np.array_equal(mapped, before, equal_nan=True)
        made.refine()
        np.testing.assert_array_equal(made.current.points, mapped)


def test_without_fixes_the_path_has_its_shape_alone():
    (local_map,) = fed(room(20)).maps
    assert not local_map.aligned
    np.testing.assert_allclose(local_map.poses[0], np.eye(4), atol=1e-9)
    relative = np.linalg.inv(POSES[0]) @ POSES[:20]
    scale = np.linalg.norm(local_map.poses[-1, :3, 3]) / np.linalg.norm(relative[-1, :3, 3])
    np.testing.assert_allclose(local_map.poses[:, :3, 3], scale * relative[:, :3, 3], atol=0.05 * scale)


def test_fixes_that_come_late_align_the_map_and_the_frames_before():
    made = pipeline()
    for frame in room(24):
        if frame.index == 20:
            made.add_fixes(exact_fixes(20))
        made.add_frame(frame)
        assert made.maps == [] or made.maps[0].aligned == (frame.index >= 20)
    assert errors_m(made.maps[0]).max() < 0.05


def test_fixes_between_pictures_that_are_shown_twice_align_the_map():
    """Twice as many frames a second as pictures; each fix lies between the two frames of a picture."""
    fixes = exact_fixes()
    twice = [
        replace(frame, index=2 * frame.index + half, t_s=(frame.index + half / 2) / FPS)
        for frame in room(24)
        for half in (0, 1)
    ]
    made = fed(twice, replace(fixes, t_s=fixes.t_s + 0.2 / FPS), live=True)
    assert made.maps[0].aligned


def test_control_points_align_a_map_without_fixes():
    """Ten corners of the room, seen in the frames 2 and 14."""
    uv = np.random.default_rng(0).uniform((30, 30), (290, 210), (10, 2))
    points = points_at(POSES[8], uv)
    seen = [pixels(POSES[k], points) for k in (2, 14)]
    controls = ControlObservations(
        np.repeat([2, 14], 10), np.concatenate(seen), np.tile(points, (2, 1)), np.zeros((20, 3))
    )
    made = fed(room(18), controls=controls)
    assert made.maps[0].aligned and errors_m(made.maps[0]).max() < 0.1


def test_standing_frames_get_a_constraint_and_no_view():
    """The camera stands from frame 12 to 19 and goes on."""
    order = [*range(12), *[12] * 8, *range(13, 20)]
    these = [Frame(i, i / FPS, images(COUNT)[k]) for i, k in enumerate(order)]
    made = fed(these)
    (local_map,) = made.maps
    assert {m.frame: m.reference for m in local_map.zero_motions} == dict.fromkeys(range(13, 20), 12)
    assert not set(range(13, 20)) & set(local_map.observations().frame.tolist())
    step = np.linalg.norm(np.diff(local_map.poses[:, :3, 3], axis=0), axis=1)
    assert step[12:19].max() < 0.05 * np.median(step) and step[20:].min() > 0.5 * np.median(step)


def test_frames_whose_picture_hangs_are_bridged():
    """From frame 12 to 19 while the camera moves on."""
    order = [*range(12), *[12] * 8, *range(20, COUNT)]
    made = fed([Frame(i, i / FPS, images(COUNT)[k]) for i, k in enumerate(order)], exact_fixes())
    (local_map,) = made.maps
    assert local_map.bridged == set(made.repeated_frames) == set(range(13, 20)) and not local_map.zero_motions
    assert errors_m(local_map).max() < 0.1


@pytest.mark.parametrize("live", [False, True])
def test_every_second_frame_repeats_a_picture_while_the_camera_brakes(live):
    """The last repeat has no picture after it."""
    shown = [0, 3, 6, 9, 12, 15, 17, 19, 21, 23, 25, 27, 29]
    made = fed([Frame(i, i / FPS, images(COUNT)[shown[i // 2]]) for i in range(26)], live=live)
    (local_map,) = made.maps
    assert local_map.next_frame == 25 and local_map.bridged == set(range(3, 25, 2))
    assert made.repeated_frames == list(range(3, 26, 2))
    assert [motion.frame for motion in local_map.zero_motions] == [1]  # before anything had moved


def test_a_camera_that_stops_at_the_end_of_its_video_stands():
    made = fed([Frame(i, i / FPS, images(COUNT)[min(i, 15)]) for i in range(20)])
    assert [motion.frame for motion in made.maps[0].zero_motions] == [16, 17, 18, 19]


@pytest.mark.parametrize(("live", "repeats", "end"), [(False, [14, 15], 14), (True, [], 16)])
def test_a_camera_that_is_lost_after_a_picture_hung_did_not_stand(live, repeats, end):
    """Live, the poses of these frames have been given out."""
    seen = list(room(14))
    hung = [replace(seen[-1], index=i, t_s=i / FPS) for i in (14, 15)]
    made = fed([*seen, *hung, *another_room(16)], live=live)
    assert made.repeated_frames == repeats and made.maps[0].next_frame == end


def test_an_exposure_that_jumps_loses_nothing():
    """To a third and back, every four frames."""
    shown = [replace(one, gray=(one.gray // 3 if one.index % 8 > 3 else one.gray)) for one in room()]
    made = fed(shown, exact_fixes())
    (local_map,) = made.maps
    assert (local_map.next_frame, local_map.bridged) == (COUNT, set()) and errors_m(local_map).max() < 0.1


def test_black_frames_are_bridged():
    made = fed(room(black=(14, 15, 16)), exact_fixes())
    (local_map,) = made.maps
    assert local_map.bridged == {14, 15, 16} and errors_m(local_map).max() < 0.1
    assert any("from frame 14 to 16" in warning for warning in made.warnings)


def test_a_camera_that_turned_in_the_dark_is_found_again():
    """By 14 degrees, which is 60 px: too far for the motion model and for optical flow."""
    dark = [Frame(i, i / FPS, np.zeros_like(images(1)[0])) for i in range(20, 24)]
    turned = [moved(pose, 0.0, (3.0, 14.0, 6.0)) for pose in POSES[24:28]]
    made = fed([*room(20), *dark, *frames(turned, start=24)], exact_fixes(20))
    (local_map,) = made.maps
    assert local_map.bridged == {20, 21, 22, 23} and local_map.next_frame == 28
    assert max(distance_m(a, b) for a, b in zip(local_map.poses[24:], turned, strict=True)) < 0.2
    assert max(apart_deg(a, b) for a, b in zip(local_map.poses[24:], turned, strict=True)) < 2.0


def test_a_map_begun_while_tracking_was_lost_is_dropped_when_it_is_resumed():
    lost = another_room(14, 2)
    back = [Frame(i, i / FPS, images(COUNT)[i]) for i in range(16, 20)]
    made = fed([*room(14), *lost, *back, *another_room(20)])
    first, second = made.maps
    assert first.bridged == {14, 15} and first.next_frame == 20 and second.first_frame == 20


def test_where_tracking_is_not_resumed_a_new_map_begins():
    """The camera is suddenly in another room."""
    made = fed([*room(15), *another_room(15)])
    first, second = made.maps
    assert (first.next_frame, second.first_frame, second.next_frame) == (15, 15, 27)
    assert made.current is second and np.isfinite(second.poses).all()
    assert any("after frame 14" in w and "begins at frame 15" in w for w in made.warnings)


def test_a_camera_that_never_moves_starts_no_map():
    made = fed(Frame(i, i / FPS, images(COUNT)[0]) for i in range(6))
    assert made.maps == [] and made.current is None


def test_the_past_is_discarded_and_its_poses_are_handed_over():
    """Two seconds of the path and its fixes stay."""
    made, retired = pipeline(exact_fixes(), retention=RetentionPolicy(view_frames=14, path_s=2.0)), []
    assert made.discard() == []
    for frame in room():
        made.add_frame(frame)
        retired += made.discard()
    (local_map,) = made.maps
    first = local_map.first_frame
    assert first == COUNT - 1 - 20
    assert made.fix_buffer.fixes.t_s.min() >= made.t_s[-1] - 2.0
    rows = np.concatenate([part.first_frame + np.arange(len(part.poses)) for part in retired])
    assert rows.tolist() == list(range(first))
    assert all(part.aligned for part in retired)
    gone = np.concatenate([part.poses for part in retired])
    assert np.linalg.norm(gone[:, :3, 3] - POSES[:first, :3, 3], axis=1).max() < 0.1
    assert errors_m(local_map).max() < 0.1


def test_a_finished_map_is_retired_whole():
    policy = RetentionPolicy(view_frames=14, path_s=60.0)
    made = fed([*room(15), *another_room(15)], retention=policy)
    first, second = made.maps
    (retired,) = made.discard()
    np.testing.assert_array_equal(retired.poses, first.poses)
    assert made.maps == [second]
