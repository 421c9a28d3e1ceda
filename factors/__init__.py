"""GTSAM factors for cameras with GPS: usable without vgps, on gtsam and numpy alone."""

from factors.custom import POINT3, POSE3, SCALAR, VECTOR1, VECTOR3, Kind, Linearised, Variable, custom_factor
from factors.gps import gps_factor, gps_factor_between, gps_factor_calibrating
from factors.gyro import (
    PreintegratedRates,
    bias_walk_factor,
    constant_velocity_factor,
    gyro_factor,
    preintegrate_rates,
)
from factors.known_points import known_points_factor, steady_centre_factor
from factors.level import level_factor
from factors.penalties import WALL_LIMIT, Cylinder, Ellipsoid, Gaussian, Penalty, stages
from factors.reprojection import (
    Loss,
    control_point_factor,
    projection_factor,
    projection_noise,
    projection_sigma_px,
    reliability_sigma_px,
)

__all__ = [
    "POINT3",
    "POSE3",
    "SCALAR",
    "VECTOR1",
    "VECTOR3",
    "WALL_LIMIT",
    "Cylinder",
    "Ellipsoid",
    "Gaussian",
    "Kind",
    "Linearised",
    "Loss",
    "Penalty",
    "PreintegratedRates",
    "Variable",
    "bias_walk_factor",
    "constant_velocity_factor",
    "control_point_factor",
    "custom_factor",
    "gps_factor",
    "gps_factor_between",
    "gps_factor_calibrating",
    "gyro_factor",
    "known_points_factor",
    "level_factor",
    "preintegrate_rates",
    "projection_factor",
    "projection_noise",
    "projection_sigma_px",
    "reliability_sigma_px",
    "stages",
    "steady_centre_factor",
]
