"""The loop A -> B -> C over frames as they come, the same one offline and live."""

from collections.abc import Callable

import numpy as np

from vgps.errors import GeometryError
from vgps.gps.fix_buffer import FixBuffer
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import Sensors
from vgps.mapping.growing_array import GrowingArray
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, NewFrame, NewView
from vgps.mapping.retention import RetentionPolicy, RetiredPoses, retire_before, retire_map
from vgps.mapping.standing_frames import pose_standing_frames
from vgps.model import FloatArray, Frame
from vgps.pipeline.map_builder import MapBuilder
from vgps.pipeline.window_worker import WindowOutcome, WindowWorker
from vgps.runtime.timing import StageTimer
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.map_alignment import align_to_control, align_to_fixes
from vgps.tracking.bootstrap import TwoViewInitializer
from vgps.tracking.control_points import control_poses
from vgps.tracking.frame_tracker import FrameTracker, TrackingResult
from vgps.tracking.mapper import Mapper
from vgps.tracking.relocaliser import Relocaliser

_UNKNOWN = np.full((4, 4), np.nan)
_MAX_FAILURES = 3  # of stage C in a row, before a map is given up


class FramePipeline:
    """Tracks, maps and optimises a window, frame by frame.

    Attributes:
        maps: Finished and current maps in order of time; each holds the poses of its own frames.
        warnings: What a user should know, in words.
        timer: Seconds by stage.
        fix_buffer: The fixes so far, their verdicts, their time offset.

    Args:
        context: Camera, control points and settings.
        camera_p_antenna: (3,) metres.
        fixes: Those known from the start; more may be added at any time.
        retention: What to keep of the past; everything if none is given.
    """

    def __init__(
        self,
        context: SmoothingContext,
        camera_p_antenna: FloatArray,
        fixes: Fixes,
        retention: RetentionPolicy | None = None,
    ) -> None:
        camera, config = context.camera, context.config
        self._context, self._config, self._retention = context, config, retention
        self._rng = rng = np.random.default_rng(config.seed)
        self._tracker = FrameTracker(camera, config.tracking, config.mapping, rng)
        self._mapper = Mapper(camera, config.tracking, config.mapping, rng)
        self._initializer = TwoViewInitializer(camera.K, config.start, config.tracking, rng)
        self._current: MapBuilder | None = None
        self._next: MapBuilder | None = None
        self._times = GrowingArray()
        self.maps: list[LocalMap] = []
        self.warnings: list[str] = []
        self.timer = StageTimer()
        self.fix_buffer = FixBuffer(fixes, camera_p_antenna, config)
        self._control_poses = control_poses(context.controls, camera.K)
        self._worker = WindowWorker(context, self.fix_buffer, self.timer)

    @property
    def t_s(self) -> FloatArray:
        """(F,) times of the frames so far."""
        return self._times.values

    @property
    def sensors(self) -> Sensors:
        """The time offset of the fixes as the path so far shows it, and the lever arm."""
        return self.fix_buffer.sensors

    @property
    def current(self) -> LocalMap | None:
        """The map that newest frames join, once it has started."""
        return self._current.local_map if self._current is not None and self._current.started else None

    def add_fixes(self, fixes: Fixes) -> None:
        """Add fixes; late ones, and in any order, count at their own times."""
        self.fix_buffer.add(fixes, float(self.t_s[-1]) if len(self._times) else -np.inf)

    def add_frame(self, frame: Frame) -> None:
        """Pose the next frame of the video, then run stage C if that is due."""
        self.track_frame(frame)
        self.refine()

    def track_frame(self, frame: Frame) -> None:
        """Run stages A and B on the next frame; :meth:`refine` must come before the one after it."""
        self._times.append(frame.t_s)
        if self._current is None or not self._current.started:
            self._current = self._grow_start(self._current, frame)
        else:
            self._track(self._current, frame)
        if self._current is not None and self._current.started and self._current.local_map not in self.maps:
            self.maps.append(self._current.local_map)

    def refine(self) -> None:
        """Align the map and run stage C, where a moving frame since the last time makes them due.

        Stage C of a map that lies in the world works beside the frames that follow.
        """
        builder = self._current
        if builder is None or not builder.started:
            return
        delay = self._config.window.delay_frames
        if self._worker.busy and len(self._times) >= builder.window_at + delay:
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
        elif not self._worker.busy:
            builder.since_window, builder.window_at = 0, len(self._times)
            self._worker.start(builder.local_map)

    def settle(self) -> None:
        """Wait for stage C, if it is at work: to be called after the last frame."""
        if self._current is not None and self._worker.busy:
            self._attempt(self._current, self._worker.finish)

    def discard(self) -> list[RetiredPoses]:
        """Discard what lies further back than the retention policy keeps, and return its poses."""
        if self._retention is None or not len(self._times):
            return []
        horizon_s = float(self.t_s[-1]) - self._retention.path_s
        current = self.current
        gone = [retire_map(local_map) for local_map in self.maps if local_map is not current]
        self.maps = [current] if current is not None else []
        for builder in (self._current, self._next):
            if builder is not None:
                part = retire_before(builder.local_map, horizon_s, self._retention)
                gone += [part] if builder.started else []
        self.fix_buffer.discard_before(horizon_s)
        return [part for part in gone if len(part.poses)]

    def _grow_start(self, builder: MapBuilder | None, frame: Frame) -> MapBuilder | None:
        """Follow features without positions until two views start the map; start over when they are lost."""
        with self.timer.measure("start"):
            if builder is None:
                return self._first_view(frame)
            local_map = builder.local_map
            tracked = self._tracker.follow(local_map, builder.key, frame.gray)
            if tracked.found.sum() < self._config.start.min_inliers:
                return self._first_view(frame)
            builder.add_pose(frame.t_s, _UNKNOWN)
            if self._stands(builder, tracked, frame):
                builder.hold_before_start(frame.index)
                return builder
            builder.add_view(frame, tracked)
            start = self._initializer.initialize(local_map)
            if start is not None:
                local_map.apply(start)
            local_map.apply(self._mapper.new_features(local_map, frame.gray))
        if start is not None:
            builder.started = True
            local_map.apply(pose_standing_frames(local_map))
            self._window(builder)
        return builder

    def _first_view(self, frame: Frame) -> MapBuilder | None:
        local_map = LocalMap(frame.index, self._config.mapping.max_track_frames)
        nothing = np.zeros((0, 2))
        view = NewView(frame.index, nothing, nothing, np.zeros(0, dtype=bool))
        local_map.apply(MapUpdate(frames=(NewFrame(frame.t_s, _UNKNOWN),), view=view))
        local_map.apply(self._mapper.new_features(local_map, frame.gray))
        if len(local_map.ids) < self._config.start.min_inliers:
            return None
        return MapBuilder(local_map, frame.gray)

    def _track(self, builder: MapBuilder, frame: Frame) -> None:
        local_map = builder.local_map
        predicted = builder.predict(frame.t_s)
        with self.timer.measure("track"):
            tracked = self._tracker.track(local_map, builder.key, frame.gray, predicted)
            if tracked.world_T_camera is None:
                tracked = self._find_again(builder, frame, predicted)
        if tracked.world_T_camera is None:
            self._lost(frame)
            return
        builder.relocaliser, self._next = None, None
        warning = builder.bridge(self.t_s, frame.index, tracked.world_T_camera)
        self.warnings += [warning] if warning else []
        builder.add_pose(frame.t_s, tracked.world_T_camera)
        if self._stands(builder, tracked, frame):
            builder.hold(frame.index, tracked)
            return
        builder.add_view(frame, tracked)
        with self.timer.measure("map"):
            local_map.apply(self._mapper.triangulate_due(local_map))
            local_map.apply(self._mapper.new_features(local_map, frame.gray))
        builder.since_window += 1
        builder.moved = True

    def _stands(self, builder: MapBuilder, tracked: TrackingResult, frame: Frame) -> bool:
        """Return whether a frame needs no view of its own.

        In a long stop it does, before its view is discarded.
        """
        newest = int(builder.local_map.view_frames[-1])
        if self._retention is not None and frame.index - newest > self._retention.view_frames // 2:
            return False
        return builder.stands(tracked, self._config.tracking.static_px)

    def _align(self, builder: MapBuilder) -> None:
        """Move the map into the world, by control points or fixes, as soon as they suffice."""
        local_map, start = builder.local_map, self._config.start
        with self.timer.measure("align"):
            found = align_to_control(local_map, self._control_poses, start.min_control_travel_m)
            if found is None and self.fix_buffer.has_new(float(self.t_s[-2]), float(self.t_s[-1])):
                antenna = self.sensors.prior_antenna
                found = align_to_fixes(local_map, self.fix_buffer.fixes, antenna, self._config)
            if found is None:
                return
            local_map.apply(found.update)
        self.warnings.extend(found.warnings)
        self._window(builder)

    def _window(self, builder: MapBuilder) -> None:
        builder.since_window = 0
        self._attempt(builder, lambda: self._worker.optimise(builder.local_map))

    def _attempt(self, builder: MapBuilder, stage_c: Callable[[], WindowOutcome | None]) -> None:
        """Apply the outcome of stage C; a failure leaves the map as it is, several in a row end it."""
        try:
            outcome = stage_c()
        except (GeometryError, RuntimeError, np.linalg.LinAlgError) as error:
            builder.failures += 1
            reason = " ".join(str(error).split())[:200]
            self.warnings.append(f"stage C failed at {self.t_s[-1]:.2f} s and was left out: {reason}")
        else:
            builder.failures = 0
            self._apply(outcome)
        if builder.failures >= _MAX_FAILURES:
            self.warnings.append(f"stage C failed {_MAX_FAILURES} times in a row: a new map begins")
            self._current = None
        builder.relocaliser = None  # it looks for the map as it was

    def _apply(self, outcome: WindowOutcome | None) -> None:
        if outcome is None:
            return
        local_map, found = outcome.local_map, outcome.reconciliation
        local_map.apply(found.update)
        with self.timer.measure("map"):
            rows = np.flatnonzero(np.isin(local_map.ids, found.unknown))
            local_map.apply(MapUpdate(positions=self._mapper.triangulate(local_map, rows)))
        self.warnings.extend(outcome.warnings)

    def _find_again(self, builder: MapBuilder, frame: Frame, predicted: FloatArray) -> TrackingResult:
        """Look for the features of the last good frame anywhere in this one."""
        local_map = builder.local_map
        if builder.relocaliser is None:
            builder.relocaliser = Relocaliser(
                self._context.camera, self._config.tracking, self._rng, builder.key, local_map
            )
        pose = builder.relocaliser.find(frame.gray, predicted)
        if pose is None:
            nothing = np.zeros(len(local_map.ids), dtype=bool)
            return TrackingResult(local_map.raw_uv_px, local_map.last_uv_px, nothing)
        return self._tracker.track(local_map, builder.key, frame.gray, pose)

    def _lost(self, frame: Frame) -> None:
        """While the old map is lost a new one may start; once it has, the old one is closed."""
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
