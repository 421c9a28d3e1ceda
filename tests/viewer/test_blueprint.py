"""The first view of the scene."""

from dataclasses import replace

import numpy as np
import pytest

from vgps.solution import Solution
from vgps.viewer.blueprint import scene_viewpoint


def test_the_scene_is_seen_from_above_and_beside_the_path(solution: Solution) -> None:
    eye, target = scene_viewpoint(solution)
    np.testing.assert_allclose(target, [0.0, 2.5, 0.0])  # the middle of 5 m northwards
    offset = eye - target
    assert abs(offset[0]) == pytest.approx(5.0)  # beside a path to the north: east or west of it
    np.testing.assert_allclose(offset[1:], [0.0, 5.0], atol=1e-9)


def test_an_eastward_path_is_seen_from_the_south(solution: Solution) -> None:
    poses = solution.world_T_camera.copy()
    poses[:, :3, 3] = poses[:, [1, 0, 2], 3]
    eye, target = scene_viewpoint(replace(solution, world_T_camera=poses))
    assert eye[1] < target[1]
