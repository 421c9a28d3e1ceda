"""Self-calibration: refinement of the camera's intrinsics in alternation with stage D.

A few iterations of stage D improve poses and landmarks with the calibration held. A Gauss-Newton step of the
calibration follows, in which poses and landmarks move as the linearised problem predicts. Both are repeated
until the steps are small relative to their standard deviations. A rough solution on a few frames of every
track suffices for this; stage D follows once on all frames.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from vgps.config import IntrinsicsConfig
from vgps.errors import GeometryError
from vgps.model import Camera, FloatArray
from vgps.smoothing.calibration.camera_equations import changed, linearise_camera, parameter_count
from vgps.smoothing.calibration.parameter_step import ParameterPrior, ParameterStep, parameter_step
from vgps.smoothing.scene.factor_graph import Scene
from vgps.smoothing.scene.few_frames import thinned
from vgps.smoothing.scene.global_shutter import as_global_shutter
from vgps.smoothing.scene.other_calibration import misfit_px, seen_by, undistorted_by
from vgps.smoothing.stage_d.batch_result import BatchResult
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.equations.normal_equations import linearise
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.matrices.band_matrix import NotPositiveDefiniteError
from vgps.solver.problem import BundleProblem

_NAMES = ("focal", "cx", "cy", "k1", "k2")
_SIGNIFICANT_SIGMAS = 3.0  # of a change of the calibration that is worth a warning
_NO_DISTORTION = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class RefinedCamera:
    """An estimated calibration.

    Attributes:
        camera: The refined camera, of the same lens model.
        sigma: Standard deviations by name: ``focal`` (relative, of fx and fy together), ``cx``, ``cy`` [px],
            and where the lens has them ``k1``, ``k2``.
        steps: Number of steps.
        converged: Whether the last step was small relative to its standard deviations.
    """

    camera: Camera
    sigma: Mapping[str, float]
    steps: int
    converged: bool

    def differs_from(self, given: Camera, sigmas: float = _SIGNIFICANT_SIGMAS) -> bool:
        """Return whether any parameter moved by more than so many of its standard deviations."""
        before = replace(given, distortion=given.distortion or _NO_DISTORTION)
        moved, sigma = _difference(self.camera, before), np.array(list(self.sigma.values()))
        return bool(np.any(np.abs(moved) > sigmas * sigma))

    def note(self, given: Camera) -> str:
        """Return a warning with the old and new parameters."""
        refined = self.camera
        words = (
            f"the calibration was refined: fx {given.fx:.1f} -> {refined.fx:.1f} px "
            f"(sigma {refined.fx * self.sigma['focal']:.1f}), centre {given.cx:.1f}, {given.cy:.1f} -> "
            f"{refined.cx:.1f}, {refined.cy:.1f} px (sigma {self.sigma['cx']:.1f}, {self.sigma['cy']:.1f})"
        )
        for k, name in enumerate(name for name in ("k1", "k2") if name in self.sigma):
            before, after = (given.distortion or _NO_DISTORTION)[k], refined.distortion[k]
            words += f", {name} {before:.4f} -> {after:.4f} (sigma {self.sigma[name]:.4f})"
        return (
            words
            if self.converged
            else f"{words}; it did not converge in {self.steps} steps: raise intrinsics.iterations"
        )


@dataclass(frozen=True)
class CameraPrior:
    """What is believed of a calibration before it is refined.

    Attributes:
        mean: A camera of the lens model that is refined.
        sigma: (5,) standard deviations of log focal length, principal point [px], and the first two
            coefficients.
    """

    mean: Camera
    sigma: FloatArray


def prior_about(camera: Camera, config: IntrinsicsConfig) -> CameraPrior:
    """Return the prior of a given calibration.

    A pinhole camera gets radial distortion: images undistorted by an imperfect lens model keep some of it.
    """
    if camera.model == "pinhole":
        camera = replace(camera, model="opencv", distortion=_NO_DISTORTION)
    rest = [config.centre_sigma_px] * 2 + [config.distortion_sigma] * 2
    return CameraPrior(camera, np.array([config.focal_sigma, *rest]))


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
        every: Step between the frames from which the calibration is estimated, as of a global shutter.

    Raises:
        GeometryError: The video does not determine the calibration.
    """
    refined = estimate_camera(scene, camera, prior, optimise, config, every)
    seen = seen_by(refined.camera, _of_model(prior, camera), scene)
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
    given = _of_model(prior, camera)
    few = as_global_shutter(scene, given)
    few = few if every == 1 else thinned(few, every)
    camera = replace(given, readout_s=None)
    result, step, converged = optimise(few, camera, every), 0, False
    while step < config.iterations and not converged:
        step += 1
        found = _step(result.problem, camera, prior)
        delta, sigma, moved = found.delta, found.sigma, changed(camera, found.delta)
        few = replace(few, poses=result.problem.world_T_camera, points=result.problem.world_p_landmark)
        few = _after_step(moved, camera, few, found)
        camera = moved
        result = optimise(few, camera, every)
        converged = bool(np.all(np.abs(delta) < config.tolerance_sigmas * sigma))
    camera = replace(camera, readout_s=given.readout_s)
    return RefinedCamera(camera, dict(zip(_NAMES, sigma.tolist(), strict=False)), step, converged)


def _of_model(prior: CameraPrior, camera: Camera) -> Camera:
    """Return a camera with the lens model that is refined."""
    return replace(camera, model=prior.mean.model, distortion=camera.distortion or _NO_DISTORTION)


def _difference(camera: Camera, given: Camera) -> FloatArray:
    """Return the parameters (p,) of a camera relative to the given one."""
    ends = np.array(camera.distortion) - np.array(given.distortion)
    moved = [np.log(camera.fx / given.fx), camera.cx - given.cx, camera.cy - given.cy, *ends]
    return np.array(moved[: parameter_count(camera)])


def _after_step(camera: Camera, before: Camera, optimum: Scene, step: ParameterStep) -> Scene:
    """Return the scene of a step's calibration: as the step predicts, or only turned if that fits better.

    The prediction is linear, and poses that hardly anything holds, as a roll that coarse fixes do not show,
    follow a step too far for that.
    """
    predicted = undistorted_by(camera, before, replace(optimum, poses=step.poses, points=step.points))
    return min(predicted, seen_by(camera, before, optimum), key=lambda one: misfit_px(one, camera))


def _step(problem: BundleProblem, camera: Camera, prior: CameraPrior) -> ParameterStep:
    """Return the step of the calibration, in the order of :class:`CameraPrior`."""
    structure, size = analyse_sparsity(problem), parameter_count(camera)
    linear = linearise(problem, all_pose_values(problem), structure)
    equations = linearise_camera(problem, linear, structure, camera, size)
    believed = ParameterPrior(prior.sigma[:size], _difference(camera, prior.mean))
    try:
        return parameter_step(problem, linear, structure, equations, believed)
    except NotPositiveDefiniteError:
        raise GeometryError(
            "the video does not determine the calibration with its poses",
            remedy="set intrinsics: {refine: no}",
        ) from None
