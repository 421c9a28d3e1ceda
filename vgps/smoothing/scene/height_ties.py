"""What the camera's height above the ground says of the path, as factors of stage D and as its scale."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Self

import gtsam
import numpy as np
import numpy.typing as npt
from gtsam.symbol_shorthand import X

from factors import camera_height_factor
from vgps.model import FloatArray, IntArray

CAMERA_HEIGHT = gtsam.symbol("h", 0)


@dataclass(frozen=True, kw_only=True)
class HeightTies:
    """Stretches of a path whose length is known in heights of the camera.

    Attributes:
        first, last: (K,) frames at the ends of a stretch.
        ratio: (K,) height over the distance between them, as the video has it.
        sigma: (K,) standard deviations of its logarithm.
        prior_m: (2,) the height and its standard deviation.
    """

    first: IntArray
    last: IntArray
    ratio: FloatArray
    sigma: FloatArray
    prior_m: FloatArray

    @property
    def scale_sigma(self) -> float:
        """Standard deviation of the logarithm of the path's scale by them alone."""
        return float(np.hypot(self.prior_m[1] / self.prior_m[0], np.sum(self.sigma**-2.0) ** -0.5))

    def shared(self) -> dict[int, FloatArray]:
        """Return the height (1,), metres, as a vector that all frames share."""
        return {CAMERA_HEIGHT: self.prior_m[:1]}

    def graph(self) -> gtsam.NonlinearFactorGraph:
        """Return a factor for each stretch, and the prior of the height."""
        graph = gtsam.NonlinearFactorGraph()
        columns = (self.first, self.last, self.ratio, self.sigma)
        for first, last, ratio, sigma in zip(*(column.tolist() for column in columns), strict=True):
            graph.push_back(camera_height_factor((X(first), X(last)), CAMERA_HEIGHT, ratio, sigma))
        prior = gtsam.noiseModel.Isotropic.Sigma(1, float(self.prior_m[1]))
        graph.push_back(gtsam.PriorFactorVector(CAMERA_HEIGHT, self.prior_m[:1], prior))
        return graph

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return them as arrays for a run folder."""
        return {f"heights.{name}": value for name, value in vars(self).items()}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, npt.NDArray[Any]]) -> Self | None:
        """Return the ties among the arrays of a run folder, if there are any."""
        if "heights.first" not in arrays:
            return None
        return cls(**{column.name: arrays[f"heights.{column.name}"] for column in fields(cls)})
