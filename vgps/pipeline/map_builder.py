"""A map that is being built: what of it is standing still, where its next frame will be, gaps in between."""

from dataclasses import dataclass

import numpy as np

from vgps.geometry import interpolate_poses
from vgps.mapping.local_map import LocalMap
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import FloatArray, Frame, GrayImage
from vgps.tracking.frame_tracker import TrackingResult
from vgps.tracking.relocaliser import Relocaliser

_STANDING_SIGMA = np.array([1e-3] * 3 + [1e-2] * 3)


@dataclass
class MapBuilder:
    """A map, and what is needed to go on with it.

    Attributes:
        local_map: The map.
        key: Image of its newest view.
        started: Whether two views have begun it.
        since_window: Moving frames since stage C last began.
        window_at: Frames of the video there were then.
        failures: Of stage C, in a row.
        moved: Whether a moving frame came since it was last refined.
        relocaliser: What looks for it while it is lost.
    """

    local_map: LocalMap
    key: GrayImage
    started: bool = False
    since_window: int = 0
    window_at: int = 0
    failures: int = 0
    moved: bool = False
    relocaliser: Relocaliser | None = None

    def push(self, frame: Frame, tracked: TrackingResult) -> None:
        """A new view, from which features are followed now."""
        self.local_map.push_view(frame.index, tracked.raw_uv_px, tracked.uv_px, tracked.found)
        self.key = frame.gray

    def stands(self, tracked: TrackingResult, static_px: float) -> bool:
        """Whether features are where the newest view has them, in the median."""
        moved = np.linalg.norm(tracked.uv_px - self.local_map.last_uv_px, axis=1)[tracked.found]
        return len(moved) > 0 and float(np.median(moved)) < static_px

    def tie(self, frame: int, tracked: TrackingResult) -> None:
        """A posed frame that stands where the newest view does."""
        if tracked.world_T_camera is None or tracked.pose_sigma is None:
            return
        key = int(self.local_map.view_frames[-1])
        relative = np.linalg.inv(self.local_map.pose(key)) @ tracked.world_T_camera
        self.local_map.zero_motions.append(
            ZeroMotion(frame, key, relative, np.maximum(tracked.pose_sigma, 1e-6))
        )

    def tie_before_start(self, frame: int) -> None:
        """A frame that stands where the newest view does, which has no pose yet."""
        key = int(self.local_map.view_frames[-1])
        self.local_map.zero_motions.append(ZeroMotion(frame, key, np.eye(4), _STANDING_SIGMA))

    def predicted(self, t_s: FloatArray, now_s: float) -> FloatArray:
        """Pose (4, 4) at constant velocity from the last two frames; ``t_s`` of all frames so far."""
        last, before = self.local_map.poses[-1], self.local_map.poses[-2]
        if not np.isfinite(before[0, 0]):
            return np.asarray(last)
        index = self.local_map.next_frame - 1
        share = (now_s - t_s[index]) / (t_s[index] - t_s[index - 1])
        return np.asarray(last @ np.linalg.inv(before) @ last) if share < 1.5 else np.asarray(last)

    def bridge(self, t_s: FloatArray, frame: int, world_T_camera: FloatArray) -> str | None:
        """Frames since the newest one get poses on the way to ``frame``'s; in words, if there are any."""
        last = self.local_map.next_frame - 1
        if frame == last + 1:
            return None
        times = t_s[last : frame + 1]
        ends = np.stack([self.local_map.poses[-1], world_T_camera])
        for pose in interpolate_poses(times[[0, -1]], ends, times[1:-1]):
            self.local_map.bridged.add(self.local_map.next_frame)
            self.local_map.append_pose(pose)
        between = f"from frame {last + 1} to {frame - 1}"
        return f"tracking was lost {between} and found again; these frames are bridged"
