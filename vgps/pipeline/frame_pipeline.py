"""Stages A, B and C frame by frame, offline and live."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from vgps.errors import GeometryError
from vgps.gps.fix_buffer import FixBuffer
from vgps.gps.fixes import Fixes
from vgps.imu.rotation import RotationPredictor
from vgps.mapping.growing_array import GrowingArray
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate
from vgps.mapping.retention import RetentionPolicy, RetiredPoses
from vgps.model import Camera, FloatArray, Frame
from vgps.pipeline.frame_stages import FrameStages
from vgps.pipeline.map_aligner import MapAligner
from vgps.pipeline.map_builder import MapBuilder
from vgps.pipeline.map_sequence import MapSequence
from vgps.pipeline.window_worker import WindowOutcome, WindowWorker
from vgps.runtime.timing import StageTimer
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.scene.other_calibration import undistorted_again
from vgps.tracking.frame_tracker import FrameTracker

_MAX_REASON = 200  # characters of an error in a warning


class FramePipeline:
    """Stages A to C of one video: tracking, mapping, and optimisation of the newest window.

    Attributes:
        config: The settings.
        warnings: Warnings for the user.
        repeated_frames: Frames that showed the picture before them again, while the camera moved on.
        timer: Seconds by stage.
        fix_buffer: The fixes so far, their verdicts and their time offset.
        gyro: The prediction of rotations between frames; None without a gyro.

    Args:
        context: Camera, control points and settings.
        camera_p_antenna: (3,) metres.
        fixes: Fixes available from the start; more may be added at any time.
        retention: How much of the past to keep; everything if none is given.
        live: Whether poses are given out frame by frame: none is taken back when the camera is lost.
    """

    def __init__(
        self,
        context: SmoothingContext,
        camera_p_antenna: FloatArray,
        fixes: Fixes,
        retention: RetentionPolicy | None = None,
        live: bool = False,
    ) -> None:
        self.config, self._retention = (config := context.config), retention
        self._rng = np.random.default_rng(config.seed)
        self._stages = FrameStages.of(context.camera, config, self._rng, retention, live)
        self.gyro = None if context.imu is None else RotationPredictor(context.imu, config.imu)
        self._maps = MapSequence()
        self._times = GrowingArray()
        self.warnings: list[str] = []
        self.repeated_frames: list[int] = []
        self.timer = StageTimer()
        self.fix_buffer = FixBuffer(fixes, camera_p_antenna, config)
        self._aligner = MapAligner(context, self.fix_buffer)
        self._worker = WindowWorker(context, self.fix_buffer, self.timer)

    @property
    def t_s(self) -> FloatArray:
        """(F,) times of the frames so far."""
        return self._times.values

    @property
    def camera(self) -> Camera:
        """The camera, which stage C may have refined."""
        return self._stages.camera

    @property
    def tracker(self) -> FrameTracker:
        """Stage A, which also leaves things out of the picture."""
        return self._stages.tracker

    @property
    def maps(self) -> list[LocalMap]:
        """Finished and current maps in order of time; each holds the poses of its own frames."""
        return self._maps.started

    @property
    def current(self) -> LocalMap | None:
        """The map that the newest frames belong to, once it has started."""
        return self._maps.newest

    @property
    def window_failures(self) -> int:
        """Number of windows that iSAM2 could not solve, and the other solver did."""
        return self._worker.failures

    def add_fixes(self, fixes: Fixes) -> None:
        """Add fixes, in any order and late if need be; each counts at its own time."""
        self.fix_buffer.add(fixes, float(self.t_s[-1]) if len(self._times) else -np.inf)

    def add_frame(self, frame: Frame) -> None:
        """Pose the next frame of the video, then run stage C if it is due."""
        self.track_frame(frame)
        self.refine()

    def track_frame(self, frame: Frame) -> None:
        """Run stage A on the next frame; call :meth:`refine` before the one after it."""
        self._times.append(frame.t_s)
        frame = self.tracker.static.masked(frame)
        maps = self._maps
        if maps.current is None or not maps.current.started:
            maps.current = self._start_map(maps.current, frame)
        else:
            self._track(maps.current, frame)
        maps.list_newest()

    def map_frame(self) -> None:
        """Run stage B on the newest frame, whose pose does not need it; :meth:`refine` does, too."""
        if self._maps.current is not None:
            with self.timer.measure("map"):
                self._maps.current.map_view(self.tracker, self._stages.mapper)

    def refine(self) -> None:
        """Run stage B, align the map, and run stage C, beside the next frames, if moving frames are due."""
        self.map_frame()
        builder = self._maps.current
        if builder is None or not builder.started:
            return
        delay = self.config.window.delay_frames
        if self._worker.busy and len(self._times) >= builder.window_at + delay:
            self.finish_window()
        if not builder.moved:
            return
        builder.moved = False
        if not builder.local_map.aligned:
            self._align(builder)
        if builder.since_window < self.config.window.every_frames:
            return
        if delay == 0 or not builder.local_map.aligned:
            self._run_window(builder)
        elif not self._worker.busy:
            builder.since_window, builder.window_at = 0, len(self._times)
            self._worker.start(builder.local_map)

    def finish_window(self) -> None:
        """Wait for stage C, if it is running, and apply its result."""
        if self._maps.current is not None and self._worker.busy:
            self._attempt(self._maps.current, self._worker.finish)

    def finish(self) -> None:
        """Apply what stage C still works at, and leave out last frames that repeat a picture."""
        self.finish_window()
        builder = self._maps.current
        if self.repeated_frames and builder is not None and builder.ends_in_repeats(self.config.tracking):
            self._discard_repeats(builder, lost=False)

    def start_anew(self) -> None:
        """Begin a new map with the next frame."""
        self.finish_window()
        self._maps.current = None

    def state(self) -> dict[str, Any] | None:
        """Return all that the next frames depend on; None while stage C runs or a lost camera is searched."""
        if self._worker.busy or self._maps.searching:
            return None
        return {
            **self._maps.state(),
            "times": self._times,
            "warnings": self.warnings,
            "repeated_frames": self.repeated_frames,
            "seconds": self.timer.by_stage,
            "fix_buffer": self.fix_buffer,
            "used_until_s": self._worker.used_until_s,
            "tracker": self.tracker.state(self.maps),
            "random": self._rng.bit_generator.state,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take over a state, before the first frame; see :meth:`state`."""
        self._maps.restore(state)
        self._times, self.warnings, self.repeated_frames = (
            state["times"],
            state["warnings"],
            state["repeated_frames"],
        )
        self.timer.by_stage.update(state["seconds"])
        vars(self.fix_buffer).update(vars(state["fix_buffer"]))
        self._worker.used_until_s = state["used_until_s"]
        self.tracker.restore(state["tracker"])
        self._rng.bit_generator.state = state["random"]

    def discard(self) -> list[RetiredPoses]:
        """Discard what the retention policy does not keep, and return the discarded poses."""
        if self._retention is None or not len(self._times):
            return []
        horizon_s = float(self.t_s[-1]) - self._retention.path_s
        self.fix_buffer.discard_before(horizon_s)
        return self._maps.discard(horizon_s, self._retention)

    def _start_map(self, builder: MapBuilder | None, frame: Frame) -> MapBuilder | None:
        """Add a frame to a map that has not started; stage C follows if it starts."""
        with self.timer.measure("start"):
            builder = self._stages.starter.add_frame(builder, frame, self.gyro)
        if builder is not None and builder.started:
            self.repeated_frames += sorted(builder.local_map.bridged)
            self._run_window(builder)
        return builder

    def _track(self, builder: MapBuilder, frame: Frame) -> None:
        tracking, sigma_scale = self.config.tracking, self.config.batch.video_sigma_scale
        predicted = builder.predict(frame.t_s, self.gyro, self.maps).beside(sigma_scale)
        with self.timer.measure("track"):
            result = self._stages.pose(builder, frame, predicted)
        result = builder.carried(frame, result, predicted, tracking)
        lost, live, again = result.world_T_camera is None, self._stages.live, bool(self.repeated_frames)
        if repeats := not (lost and live) and builder.shows_repeats(frame, result, tracking, again):
            self._discard_repeats(builder, lost)
        if result.world_T_camera is None:
            self._grow_following_map(frame)
            return
        builder.relocaliser, self._maps.following = None, None
        self._bridge(builder, frame, result.world_T_camera, repeats)
        if builder.extend(frame, result, tracking, self._retention):
            builder.unmapped = frame, result
            builder.since_window, builder.moved = builder.since_window + 1, True

    def _discard_repeats(self, builder: MapBuilder, lost: bool) -> None:
        if lost:
            self.finish_window()  # it may have these frames, which nothing will replace
        times_s, first = builder.discard_repeats(), builder.local_map.next_frame
        self.repeated_frames += range(first, first + len(times_s))

    def _bridge(self, builder: MapBuilder, frame: Frame, world_T_camera: FloatArray, repeats: bool) -> None:
        """Pose the frames between the newest one and a tracked one: repeated pictures, or a lost camera."""
        first, last = builder.local_map.next_frame, frame.index - 1
        builder.bridge(self.t_s[first : last + 1], frame.t_s, world_T_camera)
        if first <= last and not repeats:
            self.warnings.append(f"tracking was lost from frame {first} to {last}; they are bridged")

    def _align(self, builder: MapBuilder) -> None:
        """Align the map with the world, if that can be done yet."""
        with self.timer.measure("align"):
            result = self._aligner.align(builder.local_map, self.t_s)
            if result is None:
                return
            builder.local_map.apply(result.update)
        if self.gyro is None:  # else gravity shows the roll
            self.warnings.extend(result.warnings)
        self._run_window(builder)

    def _run_window(self, builder: MapBuilder) -> None:
        builder.since_window = 0
        self._attempt(builder, lambda: self._worker.optimise(builder.local_map))

    def _attempt(self, builder: MapBuilder, stage_c: Callable[[], WindowOutcome | None]) -> None:
        """Apply the outcome of stage C; a failure leaves the map as it is, three in a row end it."""
        try:
            outcome = stage_c()
        except (GeometryError, RuntimeError, np.linalg.LinAlgError) as error:
            builder.failures += 1
            reason = " ".join(str(error).split())[:_MAX_REASON]
            self.warnings.append(f"stage C failed at {self.t_s[-1]:.2f} s, the map stays as it was: {reason}")
        else:
            builder.failures = 0
            self._apply(outcome)
        if builder.failures >= self.config.window.max_failures:
            self.warnings.append(f"stage C failed {builder.failures} times in a row: a new map begins")
            self._maps.current = None
        builder.relocaliser = None  # it has the positions before stage C

    def _apply(self, outcome: WindowOutcome | None) -> None:
        if outcome is None:
            return
        local_map, reconciliation = outcome.local_map, outcome.reconciliation
        if self._worker.camera is not self.camera:
            self._use_camera(local_map)
        local_map.apply(reconciliation.update)
        with self.timer.measure("map"):
            rows = np.flatnonzero(np.isin(local_map.ids, reconciliation.unrefined))
            local_map.apply(MapUpdate(positions=self._stages.mapper.triangulate(local_map, rows)))
        self.warnings.extend(outcome.warnings)

    def _use_camera(self, seen: LocalMap) -> None:
        """Go on with the refined camera, which one of the maps was optimised with."""
        undistorted = undistorted_again(self._worker.camera, self.camera)
        self._stages = self._stages.with_camera(self._worker.camera, self.maps)
        self._maps.undistort_again(undistorted, seen)

    def _grow_following_map(self, frame: Frame) -> None:
        """Add a frame to a new map while tracking is lost; once it starts, it replaces the current map."""
        maps = self._maps
        maps.following = self._start_map(maps.following, frame)
        if maps.following is None or not maps.following.started or maps.current is None:
            return
        lost = maps.current.local_map
        self.finish_window()
        self.warnings.append(maps.follow(lost, self.t_s))
