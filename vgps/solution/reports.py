"""What was found of the sensors, and how the optimisation of stage D went."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import nan

from vgps.model import FocalChanges
from vgps.solution.clock import GpsClock


@dataclass(frozen=True)
class SensorReport:
    """Estimates of the GPS's time offset, lever arm and errors, and of the camera's calibration.

    Attributes:
        time_offset_s: By which the positions are older than their time stamps, at the first frame.
        time_offset_sigma_s: Its standard deviation; NaN if it was not estimated.
        antenna_sigma_m: (3,) standard deviations of the lever arm; NaN if it was not estimated.
        clock_rate: By which the time offset grows in each second from the first frame on.
        clock_rate_sigma: Its standard deviation; NaN if it was not estimated.
        video_speed: Seconds that passed in a second of the video: frames have the times of what they show.
        camera_sigma: Standard deviations of the calibration by name, ``focal`` as a fraction of fx and fy;
            empty if it was not refined.
        fix_errors: Learned from the recording, by fix class: ``noise_m``, ``walk_m`` and how long errors keep
            the rate of their change, ``rate_lasts_s``.
        imu: Biases in the middle of the recording, in the IMU's axes, ``accelerometer_m_s2``, ``gyro_rad_s``,
            and, where known, their standard deviations (``.._sigma_..``); empty without an IMU.
        camera_height: Where it is known, ``m`` above the ground, ``scale_sigma``, the standard deviation of
            log scale by it alone, and ``stretches``, the number of those with a plane; else empty.
        focal_changes: Changes of the focal length that the pictures show beyond those that the camera has
            already; None if they show none.
    """

    time_offset_s: float
    time_offset_sigma_s: float
    antenna_sigma_m: tuple[float, float, float]
    clock_rate: float = 0.0
    clock_rate_sigma: float = nan
    video_speed: float = 1.0
    camera_sigma: Mapping[str, float] = field(default_factory=dict)
    fix_errors: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    imu: Mapping[str, list[float]] = field(default_factory=dict)
    camera_height: Mapping[str, float] = field(default_factory=dict)
    focal_changes: FocalChanges | None = None

    @property
    def clock(self) -> GpsClock:
        """The receiver's clock."""
        return GpsClock(self.time_offset_s, self.clock_rate)


@dataclass(frozen=True)
class SubmapReport:
    """Submaps of stage D.

    Attributes:
        places: Frames, and states that stand between them, of each submap.
        separators: Those of each submap that tracks, loops and factors couple with an earlier one; 0 for the
            first. With loops they are counted in blocks of 16.
        peak_memory_mb: Most memory that the process held until stage D ended; NaN where it is not known.
    """

    places: tuple[int, ...]
    separators: tuple[int, ...]
    peak_memory_mb: float


@dataclass(frozen=True)
class SolverReport:
    """Optimisation of stage D: cost per term before and after, iterations, and reason for stopping.

    ``submaps`` is None if everything was solved at once.
    """

    cost_before: Mapping[str, float]
    cost_after: Mapping[str, float]
    iterations: int
    stop_reason: str
    submaps: SubmapReport | None = None
