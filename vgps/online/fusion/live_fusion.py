"""Fusion of video and fixes beside the frames: fit and verdicts in a thread, used some time later."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np

from vgps.config import Config
from vgps.imu.camera_imu import CameraImu
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import Similarity
from vgps.mapping.retention import RetiredPoses
from vgps.model import FloatArray
from vgps.online.fusion.doubted_fixes import Doubt
from vgps.online.fusion.fit_job import FIT_S, VERDICT_S, FitJob, SeenByFit, fix_count
from vgps.online.fusion.fusion_equations import POSITION
from vgps.online.fusion.fusion_fit import FitInput, FitResult, fit, fit_with_verdicts, newest_fit
from vgps.online.fusion.gravity import Gravity
from vgps.online.fusion.inertial_bridge import BridgedPose, InertialBridge
from vgps.online.fusion.live_sensors import LiveSensors
from vgps.online.fusion.path_fusion import FusedPath
from vgps.online.fusion.place_ties import PlaceTies
from vgps.online.fusion.pose_sigmas import UNKNOWN_SIGMAS, Sigmas, pose_sigmas
from vgps.online.fusion.video_path import VideoPath, move_map, path_of
from vgps.pipeline.frame_pipeline import FramePipeline
from vgps.runtime.threads import begin


class LiveFusion:
    """Place of the newest map in the world by the fixes, fitted again with every fix.

    The map itself follows the video alone. A fix that agrees with the path counts from the next frame on;
    one that surprises waits for a verdict, while the pose goes on with the video.

    Args:
        frame_pipeline: Stages A to C, without fixes in stage C.
        config: Settings, with the GPS model in use.
        imu: Levels the path, and bridges frames without features; None without an IMU.
        antenna_known: Whether the lever arm was measured; else it is an unknown of the fit.

    Attributes:
        sensors: Clock and antenna as the fits show them.
    """

    def __init__(
        self,
        frame_pipeline: FramePipeline,
        config: Config,
        imu: CameraImu | None = None,
        *,
        antenna_known: bool = True,
    ) -> None:
        self._frame_pipeline, self._config = frame_pipeline, config
        self.sensors = LiveSensors(frame_pipeline.fix_buffer, config.sensors, antenna_known=antenna_known)
        self._map: LocalMap | None = None
        self._camera = frame_pipeline.camera  # of the newest fit
        self._newest: FusedPath | None = None  # the fit in use, or one to fixes that came since
        self._newest_fixes = 0  # their number when it was found
        self._left_out = False  # whether it leaves out fixes that came since
        self._ended: tuple[LocalMap, FusedPath] | None = None  # the last map with a fit before the newest
        self._ties = PlaceTies.none()
        self._seen: SeenByFit | None = None  # None if a fit is due
        self.use_imu(imu)

    def use_imu(self, imu: CameraImu | None) -> None:
        """Use another IMU, or none, from now on; what an earlier one said of the path is forgotten."""
        self._gravity = None if imu is None else Gravity(imu, self._config.imu)
        self._bridge = None if imu is None else InertialBridge(imu, self._config)
        self._job: FitJob | None = None
        self._begin_anew()

    def _begin_anew(self) -> None:
        """Let the next fit know nothing of the last one, which places frames until then."""
        self.sensors.begin_anew()
        self._latest: FitResult | None = None
        self._doubt: Doubt | None = None

    @property
    def _fused(self) -> FusedPath | None:
        """The fit in use; None before the first one of the newest map."""
        return None if self._latest is None else self._latest.fused

    def refine(self) -> None:
        """Begin a fit if there are new fixes or many new frames, or if stage C has changed the map."""
        current = self._frame_pipeline.current
        if current is not self._map:
            if self._map is not None and self._fused is not None:
                self._ended = self._map, self._fused
            self.sensors.begin_map()
            self._map, self._job, self._latest, self._newest, self._doubt = current, None, None, None, None
        if self._latest is not None:  # stage C hands back the verdicts and the time offset that it began with
            self._update_fixes(self._latest)
        if self._camera is not self._frame_pipeline.camera:
            self._finish()
        if self._job is None and self.sensors.expect(self._frame_pipeline.fix_buffer):
            self._begin_anew()
        if current is None or not current.aligned or self._job is not None:
            return
        if self._fused is None or self._camera is not self._frame_pipeline.camera:
            self._camera = self._frame_pipeline.camera  # a refined one bends the whole path
            self._begin(current)
            if self._fused is not None or self._config.online.repeatable:
                self._finish()
        elif self._is_due(current):
            self._begin(current)

    def fuse_all(self) -> None:
        """Fit all that has come, and wait for it."""
        self._finish()
        current = self._frame_pipeline.current
        if current is None or current is not self._map or not current.aligned:
            return
        self._begin(current)
        self._finish()
        if self._fused is None:  # another clock was found, or there was no fit
            self._begin(current)
            self._finish()

    def _finish(self) -> None:
        """Wait for fit and verdicts."""
        while self._job is not None:
            self._take()

    def _take(self) -> None:
        """Wait for the fit at work, and use it or ask for verdicts; a failed one changes nothing."""
        assert self._job is not None
        given, future, self._job = self._job.given, self._job.fit, None
        try:
            result = future.result()
        except np.linalg.LinAlgError as error:
            self._frame_pipeline.warnings.append(f"the fixes could not be fused with the video: {error}")
            return
        if result.surprising:
            self._start(fit_with_verdicts, given, VERDICT_S - FIT_S)
            return
        self._latest, self._newest, self._newest_fixes = result, result.fused, 0
        self._update_fixes(result)
        self._heed(result.doubt)
        if result.turned is not None:
            self._frame_pipeline.warnings.append(result.turned.note)
        if given.watches_clock and self.sensors.finds_another_clock(result.clock):
            self._begin_anew()

    def _heed(self, doubt: Doubt | None) -> None:
        """Remember a doubt, unless its fixes take back what others did that were doubted before."""
        if doubt is None:
            return
        before = self._doubt
        if before is not None and doubt.takes_back(before):
            self._doubt = None
        elif before is None or doubt.outweighs(before):
            self._doubt = doubt
            self._frame_pipeline.warnings.append(doubt.note)

    def _update_fixes(self, result: FitResult) -> None:
        """Take over the verdicts on the fixes and their time offset."""
        fix_buffer, found = self._frame_pipeline.fix_buffer, self.sensors.follow(result.fused)
        fix_buffer.update_assessment(result.number, result.assessment)
        self._frame_pipeline.warnings += self.sensors.news(found)
        fix_buffer.sensors = fix_buffer.sensors.with_time_offset(found)

    def place_map(self, world_T_camera: FloatArray) -> None:
        """Put the newest map into the world, after the last frame.

        Args:
            world_T_camera: (F, 4, 4) the poses of all frames.
        """
        if self._map is not None and self._fused is not None:
            move_map(self._map, world_T_camera)

    def _start(self, work: Callable[[FitInput, Config], FitResult], given: FitInput, seconds: float) -> None:
        due_s = float(self._frame_pipeline.t_s[-1]) + seconds
        self._job = FitJob(due_s, given, begin(work, given, self.sensors.settings(self._config)))

    def use_new_fixes(self) -> None:
        """Use a fit that is due, and let the fixes count that came since, before the fit to all is there."""
        current, now_s = self._frame_pipeline.current, float(self._frame_pipeline.t_s[-1])
        if current is None or current is not self._map:
            return
        if self._job is not None and self._job.counts(now_s, self._config.online.repeatable):
            self._take()
        fixes = fix_count(now_s, self._frame_pipeline.fix_buffer)
        if self._fused is None or fixes == self._newest_fixes:
            return
        given = self._given(current)
        self._newest, self._newest_fixes, self._left_out = self._fused, fixes, bool(given.is_new.any())
        with suppress(np.linalg.LinAlgError):  # the fit to all says so
            found = newest_fit(given, self.sensors.settings(self._config))
            if found is not None:
                self._newest, self._left_out = found, False

    def to_world(self, current: LocalMap | None) -> Similarity | None:
        """Return the similarity from the newest map to the world at its end; None before the first fit."""
        if self._newest is None or current is None or current is not self._map:
            return None
        return self._newest.to_world(self._path(current))

    def sigmas(self, bridged: BridgedPose | None = None) -> Sigmas:
        """Return the standard deviations of the newest frame's pose, which the IMU may have bridged; NaN
        before the first fit.
        """
        if bridged is not None:
            return bridged.sigmas
        if self._newest is None or self._map is None:
            return UNKNOWN_SIGMAS
        t_s = float(self._frame_pipeline.t_s[-1])
        covariance = self._newest.covariance_at_end(self._path(self._map), self._config)
        away_s = t_s - float(self._map.t_s[-1])
        return pose_sigmas(self._with_doubt(covariance, t_s), away_s, self._config.motion)

    def bridged(self) -> BridgedPose | None:
        """Return the newest frame's pose by the IMU, if the last map with a fit ended before it; None if the
        IMU does not show it well enough.
        """
        t_s, placed = self._frame_pipeline.t_s, self._ended
        if self._map is not None and self._fused is not None:
            placed = self._map, self._fused
        if self._bridge is None or placed is None or placed[0].next_frame == len(t_s):
            return None
        local_map, fused = placed
        path = self._path(local_map)
        covariance = self._with_doubt(fused.covariance_at_end(path, self._config), float(path.t_s[-1]))
        to_world, seen = fused.to_world(path), 1 + max(local_map.bridged, default=-1)
        if seen > local_map.next_frame - len(path.t_s):  # the frames since features returned
            path = path.since(float(t_s[seen]))
        return self._bridge.pose(path, to_world, covariance, float(t_s[-1]))

    def at(self, frame: int) -> tuple[FloatArray, Sigmas] | None:
        """Return the pose (4, 4) of an earlier frame by all fixes so far; None if its map has ended."""
        current = self._map
        if self._fused is None or current is None or not current.first_frame <= frame < current.next_frame:
            return None
        path = self._path(current)
        row = frame - (current.next_frame - len(path.t_s))
        if row < 0 or not np.isfinite(path.poses[row, 0, 0]) or path.t_s[row] > self._fused.newest_s:
            return None
        covariance = self._with_doubt(self._fused.covariances_at(path.t_s[[row]])[0], float(path.t_s[row]))
        return self._fused.world_T_camera(path)[row], pose_sigmas(covariance, 0.0, self._config.motion)

    def world_path(self) -> RetiredPoses | None:
        """Return the fused poses of the newest map over the last ``online.keep_s``; None before a fit."""
        if self._fused is None or self._map is None:
            return None
        poses = self._fused.world_T_camera(self._path(self._map))
        return RetiredPoses(self._map.next_frame - len(poses), poses, True, self._map.bridged)

    def _is_due(self, current: LocalMap) -> bool:
        if self._seen is None or self._left_out:
            return True
        return self._seen.calls_for_another(self._sees(current), current, self._config)

    def _sees(self, current: LocalMap) -> SeenByFit:
        return SeenByFit.of(current, self._frame_pipeline.t_s, self._frame_pipeline.fix_buffer)

    def placed(self) -> tuple[FusedPath, VideoPath] | None:
        """Return the fit in use and the path of the newest map; None before the first fit."""
        current = self._map
        if self._fused is None or current is None or current is not self._frame_pipeline.current:
            return None
        return self._fused, self._path(current).snapshot()

    def tie(self, ties: PlaceTies) -> None:
        """Let places seen again count, from the next fit on, instead of those of before."""
        self._ties, self._seen = ties, None

    def _with_doubt(self, covariance: FloatArray, t_s: float) -> FloatArray:
        """Return the covariance (7, 7) of a pose at a time if fixes that are doubted may be wrong."""
        covariance = covariance.copy()
        if self._doubt is not None:
            covariance[POSITION, POSITION] += self._doubt.covariance(t_s)
        return covariance

    def _path(self, current: LocalMap) -> VideoPath:
        return path_of(current, self._config.online.keep_s, self._ties)

    def _given(self, current: LocalMap) -> FitInput:
        fix_buffer, path = self._frame_pipeline.fix_buffer, self._path(current)
        known_s = self.sensors.known_s
        fixes = fix_buffer.fixes.without_clock_rate(fix_buffer.sensors).without_time_offset(known_s)
        rows = (fixes.t_s >= path.t_s[0]) & (fixes.t_s <= path.t_s[-1])
        number = fix_buffer.number[rows]
        return FitInput(
            path=path.snapshot(),
            fixes=fixes.where(rows),
            number=number,
            is_new=np.isin(number, [] if self._latest is None else self._latest.number, invert=True),
            assessment=fix_buffer.assessment.where(rows),
            lever_arm=self.sensors.lever_arm,
            last=self._fused,
            gravity=self._gravity,
            unsure_of_antenna=self.sensors.unsure_of_antenna,
            clock_away_s=self.sensors.clock_away_s,
        )

    def _begin(self, current: LocalMap) -> None:
        t_s = self._frame_pipeline.t_s
        self._seen, self._left_out = self._sees(current), False
        due = self.sensors.clock_watch.is_due(float(t_s[-1] - t_s[current.first_frame]))
        self._start(fit, replace(self._given(current), watches_clock=due), FIT_S)
