"""What stage A found in one frame."""

from dataclasses import dataclass, replace

from vgps.geometry import reprojection_inliers
from vgps.model import BoolArray, FloatArray
from vgps.tracking.corners import is_shown
from vgps.tracking.pose import Correspondences


@dataclass(frozen=True, kw_only=True)
class TrackingResult:
    """Observations of the map's followed features in one frame, and the frame's pose unless it is lost.

    Attributes:
        raw_uv_px, uv_px: (N, 2) in the distorted and in the undistorted image.
        found: (N,) whether each feature was found.
        lens: (N, 2, 2) from :mod:`vgps.lens_jacobian`; None for a pinhole.
        world_T_camera: (4, 4), or None if the frame is lost.
        pose_sigma: (6,) standard deviations [rotation rad; translation], with the features held.
    """

    raw_uv_px: FloatArray
    uv_px: FloatArray
    found: BoolArray
    lens: FloatArray | None = None
    world_T_camera: FloatArray | None = None
    pose_sigma: FloatArray | None = None

    def shown_by(self, mask: BoolArray | None) -> "TrackingResult":
        """Return the result without features where a mask (H, W) does not show the scene."""
        return replace(self, found=self.found & is_shown(mask, self.raw_uv_px)) if mask is not None else self

    def agrees(
        self, K: FloatArray, world_T_camera: FloatArray, points: FloatArray, limit_px: float
    ) -> BoolArray:
        """Return whether the observations agree with points (N, 3) seen from a pose."""
        return reprojection_inliers(K, world_T_camera, points, self.uv_px, limit_px, self.lens)

    def matches(self, points: FloatArray, kept: BoolArray) -> Correspondences:
        """Return the observations that a mask (N,) keeps with their points (N, 3)."""
        return Correspondences(points, self.uv_px, self.lens).where(kept)

    def shifted(self, shift: FloatArray | None, sign: float = 1.0) -> "TrackingResult":
        """Return the result with its undistorted pixels shifted (N, 2)."""
        return self if shift is None else replace(self, uv_px=self.uv_px + sign * shift)
