"""The configuration of everything, one part per stage, as it is saved beside every result."""

from pathlib import Path
from typing import Any

from vgps.config.base import SettingsModel
from vgps.config.gps import GpsConfig, GpsModel, OutlierConfig
from vgps.config.other_verbs import GyroCalibrationConfig, OnlineConfig
from vgps.config.reading import read_settings, read_survey
from vgps.config.smoothing import (
    BatchConfig,
    DriftConfig,
    IntrinsicsConfig,
    MotionConfig,
    SensorsConfig,
    WindowConfig,
)
from vgps.config.tracking import MappingConfig, StartConfig, TrackingConfig


class Config(SettingsModel):
    """Everything, one part per stage."""

    seed: int = 0
    """Seed of every random choice; the same seed gives the same output."""
    tracking: TrackingConfig = TrackingConfig()
    mapping: MappingConfig = MappingConfig()
    start: StartConfig = StartConfig()
    window: WindowConfig = WindowConfig()
    batch: BatchConfig = BatchConfig()
    motion: MotionConfig = MotionConfig()
    drift: DriftConfig = DriftConfig()
    outliers: OutlierConfig = OutlierConfig()
    sensors: SensorsConfig = SensorsConfig()
    intrinsics: IntrinsicsConfig = IntrinsicsConfig()
    gyro_calibration: GyroCalibrationConfig = GyroCalibrationConfig()
    gps: GpsConfig = GpsConfig()
    online: OnlineConfig = OnlineConfig()

    def with_gps(self, model: GpsModel | None = None, survey: Path | None = None) -> "Config":
        """The same configuration with another GPS model or the regions of a survey file.

        Raises:
            ConfigError: The survey cannot be read or names an unknown class.
        """
        changes: dict[str, Any] = {}
        if model is not None:
            changes["model"] = model
        if survey is not None:
            changes["regions"] = read_survey(survey)
        return self.model_copy(update={"gps": self.gps.model_copy(update=changes)})

    def with_seed(self, seed: int | None) -> "Config":
        """The same configuration with another seed, if one is given."""
        return self if seed is None else self.model_copy(update={"seed": seed})


def read_config(path: Path | None) -> Config:
    """The defaults, overridden by the YAML file at ``path`` if there is one.

    Raises:
        ConfigError: Not readable, an unknown key or an impossible value.
    """
    return read_settings(path, Config)
