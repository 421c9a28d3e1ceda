import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import X
from scipy.spatial.transform import Rotation

from vgps.config import StartConfig
from vgps.smoothing.scene.ground import Ground
from vgps.smoothing.scene.level_priors import level_priors

NORTH = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # world_R_camera of one looking north


def cost(axis, start, ground):
    """Return the error at a camera turned by 5 degrees about one of its axes."""
    turned = NORTH @ Rotation.from_euler(axis, 5.0, degrees=True).as_matrix()
    values = gtsam.Values()
    values.insert(X(0), gtsam.Pose3(gtsam.Rot3(turned), np.zeros(3)))
    return level_priors(np.array([0]), start, ground).error(values)


def of_sigma(sigma_deg):
    return pytest.approx(0.5 * (np.sin(np.radians(5.0)) / np.radians(sigma_deg)) ** 2)


def seen(axis):
    """Return ground that shows one of the camera's axes to 1 degree."""
    return Ground(np.array([0]), np.eye(3)[[axis]], np.radians([1.0]))


@pytest.mark.parametrize("airborne, pitch_deg", [("no", 30.0), ("yes", 60.0)])
def test_without_ground_roll_and_pitch_are_level(airborne, pitch_deg):
    start = StartConfig(airborne=airborne)
    assert cost("z", start, None) == of_sigma(5.0) and cost("x", start, None) == of_sigma(pitch_deg)


def test_a_road_stands_in_for_the_roll_and_land_under_a_drone_for_the_pitch():
    road, drone = StartConfig(airborne="no"), StartConfig(airborne="yes")
    assert cost("z", road, seen(0)) == of_sigma(1.0) and cost("x", road, seen(0)) == of_sigma(30.0)
    assert cost("z", drone, seen(2)) == of_sigma(5.0) and cost("x", drone, seen(2)) == of_sigma(1.0)


def test_a_camera_is_level_as_it_is_turned():
    start = StartConfig(roll_deg=90.0)
    assert cost("z", start, None) == pytest.approx(0.5 * (np.cos(np.radians(5.0)) / np.radians(5.0)) ** 2)
    values = gtsam.Values()
    turned = NORTH @ Rotation.from_euler("z", 95.0, degrees=True).as_matrix()
    values.insert(X(0), gtsam.Pose3(gtsam.Rot3(turned), np.zeros(3)))
    assert level_priors(np.array([0]), start).error(values) == of_sigma(5.0)
