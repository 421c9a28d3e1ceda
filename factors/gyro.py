"""Factors on the motion between frames: a gyro's rates with their bias, and constant velocity."""

from dataclasses import dataclass

import gtsam
import numpy as np

from factors.custom import POSE3, VECTOR3, FloatArray, Linearised, Variable, custom_factor


@dataclass(frozen=True)
class PreintegratedRates:
    """The rotation between two times from gyro rates, with what the bias changes in it.

    Attributes:
        i_R_j: (3, 3) from the gyro's axes at the end to those at the start.
        by_bias: (3, 3); with another bias the rotation is ``i_R_j Exp(by_bias (bias - bias_rad_s))``.
        covariance: (3, 3) of ``Log`` of the rotation, in the gyro's axes at the end, rad^2.
        bias_rad_s: (3,) the bias that was taken off the rates.
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
    """Integrate rates that are constant over short intervals, each by the exact exponential.

    Eq. (3), Matsuda 2007, has a bare skew matrix of rates; here is the exponential of rate
    times interval. Bias Jacobian and noise follow Forster et al., On-Manifold Preintegration (2017), Eq. (44)
    and App. A.

    Args:
        rates_rad_s: (N, 3) mean rate of each interval, gyro's axes.
        dts_s: (N,) length of each, positive.
        bias_rad_s: (3,) taken off every rate.
        density_rad_s0p5: White noise of the rates, rad/s/sqrt(Hz): an angle integrated over t has sigma
            ``density sqrt(t)``.

    Raises:
        ValueError: Nothing to integrate, shapes that do not fit, an interval or the density not positive.
    """
    rates, dts = np.asarray(rates_rad_s, np.float64), np.asarray(dts_s, np.float64)
    if len(dts) == 0 or rates.shape != (len(dts), 3) or dts.ndim != 1:
        raise ValueError(f"rates {rates.shape} and intervals {dts.shape}: expected (N, 3) and (N,), N > 0")
    if not ((dts > 0).all() and density_rad_s0p5 > 0):
        raise ValueError("intervals and the density of the noise must be positive")
    bias = np.array(bias_rad_s, np.float64)
    rotation, by_bias, covariance = np.eye(3), np.zeros((3, 3)), np.zeros((3, 3))
    for angle, dt in zip((rates - bias) * dts[:, None], dts, strict=True):
        step, right = gtsam.Rot3.Expmap(angle).matrix(), gtsam.Rot3.ExpmapDerivative(angle)
        rotation = rotation @ step
        by_bias = step.T @ by_bias - right * dt
        covariance = step.T @ covariance @ step + density_rad_s0p5**2 * dt * right @ right.T
    return PreintegratedRates(rotation, by_bias, covariance, bias, float(dts.sum()))


def gyro_factor(
    key_i: int, key_j: int, key_bias: int, rates: PreintegratedRates, gyro_R_camera: FloatArray
) -> gtsam.CustomFactor:
    """The camera turned between two frames as the gyro says, whose bias is a variable.

    Residual (3,): ``Log(measured(bias)^T R_i^T R_j)``, radians in the camera's axes at j, where ``measured``
    is the preintegrated rotation in the camera's axes, corrected for the bias to first order. Jacobians:
    (3, 6) to T_i and T_j, zero in the translations, (3, 3) to the bias [rad/s] in the gyro's axes. Eq. (1),
    Matsuda 2007, with its noise. The residual must stay clear of pi, where Log has a jump; the rotation
    between the frames need not. On ``Rot3`` and without a mount it is gtsam's ``AHRSFactor``.

    Args:
        key_i, key_j: Keys of the two poses (``Pose3``), in order of time.
        key_bias: Key of the bias, a vector (3,).
        rates: Of the gyro, between the two.
        gyro_R_camera: (3, 3) from camera to gyro axes.

    Raises:
        ValueError: ``gyro_R_camera`` is no rotation.
    """
    mount = np.array(gyro_R_camera, np.float64)
    if mount.shape != (3, 3) or np.abs(mount.T @ mount - np.eye(3)).max() > 1e-6 or np.linalg.det(mount) < 0:
        raise ValueError(f"gyro_R_camera is no rotation: {mount.tolist()}")
    measured, by_bias = mount.T @ rates.i_R_j @ mount, mount.T @ rates.by_bias

    def error(world_T_i: gtsam.Pose3, world_T_j: gtsam.Pose3, bias: FloatArray) -> Linearised:
        turn = by_bias @ (bias - rates.bias_rad_s)
        i_R_j = world_T_i.rotation().between(world_T_j.rotation()).matrix()
        off = (measured @ gtsam.Rot3.Expmap(turn).matrix()).T @ i_R_j
        residual = gtsam.Rot3.Logmap(gtsam.Rot3(off))
        by_j = gtsam.Rot3.LogmapDerivative(residual)
        by_b = -by_j @ off.T @ gtsam.Rot3.ExpmapDerivative(turn) @ by_bias
        zero = np.zeros((3, 3))
        return residual, [np.hstack([-by_j @ i_R_j.T, zero]), np.hstack([by_j, zero]), by_b]

    noise = gtsam.noiseModel.Gaussian.Covariance(mount.T @ rates.covariance @ mount)
    variables = [Variable(key_i, POSE3), Variable(key_j, POSE3), Variable(key_bias, VECTOR3)]
    return custom_factor(noise, variables, error)


def bias_walk_factor(key_a: int, key_b: int, dt_s: float, walk_rad_s1p5: float) -> gtsam.BetweenFactorVector:
    """A gyro's bias walks at random: residual (3,) ``b - a``, sigma ``walk sqrt(dt)``.

    Args:
        key_a, key_b: Keys of the biases, vectors (3,), in order of time.
        dt_s: Time between.
        walk_rad_s1p5: Density of the walk, rad/s^2/sqrt(Hz).

    Raises:
        ValueError: The time or the density is not positive.
    """
    if not (dt_s > 0 and walk_rad_s1p5 > 0):
        raise ValueError(f"time {dt_s} s and density {walk_rad_s1p5}: expected positive numbers")
    noise = gtsam.noiseModel.Isotropic.Sigma(3, walk_rad_s1p5 * np.sqrt(dt_s))
    return gtsam.BetweenFactorVector(key_a, key_b, np.zeros(3), noise)


def constant_velocity_factor(
    key_a: int,
    key_b: int,
    key_c: int,
    dt_ab_s: float,
    dt_bc_s: float,
    rotation_density_rad_s1p5: float,
    translation_density_m_s1p5: float,
) -> gtsam.CustomFactor:
    """Three successive frames move at one velocity, up to white noise on the acceleration.

    Residual (6,): ``Log(T_b^-1 T_c)/dt_bc - Log(T_a^-1 T_b)/dt_ab``, the change of mean velocity in the
    camera's own axes, [rad/s; m/s]. Jacobians: (6, 6) to T_a, T_b, T_c. The rotation between two frames must
    stay clear of pi, where Log has a jump.

    Noise: acceleration of density q (its integral over t has sigma ``q sqrt(t)``) enters the change of mean
    velocity with a weight that rises from 0 to 1 over ab and falls to 0 over bc, so that has sigma
    ``q sqrt((dt_ab + dt_bc)/3)``. Successive factors share an interval; their correlation is neglected.

    Args:
        key_a, key_b, key_c: Keys of the three poses, in order of time.
        dt_ab_s, dt_bc_s: Time between them.
        rotation_density_rad_s1p5: Density q of the angular acceleration, rad/s^2/sqrt(Hz).
        translation_density_m_s1p5: Density q of the acceleration, m/s^2/sqrt(Hz).

    Raises:
        ValueError: A time or a density is not positive.
    """
    if not (dt_ab_s > 0 and dt_bc_s > 0 and rotation_density_rad_s1p5 > 0 and translation_density_m_s1p5 > 0):
        raise ValueError(
            f"times {dt_ab_s}, {dt_bc_s} s and densities {rotation_density_rad_s1p5}, "
            f"{translation_density_m_s1p5}: expected positive numbers"
        )
    sigma_per_density = np.sqrt((dt_ab_s + dt_bc_s) / 3)
    densities = np.repeat([rotation_density_rad_s1p5, translation_density_m_s1p5], 3)

    def error(world_T_a: gtsam.Pose3, world_T_b: gtsam.Pose3, world_T_c: gtsam.Pose3) -> Linearised:
        ab_by_a, ab_by_b, bc_by_b, bc_by_c = (np.zeros((6, 6), order="F") for _ in range(4))
        ab = world_T_a.logmap(world_T_b, ab_by_a, ab_by_b)
        bc = world_T_b.logmap(world_T_c, bc_by_b, bc_by_c)
        jacobians = [-ab_by_a / dt_ab_s, bc_by_b / dt_bc_s - ab_by_b / dt_ab_s, bc_by_c / dt_bc_s]
        return bc / dt_bc_s - ab / dt_ab_s, jacobians

    noise = gtsam.noiseModel.Diagonal.Sigmas(densities * sigma_per_density)
    variables = [Variable(key, POSE3) for key in (key_a, key_b, key_c)]
    return custom_factor(noise, variables, error)
