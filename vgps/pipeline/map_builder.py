"""A map that is being built: its newest image, when stage C is due, standing frames, gaps in tracking."""

from dataclasses import dataclass

import numpy as np

from vgps.geometry import interpolate_poses
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, NewFrame, NewView
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import FloatArray, Frame, GrayImage
from vgps.tracking.frame_tracker import TrackingResult
from vgps.tracking.relocaliser import Relocaliser

_STANDING_SIGMA = np.array([1e-3] * 3 + [1e-2] * 3)  # rad and map units, before the map has poses
_LONGEST_PREDICTION = 1.5  # frame intervals over which the velocity is believed


@dataclass
class MapBuilder:
    """A map, and what is needed to go on with it.

    Attributes:
        local_map: The map.
        key: Image of its newest view.
        started: Whether two views have started it.
        since_window: Moving frames since stage C last began.
        window_at: Number of frames of the video at that time.
        failures: Failures of stage C in a row.
        moved: Whether a moving frame came since stage C was last considered.
        relocaliser: Looks for the map while it is lost.
    """

    local_map: LocalMap
    key: GrayImage
    started: bool = False
    since_window: int = 0
    window_at: int = 0
    failures: int = 0
    moved: bool = False
    relocaliser: Relocaliser | None = None

    def add_pose(self, t_s: float, world_T_camera: FloatArray) -> None:
        """Append the next frame's pose, NaN if it is unknown."""
        self.local_map.apply(MapUpdate(frames=(NewFrame(t_s, world_T_camera),)))

    def add_view(self, frame: Frame, tracked: TrackingResult) -> None:
        """Make the newest frame a view, from which features are followed now."""
        view = NewView(frame.index, tracked.raw_uv_px, tracked.uv_px, tracked.found)
        self.local_map.apply(MapUpdate(view=view))
        self.key = frame.gray

    def stands(self, tracked: TrackingResult, static_px: float) -> bool:
        """Return whether features are where the newest view has them, in the median."""
        moved = np.linalg.norm(tracked.uv_px - self.local_map.last_uv_px, axis=1)[tracked.found]
        return len(moved) > 0 and float(np.median(moved)) < static_px

    def hold(self, frame: int, tracked: TrackingResult) -> None:
        """Hold a posed frame that stands where the newest view does."""
        if tracked.world_T_camera is None or tracked.pose_sigma is None:
            return
        key = int(self.local_map.view_frames[-1])
        relative = np.linalg.inv(self.local_map.pose(key)) @ tracked.world_T_camera
        held = ZeroMotion(frame, key, relative, np.maximum(tracked.pose_sigma, 1e-6))
        self.local_map.apply(MapUpdate(zero_motions=(held,)))

    def hold_before_start(self, frame: int) -> None:
        """Hold a frame that stands where the newest view does, which has no pose yet."""
        key = int(self.local_map.view_frames[-1])
        self.local_map.apply(MapUpdate(zero_motions=(ZeroMotion(frame, key, np.eye(4), _STANDING_SIGMA),)))

    def predict(self, now_s: float) -> FloatArray:
        """Return the pose (4, 4) at a time, at constant velocity from the last two frames."""
        poses, t_s = self.local_map.poses, self.local_map.t_s
        last, before = poses[-1], poses[-2]
        if not np.isfinite(before[0, 0]):
            return np.asarray(last)
        intervals = (now_s - t_s[-1]) / (t_s[-1] - t_s[-2])
        if intervals >= _LONGEST_PREDICTION:
            return np.asarray(last)
        return np.asarray(last @ np.linalg.inv(before) @ last)

    def bridge(self, t_s: FloatArray, frame: int, world_T_camera: FloatArray) -> str | None:
        """Pose the frames since the newest one by interpolation to ``frame``'s pose.

        Args:
            t_s: Times of all frames of the video so far.
            frame: The frame that was found again.
            world_T_camera: (4, 4) its pose.

        Returns:
            A warning, if there are any such frames.
        """
        last = self.local_map.next_frame - 1
        if frame == last + 1:
            return None
        times = t_s[last : frame + 1]
        ends = np.stack([self.local_map.poses[-1], world_T_camera])
        between = interpolate_poses(times[[0, -1]], ends, times[1:-1])
        frames = (NewFrame(float(t), pose, True) for t, pose in zip(times[1:-1], between, strict=True))
        self.local_map.apply(MapUpdate(frames=tuple(frames)))
        lost = f"from frame {last + 1} to {frame - 1}"
        return f"tracking was lost {lost} and found again; these frames are bridged"
