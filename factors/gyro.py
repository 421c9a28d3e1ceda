"""Gyro factors: the rotation between frames from preintegrated rates, and the walk of the bias."""

from dataclasses import dataclass

import gtsam
import numpy as np

from factors.custom import POSE3, VECTOR3, FloatArray, Linearisation, Variable, custom_factor


@dataclass(frozen=True, kw_only=True)
class PreintegratedRates:
    """Relative rotation between two times, integrated from gyro rates.

    Attributes:
        i_R_j: (3, 3) from the gyro's axes at the end to those at the start.
        by_bias: (3, 3) Jacobian: with another bias the rotation is
            ``i_R_j Exp(by_bias (bias - bias_rad_s))``.
        covariance: (3, 3) of ``Log`` of the rotation, in the gyro's axes at the end, rad^2.
        bias_rad_s: (3,) bias that was subtracted from the rates.
        dt_s: Time between.
    """

    i_R_j: FloatArray
    by_bias: FloatArray
    covariance: FloatArray
    bias_rad_s: FloatArray
    dt_s: float


def preintegrate_rates(
    rates_rad_s: FloatArray, dts_s: FloatArray, bias_rad_s: FloatArray, density_rad_s0p5: float
) -> PreintegratedRates:
    """Integrate rates that are constant over short intervals by the exponential of rate times interval.

    Eq. (3), Matsuda 2007, has the skew matrix of the rates instead of its exponential. Bias Jacobian and
    noise follow Forster et al., On-Manifold Preintegration (2017), Eq. (44) and App. A.

    Args:
        rates_rad_s: (N, 3) mean rate of each interval, in the gyro's axes.
        dts_s: (N,) lengths of the intervals, positive.
        bias_rad_s: (3,) subtracted from every rate.
        density_rad_s0p5: White noise of the rates, rad/s/sqrt(Hz): an angle integrated over t has sigma
            ``density sqrt(t)``.

    Raises:
        ValueError: There are no rates, shapes are inconsistent, or an interval or the density is not
            positive.
    """
    rates, dts = np.asarray(rates_rad_s, np.float64), np.asarray(dts_s, np.float64)
    if len(dts) == 0 or rates.shape != (len(dts), 3) or dts.ndim != 1:
        raise ValueError(f"rates {rates.shape} and intervals {dts.shape}: expected (N, 3) and (N,), N > 0")
    if not ((dts > 0).all() and density_rad_s0p5 > 0):
        raise ValueError(
            f"shortest interval is {dts.min()} s, density {density_rad_s0p5}, expected positive numbers"
        )
    bias = np.array(bias_rad_s, np.float64)
    rotation, by_bias, covariance = np.eye(3), np.zeros((3, 3)), np.zeros((3, 3))
    for angle, dt in zip((rates - bias) * dts[:, None], dts, strict=True):
        step, right = gtsam.Rot3.Expmap(angle).matrix(), gtsam.Rot3.ExpmapDerivative(angle)
        rotation = rotation @ step
        by_bias = step.T @ by_bias - right * dt
        covariance = step.T @ covariance @ step + density_rad_s0p5**2 * dt * right @ right.T
    return PreintegratedRates(
        i_R_j=rotation, by_bias=by_bias, covariance=covariance, bias_rad_s=bias, dt_s=float(dts.sum())
    )


def gyro_factor(
    pose_keys: tuple[int, int], bias_key: int, rates: PreintegratedRates, gyro_R_camera: FloatArray
) -> gtsam.CustomFactor:
    """Return a factor for the camera's rotation between two frames, measured by a gyro of unknown bias.

    Residual (3,): ``Log(measured(bias)^T R_i^T R_j)``, radians in the camera's axes at j, where ``measured``
    is the preintegrated rotation in the camera's axes, corrected for the bias to first order. Jacobians:
    (3, 6) to T_i and T_j, zero in the translations, (3, 3) to the bias [rad/s] in the gyro's axes. Eq. (1),
    Matsuda 2007, with its noise. The residual must stay clear of pi, where Log is discontinuous; the
    rotation between the frames need not. On ``Rot3`` and without a mount it equals gtsam's ``AHRSFactor``.

    Args:
        pose_keys: Keys of the poses of frames i and j, in order of time.
        bias_key: Key of the bias, a vector (3,).
        rates: Preintegrated between the frames.
        gyro_R_camera: (3, 3) from camera to gyro axes.

    Raises:
        ValueError: ``gyro_R_camera`` is not a rotation.
    """
    mount = np.array(gyro_R_camera, np.float64)
    if mount.shape != (3, 3) or np.abs(mount.T @ mount - np.eye(3)).max() > 1e-6 or np.linalg.det(mount) < 0:
        raise ValueError(f"gyro_R_camera is {mount.tolist()}, expected a rotation matrix")
    measured, by_bias = mount.T @ rates.i_R_j @ mount, mount.T @ rates.by_bias

    def error(world_T_i: gtsam.Pose3, world_T_j: gtsam.Pose3, bias: FloatArray) -> Linearisation:
        correction = by_bias @ (bias - rates.bias_rad_s)
        i_R_j = world_T_i.rotation().between(world_T_j.rotation()).matrix()
        difference = (measured @ gtsam.Rot3.Expmap(correction).matrix()).T @ i_R_j
        residual = gtsam.Rot3.Logmap(gtsam.Rot3(difference))
        residual_by_j = gtsam.Rot3.LogmapDerivative(residual)
        residual_by_bias = -residual_by_j @ difference.T @ gtsam.Rot3.ExpmapDerivative(correction) @ by_bias
        zero = np.zeros((3, 3))
        jacobians = [np.hstack([-residual_by_j @ i_R_j.T, zero]), np.hstack([residual_by_j, zero])]
        return residual, [*jacobians, residual_by_bias]

    noise = gtsam.noiseModel.Gaussian.Covariance(mount.T @ rates.covariance @ mount)
    variables = [*(Variable(key, POSE3) for key in pose_keys), Variable(bias_key, VECTOR3)]
    return custom_factor(noise, variables, error)


def bias_walk_factor(
    bias_keys: tuple[int, int], dt_s: float, walk_rad_s1p5: float
) -> gtsam.BetweenFactorVector:
    """Return a factor for the random walk of a gyro's bias: residual (3,) ``b - a``, sigma ``walk sqrt(dt)``.

    Args:
        bias_keys: Keys of biases a and b, vectors (3,), in order of time.
        dt_s: Time between.
        walk_rad_s1p5: Density of the walk, rad/s^2/sqrt(Hz).

    Raises:
        ValueError: The time or the density is not positive.
    """
    if not (dt_s > 0 and walk_rad_s1p5 > 0):
        raise ValueError(f"time is {dt_s} s and density {walk_rad_s1p5}, expected positive numbers")
    noise = gtsam.noiseModel.Isotropic.Sigma(3, walk_rad_s1p5 * np.sqrt(dt_s))
    return gtsam.BetweenFactorVector(*bias_keys, np.zeros(3), noise)
