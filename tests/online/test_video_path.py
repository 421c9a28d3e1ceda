import numpy as np
import pytest
from fused_drives import DrivingCamera

from vgps.geometry import interpolate_poses

PATH = DrivingCamera(40).seen(np.random.default_rng(0))


@pytest.mark.parametrize("t_s", [[], [3.9], [0.0], [-1.0], [9.0], [1.23, 1.27], [2.0, 0.31, 5.0]])
def test_poses_are_those_of_the_whole_path(t_s):
    found = PATH.at(np.array(t_s, float))
    np.testing.assert_allclose(
        found, interpolate_poses(PATH.t_s, PATH.poses, np.array(t_s, float)), atol=1e-12
    )


def test_a_path_since_a_time_begins_there():
    later = PATH.since(1.25)
    assert later.t_s[0] == 1.25 and later.t_s[1] == pytest.approx(1.3) and not later.moving[0]
    np.testing.assert_allclose(later.at(np.array([1.25, 2.0])), PATH.at(np.array([1.25, 2.0])), atol=1e-12)
