"""One small model per stage, every field with a default; a YAML file overrides, an unknown key is an error.

The resolved configuration is saved beside every result. A field's comment says which test it feeds.
"""

from vgps.config.back_end import (
    BatchConfig,
    DriftConfig,
    IntrinsicsConfig,
    MotionConfig,
    SensorsConfig,
    WindowConfig,
)
from vgps.config.files import read_settings, read_survey
from vgps.config.front_end import MappingConfig, StartConfig, TrackingConfig
from vgps.config.gps import GpsConfig, GpsModel, JudgeConfig, QualityConfig, Region, SkyConfig
from vgps.config.model import SettingsModel
from vgps.config.other_verbs import GyroCalibrationConfig, OnlineConfig
from vgps.config.whole import Config, read_config

__all__ = [
    "BatchConfig",
    "Config",
    "DriftConfig",
    "GpsConfig",
    "GpsModel",
    "GyroCalibrationConfig",
    "IntrinsicsConfig",
    "JudgeConfig",
    "MappingConfig",
    "MotionConfig",
    "OnlineConfig",
    "QualityConfig",
    "Region",
    "SensorsConfig",
    "SettingsModel",
    "SkyConfig",
    "StartConfig",
    "TrackingConfig",
    "WindowConfig",
    "read_config",
    "read_settings",
    "read_survey",
]
