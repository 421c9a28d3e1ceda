"""The scene after a step of the calibration, or after as much of it as its linear prediction holds for."""

from dataclasses import replace

import numpy as np

from vgps.model import Camera
from vgps.smoothing.calibration.camera_equations import changed_camera
from vgps.smoothing.calibration.parameter_step import ParameterStep
from vgps.smoothing.scene.other_calibration import misfit_px, seen_by, undistorted_by
from vgps.smoothing.scene.scene import Scene
from vgps.solver.problem import BundleProblem

_FITTING_PX = 1.0  # of the median observation: half of mapping.max_reprojection_px, so that most count
_LEAST_SHARE = 0.05  # of a step


def after_step(
    camera: Camera, scene: Scene, problem: BundleProblem, step: ParameterStep
) -> tuple[Camera, Scene, bool]:
    """Return the camera and the scene after a step from the optimum of a problem, and whether it is whole.

    The prediction is linear: after a step too large for it hardly an observation would count, and the next
    solution would have lost the video. So only a part is taken after which most still fit.

    Args:
        camera: Before the step.
        scene: Of the problem, whose landmarks and poses are those of its start.
        problem: At its optimum.
        step: From there.
    """
    optimum = replace(scene, poses=problem.world_T_camera, points=problem.world_p_landmark)
    most_px, share = max(_FITTING_PX, _misfit_px(optimum, camera, problem)), 1.0
    while True:
        part = step.part(share, optimum.poses, optimum.points)
        moved = changed_camera(camera, part.delta)
        found = _predicted(moved, camera, optimum, problem, part)
        if share < _LEAST_SHARE or _misfit_px(found, moved, problem) <= most_px:
            return moved, found, share == 1.0
        share /= 2.0


def _predicted(
    camera: Camera, before: Camera, optimum: Scene, problem: BundleProblem, step: ParameterStep
) -> Scene:
    """Return the scene of a step's calibration: as the step predicts, or only turned if that fits better.

    Poses that hardly anything holds, as a roll that coarse fixes do not show, follow a step too far.
    """
    predicted = undistorted_by(camera, before, replace(optimum, poses=step.poses, points=step.points))
    turned = seen_by(camera, before, optimum)
    return min(predicted, turned, key=lambda one: _misfit_px(one, camera, problem))


def _misfit_px(scene: Scene, camera: Camera, problem: BundleProblem) -> float:
    """Return the misfit of the landmarks that a problem holds: others do not move."""
    held = np.bincount(problem.landmark, minlength=len(scene.points)) > 0
    return misfit_px(scene.with_observations(held[scene.observations.landmark]), camera)
