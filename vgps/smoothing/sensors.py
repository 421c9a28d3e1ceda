"""What of the GPS may be unknown beside its fixes: its clock's lag behind the video, and the lever arm."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import gtsam
import numpy as np

from vgps.config import SensorsConfig
from vgps.model import FloatArray

LAG = gtsam.symbol("c", 0)
ANTENNA = gtsam.symbol("d", 0)
_HELD = 1e-6  # prior sigma of what is not to be estimated


@dataclass(frozen=True)
class Sensors:
    """Clock and lever arm, with standard deviations before anything was seen.

    Attributes:
        lag_s: Positions are this much older than their time stamps say.
        camera_p_antenna: (3,) metres.
        lag_sigma_s: 0 holds the lag.
        antenna_sigma_m: 0 holds the lever arm.
        believed_lag_s, believed_antenna: What the standard deviations are about.
    """

    lag_s: float
    camera_p_antenna: FloatArray
    lag_sigma_s: float
    antenna_sigma_m: float
    believed_lag_s: float
    believed_antenna: FloatArray

    @classmethod
    def known(cls, camera_p_antenna: FloatArray, lag_s: float = 0.0) -> "Sensors":
        """Nothing to estimate."""
        return cls(lag_s, camera_p_antenna, 0.0, 0.0, lag_s, camera_p_antenna)

    @classmethod
    def begin(cls, camera_p_antenna: FloatArray, config: SensorsConfig) -> "Sensors":
        """What is to be estimated, from what is known."""
        antenna_sigma_m = config.antenna_sigma_m if config.estimate_antenna else 0.0
        antenna = camera_p_antenna
        return cls(config.lag_s, antenna, config.lag_prior_s, antenna_sigma_m, config.lag_s, antenna)

    def with_lag(self, lag_s: float) -> "Sensors":
        """With a lag that is not estimated any further."""
        return replace(self, lag_s=lag_s, lag_sigma_s=0.0)

    @property
    def to_estimate(self) -> bool:
        """Whether anything is unknown."""
        return self.lag_sigma_s > 0.0 or self.antenna_sigma_m > 0.0

    def shared(self) -> dict[int, FloatArray]:
        """Start of the shared vectors: how much the lag (1,) is still to change, and the antenna (3,)."""
        return {LAG: np.zeros(1), ANTENNA: self.camera_p_antenna} if self.to_estimate else {}

    def priors(self) -> gtsam.NonlinearFactorGraph:
        """What was believed before."""
        graph = gtsam.NonlinearFactorGraph()
        if self.to_estimate:
            lag = gtsam.noiseModel.Isotropic.Sigma(1, self.lag_sigma_s or _HELD)
            antenna = gtsam.noiseModel.Isotropic.Sigma(3, self.antenna_sigma_m or _HELD)
            missing = self.believed_lag_s - self.lag_s if self.lag_sigma_s else 0.0
            graph.push_back(gtsam.PriorFactorVector(LAG, np.array([missing]), lag))
            graph.push_back(gtsam.PriorFactorVector(ANTENNA, self.believed_antenna, antenna))
        return graph

    def moved(self, shared: Mapping[int, FloatArray]) -> "Sensors":
        """With what the optimiser found."""
        if not shared:
            return self
        lag = self.lag_s + (float(shared[LAG][0]) if self.lag_sigma_s else 0.0)
        antenna = shared[ANTENNA] if self.antenna_sigma_m else self.camera_p_antenna
        return replace(self, lag_s=lag, camera_p_antenna=antenna)
