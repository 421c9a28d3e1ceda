"""What a simulated recording is made of: the scene, its camera, its motion and the errors of its sensors."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from math import hypot
from pathlib import Path
from types import MappingProxyType
from typing import Literal

from vgps.errors import ConfigError
from vgps.model import FixClass, GeodeticPoint
from vgps.simulate.receiver_errors import ErrorSeries, read_errors

_ORIGIN = GeodeticPoint(34.7325, 135.7345, 120.0)


@dataclass(frozen=True, kw_only=True)
class FixErrors:
    """Errors of one fix class: a constant bias per stretch plus a first-order Gauss-Markov process.

    Attributes:
        sigma_h_m, sigma_v_m: Standard deviation of the process, per horizontal axis and vertically.
        bias_h_m, bias_v_m: Standard deviation of the bias, drawn anew whenever the class is entered.
        correlation_s: Time over which the process forgets 63 % of itself.
        reported_m: What the receiver's GST claims: sigma east, north, up.
        hdop, satellites: What its GGA claims.
    """

    sigma_h_m: float
    sigma_v_m: float
    correlation_s: float
    bias_h_m: float = 0.0
    bias_v_m: float = 0.0
    reported_m: tuple[float, float, float] = (0.01, 0.01, 0.015)
    hdop: float = 0.8
    satellites: int = 14

    @property
    def total_m(self) -> tuple[float, float, float]:
        """Standard deviations of bias and process together: east, north, up."""
        horizontal = hypot(self.sigma_h_m, self.bias_h_m)
        return horizontal, horizontal, hypot(self.sigma_v_m, self.bias_v_m)


# RTK-fix: between a 10 min log of a standing receiver, 316 such epochs (0.007 m per horizontal axis, 0.018 m
# in height, correlated over 4-5 s), and the 95 % of Table 4, Kume 2010 (29 mm in the plane and 41 mm in
# height, which are 0.012 and 0.021 m).
# RTK-float: 289 epochs of the same log scatter by 0.87 m per horizontal axis and 2.5 m in height, 0.36 and
# 0.42 m off the mean of its RTK-fix, with an autocorrelation of 0.5-0.8 after 5 s, 0.0-0.6 after 20 s and
# 0.2-0.5 after 40 s, hence 25 s. Part of it is constant while the ambiguities float on the same values; the
# two parts below add up to 0.87 and 2.5 m. scripts.tools.fit_gps_errors fits 0.97, 0.84, 2.54 m and 23, 13,
# 36 s (east, north, up) to that log, but 0.13, 0.19, 0.42 m and 670, 68, 201 s to another receiver's RTK-
# float on a drive: each receiver's worth is in its own logs, hence ``GpsConfig.replay``. Single: nine epochs
# of the log, rounded up. The reported sigmas are as optimistic as in that log.
FIX_ERRORS: Mapping[FixClass, FixErrors] = MappingProxyType(
    {
        FixClass.RTK_FIX: FixErrors(sigma_h_m=0.010, sigma_v_m=0.020, correlation_s=5.0),
        FixClass.RTK_FLOAT: FixErrors(
            sigma_h_m=0.75,
            sigma_v_m=2.2,
            correlation_s=25.0,
            bias_h_m=0.45,
            bias_v_m=1.2,
            reported_m=(0.5, 0.5, 1.0),
            hdop=0.9,
            satellites=12,
        ),
        FixClass.SINGLE: FixErrors(
            sigma_h_m=1.5,
            sigma_v_m=3.0,
            correlation_s=60.0,
            bias_h_m=1.0,
            bias_v_m=2.0,
            reported_m=(1.5, 1.5, 3.0),
            hdop=1.3,
            satellites=9,
        ),
    }
)


@dataclass(frozen=True, kw_only=True)
class GpsConfig:
    """When fixes come, of which class, and how wrong they are.

    Attributes:
        interval_s: Time between fixes.
        offset_s: The first fix's time after the first frame, chosen so that fixes do not meet frames.
        fix_share: Share of the recording at its start, and again at its end, with RTK-fix; RTK-float between,
            as in the thesis' experiment (section 4, Kume 2010). 0.5 makes every fix an RTK-fix.
        middle_class: The class between.
        outliers: Share of fixes thrown far off, whatever their class says.
        outlier_m: Smallest and largest horizontal distance by which.
        errors: Error model per class.
        replay: Errors of a real receiver instead, for the classes that its log has.
    """

    interval_s: float = 1.0
    offset_s: float = 0.03
    fix_share: float = 0.2
    middle_class: FixClass = FixClass.RTK_FLOAT
    outliers: float = 0.0
    outlier_m: tuple[float, float] = (8.0, 40.0)
    errors: Mapping[FixClass, FixErrors] = field(default_factory=lambda: FIX_ERRORS)
    replay: ErrorSeries | None = field(default=None, repr=False)


@dataclass(frozen=True, kw_only=True)
class GyroConfig:
    """A consumer MEMS gyro: white noise, and a bias that starts somewhere and walks.

    Noise per sample is 0.1 deg/s, of the order of a telephone's: 0.007 deg/s/sqrt(Hz) times the square root
    of half the default rate, rounded up.
    """

    rate_hz: float = 200.0
    noise_rad_s: float = 0.0017
    bias_rad_s: float = 0.01
    bias_walk_rad_s_sqrt_s: float = 0.0002
    mount_deg: tuple[float, float, float] = (3.0, -2.0, 90.0)
    margin_s: float = 0.2


@dataclass(frozen=True, kw_only=True)
class SceneConfig:
    """A scene: motion, camera, surroundings, sensors. Change fields with :func:`dataclasses.replace`.

    Attributes:
        speed: Knots (time [s], speed [m/s]); the last one ends the recording.
        turns: Bends (distance at which it starts [m], its length [m], angle [deg], left positive).
        fps, width, height, focal_px, exposure_s: The camera, a pinhole with a central principal point.
        camera_p_antenna: Antenna in the camera frame, metres (x right, y down, z forward).
        eye_m: The camera's height above ground.
        bob_hz, bob_m, sway_deg: A walker's bobbing, up and down, and swaying, half as fast.
        shake_deg, look_deg: Amplitude of quick shaking (of a vehicle in motion) and of slow looking around.
        pitch_deg, roll_deg: Mean tilt of the camera, up positive, and about its viewing axis, clockwise
            positive.
        spin_deg_s, spin_period_s: Peak rate and period of turning to and fro about the vertical, fading in
            after a quarter of the recording.
        surface: What the ground looks like.
        setback_m: Least and largest distance of the facades from the path.
        moving: Whether cars and walkers pass.
        texture_scale: Scale of the textures' resolution; tests lower it for speed.
        noise_levels: Sensor noise, standard deviation in grey levels.
        max_samples: Most instants rendered and averaged for one frame, however fast the image moves.
        crf: Quality of the H.264 video (lower is better).
    """

    speed: tuple[tuple[float, float], ...]
    turns: tuple[tuple[float, float, float], ...]
    fps: int = 15
    width: int = 720
    height: int = 480
    focal_px: float = 620.0
    exposure_s: float = 0.0025
    camera_p_antenna: tuple[float, float, float] = (0.05, -0.42, -0.12)
    eye_m: float = 1.6
    bob_hz: float = 1.8
    bob_m: float = 0.025
    sway_deg: float = 0.5
    shake_deg: float = 0.0
    look_deg: float = 3.0
    pitch_deg: float = 3.0
    roll_deg: float = 0.0
    spin_deg_s: float = 0.0
    spin_period_s: float = 3.0
    surface: Literal["paving", "asphalt"] = "paving"
    setback_m: tuple[float, float] = (5.0, 9.0)
    moving: bool = False
    texture_scale: float = 1.0
    noise_levels: float = 1.5
    max_samples: int = 64
    crf: int = 16
    gps: GpsConfig = field(default_factory=GpsConfig)
    gyro: GyroConfig = field(default_factory=GyroConfig)
    start_utc: datetime = datetime(2025, 6, 1, 12, 0, 0, tzinfo=UTC)
    world_origin: GeodeticPoint = _ORIGIN

    @property
    def frames(self) -> int:
        """Number of frames; the last speed knot is the time after the last frame."""
        return round(self.speed[-1][0] * self.fps)

    @property
    def duration_s(self) -> float:
        """Time of the last frame."""
        return (self.frames - 1) / self.fps


_WALK = SceneConfig(
    speed=((0.0, 0.9), (15.0, 1.0), (30.0, 0.9), (45.0, 0.98), (60.0, 0.92), (74.0, 0.96)),
    turns=((8.0, 8.0, 35.0), (24.0, 10.0, -60.0), (42.0, 9.0, 50.0), (57.0, 8.0, 40.0)),
)
_DRIVE = SceneConfig(
    speed=(
        *((0.0, 6.0), (6.0, 9.5), (12.0, 8.5), (17.0, 5.0), (22.0, 9.0), (28.0, 8.0), (33.0, 0.0)),
        *((39.0, 0.0), (45.0, 8.0), (51.0, 9.5), (56.0, 5.5), (61.0, 9.0), (66.0, 7.0)),
    ),
    turns=((70.0, 40.0, 15.0), (122.0, 22.0, -85.0), (190.0, 40.0, 20.0), (330.0, 24.0, 80.0)),
    fps=10,
    width=1242,
    height=374,
    focal_px=720.0,
    exposure_s=0.001,
    camera_p_antenna=(0.05, -0.93, -0.32),
    eye_m=1.65,
    bob_m=0.0,
    sway_deg=0.0,
    shake_deg=0.15,
    look_deg=0.0,
    pitch_deg=0.0,
    surface="asphalt",
    setback_m=(8.0, 14.0),
)

SCENES: Mapping[str, SceneConfig] = MappingProxyType(
    {
        "walk": _WALK,
        "drive": _DRIVE,
        "demo": replace(_WALK, speed=((0.0, 1.2), (13.0, 1.2)), turns=((2.5, 5.0, 40.0), (9.5, 5.0, -65.0))),
        "spin": replace(
            _WALK,
            speed=((0.0, 1.0), (15.0, 1.0)),
            turns=((3.0, 8.0, 40.0),),
            spin_deg_s=150.0,
            exposure_s=1 / 15,
        ),
    }
)


def scene_config(name: str) -> SceneConfig:
    """The scene of that name.

    Raises:
        ConfigError: There is none.
    """
    if name not in SCENES:
        raise ConfigError(f"unknown scene {name!r}", expected="one of " + ", ".join(SCENES), place="--scene")
    return SCENES[name]


def scene_with_errors(name: str, log: Path | None = None, reference: Path | None = None) -> SceneConfig:
    """The scene of that name, with the errors of a real receiver if a log is given.

    Args:
        name: One of ``SCENES``.
        log, reference: As :func:`vgps.simulate.receiver_errors.read_errors` has them.

    Raises:
        ConfigError: There is no such scene, or a reference without a log.
        GpsLogError: A log cannot be read, or tells no errors.
    """
    scene = scene_config(name)
    if log is None:
        if reference is not None:
            raise ConfigError("a reference without a log of errors", place="--gps-reference")
        return scene
    return replace(scene, gps=replace(scene.gps, replay=read_errors(log, reference)))
