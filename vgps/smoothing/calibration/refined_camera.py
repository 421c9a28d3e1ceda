"""A calibration before and after it is refined: what is believed of it, and what was found."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from vgps.config import IntrinsicsConfig
from vgps.model import Camera, FloatArray, FocalChanges
from vgps.smoothing.calibration.camera_equations import parameter_count

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
        changes: Changes of the focal length that the video shows; None if it shows none.
    """

    camera: Camera
    sigma: Mapping[str, float]
    steps: int
    converged: bool
    changes: FocalChanges | None = None

    def differs_from(self, given: Camera, sigmas: float = _SIGNIFICANT_SIGMAS) -> bool:
        """Return whether any parameter moved by more than so many of its standard deviations."""
        before = replace(given, distortion=given.distortion or _NO_DISTORTION)
        moved, sigma = moved_from(self.camera, before), np.array(list(self.sigma.values()))
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

    def allowing(self, changes: FocalChanges | None) -> "CameraPrior":
        """Return the prior where the focal length changes, and what is believed of it holds at some time."""
        if changes is None:
            return self
        sigma = self.sigma.copy()
        sigma[0] = np.hypot(sigma[0], np.std(changes.log_ratio))
        return replace(self, sigma=sigma)

    def of_model(self, camera: Camera) -> Camera:
        """Return a camera with the lens model that is refined."""
        return replace(camera, model=self.mean.model, distortion=camera.distortion or _NO_DISTORTION)


def prior_about(camera: Camera, config: IntrinsicsConfig) -> CameraPrior:
    """Return the prior of a given calibration.

    A pinhole camera gets radial distortion: images undistorted by an imperfect lens model keep some of it.
    """
    if camera.model == "pinhole":
        camera = replace(camera, model="opencv", distortion=_NO_DISTORTION)
    rest = [config.centre_sigma_px] * 2 + [config.distortion_sigma] * 2
    return CameraPrior(camera, np.array([config.focal_sigma, *rest]))


def moved_from(camera: Camera, given: Camera) -> FloatArray:
    """Return the parameters (p,) of a camera relative to the given one."""
    ends = np.array(camera.distortion) - np.array(given.distortion)
    moved = [np.log(camera.fx / given.fx), camera.cx - given.cx, camera.cy - given.cy, *ends]
    return np.array(moved[: parameter_count(camera)])


def refined_with(camera: Camera, sigma: FloatArray, steps: int, converged: bool) -> RefinedCamera:
    """Return an estimated calibration with the standard deviations (p,) of its parameters."""
    return RefinedCamera(camera, dict(zip(_NAMES, sigma.tolist(), strict=False)), steps, converged)
