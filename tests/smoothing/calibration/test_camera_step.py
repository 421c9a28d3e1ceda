"""A step of the calibration leads only as far as its linear prediction holds."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_bundle import K
from synthetic_map import map_of, scene

from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS
from vgps.model import Camera
from vgps.smoothing.calibration.camera_step import after_step
from vgps.smoothing.calibration.parameter_step import ParameterStep
from vgps.smoothing.scene.other_calibration import misfit_px, seen_by
from vgps.smoothing.scene.scene import scene_of_map

CAMERA = Camera(model="pinhole", width=640, height=480, fx=K[0], fy=K[1], cx=K[2], cy=K[3])
NOTHING, AWAY, LONGER = np.zeros(3), np.array([0.0, 0.0, 5.0]), 1.05


@pytest.fixture(scope="module")
def made():
    """A scene as it is."""
    problem, poses, _, _ = scene(frames=12, disturbed=0.0)
    return scene_of_map(map_of(problem, 0, len(poses) - 1), 0, NO_CONTROL_OBSERVATIONS)[0]


def after(made, points, delta=NOTHING, before=None, held=None):
    """Where a step to other landmarks leads from the optimum of a problem that holds some of them."""
    landmark = np.arange(len(made.points)) if held is None else np.flatnonzero(held)
    before = made.points if before is None else before
    optimum = SimpleNamespace(world_T_camera=made.poses, world_p_landmark=before, landmark=landmark)
    return after_step(CAMERA, made, optimum, ParameterStep(delta, np.ones(3), made.poses, points))


def test_a_step_after_which_the_scene_fits_is_whole(made):
    camera, found, is_whole = after(made, made.points + 1e-4, before=made.points + AWAY)
    assert is_whole and camera == CAMERA
    np.testing.assert_array_equal(found.points, made.points + 1e-4)


def test_a_step_that_reaches_too_far_only_turns_the_poses(made):
    _, found, is_whole = after(made, made.points + AWAY, np.array([0.0, 2.0, -4.0]))
    assert is_whole and not np.allclose(found.poses, made.poses, atol=1e-3)
    np.testing.assert_array_equal(found.points, made.points)


def test_only_a_part_of_a_step_is_taken_after_which_most_observations_still_fit(made):
    """A focal length that is longer by a twentieth, of which the step predicts nothing."""
    camera, found, is_whole = after(made, made.points, np.array([np.log(LONGER), 0.0, 0.0]))
    share = np.log(camera.fx / CAMERA.fx) / np.log(LONGER)
    assert not is_whole and share < 1.0 and -np.log2(share) == pytest.approx(round(-np.log2(share)))
    assert misfit_px(found, camera) <= 1.0
    further = replace(camera, fx=CAMERA.fx * LONGER ** (2.0 * share), fy=CAMERA.fy * LONGER ** (2.0 * share))
    assert misfit_px(seen_by(further, CAMERA, made), further) > 1.0


def test_landmarks_that_the_problem_does_not_hold_say_nothing(made):
    """Those seen too rarely stay where they are, and fit no other calibration."""
    held = np.arange(len(made.points)) % 3 == 0
    moved = made.points + np.where(held[:, None], 1e-4, AWAY)
    _, found, is_whole = after(made, moved, before=made.points + AWAY, held=held)
    assert is_whole
    np.testing.assert_array_equal(found.points, moved)


def test_a_part_of_a_step_moves_poses_and_landmarks_by_as_much(made):
    moved = made.poses.copy()
    moved[:, :3, 3] += [2.0, 0.0, 0.0]
    whole = ParameterStep(np.array([0.4, 1.0, 2.0]), np.ones(3), moved, made.points + 1.0)
    part = whole.part(0.25, made.poses, made.points)
    np.testing.assert_allclose(part.delta, [0.1, 0.25, 0.5])
    np.testing.assert_allclose(part.poses[:, :3, 3], made.poses[:, :3, 3] + [0.5, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(part.points, made.points + 0.25, atol=1e-9)
    assert whole.part(1.0, made.poses, made.points) is whole
