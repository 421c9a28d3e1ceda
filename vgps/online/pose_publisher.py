"""State, corrected pose, smooth pose and events of the newest frame."""

from dataclasses import dataclass

import numpy as np

from vgps.config import OnlineConfig
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import Similarity
from vgps.model import FloatArray
from vgps.online.blending import Blender
from vgps.online.estimate import OnlineEvent, OnlineState
from vgps.online.fusion.inertial_bridge import BridgedPose
from vgps.pipeline.frame_pipeline import FramePipeline

_NO_POSE = np.full((4, 4), np.nan)


@dataclass(frozen=True)
class PublishedPose:
    """Published state of a frame.

    Attributes:
        state: How it was posed.
        global_T_camera, local_T_camera: (4, 4) corrected and smooth pose; NaN without one.
        events: Events since the previous frame.
    """

    state: OnlineState
    global_T_camera: FloatArray
    local_T_camera: FloatArray
    events: tuple[OnlineEvent, ...]

    @property
    def posed(self) -> bool:
        """Whether there is a pose."""
        return bool(np.isfinite(self.global_T_camera[0, 0]))


@dataclass(frozen=True)
class _Last:
    """The previous frame as published."""

    frame: int
    t_s: float
    global_T_camera: FloatArray


class PosePublisher:
    """Publisher of the newest frame of a frame pipeline."""

    def __init__(self, frame_pipeline: FramePipeline, config: OnlineConfig) -> None:
        self._frame_pipeline, self._config = frame_pipeline, config
        self._blender = Blender(config)
        self._map: LocalMap | None = None
        self._last: _Last | None = None
        self._state = OnlineState.STARTING

    def publish(
        self, frame: int, to_world: Similarity | None, bridged: BridgedPose | None = None
    ) -> PublishedPose:
        """Return the published state of the newest frame.

        Args:
            frame: Its index.
            to_world: Where the newest map lies in the world; None if that is not known yet.
            bridged: The pose by the IMU after the end of the map; None without.
        """
        current, t_s = self._frame_pipeline.current, float(self._frame_pipeline.t_s[frame])
        state, pose = self._newest(current, to_world, frame)
        if bridged is not None:
            state, pose = OnlineState.BRIDGED, bridged.world_T_camera
        events = self._changes(state, t_s)
        if current is not self._map or not np.isfinite(pose[0, 0]):
            self._last, self._map = None, current
        if not np.isfinite(pose[0, 0]):
            return PublishedPose(state, _NO_POSE, _NO_POSE, tuple(events))
        if self._last is None or current is None or to_world is None:
            self._blender.reset()
            smooth = pose
        else:
            if self._last.frame < current.next_frame or bridged is None:
                events += self._corrections(self._last, self._pose(current, to_world, self._last.frame), t_s)
            smooth = self._blender.advance(pose, t_s - self._last.t_s)
        self._last = _Last(frame, t_s, pose)
        return PublishedPose(state, pose, smooth, tuple(events))

    def _newest(
        self, current: LocalMap | None, to_world: Similarity | None, frame: int
    ) -> tuple[OnlineState, FloatArray]:
        if current is None:
            return OnlineState.STARTING, _NO_POSE
        tracked = current.next_frame > frame
        if to_world is None:
            return OnlineState.UNALIGNED if tracked else OnlineState.LOST, _NO_POSE
        pose = self._pose(current, to_world, frame)
        if not np.isfinite(pose[0, 0]):
            return OnlineState.LOST, _NO_POSE
        return OnlineState.TRACKED if tracked else OnlineState.BRIDGED, pose

    def _pose(self, current: LocalMap, to_world: Similarity, frame: int) -> FloatArray:
        """Return the pose in the world, or for a short time after the map's end an extrapolation at
        constant velocity."""
        pose = self._map_pose(current, frame)
        pose[:3, 3] = to_world.scale * to_world.world_R_map @ pose[:3, 3] + to_world.world_p_map
        pose[:3, :3] = to_world.world_R_map @ pose[:3, :3]
        return pose

    def _map_pose(self, current: LocalMap, frame: int) -> FloatArray:
        t_s, last = self._frame_pipeline.t_s, current.next_frame - 1
        if frame <= last:
            return current.pose(frame).copy()
        away_s = float(t_s[frame] - t_s[last])
        if away_s > self._config.bridge_s or len(current.poses) < 2:
            return _NO_POSE.copy()
        before, pose = current.poses[-2], current.poses[-1].copy()
        pose[:3, 3] += away_s / (t_s[last] - t_s[last - 1]) * (pose[:3, 3] - before[:3, 3])
        return np.asarray(pose)

    def _corrections(self, last: _Last, now: FloatArray, t_s: float) -> list[OnlineEvent]:
        if not np.isfinite(now[0, 0]):
            self._blender.reset()
            return []
        self._blender.correct(last.global_T_camera, now)
        moved_m = float(np.linalg.norm(now[:3, 3] - last.global_T_camera[:3, 3]))
        if moved_m < self._config.correction_m:
            return []
        return [OnlineEvent(t_s, "corrected", f"the pose was moved by {moved_m:.1f} m", {"moved_m": moved_m})]

    def _changes(self, state: OnlineState, t_s: float) -> list[OnlineEvent]:
        before, self._state = self._state, state
        posed = {OnlineState.TRACKED, OnlineState.BRIDGED}
        events = []
        if state is OnlineState.TRACKED and before not in posed | {OnlineState.LOST}:
            events.append(OnlineEvent(t_s, "aligned", "scale, heading and position are known"))
        if state is OnlineState.LOST and before is not state:
            events.append(OnlineEvent(t_s, "lost", "tracking is lost: too few features are matched"))
        if before in {OnlineState.LOST, OnlineState.BRIDGED} and state is OnlineState.TRACKED:
            events.append(OnlineEvent(t_s, "found", "tracking continues"))
        return events
