"""What may be unknown of the GPS beside its fixes: the time offset of its clock, and the lever arm."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import gtsam
import numpy as np

from vgps.config import SensorsConfig
from vgps.model import FloatArray

TIME_OFFSET = gtsam.symbol("c", 0)
ANTENNA = gtsam.symbol("d", 0)
_HELD = 1e-6  # prior sigma of what is not to be estimated


@dataclass(frozen=True)
class TimeOffset:
    """How much older positions are than their time stamps say: ``time_offset_s`` and its ``sigma_s``."""

    time_offset_s: float
    sigma_s: float


@dataclass(frozen=True)
class Sensors:
    """Time offset and lever arm, with their priors.

    Attributes:
        time_offset_s: Positions are this much older than their time stamps say.
        camera_p_antenna: (3,) metres.
        prior_time_offset: Prior of the time offset; a sigma of 0 holds it.
        prior_antenna: (3,) prior of the lever arm.
        antenna_sigma_m: Its standard deviation; 0 holds it.
    """

    time_offset_s: float
    camera_p_antenna: FloatArray
    prior_time_offset: TimeOffset
    prior_antenna: FloatArray
    antenna_sigma_m: float = 0.0

    @classmethod
    def known(cls, camera_p_antenna: FloatArray, time_offset_s: float = 0.0) -> "Sensors":
        """Return sensors with nothing to estimate."""
        return cls(time_offset_s, camera_p_antenna, TimeOffset(time_offset_s, 0.0), camera_p_antenna)

    @classmethod
    def begin(cls, camera_p_antenna: FloatArray, config: SensorsConfig) -> "Sensors":
        """Return the time offset as configured, held so far, and the lever arm, estimated if asked for."""
        antenna_sigma_m = config.antenna_sigma_m if config.estimate_antenna else 0.0
        return replace(cls.known(camera_p_antenna, config.time_offset_s), antenna_sigma_m=antenna_sigma_m)

    def with_time_offset(self, prior: TimeOffset) -> "Sensors":
        """Return the same with another prior of the time offset, and starting from it."""
        return replace(self, time_offset_s=prior.time_offset_s, prior_time_offset=prior)

    @property
    def to_estimate(self) -> bool:
        """Whether anything is unknown."""
        return self.prior_time_offset.sigma_s > 0.0 or self.antenna_sigma_m > 0.0

    def shared(self) -> dict[int, FloatArray]:
        """Return the start of the shared vectors: the change of the time offset (1,), and the antenna
        (3,)."""
        return {TIME_OFFSET: np.zeros(1), ANTENNA: self.camera_p_antenna} if self.to_estimate else {}

    def priors(self) -> gtsam.NonlinearFactorGraph:
        """Return the prior factors."""
        graph = gtsam.NonlinearFactorGraph()
        if self.to_estimate:
            offset = gtsam.noiseModel.Isotropic.Sigma(1, self.prior_time_offset.sigma_s or _HELD)
            antenna = gtsam.noiseModel.Isotropic.Sigma(3, self.antenna_sigma_m or _HELD)
            graph.push_back(
                gtsam.PriorFactorVector(
                    TIME_OFFSET, np.array([self.prior_time_offset.time_offset_s - self.time_offset_s]), offset
                )
            )
            graph.push_back(gtsam.PriorFactorVector(ANTENNA, self.prior_antenna, antenna))
        return graph

    def moved(self, shared: Mapping[int, FloatArray]) -> "Sensors":
        """Return the sensors as the optimiser found them."""
        if not shared:
            return self
        time_offset_s = self.time_offset_s + (
            float(shared[TIME_OFFSET][0]) if self.prior_time_offset.sigma_s else 0.0
        )
        antenna = shared[ANTENNA] if self.antenna_sigma_m else self.camera_p_antenna
        return replace(self, time_offset_s=time_offset_s, camera_p_antenna=antenna)
