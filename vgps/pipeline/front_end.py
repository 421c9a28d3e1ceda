"""The loop A -> B -> C over frames as they come, the same one offline and online."""

from collections.abc import Callable

import numpy as np

from vgps.config import Config
from vgps.errors import GeometryError
from vgps.gps.fix_buffer import FixBuffer
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import Sensors
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS, ControlObservations
from vgps.mapping.growing_array import GrowingArray
from vgps.mapping.local_map import LocalMap
from vgps.mapping.retention import RetentionPolicy, RetiredPoses, oldest, whole
from vgps.model import Camera, FloatArray, Frame
from vgps.pipeline.map_builder import MapBuilder
from vgps.pipeline.window_worker import WindowWorker
from vgps.runtime.timing import StageTimer
from vgps.tracking.bootstrap import TwoViewInitializer
from vgps.tracking.control_points import control_poses
from vgps.tracking.frame_tracker import FrameTracker, TrackingResult
from vgps.tracking.mapper import Mapper
from vgps.tracking.relocaliser import Relocaliser

_UNKNOWN = np.full((4, 4), np.nan)
_MOST_FAILURES = 3  # of stage C in a row, before a map is given up


class FramePipeline:
    """Tracks, maps and optimises a window, frame by frame.

    Attributes:
        t_s: Times of the frames so far.
        maps: Finished and current maps in order of time; each holds the poses of its own frames.
        warnings: What happened on the way that a user should know.
        fix_buffer: The fixes so far, their verdicts, their clock.

    Args:
        camera: Its lens.
        camera_p_antenna: (3,) metres.
        fixes: Those known from the start; more may be added at any time.
        config: Everything.
        controls: Observations of known points.
        memory: What to remember of long ago; everything if none is given.
    """

    def __init__(
        self,
        camera: Camera,
        camera_p_antenna: FloatArray,
        fixes: Fixes,
        config: Config,
        controls: ControlObservations = NO_CONTROL_OBSERVATIONS,
        memory: RetentionPolicy | None = None,
    ) -> None:
        self._camera, self._config, self._memory = camera, config, memory
        rng = np.random.default_rng(config.seed)
        self._rng = rng
        self._tracker = FrameTracker(camera, config.tracking, config.mapping, rng)
        self._mapper = Mapper(camera, config.tracking, config.mapping, rng)
        self._start = TwoViewInitializer(camera.K, config.start, config.tracking, rng)
        self._current: MapBuilder | None = None
        self._next: MapBuilder | None = None
        self._times = GrowingArray()
        self.maps: list[LocalMap] = []
        self.warnings: list[str] = []
        self.seconds = StageTimer()
        self.fix_buffer = FixBuffer(fixes, camera_p_antenna, config)
        poses = control_poses(controls, camera.K)
        self._refiner = WindowWorker(camera.K, self.fix_buffer, config, controls, poses, self.seconds)

    @property
    def t_s(self) -> FloatArray:
        """(F,) times of the frames so far."""
        return self._times.values

    @property
    def sensors(self) -> Sensors:
        """The lag of the fixes as the path so far shows it, and the lever arm."""
        return self.fix_buffer.sensors

    @property
    def current(self) -> LocalMap | None:
        """The map that newest frames join, once it stands."""
        return self._current.local_map if self._current is not None and self._current.started else None

    def add_fixes(self, fixes: Fixes) -> None:
        """More fixes; late ones, and in any order, land at their own times."""
        self.fix_buffer.add(fixes, float(self.t_s[-1]) if len(self._times) else -np.inf)

    def add_frame(self, frame: Frame) -> None:
        """The next frame of the video: its pose, then stage C if that is due."""
        self.track_frame(frame)
        self.refine()

    def track_frame(self, frame: Frame) -> None:
        """Stages A and B of the next frame; :meth:`refine` must come before the next one."""
        self._times.append(frame.t_s)
        if self._current is None or not self._current.started:
            self._current = self._grow_start(self._current, frame)
        else:
            self._track(self._current, frame)
        if self._current is not None and self._current.started and self._current.local_map not in self.maps:
            self.maps.append(self._current.local_map)

    def refine(self) -> None:
        """Alignment and stage C, where a moving frame since the last time makes them due.

        Stage C of a map that lies in the world works beside the frames that follow.
        """
        builder = self._current
        if builder is None or not builder.started:
            return
        delay = self._config.window.delay_frames
        if self._refiner.busy and len(self._times) >= builder.window_at + delay:
            self.settle()
        if not builder.moved:
            return
        builder.moved = False
        if not builder.local_map.aligned:
            self._align(builder)
        if builder.since_window < self._config.window.every_frames:
            return
        if delay == 0 or not builder.local_map.aligned:
            self._window(builder)
        elif not self._refiner.busy:
            builder.since_window, builder.window_at = 0, len(self._times)
            self._refiner.begin(builder.local_map, self.t_s)

    def settle(self) -> None:
        """Wait for stage C, if it is at work: to be called after the last frame."""
        builder = self._current
        if builder is not None and self._refiner.busy:
            self._attempt(builder, lambda: self._take_over(builder.local_map))

    def _take_over(self, local_map: LocalMap) -> list[str]:
        unknown, warnings = self._refiner.finish()
        with self.seconds.measure("map"):
            self._mapper.position(local_map, np.flatnonzero(np.isin(local_map.ids, unknown)))
        return warnings

    def forget(self) -> list[RetiredPoses]:
        """Let go of what lies further back than the memory, and give its poses."""
        if self._memory is None or not len(self._times):
            return []
        horizon_s = float(self.t_s[-1]) - self._memory.path_s
        current = self.current
        gone = [whole(local_map) for local_map in self.maps if local_map is not current]
        self.maps = [current] if current is not None else []
        for builder in (self._current, self._next):
            if builder is not None:
                part = oldest(builder.local_map, self.t_s, horizon_s, self._memory)
                gone += [part] if builder.started else []
        self.fix_buffer.forget(horizon_s)
        return [part for part in gone if len(part.poses)]

    def _grow_start(self, builder: MapBuilder | None, frame: Frame) -> MapBuilder | None:
        """Follow features without positions until two views begin the map; start over when they are lost."""
        with self.seconds.measure("start"):
            if builder is None:
                return self._first_view(frame)
            local_map = builder.local_map
            tracked = self._tracker.follow(local_map, builder.key, frame.gray)
            if tracked.found.sum() < self._config.start.min_inliers:
                return self._first_view(frame)
            local_map.append_pose(_UNKNOWN)
            if self._stands(builder, tracked, frame):
                builder.tie_before_start(frame.index)
                return builder
            builder.push(frame, tracked)
            builder.started = self._start.initialize(local_map)
            self._mapper.refill(local_map, frame.gray)
        if builder.started:
            local_map.pose_standing_frames()
            self._window(builder)
        return builder

    def _first_view(self, frame: Frame) -> MapBuilder | None:
        local_map = LocalMap(frame.index, self._config.mapping.max_track_frames)
        local_map.append_pose(_UNKNOWN)
        nothing = np.zeros((0, 2))
        local_map.push_view(frame.index, nothing, nothing, np.zeros(0, dtype=bool))
        self._mapper.refill(local_map, frame.gray)
        if len(local_map.ids) < self._config.start.min_inliers:
            return None
        return MapBuilder(local_map, frame.gray)

    def _track(self, builder: MapBuilder, frame: Frame) -> None:
        local_map = builder.local_map
        predicted = builder.predicted(self.t_s, frame.t_s)
        with self.seconds.measure("track"):
            tracked = self._tracker.track(local_map, builder.key, frame.gray, predicted)
            if tracked.world_T_camera is None:
                tracked = self._find_again(builder, frame, predicted)
        if tracked.world_T_camera is None:
            self._lost(frame)
            return
        builder.relocaliser, self._next = None, None
        note = builder.bridge(self.t_s, frame.index, tracked.world_T_camera)
        self.warnings += [note] if note else []
        local_map.append_pose(tracked.world_T_camera)
        if self._stands(builder, tracked, frame):
            builder.tie(frame.index, tracked)
            return
        builder.push(frame, tracked)
        with self.seconds.measure("map"):
            self._mapper.update(local_map, frame.gray)
        builder.since_window += 1
        builder.moved = True

    def _stands(self, builder: MapBuilder, tracked: TrackingResult, frame: Frame) -> bool:
        """Whether a frame needs no view of its own; in a long stop it does, before its view is forgotten."""
        newest = int(builder.local_map.view_frames[-1])
        if self._memory is not None and frame.index - newest > self._memory.view_frames // 2:
            return False
        return builder.stands(tracked, self._config.tracking.static_px)

    def _align(self, builder: MapBuilder) -> None:
        warnings = self._refiner.align(builder.local_map, self.t_s)
        if warnings is not None:
            self.warnings.extend(warnings)
            self._window(builder)

    def _window(self, builder: MapBuilder) -> None:
        builder.since_window = 0
        self._attempt(builder, lambda: self._refiner.optimise(builder.local_map, self.t_s))

    def _attempt(self, builder: MapBuilder, stage_c: Callable[[], list[str]]) -> None:
        """An update that fails leaves the map as it is, a map that fails again and again ends."""
        try:
            self.warnings.extend(stage_c())
        except (GeometryError, RuntimeError, np.linalg.LinAlgError) as error:
            builder.failures += 1
            reason = " ".join(str(error).split())[:200]
            self.warnings.append(f"stage C failed at {self.t_s[-1]:.2f} s and was left out: {reason}")
        else:
            builder.failures = 0
        if builder.failures >= _MOST_FAILURES:
            self.warnings.append(f"stage C failed {_MOST_FAILURES} times in a row: a new map begins")
            self._current = None
        builder.relocaliser = None  # it looks for the map as it was

    def _find_again(self, builder: MapBuilder, frame: Frame, predicted: FloatArray) -> TrackingResult:
        """Look for the features of the last good frame anywhere in this one."""
        if builder.relocaliser is None:
            builder.relocaliser = Relocaliser(
                self._camera, self._config.tracking, self._rng, builder.key, builder.local_map
            )
        pose = builder.relocaliser.find(frame.gray, predicted)
        if pose is None:
            nothing = np.zeros(len(builder.local_map.ids), dtype=bool)
            return TrackingResult(builder.local_map.raw_uv_px, builder.local_map.last_uv_px, nothing)
        return self._tracker.track(builder.local_map, builder.key, frame.gray, pose)

    def _lost(self, frame: Frame) -> None:
        """While the old map is lost a new one may begin; once it stands the old one is closed."""
        self._next = self._grow_start(self._next, frame)
        if self._next is None or not self._next.started or self._current is None:
            return
        last = self._current.local_map.next_frame - 1
        self.settle()
        begin = self._next.local_map.first_posed
        self.warnings.append(
            f"tracking was lost after frame {last} ({self.t_s[last]:.2f} s) and could not be bridged; "
            f"a new map begins at frame {begin} ({self.t_s[begin]:.2f} s)"
        )
        self._current, self._next = self._next, None
