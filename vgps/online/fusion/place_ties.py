"""Poses that places seen again give to the live path."""

from dataclasses import dataclass, fields

import numpy as np

from vgps.model import BoolArray, FloatArray

# Squared sigmas (95 % of six Gaussian errors) beyond which a place counts less and less, by Cauchy's loss: it
# may be a look-alike.
ROBUST = 12.6


@dataclass(frozen=True, kw_only=True)
class PlaceTies:
    """Frames (K,) in which landmarks of an earlier visit are found.

    The errors of a pose are those of the earlier visit, which all frames of a visit share; so only the newest
    of a visit takes part.

    Attributes:
        t_s: (K,) their times.
        world_T_camera: (K, 4, 4) poses by these landmarks.
        sigma: (K, 6) standard deviations of position, metres, and rotation, radians, about east, north, up.
    """

    t_s: FloatArray
    world_T_camera: FloatArray
    sigma: FloatArray

    @classmethod
    def none(cls) -> "PlaceTies":
        """Return no ties."""
        return cls(t_s=np.zeros(0), world_T_camera=np.zeros((0, 4, 4)), sigma=np.zeros((0, 6)))

    def where(self, kept: BoolArray) -> "PlaceTies":
        """Return the ties that a mask (K,) keeps."""
        return PlaceTies(**{one.name: getattr(self, one.name)[kept] for one in fields(self)})
