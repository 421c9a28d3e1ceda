import numpy as np

from vgps.mapping.control_observations import ControlObservations


def test_observations_between_two_frames_are_counted_from_the_first():
    frame = np.array([0, 3, 4, 4, 7, 9])
    uv, points = np.arange(12.0).reshape(6, 2), np.arange(18.0).reshape(6, 3)
    part = ControlObservations(frame, uv, points, points + 1).between(3, 7)
    assert part.frame.tolist() == [0, 1, 1, 4]
    np.testing.assert_array_equal(part.uv_px, uv[1:5])
    np.testing.assert_array_equal(part.world_p_point, points[1:5])
    np.testing.assert_array_equal(part.sigma_m, points[1:5] + 1)


def test_nothing_is_between_frames_without_observations():
    observations = ControlObservations(np.array([2]), *(np.zeros((1, n)) for n in (2, 3, 3)))
    assert len(observations.between(3, 9).frame) == 0
