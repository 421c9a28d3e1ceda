"""How a camera is turned about its axis of view."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vgps.config import StartConfig
from vgps.gps.camera_roll import camera_turned_deg
from vgps.solution import Trajectory

LOOKS_NORTH = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def path_of(roll_deg, pitch_deg=0.0):
    """Three poses of a camera turned clockwise, as it looks, that looks down by a pitch."""
    poses = np.tile(np.eye(4), (3, 1, 1))
    down = Rotation.from_euler("x", -pitch_deg, degrees=True).as_matrix()
    poses[:, :3, :3] = down @ LOOKS_NORTH @ Rotation.from_euler("z", roll_deg, degrees=True).as_matrix()
    return Trajectory(np.arange(3.0), poses)


@pytest.mark.parametrize("roll_deg, expected", [(5, 0), (53, 90), (90, 90), (182, 180), (-80, 270), (-30, 0)])
def test_the_nearest_quarter_is_told(roll_deg, expected):
    assert camera_turned_deg(path_of(roll_deg), StartConfig(), upside_down=False) == expected
    assert camera_turned_deg(path_of(roll_deg), StartConfig(), upside_down=True) == (expected + 180) % 360


def test_the_upright_axes_of_a_camera_turned_clockwise():
    # its own right points down then, and its own down to the left
    np.testing.assert_allclose(StartConfig(roll_deg=90.0).upright[:, 0], [0.0, -1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(StartConfig(roll_deg=90.0).upright[:, 1], [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(path_of(90.0).world_T_camera[0, :3, 0], [0.0, 0.0, -1.0], atol=1e-12)


@pytest.mark.parametrize("roll_deg", [0.0, 90.0, 180.0, 270.0])
def test_nothing_is_told_of_a_camera_that_is_turned_as_assumed(roll_deg):
    assert not camera_turned_deg(path_of(roll_deg + 4.0), StartConfig(roll_deg=roll_deg), upside_down=False)


def test_one_that_flies_or_looks_down_may_be_turned_anyhow():
    assert camera_turned_deg(path_of(0.0, 70.0), StartConfig(), upside_down=True) == 0.0
    assert camera_turned_deg(path_of(90.0), StartConfig(airborne="yes"), upside_down=False) == 0.0
