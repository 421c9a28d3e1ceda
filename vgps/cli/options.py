"""Options that several verbs share, and the limits of their values."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from cyclopts.validators import Number

from vgps.config import Config, GpsModel, read_config


def finite_and_not_negative(_: Any, value: float | None) -> None:
    """Raise ValueError for an option that is negative, infinite or NaN."""
    if value is not None and not (math.isfinite(value) and value >= 0.0):
        raise ValueError("Must be a finite number >= 0.")


Seed = Annotated[int, Parameter(validator=Number(gte=0))]
NotNegative = Annotated[float, Parameter(validator=finite_and_not_negative)]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class CalibrationFiles:
    """Calibrations used instead of those in the recording folder.

    Attributes:
        camera: Another camera.yaml, or a camera file of OpenCV, Kalibr or COLMAP; a path, or a name inside
            the folder.
        rig: Another rig.yaml; a path, or a name inside the folder.
    """

    camera: str | None = None
    rig: str | None = None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class SensorFiles(CalibrationFiles):
    """Calibrations and sensors used instead of those in the recording folder.

    Attributes:
        imu: Angular rates and specific force, as imu.csv; a path, or a name inside the folder.
    """

    imu: str | None = None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class RecordingFiles(SensorFiles):
    """Files used instead of those in the recording folder.

    Attributes:
        gps: GPS log; a path, or a name inside the folder.
        control_points: Another control_points.csv or gcp_list.txt; a path, or a name inside the folder.
        control_crs: Coordinate system of the control points, as EPSG:25832+7837.
        control_geoid: What the heights of the control points are above: egm96, a grid file, or metres.
        image_topic: Topic of the images of a ROS bag or MCAP file that has several.
    """

    gps: str | None = None
    control_points: str | None = None
    control_crs: str | None = None
    control_geoid: str | None = None
    image_topic: str | None = None

    def options(self) -> dict[str, Any]:
        """Return the options of :func:`vgps.open_recording`."""
        from vgps.readers.control_points import PointSystem

        return {
            "gps": self.gps,
            "camera": self.camera,
            "rig": self.rig,
            "imu": self.imu,
            "control_points": self.control_points,
            "control_system": PointSystem(self.control_crs, self.control_geoid),
            "image_topic": self.image_topic,
        }


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class SettingsOptions:
    """Where the settings of a verb come from.

    Attributes:
        config: YAML file with settings that replace the defaults.
        seed: Seed of all random choices; the same seed gives the same result.
    """

    config: Path | None = None
    seed: Seed | None = None

    def read(self) -> Config:
        """Return the resolved settings.

        Raises:
            ConfigError: A file cannot be read, or has an unknown key or an impossible value.
        """
        return read_config(self.config).with_seed(self.seed)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class SurveyedSettings(SettingsOptions):
    """Settings with the error regions of a surveyed receiver.

    Attributes:
        survey: YAML file with the error region r_m, h_m of each fix class, as `vgps survey` writes it.
    """

    survey: Path | None = None

    def read(self) -> Config:
        """Return the resolved settings; raises as in `SettingsOptions.read`."""
        return super().read().with_gps(survey=self.survey)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class GpsSettings(SurveyedSettings):
    """Settings with a GPS model.

    Attributes:
        gps_model: How a fix constrains the path; by default cylinder: not at all inside its error region, and
            the more the farther outside.
    """

    gps_model: GpsModel | None = None

    def read(self) -> Config:
        """Return the resolved settings; raises as in `SettingsOptions.read`."""
        return super().read().with_gps(self.gps_model)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class CoordinateOptions:
    """What coordinates and heights are in.

    Attributes:
        crs: Coordinate system: EPSG:NNNN or, with heights, EPSG:NNNN+MMMM; by default WGS 84.
        geoid: What heights are above: egm96, another model whose grid PROJ has, a grid file (.gtx, .tif,
            .pgm), or the geoid's height above the ellipsoid [m]; by default the ellipsoid.
        gps_crs: System of the fixes if not WGS 84, as EPSG:9989 for ITRF2020.
    """

    crs: str | None = None
    geoid: str | None = None
    gps_crs: str | None = None
