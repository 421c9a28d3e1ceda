"""Projection factors weighted by reliability, Eq. (12)(13), Kume 2010, and control points.

Poses are ``world_T_camera``, the camera frame is OpenCV's (x right, y down, z forward), and pixels are those
of the undistorted (pinhole) image.
"""

from typing import Literal

import gtsam
import numpy as np
import numpy.typing as npt

from factors.custom import POSE3, FloatArray, Linearisation, Variable, custom_factor

Loss = Literal["none", "huber", "cauchy"]


def reliability_sigma_px(
    residual_px: FloatArray, landmark: npt.NDArray[np.int64], landmark_count: int, floor_px: float
) -> FloatArray:
    """Return the reliability sigma_j of each track: its RMS reprojection error, Eq. (13), Kume 2010.

    The floor is not in the thesis: two or three observations can be fitted exactly, and their weight
    ``1/sigma_j^2`` would be infinite.

    Args:
        residual_px: (N, 2) reprojection errors.
        landmark: (N,) landmark of each observation.
        landmark_count: L.
        floor_px: Smallest sigma_j.

    Returns:
        (L,) sigma_j in pixels; NaN for a landmark without observations.

    Raises:
        ValueError: The floor is not positive.
    """
    if not floor_px > 0:
        raise ValueError(f"floor_px is {floor_px}, expected a positive number of pixels")
    squared = residual_px[:, 0] ** 2
    squared += residual_px[:, 1] ** 2  # without a copy of both columns, for the sake of memory
    square = np.bincount(landmark, weights=squared, minlength=landmark_count)
    count = np.bincount(landmark, minlength=landmark_count)
    mean = np.divide(square, count, out=np.full(landmark_count, np.nan), where=count > 0)
    sigma_px: FloatArray = np.maximum(np.sqrt(mean), floor_px)
    return sigma_px


def projection_sigma_px(
    sigma_px: FloatArray, landmark: npt.NDArray[np.int64], frame: npt.NDArray[np.int64]
) -> FloatArray:
    """Return the sigma of each observation, ``sigma_j sqrt(|P_i|)``.

    With it GTSAM's cost is Phi_i, Eq. (12), Kume 2010.

    Args:
        sigma_px: (L,) reliability of each landmark.
        landmark: (N,) landmark of each observation.
        frame: (N,) frame of each observation; |P_i| is the number of observations in frame i.

    Returns:
        (N,) pixels.
    """
    return sigma_px[landmark] * np.sqrt(np.bincount(frame)[frame])


def projection_noise(sigma_px: float, loss: Loss = "none", loss_px: float = 1.0) -> gtsam.noiseModel.Base:
    """Return the noise model of an observation, with a loss whose scale is ``loss_px`` pixels at any weight.

    GTSAM applies a loss to the whitened length ``||e||/sigma``, and sigma contains ``sqrt(|P_i|)``: with one
    constant for all observations, a frame with many features would trust every outlier. Both losses obey
    ``rho_k(s) = k^2 rho_1(s/k)``, so ``k = loss_px / sigma`` gives
    ``rho_loss_px(||e||) / (sigma_j^2 |P_i|)``: first the loss in pixels, then the weights of Eq. (12).

    Args:
        sigma_px: ``sigma_j sqrt(|P_i|)``, see :func:`projection_sigma_px`.
        loss: ``none``, ``huber`` or ``cauchy``.
        loss_px: Error in pixels at which the loss departs from a square.

    Raises:
        ValueError: ``loss_px`` is not positive.
    """
    plain = gtsam.noiseModel.Isotropic.Sigma(2, sigma_px)
    if loss == "none":
        return plain
    if not loss_px > 0:
        raise ValueError(f"loss_px is {loss_px}, expected a positive number of pixels")
    k = loss_px / sigma_px
    if loss == "huber":
        return gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Huber.Create(k), plain)
    return gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Cauchy.Create(k), plain)


def projection_factor(
    pose_key: int, point_key: int, uv_px: FloatArray, calibration: gtsam.Cal3_S2, noise: gtsam.noiseModel.Base
) -> gtsam.GenericProjectionFactorCal3_S2:
    """Return GTSAM's own factor for an observation of a landmark.

    Residual (2,): projection minus ``uv_px``. A landmark behind the camera has the constant residual ``2 fx``
    in u and v and zero Jacobians, and raises nothing.
    """
    return gtsam.GenericProjectionFactorCal3_S2(uv_px, noise, pose_key, point_key, calibration, False, False)


def control_point_factor(
    pose_key: int,
    uv_px: FloatArray,
    world_p_point: FloatArray,
    calibration: gtsam.Cal3_S2,
    noise: gtsam.noiseModel.Base,
) -> gtsam.CustomFactor:
    """Return a factor for an observation of a point of known position, Sec. 4.1, Kume 2010.

    Residual (2,): projection minus ``uv_px``. Jacobian: (2, 6) to the pose. Behind the camera as in
    :func:`projection_factor`.

    Args:
        pose_key: Key of the frame's pose.
        uv_px: (2,) observed position in the undistorted image.
        world_p_point: (3,) ENU metres.
        calibration: The pinhole camera.
        noise: Of dimension 2, pixels.
    """
    uv, point = np.array(uv_px, dtype=np.float64), np.array(world_p_point, dtype=np.float64)
    behind = np.full(2, 2 * calibration.fx()), [np.zeros((2, 6))]

    def error(world_T_camera: gtsam.Pose3) -> Linearisation:
        if world_T_camera.transformTo(point)[2] <= 0:
            return behind
        jacobian = np.zeros((2, 6), order="F")
        projected = gtsam.PinholeCameraCal3_S2(world_T_camera, calibration).project(point, jacobian)
        return projected - uv, [jacobian]

    return custom_factor(noise, [Variable(pose_key, POSE3)], error)
