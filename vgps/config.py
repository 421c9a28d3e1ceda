"""One small model per stage, every field with a default; a YAML file overrides, an unknown key is an error.

The resolved configuration is saved beside every result. A field's comment says which test it feeds.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, PositiveInt, ValidationError

from vgps.errors import ConfigError
from vgps.model import FixClass

Settings = TypeVar("Settings", bound=BaseModel)
GpsModel = Literal["none", "gaussian", "gaussian-receiver", "ellipsoid", "cylinder", "cauchy"]


class _Stage(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class TrackingConfig(_Stage):
    """Stage A, Kume 2010: follow features from frame to frame and pose the camera by them."""

    method: Literal["lk", "ssd"] = "lk"
    """Matcher: pyramidal Lucas-Kanade, or the thesis's SSD templates on Harris corners."""
    max_features: PositiveInt = 350
    """Corners are added while fewer features than this are being followed."""
    min_distance_px: PositiveFloat = 12.0
    """No new corner nearer than this to a followed one."""
    harris_k: float = 0.04
    harris_quality: PositiveFloat = 1e-4
    """A corner's Harris response must exceed this share of the strongest in the frame (A-1)."""
    window_px: PositiveInt = 15
    """Side of the patch that is matched."""
    pyramid_levels: PositiveInt = 4
    search_px: PositiveInt = 48
    """SSD: half side of the search window around the previous position (A-2)."""
    rematch_px: PositiveInt = 6
    """SSD: half side of the search window around the predicted position (A-4)."""
    max_match_error: PositiveFloat = 25.0
    """A match is refused when its mean absolute grey difference exceeds this."""
    forward_backward_px: PositiveFloat = 1.0
    """LK: a match is refused when tracking it back misses its start by more."""
    lmeds_samples: PositiveInt = 60
    """Minimal samples drawn for the least-median-of-squares pose (A-3)."""
    inlier_px: PositiveFloat = 2.5
    """Reprojection error above which a match does not vote in (A-5)."""
    min_inliers: PositiveInt = 12
    """Fewer inliers than this and the frame counts as lost."""
    min_inlier_share: PositiveFloat = 0.3
    """A smaller share of inliers and the frame counts as lost."""
    static_px: PositiveFloat = 0.4
    """A frame whose features moved by less (median) since the last view adds no view: the camera stands."""


class MappingConfig(_Stage):
    """Stage B, Kume 2010: triangulate (19), add and delete features by their quality."""

    min_parallax_deg: PositiveFloat = 0.2
    """A feature gets a position once the largest angle between its rays exceeds this."""
    max_reprojection_px: PositiveFloat = 2.0
    """A position is accepted when every view of the feature agrees to this; a match beyond it is dropped."""
    max_sigma_px: PositiveFloat = 1.5
    """A feature whose reliability sigma_j (13) is larger is deleted."""
    sigma_floor_px: PositiveFloat = 0.3
    """Two or three views drive sigma_j to zero; it is never taken smaller than this."""
    max_track_frames: PositiveInt = 60
    """A feature followed for longer goes on as a new one (the solver's cost grows with the square)."""
    min_views: PositiveInt = 3
    """Features seen in fewer frames are left out of the graph."""


class StartConfig(_Stage):
    """How a map begins and how it finds its place in the world."""

    min_flow_px: PositiveFloat = 15.0
    """Median image motion between the two views that begin a map."""
    min_inliers: PositiveInt = 30
    """Features that agree with the two views' essential matrix and lie in front of both cameras."""
    min_parallax_deg: PositiveFloat = 0.7
    """Median angle between the rays of the two views."""
    min_fixes: PositiveInt = 3
    """Usable fixes before scale, heading and position are taken from GPS."""
    min_travel_ratio: PositiveFloat = 4.0
    """The fixes must span this many times the median region radius before they give scale and heading."""
    min_travel_m: PositiveFloat = 3.0
    least_travel_ratio: PositiveFloat = 1.0
    """At the end of a video that never spans enough this many must do, and the result is said to be poor."""
    level_sigma_deg: PositiveFloat = 5.0
    """The camera is believed to be carried upright to this standard deviation of its mean roll. It matters
    only where the fixes do not show the roll, on a straight track above all."""
    min_control_travel_m: PositiveFloat = 0.5
    """Frames posed by control points must lie this far apart before they give the scale."""
    control_sigma_px: PositiveFloat = 1.0
    """Standard deviation of a control point's sighting."""
    pitch_sigma_deg: PositiveFloat = 30.0
    """The same for its mean pitch."""


class WindowConfig(_Stage):
    """Stage C, Kume 2010: optimise the last frames every few frames."""

    every_frames: PositiveInt = 15
    length_frames: PositiveInt = 60
    iterations: PositiveInt = 4
    tolerated_drift: PositiveFloat = 0.02
    """Antennas further outside their fix's region than this share of the way through the window show that
    what is held has drifted: then the drift is taken out first."""


class DriftConfig(_Stage):
    """How a camera's scale and heading may drift; from knot to knot both walk at random."""

    knot_frames: PositiveInt = 15
    scale_sigma: PositiveFloat = 0.05
    """Standard deviation of the change of the log scale from one knot to the next."""
    rotation_sigma_deg: PositiveFloat = 0.3
    """The same for the rotation."""
    iterations: PositiveInt = 30


class JudgeConfig(_Stage):
    """What is believed of fixes before the video has spoken."""

    enabled: bool = True
    """Whether fixes are judged at all; `cauchy` is robust by itself and never is."""
    outlier_share: PositiveFloat = 0.05
    """Prior probability that a fix is wrong altogether."""
    lower_share: PositiveFloat = 0.02
    """Prior probability that an RTK-fix has the error of an RTK-float."""
    tail_share: PositiveFloat = 0.05
    """Share of a class that lies outside its region by nature: what a survey drops."""
    tail_size: PositiveFloat = 2.0
    """These lie in a cylinder so many times the size."""
    outlier_radius_m: PositiveFloat = 50.0
    """A wrong fix lies anywhere within this distance."""
    path_tolerance: PositiveFloat = 0.02
    """The path may be wrong by this share of the way between two knots of its drift."""


class SensorsConfig(_Stage):
    """The GPS's clock and the lever arm, where they are not known well enough."""

    lag_s: float = 0.0
    """Positions are this much older than their time stamps say, as far as known."""
    estimate_lag: Literal["auto", "yes", "no"] = "auto"
    """Estimate the lag with the poses; auto keeps what it finds only if it cannot be chance."""
    lag_sigma_s: PositiveFloat = 0.5
    """Standard deviation of the lag before anything was seen."""
    trusted_lag_s: PositiveFloat = 0.02
    """Auto: clocks agree to this standard deviation where nothing is wrong; exposure and rounding of time
    stamps leave as much."""
    significant: PositiveFloat = 3.0
    """Auto: a lag is kept if it exceeds so many standard deviations."""
    estimate_antenna: bool = False
    """Estimate the antenna's place on the camera with the poses."""
    antenna_sigma_m: PositiveFloat = 0.5
    """Standard deviation of the lever arm before anything was seen."""

    @property
    def lag_prior_s(self) -> float:
        """Prior standard deviation of what is still unknown of the lag; 0 if it is held."""
        return 0.0 if self.estimate_lag == "no" else self.lag_sigma_s


class MotionConfig(_Stage):
    """What is assumed of the camera's motion, used only where frames have no features of their own."""

    rotation_density: PositiveFloat = 1.0
    """White noise on the angular acceleration, rad/s^2/sqrt(Hz)."""
    translation_density: PositiveFloat = 2.0
    """White noise on the acceleration, m/s^2/sqrt(Hz)."""


class BatchConfig(_Stage):
    """Stage D, Kume 2010: optimise everything once."""

    solver: Literal["schur", "gtsam"] = "schur"
    rounds: PositiveInt = 3
    """Outliers are dropped and reliabilities (13) recomputed between rounds."""
    iterations: PositiveInt = 25
    """Of a round; the last may take twice as many."""
    relative_tolerance: PositiveFloat = 1e-5
    """The last round ends once a step lowers the cost by no more than this share of it."""
    early_tolerance: PositiveFloat = 3e-4
    """The same for the rounds before, after which everything is judged anew."""
    robust_px: PositiveFloat = 1.0
    """Huber's constant on a reprojection error, in pixels, before the weights of (12)."""
    weight: Literal["per_frame", "per_observation"] = "per_observation"
    """Eq. (12) divides by the number of features in the frame; per_observation does not."""
    video_sigma_scale: PositiveFloat = 8.0
    """Pixel sigmas are multiplied by this: tracks drift together, so their errors are not independent."""
    balance: Literal["fixed", "estimated"] = "fixed"
    """Whether the scale stays, or follows the misfit of the fixes from round to round."""
    balance_worth: PositiveFloat = 4.0
    """What is believed of the fit before anything was seen counts as so many independent fixes; standard
    deviations follow the misfit as well."""
    balance_range: PositiveFloat = 8.0
    """The estimated scale stays within this factor of it."""
    draws: PositiveInt = 200
    """Draws of all errors behind the standard deviations, known to 1 / sqrt(2 draws) of themselves."""


class IntrinsicsConfig(_Stage):
    """The camera's calibration, refined with the poses in stage D."""

    refine: bool = False
    """Whether it is: for calibrations that are only roughly known."""
    focal_sigma: PositiveFloat = 0.05
    """Standard deviation of the focal length as it is given, as a share of it."""
    centre_sigma_px: PositiveFloat = 5.0
    """The same for the principal point."""
    distortion_sigma: PositiveFloat = 0.02
    """The same for the first two coefficients of the lens model, where it has any."""
    steps: PositiveInt = 8
    """At most so many turns between poses and calibration."""
    settled_sigmas: PositiveFloat = 0.5
    """It ends once a turn changes every number by less than this share of its standard deviation."""


class Region(_Stage):
    """The cylinder of a fix class: radius and half height, metres; 95 % of its fixes lie within each."""

    r_m: PositiveFloat
    h_m: PositiveFloat
    correlation_s: PositiveFloat = 60.0
    """After this time the error of a fix counts as a new one; standard deviations depend on it, and the
    balance where it is estimated."""


def _default_regions() -> dict[FixClass, Region]:
    return {
        FixClass.RTK_FIX: Region(r_m=0.07, h_m=0.05, correlation_s=10.0),
        FixClass.RTK_FLOAT: Region(r_m=2.4, h_m=6.5),
        FixClass.PPP: Region(r_m=0.5, h_m=1.0),
        FixClass.DGPS: Region(r_m=3.0, h_m=6.0),
        FixClass.SBAS: Region(r_m=3.0, h_m=6.0),
        FixClass.SINGLE: Region(r_m=6.0, h_m=12.0),
    }


class QualityConfig(_Stage):
    """When a fix is worse than its class: its region then grows, it never shrinks."""

    enlarge: bool = True
    """Whether regions depend on more than the class."""
    good_hdop: PositiveFloat = 2.0
    """A region grows in proportion to a horizontal dilution of precision beyond this."""
    good_satellites: PositiveInt = 8
    """Where the log has no dilution: it grows with the root of what is left over of so many satellites."""
    fresh_s: PositiveFloat = 10.0
    """Corrections are good for this long."""
    age_rate_m_s: PositiveFloat = 0.002
    """So much is added for every second more: how fast a satellite's clock and the air wander."""


class GpsConfig(_Stage):
    """The GPS term of the energy (11)."""

    model: GpsModel = "cylinder"
    n: PositiveInt = 2
    """Exponent of (16) and (22): the larger, the flatter inside and the steeper outside."""
    omega: PositiveFloat = 0.5
    """Weight of the GPS term: with 0.5 the penalty at the wall equals that of a one-sigma residual."""
    min_sigma_m: PositiveFloat = 0.01
    """No receiver's own sigma is believed below this."""
    gaussian_sigma_m: PositiveFloat = 1.0
    """Sigma of every fix under `gaussian`, which ignores accuracy (14)."""
    quality: QualityConfig = QualityConfig()
    regions: dict[FixClass, Region] = Field(default_factory=_default_regions)
    """r(p) and h(p) per fix class, from a survey of the receiver. Classes not named are not used."""


class GyroCalibrationConfig(_Stage):
    """When a gyro counts as calibrated against the video."""

    least_interval_s: PositiveFloat = 0.03
    """Frames nearer to the last one than this are passed over: a turn must rise above its error."""
    search_s: PositiveFloat = 2.0
    """The clocks are taken to agree to this."""
    min_intervals: PositiveInt = 30
    """Intervals between frames with a rotation from the video and gyro rates throughout."""
    least_rate_deg_s: PositiveFloat = 0.5
    """The gyro's rate must vary by this (standard deviation), else the camera hardly turned, or steadily."""
    least_agreement: PositiveFloat = 0.85
    """Correlation of the rates of gyro and video; less, and they do not tell of the same motion."""
    max_rotation_sigma_deg: PositiveFloat = 2.0
    """Above this standard deviation, about its worst axis, the sensor's rotation is not given."""
    max_offset_sigma_s: PositiveFloat = 0.005
    """The same for the offset between the clocks."""
    max_bias_sigma_deg_s: PositiveFloat = 0.5
    """The same for the bias."""
    scale_tolerance: PositiveFloat = 0.03
    """The video may turn by this share more or less than the gyro before the focal length is doubted."""


class OnlineConfig(_Stage):
    """What is special about a sequence that is fed live."""

    keep_s: PositiveFloat = 120.0
    """Path and fixes are remembered for so long: what judges late fixes and is bent when GPS returns."""
    bridge_s: PositiveFloat = 1.0
    """Frames without features go on at constant velocity for so long; then the camera counts as lost."""
    blend_s: PositiveFloat = 2.0
    """Time in which the smooth pose approaches the corrected one by all but 1/e,"""
    blend_m_s: PositiveFloat = 1.0
    """but never faster than this,"""
    blend_deg_s: PositiveFloat = 5.0
    """nor turning faster than this."""


class Config(_Stage):
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
    judge: JudgeConfig = JudgeConfig()
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


def _read_yaml(path: Path) -> Mapping[str, Any]:
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path, expected="a YAML file") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f"not YAML: {error}", file=path) from error
    if data is None:
        return {}
    if not isinstance(data, dict):
        raise ConfigError(f"found a {type(data).__name__}", file=path, expected="a mapping of keys to values")
    return data


def _as_config_error(error: ValidationError, path: Path) -> ConfigError:
    first = error.errors()[0]
    place = "key " + ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        return ConfigError("unknown key", file=path, place=place, remedy="remove it or correct its spelling")
    found = f"found {first['input']!r}"[:80]
    return ConfigError(found, file=path, place=place, expected=first["msg"][:1].lower() + first["msg"][1:])


def read_config(path: Path | None) -> Config:
    """The defaults, overridden by the YAML file at ``path`` if there is one.

    Raises:
        ConfigError: Not readable, an unknown key or an impossible value.
    """
    return read_settings(path, Config)


def read_settings(path: Path | None, kind: type[Settings]) -> Settings:
    """The defaults of a settings model, overridden by the YAML file at ``path`` if there is one.

    Raises:
        ConfigError: Not readable, an unknown key or an impossible value.
    """
    if path is None:
        return kind()
    try:
        return kind.model_validate(_read_yaml(path))
    except ValidationError as error:
        raise _as_config_error(error, path) from error


def read_survey(path: Path) -> dict[FixClass, Region]:
    """Regions r(p), h(p) per fix class from a survey file; other keys may stand beside them.

    Raises:
        ConfigError: Not readable, no known class, or impossible sizes.
    """
    regions: dict[FixClass, Region] = {}
    for name, value in _read_yaml(path).items():
        if name not in set(FixClass) or not isinstance(value, dict):
            continue
        sizes = {key: value[key] for key in ("r_m", "h_m", "correlation_s") if key in value}
        try:
            regions[FixClass(name)] = Region.model_validate(sizes)
        except ValidationError as error:
            raise _as_config_error(error, path) from error
    if not regions:
        known = ", ".join(FixClass)
        raise ConfigError("no fix class in it", file=path, expected=f"one of {known}, each with r_m and h_m")
    return regions
