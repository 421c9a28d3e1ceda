"""What a Solution derives from its fields."""

import numpy as np
from solutions import PINHOLE, make_solution

from vgps.solution import Landmarks, Observations, SolvedCamera, Trajectory


def make_map(
    frames: list[int], rows: list[int], landmarks: int, first: float
) -> tuple[Landmarks, Observations]:
    """Return landmarks numbered from ``first`` in each field, and observations of them."""
    number = first + np.arange(landmarks)
    uv_px = np.column_stack([first + np.arange(len(rows)), np.zeros(len(rows))])
    return (
        Landmarks(np.tile(number[:, None], 3), number, number.astype(np.uint8)),
        Observations(np.array(frames), np.array(rows), uv_px),
    )


def test_landmarks_of_all_cameras_are_those_of_the_reference_first():
    own, other = make_map([0, 0, 1], [0, 1, 1], 2, 10.0), make_map([1, 1], [0, 2], 3, 20.0)
    camera = SolvedCamera(
        name="left",
        camera=PINHOLE,
        reference_T_camera=np.eye(4),
        sigma=np.zeros(6),
        delay_s=np.zeros(2),
        landmarks=other[0],
        observations=other[1],
    )
    poses = np.tile(np.eye(4), (2, 1, 1))
    run = make_solution(np.arange(2.0), poses, landmarks=own[0], observations=own[1], cameras=(camera,))
    landmarks, observations = run.all_landmarks
    assert landmarks.sigma_px.tolist() == [10, 11, 20, 21, 22] == landmarks.gray.tolist()
    np.testing.assert_array_equal(landmarks.world_p_landmark[:, 2], landmarks.sigma_px)
    assert observations.frame.tolist() == [0, 0, 1, 1, 1]
    assert observations.landmark.tolist() == [0, 1, 1, 2, 4]
    assert observations.uv_px[:, 0].tolist() == [10, 11, 12, 20, 21]


def test_rows_of_observations_keep_what_belongs_together():
    _, observations = make_map([5, 6, 7], [3, 1, 2], 4, 10.0)
    some = observations.rows(np.array([2, 0]))
    assert (some.frame.tolist(), some.landmark.tolist()) == ([7, 5], [2, 3])
    np.testing.assert_array_equal(some.uv_px, [[12, 0], [10, 0]])


def test_length_of_a_path_is_that_of_its_steps():
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, :3, 3] = [[0, 0, 0], [3, 4, 0], [3, 4, 2]]
    assert Trajectory(np.arange(3.0), poses).length_m == 7.0


def test_pixels_that_several_boxes_cover_count_once():
    corner, across, apart = (0, 4, 0, 0, 320, 240), (1, 2, 160, 120, 480, 360), (2, 6, 320, 360, 640, 480)
    regions = np.array([corner, across, apart])
    run = make_solution(np.arange(9.0), np.tile(np.eye(4), (9, 1, 1)), camera=PINHOLE, moving_regions=regions)
    assert run.moving_share.tolist() == [0.25, 0.4375, 0.5625, 0.375, 0.375, 0.125, 0.125, 0.0, 0.0]
