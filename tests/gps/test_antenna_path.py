"""The velocity of an antenna along a path."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vgps.gps.antenna_path import antenna_velocities
from vgps.solution import Trajectory


def driven(t_s, at):
    """A path along the x axis, turned by 90 degrees a second about the vertical."""
    poses = np.tile(np.eye(4), (len(t_s), 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(np.outer(t_s, [0.0, 0.0, np.pi / 2])).as_matrix()
    poses[:, 0, 3] = at
    return Trajectory(t_s, poses)


def test_the_velocity_at_a_fix_is_that_between_its_mean_places_before_and_after():
    """The camera brakes, 2 t - t^2 / 10; the antenna goes around it by 45 degrees in either half second."""
    t_s = np.arange(0.0, 6.05, 0.1)
    found = antenna_velocities(
        driven(t_s, 2.0 * t_s - 0.1 * t_s**2), np.array([2.0]), np.array([1.0, 0.0, 0.0])
    )
    aside_m = (1.0 - np.cos(np.pi / 4.0)) / (np.pi / 4.0)  # mean of a sine over 45 degrees
    np.testing.assert_allclose(found, [[1.6, -2.0 * aside_m / 0.5, 0.0]], atol=0.01)


def test_at_the_ends_and_beyond_them_the_velocity_is_that_of_what_is_left():
    t_s = np.arange(0.0, 3.05, 0.1)
    found = antenna_velocities(driven(t_s, t_s**2), np.array([-9.0, 0.0, 2.9, 9.0]), np.zeros(3))
    # mean squares over mean times; as if it stood still from 3 s on
    late = (8.94067 - 7.04333) / (2.99 - 2.65)
    np.testing.assert_allclose(found[:, 0], [1.0 / 3.0, 1.0 / 3.0, late, 17.0 / 3.0], atol=0.01)


def test_noise_of_the_poses_is_no_velocity():
    t_s = np.arange(0.0, 3.02, 1 / 30)
    path = driven(t_s, 1.5 * t_s + np.where(np.arange(len(t_s)) % 2, 0.005, -0.005))  # 0.3 m/s by frame
    found = antenna_velocities(path, np.arange(0.6, 2.4, 0.1), np.zeros(3))
    np.testing.assert_allclose(found[:, 0], 1.5, atol=0.011)


@pytest.mark.parametrize("steps_hz", [1.6, 1.8, 2.8])
def test_the_bob_of_a_walk_is_not_reversed(steps_hz):
    """In a mean velocity over a second that of 1.6 or 1.8 steps a second is."""
    t_s, rate = np.arange(0.0, 3.02, 1 / 30), 2.0 * np.pi * steps_hz
    at_s = np.arange(0.6, 2.4, 0.1)
    found = antenna_velocities(driven(t_s, 0.02 * np.sin(rate * t_s)), at_s, np.zeros(3))
    assert found[:, 0] @ np.cos(rate * at_s) > 0.0
