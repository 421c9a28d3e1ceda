"""Factors of the IMU: preintegrated rates and forces between knots, and the walk of the biases.

Forster et al., On-Manifold Preintegration for Real-Time Visual-Inertial Odometry, 2017, in GTSAM.
"""

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from vgps.config import ImuConfig
from vgps.geometry import interpolate_vectors
from vgps.imu.camera_imu import CameraImu
from vgps.imu.states import ImuStates, as_bias, bias_key, velocity_key
from vgps.model import FloatArray

_INTEGRATION_SIGMA = 1e-4  # m/sqrt(s): of the position that a sample's constant acceleration gives


def imu_graph(
    imu: CameraImu, states: ImuStates, t_s: FloatArray, config: ImuConfig
) -> gtsam.NonlinearFactorGraph:
    """Return a factor for each link between knots, the walk of the biases, and the prior of the first.

    Args:
        imu: The samples.
        states: Knots; their biases are those of the preintegration.
        t_s: (F,) times of the frames.
        config: Noise, prior and loss.
    """
    graph = gtsam.NonlinearFactorGraph()
    at_s = t_s[states.frame]
    for k in np.flatnonzero(states.linked).tolist():
        measured = preintegrate(imu, float(at_s[k]), float(at_s[k + 1]), states.bias[k], config)
        a, b = (int(X(int(frame))) for frame in states.frame[k : k + 2])
        factor = gtsam.ImuFactor(a, velocity_key(k), b, velocity_key(k + 1), bias_key(k), measured)
        loss = gtsam.noiseModel.mEstimator.Huber.Create(config.robust_sigmas)
        graph.push_back(
            factor.cloneWithNewNoiseModel(gtsam.noiseModel.Robust.Create(loss, factor.noiseModel()))
        )
    walk = _six(config.accelerometer_bias_walk, config.gyro_bias_walk)
    zero = gtsam.imuBias.ConstantBias()
    for k, interval_s in enumerate(np.diff(at_s).tolist()):
        noise = gtsam.noiseModel.Diagonal.Sigmas(walk * np.sqrt(interval_s))
        graph.push_back(gtsam.BetweenFactorConstantBias(bias_key(k), bias_key(k + 1), zero, noise))
    prior = gtsam.noiseModel.Diagonal.Sigmas(_six(config.accelerometer_bias_sigma, config.gyro_bias_sigma))
    graph.push_back(gtsam.PriorFactorConstantBias(bias_key(0), as_bias(imu.bias), prior))
    return graph


def preintegrate(
    imu: CameraImu, start_s: float, end_s: float, bias: FloatArray, config: ImuConfig
) -> gtsam.PreintegratedImuMeasurements:
    """Return the preintegrated measurements from one time to another, linearised at a bias (6,).

    To the white noise comes an error in proportion to the rotation and to the change of velocity (without
    the mean force, whose share is constant and part of the bias), as white noise of the same effect.
    """
    between = imu.t_s[(imu.t_s > start_s) & (imu.t_s < end_s)]
    edges = np.concatenate([[start_s], between, [end_s]])
    middle, step_s = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    rate, force = (
        interpolate_vectors(imu.t_s, samples, middle) for samples in (imu.rate_rad_s, imu.force_m_s2)
    )
    rotation = float(np.linalg.norm(step_s @ (rate - bias[3:])))
    change = float(np.linalg.norm(step_s @ (force - imu.force_m_s2.mean(axis=0))))
    density = np.array([imu.gyro_density, imu.accelerometer_density])
    density = np.hypot(density, config.scale_error * np.array([rotation, change]) / np.sqrt(end_s - start_s))
    parameters = gtsam.PreintegrationParams.MakeSharedU(imu.gravity_m_s2)
    parameters.setGyroscopeCovariance(density[0] ** 2 * np.eye(3))
    parameters.setAccelerometerCovariance(density[1] ** 2 * np.eye(3))
    parameters.setIntegrationCovariance(_INTEGRATION_SIGMA**2 * np.eye(3))
    measured = gtsam.PreintegratedImuMeasurements(parameters, as_bias(bias))
    for f, w, dt in zip(force, rate, step_s.tolist(), strict=True):
        measured.integrateMeasurement(f, w, dt)
    return measured


def _six(of_force: float, of_rates: float) -> FloatArray:
    return np.repeat([of_force, of_rates], 3)
