"""One small model per stage, every field with a default; a YAML file overrides, an unknown key is an error.

The resolved configuration is saved beside every result. A field's comment says which test it feeds.
"""

from vgps.config.base import SettingsModel, present_names
from vgps.config.camera_calibration import CameraCalibrationConfig
from vgps.config.camera_height import CameraHeightConfig
from vgps.config.gps import ErrorModel, GpsConfig, GpsModel, OutlierConfig, QualityConfig, Region, SkyConfig
from vgps.config.gyro_calibration import GyroCalibrationConfig, RotationConfig
from vgps.config.imu import ImuConfig
from vgps.config.landmarks import Frames, LandmarksConfig, SelectionConfig
from vgps.config.localization import LocalizationConfig
from vgps.config.loops import LoopsConfig
from vgps.config.online import OnlineConfig
from vgps.config.reading import read_survey, setting_names
from vgps.config.rolling_shutter import RollingShutterConfig
from vgps.config.root import Config, read_config
from vgps.config.smoothing import (
    BatchConfig,
    DriftConfig,
    IntrinsicsConfig,
    MotionConfig,
    SensorsConfig,
    TimeOffsetConfig,
    WindowConfig,
)
from vgps.config.survey import SurveyConfig
from vgps.config.tracking import MappingConfig, StartConfig, TrackingConfig

__all__ = [
    "BatchConfig",
    "CameraCalibrationConfig",
    "CameraHeightConfig",
    "Config",
    "DriftConfig",
    "ErrorModel",
    "Frames",
    "GpsConfig",
    "GpsModel",
    "GyroCalibrationConfig",
    "ImuConfig",
    "IntrinsicsConfig",
    "LandmarksConfig",
    "LocalizationConfig",
    "LoopsConfig",
    "MappingConfig",
    "MotionConfig",
    "OnlineConfig",
    "OutlierConfig",
    "QualityConfig",
    "Region",
    "RollingShutterConfig",
    "RotationConfig",
    "SelectionConfig",
    "SensorsConfig",
    "SettingsModel",
    "SkyConfig",
    "StartConfig",
    "SurveyConfig",
    "TimeOffsetConfig",
    "TrackingConfig",
    "WindowConfig",
    "present_names",
    "read_config",
    "read_survey",
    "setting_names",
]
