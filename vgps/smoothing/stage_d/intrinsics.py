"""Self-calibration: refinement of the camera's intrinsics in alternation with stage D.

A few iterations of stage D improve poses and landmarks with the calibration held. A Gauss-Newton step of the
calibration follows, in which poses and landmarks move as the linearised problem predicts. Both are repeated
until the steps are small relative to their standard deviations. A rough solution on a few frames of every
track suffices for this; stage D follows once on all frames.
"""

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from vgps.config import IntrinsicsConfig
from vgps.errors import GeometryError
from vgps.model import Camera, FloatArray, FocalChanges
from vgps.smoothing.calibration.camera_equations import linearise_camera, parameter_count
from vgps.smoothing.calibration.camera_step import after_step
from vgps.smoothing.calibration.focal_changes import (
    changes_of,
    focal_equations,
    gain_of_pictures,
    is_clear,
    without_change,
)
from vgps.smoothing.calibration.parameter_step import ParameterPrior, ParameterStep, parameter_step
from vgps.smoothing.calibration.refined_camera import CameraPrior, RefinedCamera, moved_from, refined_with
from vgps.smoothing.scene.few_frames import thinned
from vgps.smoothing.scene.global_shutter import as_global_shutter
from vgps.smoothing.scene.other_calibration import seen_by
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.stage_d.batch_result import BatchResult
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.equations.normal_equations import linearise
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.matrices.band_matrix import NotPositiveDefiniteError
from vgps.solver.problem import BundleProblem

_CONTRADICTED_SIGMAS = 3.0  # of the prior
_SETTLED_CHANGE = 2e-4  # of log focal length, a tenth of a pixel in the corners of most pictures


class Optimiser(Protocol):
    """Stage D as a function of a scene and the camera that its observations were undistorted by."""

    def __call__(
        self, scene: Scene, camera: Camera, every: int | None = None, sigma: FloatArray | None = None
    ) -> BatchResult:
        """Return the result of stage D; a rough one if each frame stands for ``every`` frames of the video.

        ``sigma`` are the standard deviations of the calibration, once it is found.
        """
        ...


def refine_camera(
    scene: Scene,
    camera: Camera,
    prior: CameraPrior,
    optimise: Optimiser,
    config: IntrinsicsConfig,
    every: int = 1,
) -> tuple[BatchResult, RefinedCamera]:
    """Run stage D with the calibration as an unknown.

    Args:
        scene: Input of stage D, observations undistorted by ``camera``.
        camera: Initial calibration.
        prior: Of the calibration.
        optimise: Stage D.
        config: Stopping criteria.
        every: Step between the frames from which the calibration is estimated, as for a global shutter.

    Raises:
        GeometryError: The video does not determine the calibration.
    """
    rough = _estimated(scene, camera, prior, optimise, config, every)
    refined = rough.refined
    if config.focal_changes:
        refined = replace(refined, changes=_focal_changes(rough, prior, optimise, config, every))
    seen = seen_by(refined.camera, prior.of_model(camera), scene)
    return optimise(seen, refined.camera, sigma=np.array(list(refined.sigma.values()))), refined


def estimate_camera(
    scene: Scene,
    camera: Camera,
    prior: CameraPrior,
    optimise: Optimiser,
    config: IntrinsicsConfig,
    every: int = 1,
) -> RefinedCamera:
    """Estimate the calibration by rough solutions alone; see :func:`refine_camera`."""
    return _estimated(scene, camera, prior, optimise, config, every).refined


@dataclass(frozen=True)
class _Rough:
    """A calibration estimated by rough solutions, and the last of these with its scene."""

    refined: RefinedCamera
    scene: Scene
    problem: BundleProblem


def _estimated(
    scene: Scene,
    camera: Camera,
    prior: CameraPrior,
    optimise: Optimiser,
    config: IntrinsicsConfig,
    every: int,
) -> _Rough:
    """Estimate the calibration by rough solutions."""
    given, prior = prior.of_model(camera), prior.allowing(camera.focal_changes)
    few = as_global_shutter(scene, given)
    few = few if every == 1 else thinned(few, every)
    camera = replace(given, readout_s=None)
    result, step, converged = optimise(few, camera, every), 0, False
    while step < config.iterations and not converged:
        step += 1
        found = _step(result.problem, camera, prior)
        camera, few, is_whole = after_step(camera, few, result.problem, found)
        result, sigma = optimise(few, camera, every), found.sigma
        converged = is_whole and bool(np.all(np.abs(found.delta) < config.tolerance_sigmas * sigma))
    refined = refined_with(replace(camera, readout_s=given.readout_s), sigma, step, converged)
    return _Rough(refined, few, result.problem)


def _focal_changes(
    rough: _Rough, prior: CameraPrior, optimise: Optimiser, config: IntrinsicsConfig, every: int
) -> FocalChanges | None:
    """Return changes of the focal length, if a rough solution shows them clearly, by further ones.

    Changes that pictures alone contradict are none, and those that they hardly show have to be clearer.
    """
    camera, scene, problem = replace(rough.refined.camera, readout_s=None), rough.scene, rough.problem
    believed, found = _believed(camera, prior.allowing(camera.focal_changes)), None
    with suppress(GeometryError, NotPositiveDefiniteError):  # what was found before stays
        for _ in range(config.iterations):
            equations = focal_equations(problem, camera, believed, scene.t_s)
            done = np.zeros_like(equations.t_s) if found is None else np.array(found.log_ratio)
            total, evidence = equations.about(done).likeliest()
            step = total - total.mean() - done
            if not is_clear(evidence) or np.abs(step).max() < _SETTLED_CHANGE:
                break  # large changes may have left the rough solution astray
            changes = changes_of(equations, done + step, camera)
            if found is None and (
                _is_another_lens(camera, prior, changes)
                or not is_clear(evidence, gain_of_pictures(step, problem, camera, believed, scene.t_s))
            ):
                break
            found = changes
            at_frame, observations = np.interp(scene.t_s, equations.t_s, step), scene.observations
            uv_px = without_change(observations.uv_px, camera, at_frame[observations.frame])
            scene = replace(scene, observations=replace(observations, uv_px=uv_px))
            problem = optimise(scene, camera, every).problem
            scene = replace(scene, poses=problem.world_T_camera, points=problem.world_p_landmark)
    return found


def _is_another_lens(camera: Camera, prior: CameraPrior, changes: FocalChanges) -> bool:
    """Whether the focal length is at no time what is believed of it.

    Then the prior keeps the lens from the right one, and it fits some parts of the video better with other
    focal lengths.
    """
    known = camera.focal_changes
    both = changes if known is None else known.followed_by(changes)
    moved = moved_from(camera, prior.mean)[0] + np.array(both.log_ratio)
    beyond = _CONTRADICTED_SIGMAS * prior.sigma[0]
    return bool(moved.min() > beyond or moved.max() < -beyond)


def _believed(camera: Camera, prior: CameraPrior) -> ParameterPrior:
    """Return the prior of a camera's parameters."""
    return ParameterPrior(prior.sigma[: parameter_count(camera)], moved_from(camera, prior.mean))


def _step(problem: BundleProblem, camera: Camera, prior: CameraPrior) -> ParameterStep:
    """Return the step of the calibration, in the order of :class:`CameraPrior`."""
    structure, size = analyse_sparsity(problem), parameter_count(camera)
    linear = linearise(problem, all_pose_values(problem), structure)
    equations = linearise_camera(problem, linear, structure, camera, size)
    try:
        return parameter_step(problem, linear, structure, equations, _believed(camera, prior))
    except NotPositiveDefiniteError:
        raise GeometryError(
            "the video does not determine the calibration with its poses",
            remedy="set intrinsics: {refine: no}",
        ) from None
