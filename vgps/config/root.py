"""The configuration of every verb, one section per part, as it is saved beside every result."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

from pydantic import NonNegativeInt, ValidationError

from vgps.config.base import SettingsModel
from vgps.config.camera_calibration import CameraCalibrationConfig
from vgps.config.camera_height import CameraHeightConfig
from vgps.config.gps import GpsConfig, GpsModel, OutlierConfig
from vgps.config.gyro_calibration import GyroCalibrationConfig
from vgps.config.imu import ImuConfig
from vgps.config.landmarks import LandmarksConfig
from vgps.config.localization import LocalizationConfig
from vgps.config.loops import LoopsConfig
from vgps.config.online import OnlineConfig
from vgps.config.reading import as_config_error, read_settings, read_survey, read_survey_memory
from vgps.config.rolling_shutter import RollingShutterConfig
from vgps.config.smoothing import (
    BatchConfig,
    DriftConfig,
    IntrinsicsConfig,
    MotionConfig,
    SensorsConfig,
    WindowConfig,
)
from vgps.config.submaps import SubmapsConfig
from vgps.config.survey import SurveyConfig
from vgps.config.tracking import MappingConfig, StartConfig, TrackingConfig


def _moved(model: type[SettingsModel], section: str) -> dict[str, str]:
    """Settings that stood at the top of a file of their own, and the section that they are in now."""
    return {name: f"{section}.{name}" for name in (*model.model_fields, *model.renamed)}


class Config(SettingsModel):
    """All settings, one section per part; every verb reads this one file."""

    renamed: ClassVar[Mapping[str, str]] = {
        "judge": "outliers",
        **_moved(LocalizationConfig, "localization"),
        **_moved(LandmarksConfig, "landmarks"),
    }

    basic: ClassVar[tuple[str, ...]] = ("seed",)

    seed: NonNegativeInt = 0
    """Seed of every random choice; the same seed gives the same output."""
    gps: GpsConfig = GpsConfig()
    sensors: SensorsConfig = SensorsConfig()
    outliers: OutlierConfig = OutlierConfig()
    tracking: TrackingConfig = TrackingConfig()
    mapping: MappingConfig = MappingConfig()
    start: StartConfig = StartConfig()
    window: WindowConfig = WindowConfig()
    drift: DriftConfig = DriftConfig()
    motion: MotionConfig = MotionConfig()
    batch: BatchConfig = BatchConfig()
    submaps: SubmapsConfig = SubmapsConfig()
    intrinsics: IntrinsicsConfig = IntrinsicsConfig()
    rolling_shutter: RollingShutterConfig = RollingShutterConfig()
    imu: ImuConfig = ImuConfig()
    loops: LoopsConfig = LoopsConfig()
    camera_height: CameraHeightConfig = CameraHeightConfig()
    camera_calibration: CameraCalibrationConfig = CameraCalibrationConfig()
    online: OnlineConfig = OnlineConfig()
    gyro_calibration: GyroCalibrationConfig = GyroCalibrationConfig()
    landmarks: LandmarksConfig = LandmarksConfig()
    localization: LocalizationConfig = LocalizationConfig()
    survey: SurveyConfig = SurveyConfig()

    def with_gps(self, model: GpsModel | None = None, survey: Path | None = None) -> Self:
        """Return the configuration with another GPS model or the errors of a survey file.

        Raises:
            ConfigError: The survey cannot be read or names an unknown class.
        """
        if survey is None:
            return self._with("gps", model=model)
        memory = self.gps.memory
        classes = read_survey_memory(survey, memory.classes, memory.own_spread)
        memory = memory.model_copy(update={"classes": classes})
        return self._with("gps", model=model, regions=read_survey(survey), memory=memory)

    def with_estimator(self, estimator: Literal["frame", "graph"] | None) -> Self:
        """Return the configuration with another estimator of the tracker, if one is given."""
        return self._with("localization", estimator=estimator)

    def with_landmarks(self, settings: LandmarksConfig | None) -> Self:
        """Return the configuration with those settings of a landmark database that were set explicitly."""
        return self._with("landmarks", **(settings.model_dump(exclude_unset=True) if settings else {}))

    def with_refined_camera(self) -> Self:
        """Return the configuration under which the camera's calibration is refined."""
        return self._with("intrinsics", refine="yes")

    def with_imu_knots(self, knot_s: float) -> Self:
        """Return the configuration with another time between the IMU's knots."""
        return self._with("imu", knot_s=knot_s)

    def with_seed(self, seed: int | None) -> Self:
        """Return the configuration with another seed, if one is given."""
        return self if seed is None else self.model_copy(update={"seed": seed})

    def with_survey(self, **changes: float | None) -> Self:
        """Return the configuration with those settings of a survey that are not None.

        Raises:
            ConfigError: A number is out of its range.
        """
        return self._with("survey", **changes)

    def _with(self, section: str, **changes: Any) -> Self:
        """Return the configuration with the settings of a section that are not None."""
        given = {name: value for name, value in changes.items() if value is not None}
        present = getattr(self, section)
        try:
            changed = type(present).model_validate({**dict(present), **given})
        except ValidationError as error:
            raise as_config_error(error, type(self), (section,)) from error
        return self.model_copy(update={section: changed})


def read_config(path: Path | None) -> Config:
    """Return the defaults, overridden by the YAML file at ``path`` if there is one.

    Raises:
        ConfigError: Not readable, an unknown key or an impossible value.
    """
    return Config() if path is None else read_settings(path, Config)
