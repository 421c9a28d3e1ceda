"""Changes of a local map, as stages A to C return them and :meth:`LocalMap.apply` takes them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Similarity:
    """Similarity from map to world: ``x_world = scale * world_R_map x_map + world_p_map``."""

    scale: float
    world_R_map: FloatArray
    world_p_map: FloatArray

    def points(self, map_p: FloatArray) -> FloatArray:
        """Return points (n, 3) of the map in the world."""
        return np.asarray(self.scale * map_p @ self.world_R_map.T + self.world_p_map)

    def poses(self, map_T_camera: FloatArray) -> FloatArray:
        """Return poses (n, 4, 4) of the map in the world."""
        world_T_camera = map_T_camera.copy()
        world_T_camera[:, :3, :3] = self.world_R_map @ map_T_camera[:, :3, :3]
        world_T_camera[:, :3, 3] = self.points(map_T_camera[:, :3, 3])
        return world_T_camera


@dataclass(frozen=True)
class NewFrame:
    """A frame to append: its time, its pose (4, 4), NaN if unknown, and whether it was bridged."""

    t_s: float
    world_T_camera: FloatArray
    bridged: bool = False


@dataclass(frozen=True)
class NewView:
    """A frame's observations of the followed features.

    Attributes:
        frame: Index of the frame.
        raw_uv_px, uv_px: (N, 2) in the distorted and in the undistorted image.
        found: (N,) whether each was found; the others are no longer followed.
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
class ReturnedFeatures:
    """Features ``ids`` (n,) of a map that the newest view shows again, at ``raw_uv_px``, ``uv_px`` (n, 2)."""

    ids: IntArray
    raw_uv_px: FloatArray
    uv_px: FloatArray


@dataclass(frozen=True)
class Positions:
    """Positions ``points`` (n, 3) and reliabilities ``sigma_px`` (n,) of features ``ids`` (n,).

    NaN removes a feature's position.
    """

    ids: IntArray
    points: FloatArray
    sigma_px: FloatArray

    def with_others(self, others: "Positions") -> "Positions":
        """Return these positions and, of the others, those of features that are not among these."""
        more = ~np.isin(others.ids, self.ids)
        return Positions(
            np.concatenate([self.ids, others.ids[more]]),
            np.concatenate([self.points, others.points[more]]),
            np.concatenate([self.sigma_px, others.sigma_px[more]]),
        )


@dataclass(frozen=True, kw_only=True)
class MapUpdate:
    """A change of a local map, applied field by field from top to bottom.

    Attributes:
        undistorted: Gives where another calibration sees undistorted pixels (n, 2), for all observations.
        similarity: Similarity to apply to the whole map.
        aligned: Whether the map's world is the world of the GPS fixes from now on.
        end: Frames from this one on leave the map, which has no view of them; None for none.
        frames: New frames, in order.
        first_frame, poses: Poses (n, 4, 4) that replace those from frame ``first_frame`` on.
        bending: (n,) bending of these frames (:attr:`LocalMap.bending`); it stays as it was where it is NaN.
        view: Observations of the newest frame.
        returned: Features that are followed again from the newest view on.
        positions: New positions of features.
        more_moving_views: (N,) what is added to ``moving_views`` of the followed features.
        renew_full_tracks: Whether features whose history is full continue as new ones.
        features: Features that start in the newest view.
        zero_motions: Constraints of standing frames; they replace earlier ones of the same frames.
    """

    undistorted: Callable[[FloatArray], FloatArray] | None = None
    similarity: Similarity | None = None
    aligned: bool = False
    end: int | None = None
    frames: tuple[NewFrame, ...] = ()
    first_frame: int = 0
    poses: FloatArray | None = None
    bending: FloatArray | None = None
    view: NewView | None = None
    returned: ReturnedFeatures | None = None
    positions: Positions | None = None
    more_moving_views: IntArray | None = None
    renew_full_tracks: bool = False
    features: NewFeatures | None = None
    zero_motions: tuple[ZeroMotion, ...] = ()
