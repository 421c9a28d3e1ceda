"""The loop A -> B -> C over frames as they come, the same one offline and online."""

from dataclasses import dataclass

import numpy as np

from vgps.config import Config
from vgps.interpolation import interpolate_poses
from vgps.local_map import NO_CONTROLS, Controls, LocalMap, StaticTie
from vgps.model import Camera, FloatArray, Frame, GrayImage
from vgps.seconds import Seconds
from vgps.smoothing.drift import correct_drift
from vgps.smoothing.fixes import Fixes
from vgps.smoothing.judging import Judgement, judge_on_path, judges
from vgps.smoothing.lag import settle_lag
from vgps.smoothing.sensors import Sensors
from vgps.smoothing.start import align_to_control, try_alignment
from vgps.smoothing.window import contradicts, optimise_window
from vgps.tracking.bootstrap import TwoViewStart
from vgps.tracking.control import control_poses
from vgps.tracking.frame_tracker import FrameTracker, Tracked
from vgps.tracking.mapper import Mapper
from vgps.tracking.relocaliser import Relocaliser

_UNKNOWN = np.full((4, 4), np.nan)
_STANDING_SIGMA = np.array([1e-3] * 3 + [1e-2] * 3)


@dataclass
class _Growing:
    """A map that is being built, the image of its newest view, and what is needed once it is lost."""

    local_map: LocalMap
    key: GrayImage
    started: bool = False
    since_window: int = 0
    relocaliser: Relocaliser | None = None


class Sequence:
    """Tracks, maps and optimises a window, frame by frame.

    Attributes:
        t_s: Times of the frames so far.
        maps: Finished and current maps in order of time; each holds the poses of its own frames.
        warnings: What happened on the way that a user should know.
        judgement: Of all fixes, as far as they have been judged.
        sensors: The lag of the fixes as the path so far shows it, and the lever arm.
    """

    def __init__(
        self,
        camera: Camera,
        camera_p_antenna: FloatArray,
        fixes: Fixes,
        config: Config,
        controls: Controls = NO_CONTROLS,
    ) -> None:
        self._controls = controls
        self._control_poses = control_poses(controls, camera.K)
        self._camera, self._antenna, self._fixes, self._config = camera, camera_p_antenna, fixes, config
        rng = np.random.default_rng(config.seed)
        self._rng = rng
        self._tracker = FrameTracker(camera, config.tracking, config.mapping, rng)
        self._mapper = Mapper(camera, config.tracking, config.mapping, rng)
        self._start = TwoViewStart(camera.K, config.start, config.tracking, rng)
        self._current: _Growing | None = None
        self._next: _Growing | None = None
        self._times: list[float] = []
        self.maps: list[LocalMap] = []
        self.warnings: list[str] = []
        self.seconds = Seconds()
        self.judgement = Judgement.none(len(fixes))
        self.sensors = Sensors.begin(camera_p_antenna, config.sensors)

    @property
    def t_s(self) -> FloatArray:
        """(F,) times of the frames so far."""
        return np.array(self._times)

    def add_frame(self, frame: Frame) -> None:
        """The next frame of the video."""
        self._times.append(frame.t_s)
        if self._current is None or not self._current.started:
            self._current = self._grow_start(self._current, frame)
        else:
            self._track(self._current, frame)
        if self._current is not None and self._current.started and self._current.local_map not in self.maps:
            self.maps.append(self._current.local_map)

    def _grow_start(self, growing: _Growing | None, frame: Frame) -> _Growing | None:
        """Follow features without positions until two views begin the map; start over when they are lost."""
        with self.seconds.measure("start"):
            if growing is None:
                return self._first_view(frame)
            local_map = growing.local_map
            tracked = self._tracker.follow(local_map, growing.key, frame.gray)
            if tracked.found.sum() < self._config.start.min_inliers:
                return self._first_view(frame)
            local_map.append_pose(_UNKNOWN)
            if self._standing(local_map, tracked):
                key = int(local_map.view_frames[-1])
                local_map.static_ties.append(StaticTie(frame.index, key, np.eye(4), _STANDING_SIGMA))
                return growing
            self._push(growing, frame, tracked)
            growing.started = self._start.try_start(local_map)
            self._mapper.refill(local_map, frame.gray)
        if growing.started:
            local_map.pose_standing_frames()
            self._window(growing)
        return growing

    def _first_view(self, frame: Frame) -> _Growing | None:
        local_map = LocalMap(frame.index, self._config.mapping.max_track_frames)
        local_map.append_pose(_UNKNOWN)
        nothing = np.zeros((0, 2))
        local_map.push_view(frame.index, nothing, nothing, np.zeros(0, dtype=bool))
        self._mapper.refill(local_map, frame.gray)
        if len(local_map.ids) < self._config.start.min_inliers:
            return None
        return _Growing(local_map, frame.gray)

    def _track(self, growing: _Growing, frame: Frame) -> None:
        local_map = growing.local_map
        predicted = self._predict(local_map, frame.t_s)
        with self.seconds.measure("track"):
            tracked = self._tracker.track(local_map, growing.key, frame.gray, predicted)
            if tracked.world_T_camera is None:
                tracked = self._find_again(growing, frame, predicted)
        if tracked.world_T_camera is None:
            self._lost(frame)
            return
        self._found_again(growing, frame, tracked.world_T_camera)
        local_map.append_pose(tracked.world_T_camera)
        if self._standing(local_map, tracked):
            self._tie(local_map, frame.index, tracked)
            return
        self._push(growing, frame, tracked)
        with self.seconds.measure("map"):
            self._mapper.update(local_map, frame.gray)
        growing.since_window += 1
        if not local_map.aligned:
            self._align(growing)
        if growing.since_window >= self._config.window.every_frames:
            self._window(growing)

    def _push(self, growing: _Growing, frame: Frame, tracked: Tracked) -> None:
        growing.local_map.push_view(frame.index, tracked.raw_uv_px, tracked.uv_px, tracked.found)
        growing.key = frame.gray

    def _standing(self, local_map: LocalMap, tracked: Tracked) -> bool:
        moved = np.linalg.norm(tracked.uv_px - local_map.last_uv_px, axis=1)[tracked.found]
        return len(moved) > 0 and float(np.median(moved)) < self._config.tracking.static_px

    def _tie(self, local_map: LocalMap, frame: int, tracked: Tracked) -> None:
        if tracked.world_T_camera is None or tracked.pose_sigma is None:
            return
        key = int(local_map.view_frames[-1])
        relative = np.linalg.inv(local_map.pose(key)) @ tracked.world_T_camera
        local_map.static_ties.append(StaticTie(frame, key, relative, np.maximum(tracked.pose_sigma, 1e-6)))

    def _predict(self, local_map: LocalMap, t_s: float) -> FloatArray:
        """Pose at constant velocity from the last two frames."""
        last, before = local_map.poses[-1], local_map.poses[-2]
        if not np.isfinite(before[0, 0]):
            return np.asarray(last)
        index = local_map.next_frame - 1
        share = (t_s - self._times[index]) / (self._times[index] - self._times[index - 1])
        return np.asarray(last @ np.linalg.inv(before) @ last) if share < 1.5 else np.asarray(last)

    def _align(self, growing: _Growing) -> None:
        with self.seconds.measure("align"):
            enough = self._config.start.min_control_travel_m
            if align_to_control(growing.local_map, self._control_poses, enough):
                note: list[str] | None = []
            else:
                note = try_alignment(growing.local_map, self.t_s, self._fixes, self._antenna, self._config)
        if note is not None:
            self.warnings.extend(note)
            self._window(growing)

    def _window(self, growing: _Growing) -> None:
        """Stage C; first, where the fixes contradict what will be held, its drift is taken out.

        Otherwise the window would tear to reach the fixes, and the tear would stay.
        """
        growing.since_window = 0
        local_map, t_s = growing.local_map, self.t_s
        with self.seconds.measure("drift"):
            if local_map.aligned:
                self._settle_lag(local_map)
            if local_map.aligned and self._contradicted(local_map):
                self._judge(local_map)
                if self._contradicted(local_map):
                    correct_drift(local_map, t_s, self._believed(), self._antenna, self._config)
        fixes = self._believed()
        with self.seconds.measure("window"):
            optimise_window(
                local_map, t_s, self._camera.K, fixes, self._antenna, self._config, self._controls
            )

    def _believed(self) -> Fixes:
        """The fixes so far, as they are judged, at the times at which they were true."""
        return self.judgement.applied(self._in_time).until(self._times[-1])

    @property
    def _in_time(self) -> Fixes:
        return self._fixes.earlier(self.sensors.lag_s)

    def _path(self, local_map: LocalMap) -> tuple[FloatArray, FloatArray]:
        """Poses of a map from its first posed frame on, and their times."""
        first = local_map.first_posed
        poses = local_map.poses[first - local_map.first_frame :]
        return poses, self.t_s[first : first + len(poses)]

    def _settle_lag(self, local_map: LocalMap) -> None:
        """The clock's lag as the path so far shows it; were it left in, the window would bend to it."""
        believed = self.judgement.applied(self._fixes)
        self.sensors, _ = settle_lag(self.sensors, *self._path(local_map), believed, self._config.sensors)

    def _contradicted(self, local_map: LocalMap) -> bool:
        return contradicts(local_map, self.t_s, self._believed(), self._antenna, self._config)

    def _judge(self, local_map: LocalMap) -> None:
        """All fixes since the map began, anew: what came later may reverse a verdict."""
        if not judges(self._config):
            return
        found = judge_on_path(*self._path(local_map), self._in_time, self._antenna, self._config)
        self.judgement = self.judgement.updated(found)

    def _find_again(self, growing: _Growing, frame: Frame, predicted: FloatArray) -> Tracked:
        """Look for the features of the last good frame anywhere in this one."""
        if growing.relocaliser is None:
            growing.relocaliser = Relocaliser(
                self._camera, self._config.tracking, self._rng, growing.key, growing.local_map
            )
        pose = growing.relocaliser.find(frame.gray, predicted)
        if pose is None:
            nothing = np.zeros(len(growing.local_map.ids), dtype=bool)
            return Tracked(growing.local_map.raw_uv_px, growing.local_map.last_uv_px, nothing)
        return self._tracker.track(growing.local_map, growing.key, frame.gray, pose)

    def _lost(self, frame: Frame) -> None:
        """While the old map is lost a new one may begin; once it stands the old one is closed."""
        self._next = self._grow_start(self._next, frame)
        if self._next is None or not self._next.started or self._current is None:
            return
        last = self._current.local_map.next_frame - 1
        begin = self._next.local_map.first_posed
        self.warnings.append(
            f"tracking was lost after frame {last} ({self._times[last]:.2f} s) and could not be bridged; "
            f"a new map begins at frame {begin} ({self._times[begin]:.2f} s)"
        )
        self._current, self._next = self._next, None

    def _found_again(self, growing: _Growing, frame: Frame, pose: FloatArray) -> None:
        """Frames between the last good one and this one get poses in between."""
        growing.relocaliser, self._next = None, None
        local_map = growing.local_map
        last = local_map.next_frame - 1
        if frame.index == last + 1:
            return
        t_s = np.array(self._times[last : frame.index + 1])
        between = interpolate_poses(t_s[[0, -1]], np.stack([local_map.poses[-1], pose]), t_s[1:-1])
        for bridged in between:
            local_map.bridged.add(local_map.next_frame)
            local_map.append_pose(bridged)
        self.warnings.append(
            f"tracking was lost from frame {last + 1} to {frame.index - 1} and found again; "
            "these frames are bridged"
        )
