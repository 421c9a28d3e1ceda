"""The loop A -> B -> C over frames as they come, the same one offline and online."""

from collections.abc import Callable

import numpy as np

from vgps.config import Config
from vgps.errors import GeometryError
from vgps.gps.fix_buffer import FixLedger
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import Sensors
from vgps.mapping.control_observations import NO_CONTROLS, Controls
from vgps.mapping.growing_array import GrowingRows
from vgps.mapping.local_map import LocalMap
from vgps.mapping.retention import Forgotten, Memory, oldest, whole
from vgps.model import Camera, FloatArray, Frame
from vgps.pipeline.map_builder import GrowingMap
from vgps.pipeline.window_worker import Refiner
from vgps.runtime.timing import Seconds
from vgps.tracking.bootstrap import TwoViewStart
from vgps.tracking.control_points import control_poses
from vgps.tracking.frame_tracker import FrameTracker, Tracked
from vgps.tracking.mapper import Mapper
from vgps.tracking.relocaliser import Relocaliser

_UNKNOWN = np.full((4, 4), np.nan)
_MOST_FAILURES = 3  # of stage C in a row, before a map is given up


class Sequence:
    """Tracks, maps and optimises a window, frame by frame.

    Attributes:
        t_s: Times of the frames so far.
        maps: Finished and current maps in order of time; each holds the poses of its own frames.
        warnings: What happened on the way that a user should know.
        ledger: The fixes so far, their verdicts, their clock.

    Args:
        camera: Its lens.
        camera_p_antenna: (3,) metres.
        fixes: Those known from the start; more may be added at any time.
        config: Everything.
        controls: Sightings of known points.
        memory: What to remember of long ago; everything if none is given.
    """

    def __init__(
        self,
        camera: Camera,
        camera_p_antenna: FloatArray,
        fixes: Fixes,
        config: Config,
        controls: Controls = NO_CONTROLS,
        memory: Memory | None = None,
    ) -> None:
        self._camera, self._config, self._memory = camera, config, memory
        rng = np.random.default_rng(config.seed)
        self._rng = rng
        self._tracker = FrameTracker(camera, config.tracking, config.mapping, rng)
        self._mapper = Mapper(camera, config.tracking, config.mapping, rng)
        self._start = TwoViewStart(camera.K, config.start, config.tracking, rng)
        self._current: GrowingMap | None = None
        self._next: GrowingMap | None = None
        self._times = GrowingRows()
        self.maps: list[LocalMap] = []
        self.warnings: list[str] = []
        self.seconds = Seconds()
        self.ledger = FixLedger(fixes, camera_p_antenna, config)
        poses = control_poses(controls, camera.K)
        self._refiner = Refiner(camera.K, self.ledger, config, controls, poses, self.seconds)

    @property
    def t_s(self) -> FloatArray:
        """(F,) times of the frames so far."""
        return self._times.values

    @property
    def sensors(self) -> Sensors:
        """The lag of the fixes as the path so far shows it, and the lever arm."""
        return self.ledger.sensors

    @property
    def current(self) -> LocalMap | None:
        """The map that newest frames join, once it stands."""
        return self._current.local_map if self._current is not None and self._current.started else None

    def add_fixes(self, fixes: Fixes) -> None:
        """More fixes; late ones, and in any order, land at their own times."""
        self.ledger.add(fixes, float(self.t_s[-1]) if len(self._times) else -np.inf)

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
        growing = self._current
        if growing is None or not growing.started:
            return
        delay = self._config.window.delay_frames
        if self._refiner.busy and len(self._times) >= growing.window_at + delay:
            self.settle()
        if not growing.moved:
            return
        growing.moved = False
        if not growing.local_map.aligned:
            self._align(growing)
        if growing.since_window < self._config.window.every_frames:
            return
        if delay == 0 or not growing.local_map.aligned:
            self._window(growing)
        elif not self._refiner.busy:
            growing.since_window, growing.window_at = 0, len(self._times)
            self._refiner.begin(growing.local_map, self.t_s)

    def settle(self) -> None:
        """Wait for stage C, if it is at work: to be called after the last frame."""
        growing = self._current
        if growing is not None and self._refiner.busy:
            self._attempt(growing, lambda: self._take_over(growing.local_map))

    def _take_over(self, local_map: LocalMap) -> list[str]:
        unknown, warnings = self._refiner.finish()
        with self.seconds.measure("map"):
            self._mapper.position(local_map, np.flatnonzero(np.isin(local_map.ids, unknown)))
        return warnings

    def forget(self) -> list[Forgotten]:
        """Let go of what lies further back than the memory, and give its poses."""
        if self._memory is None or not len(self._times):
            return []
        horizon_s = float(self.t_s[-1]) - self._memory.path_s
        current = self.current
        gone = [whole(local_map) for local_map in self.maps if local_map is not current]
        self.maps = [current] if current is not None else []
        for growing in (self._current, self._next):
            if growing is not None:
                part = oldest(growing.local_map, self.t_s, horizon_s, self._memory)
                gone += [part] if growing.started else []
        self.ledger.forget(horizon_s)
        return [part for part in gone if len(part.poses)]

    def _grow_start(self, growing: GrowingMap | None, frame: Frame) -> GrowingMap | None:
        """Follow features without positions until two views begin the map; start over when they are lost."""
        with self.seconds.measure("start"):
            if growing is None:
                return self._first_view(frame)
            local_map = growing.local_map
            tracked = self._tracker.follow(local_map, growing.key, frame.gray)
            if tracked.found.sum() < self._config.start.min_inliers:
                return self._first_view(frame)
            local_map.append_pose(_UNKNOWN)
            if self._stands(growing, tracked, frame):
                growing.tie_before_start(frame.index)
                return growing
            growing.push(frame, tracked)
            growing.started = self._start.try_start(local_map)
            self._mapper.refill(local_map, frame.gray)
        if growing.started:
            local_map.pose_standing_frames()
            self._window(growing)
        return growing

    def _first_view(self, frame: Frame) -> GrowingMap | None:
        local_map = LocalMap(frame.index, self._config.mapping.max_track_frames)
        local_map.append_pose(_UNKNOWN)
        nothing = np.zeros((0, 2))
        local_map.push_view(frame.index, nothing, nothing, np.zeros(0, dtype=bool))
        self._mapper.refill(local_map, frame.gray)
        if len(local_map.ids) < self._config.start.min_inliers:
            return None
        return GrowingMap(local_map, frame.gray)

    def _track(self, growing: GrowingMap, frame: Frame) -> None:
        local_map = growing.local_map
        predicted = growing.predicted(self.t_s, frame.t_s)
        with self.seconds.measure("track"):
            tracked = self._tracker.track(local_map, growing.key, frame.gray, predicted)
            if tracked.world_T_camera is None:
                tracked = self._find_again(growing, frame, predicted)
        if tracked.world_T_camera is None:
            self._lost(frame)
            return
        growing.relocaliser, self._next = None, None
        note = growing.bridge(self.t_s, frame.index, tracked.world_T_camera)
        self.warnings += [note] if note else []
        local_map.append_pose(tracked.world_T_camera)
        if self._stands(growing, tracked, frame):
            growing.tie(frame.index, tracked)
            return
        growing.push(frame, tracked)
        with self.seconds.measure("map"):
            self._mapper.update(local_map, frame.gray)
        growing.since_window += 1
        growing.moved = True

    def _stands(self, growing: GrowingMap, tracked: Tracked, frame: Frame) -> bool:
        """Whether a frame needs no view of its own; in a long stop it does, before its view is forgotten."""
        newest = int(growing.local_map.view_frames[-1])
        if self._memory is not None and frame.index - newest > self._memory.view_frames // 2:
            return False
        return growing.stands(tracked, self._config.tracking.static_px)

    def _align(self, growing: GrowingMap) -> None:
        warnings = self._refiner.align(growing.local_map, self.t_s)
        if warnings is not None:
            self.warnings.extend(warnings)
            self._window(growing)

    def _window(self, growing: GrowingMap) -> None:
        growing.since_window = 0
        self._attempt(growing, lambda: self._refiner.optimise(growing.local_map, self.t_s))

    def _attempt(self, growing: GrowingMap, stage_c: Callable[[], list[str]]) -> None:
        """An update that fails leaves the map as it is, a map that fails again and again ends."""
        try:
            self.warnings.extend(stage_c())
        except (GeometryError, RuntimeError, np.linalg.LinAlgError) as error:
            growing.failures += 1
            reason = " ".join(str(error).split())[:200]
            self.warnings.append(f"stage C failed at {self.t_s[-1]:.2f} s and was left out: {reason}")
        else:
            growing.failures = 0
        if growing.failures >= _MOST_FAILURES:
            self.warnings.append(f"stage C failed {_MOST_FAILURES} times in a row: a new map begins")
            self._current = None
        growing.relocaliser = None  # it looks for the map as it was

    def _find_again(self, growing: GrowingMap, frame: Frame, predicted: FloatArray) -> Tracked:
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
        self.settle()
        begin = self._next.local_map.first_posed
        self.warnings.append(
            f"tracking was lost after frame {last} ({self.t_s[last]:.2f} s) and could not be bridged; "
            f"a new map begins at frame {begin} ({self.t_s[begin]:.2f} s)"
        )
        self._current, self._next = self._next, None
