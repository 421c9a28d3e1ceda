"""Clock and lever arm of the GPS receiver: values, priors, and the variables that estimate them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import gtsam
import numpy as np

from vgps.config import SensorsConfig
from vgps.model import FloatArray
from vgps.solution import GpsClock

TIME_OFFSET = gtsam.symbol("c", 0)
ANTENNA = gtsam.symbol("d", 0)
_FIXED_SIGMA = 1e-6  # prior sigma of a quantity that is not estimated


@dataclass(frozen=True)
class TimeOffset:
    """A time offset, by which positions are older than their time stamps, and its standard deviation."""

    time_offset_s: float
    sigma_s: float

    @classmethod
    def from_config(cls, config: SensorsConfig) -> "TimeOffset":
        """Return the configured prior; with a sigma of 0 the time offset is not estimated."""
        return cls(config.time_offset_s, config.time_offset_prior_s)


@dataclass(frozen=True)
class Sensors:
    """Clock and lever arm with their priors.

    Attributes:
        time_offset_s: By which positions are older than their time stamps, at the video's first frame.
        camera_p_antenna: (3,) metres.
        prior_time_offset: Prior of the time offset; with a sigma of 0 it is not estimated.
        prior_antenna: (3,) prior of the lever arm.
        antenna_sigma_m: Its standard deviation; with 0 the lever arm is not estimated.
        separate_antenna_sigma_m: That of an antenna of its own, if the prior assumes the camera's; else 0.
        probability: That the prior time offset is not chance; below 1 stage D decides.
        shown_by_poses: Whether the poses of stage D determine the time offset although errors have memory.
        held_sigma_s: Root mean square error of a time offset that is not estimated, as far as stage D shows.
        by_displacements: What displacements say, under the configured prior, where they are not certain; None
            before they were looked at.
        agreed: What displacements say under the prior of clocks that agree to hundredths of a second; None if
            they may as well agree exactly.
        clock_rate: By which the time offset grows in each second.
        clock_rate_sigma: Its standard deviation, or that of the speed at which the video was found to play; 0
            if nothing contradicts the configured ones.
    """

    time_offset_s: float
    camera_p_antenna: FloatArray
    prior_time_offset: TimeOffset
    prior_antenna: FloatArray
    antenna_sigma_m: float = 0.0
    separate_antenna_sigma_m: float = 0.0
    probability: float = 1.0
    shown_by_poses: bool = False
    held_sigma_s: float = 0.0
    by_displacements: TimeOffset | None = None
    agreed: TimeOffset | None = None
    clock_rate: float = 0.0
    clock_rate_sigma: float = 0.0

    @classmethod
    def fixed(cls, camera_p_antenna: FloatArray, time_offset_s: float = 0.0) -> "Sensors":
        """Return sensors whose time offset and lever arm are not estimated."""
        return cls(time_offset_s, camera_p_antenna, TimeOffset(time_offset_s, 0.0), camera_p_antenna)

    @classmethod
    def from_config(cls, camera_p_antenna: FloatArray, config: SensorsConfig) -> "Sensors":
        """Return sensors with the configured, fixed clock, and a lever arm estimated if configured so."""
        antenna_sigma_m = config.antenna_sigma_m if config.estimate_antenna else 0.0
        fixed = cls.fixed(camera_p_antenna, config.time_offset_s)
        return replace(fixed, antenna_sigma_m=antenna_sigma_m, clock_rate=config.clock_rate)

    def with_unknown_antenna(self, config: SensorsConfig, is_separate: bool = False) -> "Sensors":
        """Return sensors with a prior of a lever arm that nobody gave, unless it is estimated anyway.

        Args:
            config: Standard deviations of the prior.
            is_separate: Whether the antenna is known not to be the camera's.
        """
        if self.antenna_sigma_m or not config.unknown_antenna_sigma_m:
            return self
        possible = replace(
            self,
            antenna_sigma_m=config.unknown_antenna_sigma_m,
            separate_antenna_sigma_m=config.separate_antenna_sigma_m,
        )
        return possible.with_separate_antenna() if is_separate else possible

    def with_separate_antenna(self) -> "Sensors":
        """Return sensors with the prior of an antenna that is not the camera's."""
        return replace(self, antenna_sigma_m=self.separate_antenna_sigma_m, separate_antenna_sigma_m=0.0)

    def with_time_offset(self, prior: TimeOffset, probability: float = 1.0) -> "Sensors":
        """Return sensors with another prior of the time offset, starting from it."""
        return replace(
            self,
            time_offset_s=prior.time_offset_s,
            prior_time_offset=prior,
            probability=probability,
            held_sigma_s=0.0,
        )

    def with_clock(self, clock: GpsClock, time_offset_sigma_s: float, rate_sigma: float) -> "Sensors":
        """Return sensors with a clock that displacements show, with its standard deviations."""
        shown = self.with_time_offset(TimeOffset(clock.time_offset_s, time_offset_sigma_s))
        return replace(shown, clock_rate=clock.rate, clock_rate_sigma=rate_sigma)

    def holding_time_offset(self) -> "Sensors":
        """Return sensors whose time offset is not estimated with the poses."""
        return replace(self, prior_time_offset=TimeOffset(self.time_offset_s, 0.0))

    @property
    def clock(self) -> GpsClock:
        """The receiver's clock."""
        return GpsClock(self.time_offset_s, self.clock_rate)

    @property
    def is_estimated(self) -> bool:
        """Whether the time offset or the lever arm is estimated."""
        return self.prior_time_offset.sigma_s > 0.0 or self.antenna_sigma_m > 0.0

    def shared(self) -> dict[int, FloatArray]:
        """Return initial values of the shared vectors: change of the time offset (1,), and antenna (3,)."""
        return {TIME_OFFSET: np.zeros(1), ANTENNA: self.camera_p_antenna} if self.is_estimated else {}

    def priors(self) -> gtsam.NonlinearFactorGraph:
        """Return the prior factors."""
        graph = gtsam.NonlinearFactorGraph()
        if self.is_estimated:
            offset = gtsam.noiseModel.Isotropic.Sigma(1, self.prior_time_offset.sigma_s or _FIXED_SIGMA)
            antenna = gtsam.noiseModel.Isotropic.Sigma(3, self.antenna_sigma_m or _FIXED_SIGMA)
            graph.push_back(
                gtsam.PriorFactorVector(
                    TIME_OFFSET, np.array([self.prior_time_offset.time_offset_s - self.time_offset_s]), offset
                )
            )
            graph.push_back(gtsam.PriorFactorVector(ANTENNA, self.prior_antenna, antenna))
        return graph

    def moved(self, shared: Mapping[int, FloatArray]) -> "Sensors":
        """Return the sensors with the optimised values of the shared vectors."""
        if TIME_OFFSET not in shared:
            return self
        time_offset_s = self.time_offset_s + (
            float(shared[TIME_OFFSET][0]) if self.prior_time_offset.sigma_s else 0.0
        )
        antenna = shared[ANTENNA] if self.antenna_sigma_m else self.camera_p_antenna
        return replace(self, time_offset_s=time_offset_s, camera_p_antenna=antenna)
