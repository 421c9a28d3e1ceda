"""Rays of a lens with square pixels and two radial coefficients, for any angle from the axis.

An image radius of f g(x), with g(x) = x (1 + k1 x^2 + k2 x^4), belongs to the angle x (``fisheye``) or to the
angle of tangent x (``opencv``): the models of OpenCV, without the terms that a guess does not have.
"""

from dataclasses import replace

import numpy as np

from vgps.model import BoolArray, Camera, FloatArray

_NEWTON_STEPS = 12  # at most
_EXACT = 1e-9  # step after which the next one, its square, is nothing
_MIN_SLOPE = 0.05  # of g: below it the model folds back
_LARGEST = {"fisheye": 3.0, "opencv": 20.0, "pinhole": 20.0}  # angle [rad], or its tangent


def parameters_of(camera: Camera) -> FloatArray:
    """Return log focal length [px], principal point [px] and the first two radial coefficients, (5,)."""
    k1, k2 = camera.distortion[:2] or (0.0, 0.0)
    return np.array([0.5 * np.log(camera.fx * camera.fy), camera.cx, camera.cy, k1, k2])


def with_parameters(camera: Camera, parameters: FloatArray) -> Camera:
    """Return the camera with the parameters (5,) of `parameters_of`."""
    focal = float(np.exp(parameters[0]))
    cx, cy, k1, k2 = parameters[1:].tolist()
    return replace(camera, fx=focal, fy=focal, cx=cx, cy=cy, distortion=(k1, k2, 0.0, 0.0))


def angles(model: str, parameters: FloatArray, radius_px: FloatArray) -> FloatArray:
    """Return the angles (N,) from the axis [rad] at image radii (N,) [px]."""
    x, _ = _inverse(model, parameters, radius_px)
    return x if model == "fisheye" else np.arctan(x)


def rays(model: str, parameters: FloatArray, uv_px: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return unit rays (N, 3) of pixels (N, 2), their Jacobians (N, 3, 2), and where the model holds (N,).

    Args:
        model: ``opencv`` or ``fisheye``.
        parameters: (5,) of `parameters_of`.
        uv_px: Pixels.
    """
    offset = uv_px - parameters[1:3]
    radius = np.maximum(np.hypot(offset[:, 0], offset[:, 1]), 1e-9)
    x, slope = _inverse(model, parameters, radius)
    angle = x if model == "fisheye" else np.arctan(x)
    # derivative of the angle by the radius
    rate = 1.0 / (np.exp(parameters[0]) * np.maximum(slope, _MIN_SLOPE))
    rate = rate if model == "fisheye" else rate / (1.0 + x**2)
    outward = offset / radius[:, None]
    sine, cosine = np.sin(angle), np.cos(angle)
    ray = np.column_stack([outward * sine[:, None], cosine])
    by_angle = np.column_stack([outward * cosine[:, None], -sine])
    around = np.column_stack([-outward[:, 1], outward[:, 0], np.zeros(len(x))])
    jacobian = np.einsum("n,ni,nj->nij", rate, by_angle, outward)
    jacobian += np.einsum("n,ni,nj->nij", sine / radius, around, around[:, :2])
    return ray, jacobian, np.asarray((slope > _MIN_SLOPE) & (x < _LARGEST[model]))


def _inverse(model: str, parameters: FloatArray, radius_px: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Solve g(x) = radius / f by Newton's method; return x and the slope of g there."""
    k1, k2 = parameters[3:]
    target = radius_px / np.exp(parameters[0])
    x = np.minimum(target, _LARGEST[model])
    for _ in range(_NEWTON_STEPS):
        slope = np.maximum(1.0 + 3.0 * k1 * x**2 + 5.0 * k2 * x**4, _MIN_SLOPE)
        before, excess = x, x * (1.0 + k1 * x**2 + k2 * x**4) - target
        x = np.clip(x - excess / slope, 0.0, _LARGEST[model])
        if np.all(np.abs(x - before) < _EXACT):
            break
    return x, 1.0 + 3.0 * k1 * x**2 + 5.0 * k2 * x**4
