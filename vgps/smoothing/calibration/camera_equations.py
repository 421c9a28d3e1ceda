"""Normal equations of the camera's calibration beside those of poses, with the points eliminated."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import gtsam
import numpy as np

from vgps.camera import distort
from vgps.geometry import in_picture
from vgps.lens_jacobian import distortion_jacobian
from vgps.model import Camera, FloatArray, IntArray
from vgps.solver.cost import camera_points, pixel_errors
from vgps.solver.equations.linearised_chunk import LinearisedChunk
from vgps.solver.equations.normal_equations import Linearisation, whitening
from vgps.solver.equations.schur_complement import absorbed_residuals
from vgps.solver.equations.unknowns import Unknowns
from vgps.solver.matrices.band_matrix import POSE_DIM
from vgps.solver.problem import BundleProblem

_STEPS = np.array([1e-5, 1e-2, 1e-2, 1e-5, 1e-5])  # of the numerical Jacobian


@dataclass(frozen=True)
class ReducedEquations:
    """Equations of p parameters beside poses and states, with the points eliminated.

    Attributes:
        coupling: (6 n_free, p) with poses and states.
        hessian: (p, p).
        gradient: (p,).
    """

    coupling: FloatArray
    hessian: FloatArray
    gradient: FloatArray


@dataclass(frozen=True)
class CameraEquations(ReducedEquations):
    """Equations of log focal length, principal point and the first two coefficients.

    Attributes:
        by_camera: Whitened Jacobians (p, 2, n) of each chunk's residuals.
    """

    by_camera: Sequence[FloatArray]


def linearise_camera(
    problem: BundleProblem, linear: Linearisation, unknowns: Unknowns, camera: Camera, size: int
) -> CameraEquations:
    """Linearise all observations by the calibration.

    Args:
        problem: Its observations are undistorted by ``camera``.
        linear: The problem, linearised.
        unknowns: Places of its poses.
        camera: The calibration.
        size: Number p of parameters, at most :func:`parameter_count`.
    """
    by_camera = [camera_jacobian(problem, part, camera, size) for part in linear.chunks]
    return reduced_equations(linear, unknowns, by_camera, size)


def held_coupling(problem: BundleProblem, linear: Linearisation, unknowns: Unknowns) -> FloatArray:
    """Return the coupling (6 n_free, p) of poses and states with a held calibration, the points eliminated.

    Its parameters are what may be left of errors in undistorted images, whatever the lens: log focal length,
    principal point [px], and radial distortion k1, by which a ray of squared radius r^2 is off by ``k1 r^2``
    of itself. Of a rig they are those of each camera, followed by the poses on it of all cameras but the
    reference.

    Args:
        problem: The problem.
        linear: The problem, linearised.
        unknowns: Places of its poses.
    """
    cameras = 1 if problem.mounts is None else len(problem.mounts.K)
    coupling = np.zeros((POSE_DIM, len(unknowns.free), 4 * cameras + POSE_DIM * (cameras - 1)))
    for part in linear.chunks:
        J = _held_jacobian(problem, part)
        _couple(coupling, part, J, np.arange(len(J)))
    return unknowns.to_columns(coupling.transpose(1, 0, 2))


def _held_jacobian(problem: BundleProblem, part: LinearisedChunk) -> FloatArray:
    lens, mounts = pinhole_jacobian(problem, part), part.chunk.problem.mounts
    if mounts is None:
        return lens
    by_lens = [np.where(mounts.camera == k, lens, 0.0) for k in range(len(mounts.K))]
    return np.concatenate([*by_lens, mount_jacobian(part)])


def reduced_equations(
    linear: Linearisation, unknowns: Unknowns, by_camera: Sequence[FloatArray], size: int
) -> CameraEquations:
    """Return the equations of parameters with these Jacobians (p, 2, n) by chunk, the points eliminated."""
    every = np.arange(size)
    sums = summed_equations(linear, unknowns, ((J, every) for J in by_camera), size)
    return CameraEquations(sums.coupling, sums.hessian, sums.gradient, by_camera)


def summed_equations(
    linear: Linearisation, unknowns: Unknowns, jacobians: Iterable[tuple[FloatArray, IntArray]], size: int
) -> ReducedEquations:
    """Return the equations of parameters, the points eliminated, chunk by chunk.

    Args:
        linear: The problem, linearised.
        unknowns: Places of its poses.
        jacobians: For each chunk, those (k, 2, n) of its residuals and the parameters (k,) that they are by.
        size: Number p of parameters.
    """
    coupling = np.zeros((POSE_DIM, len(unknowns.free), size))
    hessian, gradient = np.zeros((size, size)), np.zeros(size)
    for part, (J, own) in zip(linear.chunks, jacobians, strict=True):
        reduced = _couple(coupling, part, J, own)
        hessian[np.ix_(own, own)] += np.tensordot(J, reduced, axes=((1, 2), (1, 2)))
        gradient[own] += np.einsum("in,kin->k", part.r, reduced)
    return ReducedEquations(unknowns.to_columns(coupling.transpose(1, 0, 2)), hessian, gradient)


def _couple(coupling: FloatArray, part: LinearisedChunk, J: FloatArray, columns: IntArray) -> FloatArray:
    """Add a chunk to the coupling (6, F, p) of frames with parameters; return its J without the points."""
    reduced = np.stack([one - absorbed_residuals(part, one) for one in J])
    frames = slice(part.chunk.first_frame, part.chunk.first_frame + part.chunk.frames)
    coupling[:, frames, columns] += np.stack([part.pose_gradient(r) for r in reduced], axis=-1)
    return reduced


def pinhole_jacobian(problem: BundleProblem, part: LinearisedChunk) -> FloatArray:
    """Return whitened Jacobians (4, 2, n) of a chunk's residuals by the parameters of a pinhole camera."""
    here = part.chunk.problem.moved(problem.world_T_camera, problem.world_p_landmark)
    camera_p = camera_points(here)
    error, behind = pixel_errors(here, camera_p)
    scale = np.where(behind, 0.0, whitening(here, error))
    fx, fy, _, _ = here.intrinsics
    focal = np.stack([np.broadcast_to(f, scale.shape) for f in (fx, fy)])
    pixels = focal * camera_p[:2] / np.where(behind, 1.0, camera_p[2])
    squared = np.sum((pixels / focal) ** 2, axis=0)
    one, zero = np.ones_like(scale), np.zeros_like(scale)
    J = np.stack([pixels, np.stack([one, zero]), np.stack([zero, one]), squared * pixels], axis=1)
    return np.asarray(in_picture(here.lens, J).transpose(1, 0, 2) * scale)


def mount_jacobian(part: LinearisedChunk) -> FloatArray:
    """Return whitened Jacobians (6 (C - 1), 2, n) of a chunk's residuals by the cameras' poses on a rig.

    In the tangents of ``reference_T_camera`` of all cameras but the reference. A camera's pose in the world
    moves with it as with ``world_T_reference``, only in its own axes.
    """
    mounts = part.chunk.problem.mounts
    assert mounts is not None
    assert mounts.reference_T_camera is not None
    J = np.zeros((len(mounts.reference_T_camera) - 1, POSE_DIM, *part.r.shape))
    for k, mount in enumerate(mounts.reference_T_camera[1:]):
        own = mounts.camera == k + 1
        J[k][:, :, own] = np.einsum("ian,ab->bin", part.jp[:, :, own], gtsam.Pose3(mount).AdjointMap())
    return J.reshape(-1, *part.r.shape)


def changed_camera(camera: Camera, delta: FloatArray) -> Camera:
    """Return the camera with a change of log focal length, principal point and first two coefficients."""
    scale, coefficients = float(np.exp(delta[0])), np.array(camera.distortion)
    coefficients[: len(delta) - 3] += delta[3:]
    return replace(
        camera,
        fx=camera.fx * scale,
        fy=camera.fy * scale,
        cx=camera.cx + float(delta[1]),
        cy=camera.cy + float(delta[2]),
        distortion=tuple(coefficients.tolist()),
    )


def parameter_count(camera: Camera) -> int:
    """Return the number of parameters of a camera."""
    return 3 + min(len(camera.distortion), 2)


def camera_jacobian(problem: BundleProblem, part: LinearisedChunk, camera: Camera, size: int) -> FloatArray:
    """Return whitened Jacobians (p, 2, n) of a chunk's residuals by the calibration, lens included."""
    here = part.chunk.problem.moved(problem.world_T_camera, problem.world_p_landmark)
    camera_p = camera_points(here)
    error, behind = pixel_errors(here, camera_p)
    scale = np.where(behind, 0.0, whitening(here, error))
    rays = camera_p[:2] / np.where(behind, 1.0, camera_p[2])
    slopes = calibration_jacobian(camera, rays, here.uv_px, size, here.lens)
    return np.asarray(np.nan_to_num(slopes) * scale)


def calibration_jacobian(
    camera: Camera, rays: FloatArray, uv_px: FloatArray, size: int, lens: FloatArray | None = None
) -> FloatArray:
    """Return Jacobians (p, 2, n) of residuals, prediction minus undistorted pixel, by the calibration.

    The undistorted pixel q of a feature follows from its pixel in the picture, which stays: ``d(q; c)`` is
    the same, so ``dq/dc = -(dd/dq)^-1 dd/dc``. That takes no lens model's inverse, which costs ten times as
    much.

    Args:
        camera: The calibration.
        rays: (2, n) where each observation is predicted, in units of the focal length.
        uv_px: (n, 2) observations, undistorted.
        size: Number p of parameters, at most :func:`parameter_count`.
        lens: As for :func:`vgps.geometry.in_picture`.
    """
    a, b, c, d = distortion_jacobian(camera, uv_px).reshape(-1, 4).T
    determinant = a * d - b * c
    inverse = np.array([[d, -b], [-c, a]]) / np.where(determinant == 0.0, np.nan, determinant)

    def residual(delta: FloatArray) -> FloatArray:
        other = changed_camera(camera, delta)
        predicted = rays * [[other.fx], [other.fy]] + [[other.cx], [other.cy]]
        return np.asarray(predicted + np.einsum("ijn,nj->in", inverse, distort(other, uv_px)))

    steps = np.diag(_STEPS[:size])
    return np.stack([in_picture(lens, residual(d) - residual(-d)) / (2.0 * d.sum()) for d in steps])
