"""Settings of the simulated receiver, gyro and accelerometer, and the errors of real ones behind them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import hypot
from types import MappingProxyType

from vgps.model import FixClass
from vgps.survey import ErrorSeries


@dataclass(frozen=True, kw_only=True)
class FixErrors:
    """Errors of one fix class: a constant bias per stretch, plus a first-order Gauss-Markov process.

    Attributes:
        sigma_h_m, sigma_v_m: Standard deviation of the process, per horizontal axis and vertically.
        bias_h_m, bias_v_m: Standard deviation of the bias, drawn for every stretch of the class.
        correlation_s: Correlation time of the process.
        reported_m: Sigma east, north, up in the receiver's GST.
        hdop, satellites: As in the receiver's GGA.
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
        """Standard deviations of bias plus process: east, north, up."""
        horizontal = hypot(self.sigma_h_m, self.bias_h_m)
        return horizontal, horizontal, hypot(self.sigma_v_m, self.bias_v_m)


# RTK-fix: between a 10 min log of a standing receiver with 316 such epochs (0.007 m per horizontal axis,
# 0.018 m in height, correlated over 4-5 s) and the 95 % of Table 4, Kume 2010 (29 mm horizontally and 41 mm
# in height, which are 0.012 and 0.021 m).
# RTK-float: 289 epochs of the same log scatter by 0.87 m per horizontal axis and 2.5 m in height, 0.36 and
# 0.42 m from the mean of its RTK-fix, with an autocorrelation of 0.5-0.8 after 5 s, 0.0-0.6 after 20 s and
# 0.2-0.5 after 40 s, hence 25 s. A part is constant while the ambiguities stay at the same values; the two
# parts below add up to 0.87 and 2.5 m. scripts.tools.fit_gps_errors fits 0.97, 0.84, 2.54 m and 23, 13, 36 s
# (east, north, up) to that log, but 0.13, 0.19, 0.42 m and 670, 68, 201 s to another receiver's RTK-float
# on a drive: receivers differ, hence ``GpsConfig.replay``. Single: nine epochs of the log, rounded up. The
# reported sigmas are as optimistic as in that log.
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
    """Times, classes and errors of the simulated fixes.

    Attributes:
        interval_s: Time between fixes.
        offset_s: Time of the first fix after the first frame; by default fixes are between frames.
        fix_share: Share of the recording at its start, and again at its end, with RTK-fix; RTK-float between,
            as in the experiment of section 4, Kume 2010. With 0.5 every fix is an RTK-fix.
        middle_class: The class between.
        outliers: Share of fixes displaced far, whatever their class.
        outlier_m: Smallest and largest horizontal displacement.
        errors: Error model per class.
        replay: Errors of a real receiver, used for the classes in its log.
        seed: Seed of the errors if they are to differ from recording to recording in one world.
    """

    interval_s: float = 1.0
    offset_s: float = 0.03
    fix_share: float = 0.2
    middle_class: FixClass = FixClass.RTK_FLOAT
    outliers: float = 0.0
    outlier_m: tuple[float, float] = (8.0, 40.0)
    errors: Mapping[FixClass, FixErrors] = field(default_factory=lambda: FIX_ERRORS)
    replay: ErrorSeries | None = field(default=None, repr=False)
    seed: int | None = None


@dataclass(frozen=True, kw_only=True)
class GyroConfig:
    """A consumer MEMS gyro: white noise, and a random initial bias with a random walk.

    Noise per sample is 0.1 deg/s, as of a phone: 0.007 deg/s/sqrt(Hz) times the square root of half the
    default rate, rounded up.
    """

    rate_hz: float = 200.0
    noise_rad_s: float = 0.0017
    bias_rad_s: float = 0.01
    bias_walk_rad_s_sqrt_s: float = 0.0002
    mount_deg: tuple[float, float, float] = (3.0, -2.0, 90.0)
    margin_s: float = 0.2


@dataclass(frozen=True, kw_only=True)
class AccelerometerConfig:
    """A consumer MEMS accelerometer in one housing with the gyro: white noise, and a bias that walks.

    Noise per sample is that of 150 ug/sqrt(Hz) at the default rate; the bias is 10 mg (one sigma). Scales and
    the angles between axes of both sensors are off by 0.5 % (one sigma), the tolerance of the accelerometer's
    scale in the ICM-20948's data sheet (DS-000189, table 2), which states 2 % at most for its axes.

    Attributes:
        noise_m_s2: White noise of a sample.
        bias_m_s2: Standard deviation of the initial bias, per axis.
        bias_walk_m_s2_sqrt_s: Random walk of the bias.
        scale_error: Standard deviation of the scale factors and of the angles between axes, also the gyro's.
        imu_p_camera: The camera in the housing's frame, metres.
    """

    noise_m_s2: float = 0.02
    bias_m_s2: float = 0.1
    bias_walk_m_s2_sqrt_s: float = 0.0005
    scale_error: float = 0.005
    imu_p_camera: tuple[float, float, float] = (0.05, -0.08, 0.02)
