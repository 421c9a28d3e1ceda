"""Landmarks across a path, and the plane below it: hand-computed turns, a road between walls."""

import numpy as np
import pytest

from vgps.smoothing.scene.passed_landmarks import PassedLandmarks, commonest_plane

HEIGHT = 1.5


def section(across: np.ndarray, down: np.ndarray) -> PassedLandmarks:
    return PassedLandmarks(np.zeros(len(across), dtype=int), across, down)


def test_a_section_is_turned_so_that_a_slope_becomes_level():
    """Ground that falls by 3 in 4 to the right, 5 below the camera: 4 away from it, at right angles."""
    across = np.array([-4.0, 0.0, 4.0])
    turned = section(across, 5.0 + 0.75 * across).rolled(np.arctan(0.75))
    np.testing.assert_allclose(turned.down, 4.0)
    np.testing.assert_allclose(turned.across, [-2.0, 3.0, 8.0])


def test_a_lane_is_four_heights_wide():
    across = np.array([-3.1, -2.9, 2.9, 3.1])
    assert section(across, np.ones(4)).in_lane(HEIGHT).tolist() == [False, True, True, False]


@pytest.mark.parametrize("roll_deg", [0.0, 15.0, -25.0])
def test_the_road_is_the_plane_although_more_landmarks_are_on_a_wall(roll_deg):
    """A road of 300 landmarks, a wall 6 m to the right with 400: the camera is turned by some angle."""
    rng = np.random.default_rng(0)
    across = np.append(rng.uniform(-3.0, 3.0, 300), np.full(400, 6.0))
    down = np.append(np.full(300, HEIGHT), rng.uniform(-8.0, HEIGHT, 400))
    plane = commonest_plane(section(across, down).rolled(-np.radians(roll_deg)))
    assert plane is not None
    assert np.degrees(plane.roll_rad) == pytest.approx(roll_deg)
    assert plane.height == pytest.approx(HEIGHT, rel=0.05)


def test_the_plane_that_hides_no_landmark_is_the_ground():
    """Shelves above the ground hold more landmarks than the ground itself."""
    across = np.tile(np.linspace(-2.0, 2.0, 200), 3)
    down = np.repeat([0.9, 0.9, HEIGHT], 200)
    plane = commonest_plane(section(across, down))
    assert plane is not None and plane.height == pytest.approx(HEIGHT, rel=0.05)


def test_without_landmarks_below_there_is_no_plane():
    assert commonest_plane(section(np.zeros(0), np.zeros(0))) is None
    assert commonest_plane(section(np.zeros(20), np.full(20, -1.0))) is None


def test_scattered_landmarks_have_some_plane_all_the_same():
    """Below each height lie more landmarks than at it: whether the plane is there is for others to check."""
    down = np.append(np.geomspace(1.0, 1e4, 98), [1.3e4, 1.3e4])
    plane = commonest_plane(section(np.zeros(100), down))
    assert plane is not None and plane.roll_rad == 0.0
