"""What is known of the antenna's place in the camera while the video runs."""

from dataclasses import dataclass

import numpy as np

from vgps.model import FloatArray

_HELD_M = 1e-4  # standard deviation of a lever arm that was measured


@dataclass(frozen=True)
class LeverArm:
    """The lever arm as a Gaussian.

    Attributes:
        camera_p_antenna: (3,) metres.
        covariance: (3, 3) square metres.
    """

    camera_p_antenna: FloatArray
    covariance: FloatArray

    @classmethod
    def within(cls, camera_p_antenna: FloatArray, sigma_m: float = 0.0) -> "LeverArm":
        """Return a lever arm with the same standard deviation on each axis; a measured one is held."""
        return cls(camera_p_antenna, max(sigma_m, _HELD_M) ** 2 * np.eye(3))

    @property
    def sigma_m(self) -> FloatArray:
        """(3,) standard deviations."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance)))
