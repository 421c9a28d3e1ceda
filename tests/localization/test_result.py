from dataclasses import replace

import numpy as np
from landmark_matches import matched
from textured_wall import ORIGIN, WallVideo, recording_of

from vgps.config import Config
from vgps.localization.pose import NO_MATCHES
from vgps.localization.result import Track, to_solution
from vgps.localization.tracker import TrackedFrame
from vgps.solution import FrameState


def matches(*ids):
    rows = np.array(ids)
    points = np.column_stack([rows, rows, rows]).astype(float)
    return matched(rows, points, points[:, :2] + 0.5, rows / 100)


def tracked_frame(t_s, observations, sigma=0.1):
    return TrackedFrame(
        t_s=t_s,
        world_T_camera=np.eye(4),
        covariance=sigma**2 * np.eye(6),
        tracked=len(observations) > 0,
        recovered=False,
        observations=observations,
        correlation=0.9,
    )


def test_frames_become_a_solution():
    frames = [tracked_frame(0.0, matches(7, 3)), tracked_frame(0.1, matches(3, 9))]
    lost = replace(tracked_frame(0.2, NO_MATCHES), covariance=np.full((6, 6), np.nan))
    path = np.tile(np.eye(4), (3, 1, 1))
    path[:, 0, 3] = (1, 2, 3)
    track = Track(
        frames=[*frames, lost],
        gray=[np.array([70.0, 30.0]), np.array([31.0, 300.0]), np.zeros(0)],
        world_T_camera=path,
        seconds={"track": 1.5},
        warnings=["lost"],
    )
    solution = to_solution(recording_of(WallVideo(3)), ORIGIN, Config(), track)
    assert solution.state == (FrameState.TRACKED, FrameState.TRACKED, FrameState.BRIDGED)
    np.testing.assert_array_equal(solution.t_s, [0.0, 0.1, 0.2])
    np.testing.assert_array_equal(solution.world_T_camera, path)
    np.testing.assert_allclose(solution.sigma_position_m[:2], 0.1)
    assert np.isnan(solution.sigma_position_m[2]).all()
    # landmarks 3, 7 and 9, each with the grey of its first observation
    np.testing.assert_array_equal(solution.landmarks.world_p_landmark[:, 0], [3, 7, 9])
    np.testing.assert_array_equal(solution.landmarks.gray, [30, 70, 255])
    np.testing.assert_array_equal(solution.observations.landmark, [1, 0, 0, 2])
    np.testing.assert_array_equal(solution.observations.frame, [0, 0, 1, 1])
    np.testing.assert_array_equal(solution.observations.uv_px[:, 0], [7.5, 3.5, 3.5, 9.5])
    assert (solution.world_origin, solution.georeferenced) == (ORIGIN, True)
    assert (solution.seconds, solution.warnings) == ({"track": 1.5}, ("lost",))
