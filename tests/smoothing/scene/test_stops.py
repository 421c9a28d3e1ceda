"""Scenes without the frames of stops, and their poses put back."""

from dataclasses import replace

import numpy as np
from synthetic_map import map_of, scene

from vgps.geometry import project
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS, ControlObservations
from vgps.smoothing.scene.scene import scene_of_map
from vgps.smoothing.scene.stops import with_stops, without_stops


def stopping(controls=NO_CONTROL_OBSERVATIONS):
    """Twelve frames; the camera stands in 5 to 9, as in 4."""
    problem, true, _, _ = scene()
    made = map_of(replace(problem, world_T_camera=true), 0, 6, stop=(4, 5))
    return scene_of_map(made, 0, controls)[0]


def test_a_stop_is_its_first_frame_and_its_last():
    whole = stopping()
    moving, rows = without_stops(whole)
    assert rows.tolist() == [0, 1, 2, 3, 4, 9, 10, 11]
    np.testing.assert_array_equal(moving.t_s, whole.t_s[rows])
    np.testing.assert_array_equal(rows[moving.observations.frame], whole.observations.frame)
    (held,) = moving.zero_motions
    assert (held.frame, held.reference) == (5, 4) and not moving.unseen.any()


def test_observations_stay_those_of_their_poses():
    moving, _ = without_stops(stopping())
    seen = moving.observations
    K = np.array([[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]])
    uv_px, depth = project(K, moving.poses[seen.frame], moving.points[seen.landmark, None])
    again, _ = project(K, stopping().poses[stopping().observations.frame], moving.points[seen.landmark, None])
    np.testing.assert_array_equal(uv_px, again)
    assert (depth > 0.0).all()


def test_a_frame_that_shows_a_control_point_stays():
    control = ControlObservations(np.array([7]), np.zeros((1, 2)), np.zeros((1, 3)), np.ones((1, 3)))
    moving, rows = without_stops(stopping(control))
    assert rows.tolist() == [0, 1, 2, 3, 4, 7, 9, 10, 11] and moving.controls.frame.tolist() == [5]


def test_frames_of_a_stop_go_where_its_first_frame_goes():
    whole = stopping()
    moving, rows = without_stops(whole)
    poses = moving.poses.copy()
    poses[:, 0, 3] += np.arange(len(rows))
    back = with_stops(whole, rows, poses)
    np.testing.assert_array_equal(back[rows], poses)
    np.testing.assert_allclose(back[5:9], np.broadcast_to(back[4], (4, 4, 4)), atol=1e-12)


def test_without_a_stop_nothing_changes():
    problem, _, _, _ = scene()
    whole = scene_of_map(map_of(problem, 0, 6), 0, NO_CONTROL_OBSERVATIONS)[0]
    moving, rows = without_stops(whole)
    assert moving is whole and rows.tolist() == list(range(7))
    np.testing.assert_array_equal(with_stops(whole, rows, whole.poses), whole.poses)
