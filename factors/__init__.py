"""GTSAM factors for cameras with GPS; they import gtsam and numpy only and do not need vgps."""

from factors.camera_height import camera_height_factor
from factors.continuous_path import knots_around, path_poses, path_vectors, path_weights, poses_at
from factors.custom import (
    POINT3,
    POSE3,
    SCALAR,
    VECTOR1,
    VECTOR3,
    Kind,
    Linearisation,
    Variable,
    custom_factor,
)
from factors.gps import gps_factor, gps_factor_calibrating, gps_factor_interpolated, offset_factor
from factors.gyro import PreintegratedRates, bias_walk_factor, gyro_factor, preintegrate_rates
from factors.known_points import known_points_factor
from factors.level import CAMERA_RIGHT_AND_FORWARD, level_factor
from factors.motion import constant_centre_velocity_factor, constant_velocity_factor
from factors.penalties import WALL_LIMIT, Cylinder, Ellipsoid, Gaussian, Penalty, exponent_schedule
from factors.reprojection import (
    Loss,
    control_point_factor,
    projection_factor,
    projection_noise,
    projection_sigma_px,
    reliability_sigma_px,
)
from factors.rolling_shutter import RowTime, rolling_projection_factor

__all__ = [
    "CAMERA_RIGHT_AND_FORWARD",
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
    "Linearisation",
    "Loss",
    "Penalty",
    "PreintegratedRates",
    "RowTime",
    "Variable",
    "bias_walk_factor",
    "camera_height_factor",
    "constant_centre_velocity_factor",
    "constant_velocity_factor",
    "control_point_factor",
    "custom_factor",
    "exponent_schedule",
    "gps_factor",
    "gps_factor_calibrating",
    "gps_factor_interpolated",
    "gyro_factor",
    "knots_around",
    "known_points_factor",
    "level_factor",
    "offset_factor",
    "path_poses",
    "path_vectors",
    "path_weights",
    "poses_at",
    "preintegrate_rates",
    "projection_factor",
    "projection_noise",
    "projection_sigma_px",
    "reliability_sigma_px",
    "rolling_projection_factor",
]
