"""What stages A to C change in a local map: the only thing that :meth:`LocalMap.apply` takes."""

from dataclasses import dataclass

import numpy as np

from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Similarity:
    """From map to world: ``x_world = scale * world_R_map x_map + world_p_map``."""

    scale: float
    world_R_map: FloatArray
    world_p_map: FloatArray


@dataclass(frozen=True)
class NewFrame:
    """A frame at the end of a map: its time, its pose (4, 4), NaN if unknown, and whether it was bridged."""

    t_s: float
    world_T_camera: FloatArray
    bridged: bool = False


@dataclass(frozen=True)
class NewView:
    """A frame's observations of the followed features.

    Attributes:
        frame: Index of the frame.
        raw_uv_px, uv_px: (N, 2) in the distorted and in the undistorted image.
        found: (N,) whether each was found; the others are followed no longer.
    """

    frame: int
    raw_uv_px: FloatArray
    uv_px: FloatArray
    found: BoolArray


@dataclass(frozen=True)
class NewFeatures:
    """Features that start in the newest view: ``raw_uv_px``, ``uv_px`` (n, 2), luminance ``gray`` (n,)."""

    raw_uv_px: FloatArray
    uv_px: FloatArray
    gray: np.ndarray


@dataclass(frozen=True)
class Positions:
    """Positions ``points`` (n, 3) and reliabilities ``sigma_px`` (n,) of features ``ids`` (n,).

    NaN takes a feature's position away.
    """

    ids: IntArray
    points: FloatArray
    sigma_px: FloatArray

    @classmethod
    def removed(cls, ids: IntArray) -> "Positions":
        """Features (n,) that lose their position."""
        return cls(ids, np.full((len(ids), 3), np.nan), np.full(len(ids), np.nan))


@dataclass(frozen=True, kw_only=True)
class MapUpdate:
    """A change of a local map. Fields take effect from top to bottom; what is left out stays.

    Attributes:
        similarity: Moves the whole map.
        aligned: The map's world is the world of the GPS fixes from now on.
        frames: New frames, in order.
        first_frame, poses: Poses (n, 4, 4) that replace those from frame ``first_frame`` on.
        view: The newest frame's observations.
        positions: Of features.
        renew_full_tracks: Features whose history is full go on as new ones.
        features: Features that start in the newest view.
        zero_motions: Constraints of standing frames, in place of earlier ones of the same frames.
    """

    similarity: Similarity | None = None
    aligned: bool = False
    frames: tuple[NewFrame, ...] = ()
    first_frame: int = 0
    poses: FloatArray | None = None
    view: NewView | None = None
    positions: Positions | None = None
    renew_full_tracks: bool = False
    features: NewFeatures | None = None
    zero_motions: tuple[ZeroMotion, ...] = ()
