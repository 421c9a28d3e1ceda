"""The live mode: a pose for every frame as frames and fixes arrive."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from vgps.config import Config
from vgps.errors import ConfigError
from vgps.gps.fixes import Fixes
from vgps.mapping.retention import RetentionPolicy
from vgps.model import Camera, FloatArray, Frame, GrayImage, GyroLog, ImuLog, Rig
from vgps.online.archive import FrameArchive
from vgps.online.checked_frame import check_frame
from vgps.online.estimate import OnlineEstimate
from vgps.online.event_queue import EventQueue
from vgps.online.fix_intake import FixIntake
from vgps.online.fusion.live_fusion import LiveFusion
from vgps.online.fusion.live_time_offset import video_alone
from vgps.online.fusion.pose_sigmas import UNKNOWN_SIGMAS
from vgps.online.live_imu import LiveImu
from vgps.online.live_places import LivePlaces
from vgps.online.pose_publisher import PosePublisher
from vgps.online.session_result import SessionRecord, session_front_end, session_solution
from vgps.online.verdict_events import VerdictEvents
from vgps.pipeline.frame_pipeline import FramePipeline
from vgps.pipeline.offline import optimise_all
from vgps.readers.gps_formats.fixes import Fix
from vgps.runtime.allocator import release_free_memory
from vgps.runtime.threads import one_blas_thread
from vgps.smoothing.context import SmoothingContext
from vgps.solution import Solution

_DISCARD_EVERY = 15  # frames; discarding costs more than keeping a few frames
_GIVE_BACK_EVERY = 300  # frames; returning memory to the system takes milliseconds
_LIVE = Path("live")


class OnlineSmoother:
    """Live smoother: stages A, B and C on every frame; stage D at the end, if everything was kept.

    The pose of a frame is published after stage A; the others run afterwards. Without ``keep_all`` neither
    time nor memory per frame grows with their number, but for about 100 bytes per frame and fix.

    Stage C optimises the map by the video alone. Where the map lies in the world follows from the fixes of
    the frames kept (``online.keep_s``), by :class:`vgps.online.fusion.live_fusion.LiveFusion`.

    Args:
        camera: Its lens.
        rig: Lever arm; the origin of the world is ``world_origin`` or else the first usable fix.
        config: Settings; the defaults if none are given.
        keep_all: Whether to keep all observations, which stage D needs.
        source: Name of the recording in the result.
        imu: Of a recording that is replayed: its gyro predicts the rotation from each frame to the next,
            gravity levels the path, and both bridge frames without features.

    Attributes:
        video_start_utc: UTC of the first frame, if known; initially that of the rig.
    """

    def __init__(
        self,
        camera: Camera,
        rig: Rig,
        config: Config | None = None,
        *,
        keep_all: bool = False,
        source: Path = _LIVE,
        imu: ImuLog | None = None,
    ) -> None:
        self._config = config = config or Config()
        self._camera, self._rig, self._source, self._keep_all = camera, rig, source, keep_all
        self._imu = LiveImu(imu, rig, config)
        retention = None if keep_all else RetentionPolicy.of(config)
        # stage C follows the video alone: a path bent to fixes no longer contradicts them
        calibrates = config.intrinsics.refine != "no"
        context = SmoothingContext(
            camera, video_alone(config), imu=self._imu.at_camera, calibrates=calibrates
        )
        self._frame_pipeline = FramePipeline(
            context, rig.camera_p_antenna, Fixes.empty(), retention, live=True
        )
        self._intake = FixIntake(self._frame_pipeline, config.gps, source, rig.world_origin)
        self._frames = FrameArchive()
        self._gyro: list[tuple[float, float, float, float]] = []
        self._publisher = PosePublisher(self._frame_pipeline, config.online)
        self._fusion = LiveFusion(
            self._frame_pipeline, config, self._imu.at_camera, antenna_known=rig.antenna_known
        )
        self._places = LivePlaces(self._frame_pipeline, self._fusion, camera, config)
        self._verdicts = VerdictEvents(config.gps.model)
        self._events = EventQueue()
        self._estimate: OnlineEstimate | None = None
        self._unrefined: GrayImage | None = None  # the newest frame
        self.video_start_utc = rig.video_start_utc

    def add_fix(self, fix: Fix) -> bool:
        """Add a fix, which may be late or out of order.

        Args:
            fix: ``t_s`` on the video's clock, heights ellipsoidal.

        Returns:
            Whether it was accepted; a fix without a position, at the time of another, with the same position
            as the one before it within a second, or an hour ahead of the newest frame is not.
        """
        return self._intake.add(fix)

    def add_gyro(self, t_s: float, rate_rad_s: FloatArray) -> None:
        """Record an angular rate (3,) in the gyro's axes, if ``keep_all`` is set."""
        if self._keep_all:
            x, y, z = (float(rate) for rate in rate_rad_s)
            self._gyro.append((t_s, x, y, z))

    def add_note(self, text: str) -> None:
        """Add a message for the user: an event of the next frame, and a warning of the result."""
        self._frame_pipeline.warnings.append(text)

    def add_frame(self, t_s: float, image: GrayImage) -> OnlineEstimate:
        """Pose the next frame, after stage C of the previous one if it is still due.

        Args:
            t_s: Seconds since the first frame, later than the frame before.
            image: (H, W) luminance, uint8.

        Raises:
            VideoError: The size differs from the camera's, or the time is not later than the last.
        """
        begun, frame = time.perf_counter(), len(self._frame_pipeline.t_s)
        check_frame(self._camera, self._frame_pipeline.t_s, t_s, image)
        self.refine()
        with one_blas_thread():
            self._frame_pipeline.track_frame(Frame(frame, t_s, image))
        self._intake.place()
        self._fusion.use_new_fixes()
        to_world, bridged = self._fusion.to_world(self._frame_pipeline.current), self._fusion.bridged()
        published = self._publisher.publish(frame, to_world, bridged)
        sigmas = self._fusion.sigmas(bridged) if published.posed else UNKNOWN_SIGMAS
        self._frames.append(published.global_T_camera, sigmas, tracked=published.state == "tracked")
        self._events.add_notes(t_s, self._frame_pipeline.warnings)
        self._events.add(published.events)
        self._estimate = OnlineEstimate(
            frame,
            t_s,
            published.state,
            published.global_T_camera,
            published.local_T_camera,
            sigmas.position_m,
            sigmas.rotation_rad,
            self._intake.origin,
            self._events.take(),
            time.perf_counter() - begun,
        )
        self._unrefined = image
        return self._estimate

    def refine(self) -> None:
        """Do what the newest pose did not wait for; call it in idle time, else :meth:`add_frame` does."""
        if self._unrefined is None:
            return
        image, self._unrefined, frames = self._unrefined, None, len(self._frame_pipeline.t_s)
        with one_blas_thread():
            self._frame_pipeline.map_frame()
            self._events.add(self._places.see(image))
            self._frame_pipeline.refine()
            self._imu.check(self._frame_pipeline, self._fusion)
            self._fusion.refine()
        fix_buffer = self._frame_pipeline.fix_buffer
        self._intake.archive.set_assessment(fix_buffer.number, fix_buffer.assessment)
        self._report_verdicts()
        if frames % _DISCARD_EVERY == 0:
            self._archive_path()
            self._frame_pipeline.discard()
        if frames % _GIVE_BACK_EVERY == 0:
            release_free_memory()

    def estimate(self) -> OnlineEstimate | None:
        """Return the newest frame's estimate, None before the first frame."""
        return self._estimate

    def revised(self, estimate: OnlineEstimate) -> OnlineEstimate:
        """Return an earlier estimate with pose and sigmas by all frames and fixes so far."""
        found = self._fusion.at(estimate.frame)
        if found is None:
            return estimate
        pose, sigmas = found
        return replace(
            estimate,
            global_T_camera=pose,
            sigma_position_m=sigmas.position_m,
            sigma_rotation_rad=sigmas.rotation_rad,
        )

    def finish(self, stage_d: bool = False) -> Solution:
        """Return the solution for a run folder; nothing may be added afterwards.

        Args:
            stage_d: Whether to run stage D first, as offline; requires ``keep_all``.

        Raises:
            ConfigError: Stage D is asked for, but not everything was kept.
            GeometryError: No frame has a pose; with stage D also as :func:`vgps.smooth`.
        """
        if stage_d and not self._keep_all:
            raise ConfigError("stage D needs the observations of all frames", remedy="set keep_all")
        self.refine()
        self._frame_pipeline.finish_window()
        self._fusion.fuse_all()
        self._archive_path()
        self._fusion.place_map(self._frames.poses())
        if self._estimate is not None:
            self._events.add_notes(self._estimate.t_s, self._frame_pipeline.warnings)
        maps, session = self._frame_pipeline.maps, self._session()
        if stage_d and maps:
            return optimise_all(session_front_end(session), self._config)
        return session_solution(session)

    def _archive_path(self) -> None:
        """Replace the published poses by those of the newest fit."""
        path = self._fusion.world_path()
        if path is not None:
            self._frames.update(path)

    def _session(self) -> SessionRecord:
        samples = np.array(self._gyro).reshape(-1, 4)
        return SessionRecord(
            source=self._source,
            camera=self._frame_pipeline.camera,
            rig=replace(self._rig, video_start_utc=self.video_start_utc),
            config=self._config,
            origin=self._intake.origin,
            frame_pipeline=self._frame_pipeline,
            frames=self._frames,
            fixes=self._intake.archive,
            gyro=GyroLog(samples[:, 0], samples[:, 1:], self._source) if len(samples) else None,
            imu=self._imu.log,
            lever_arm=self._fusion.sensors.estimated_lever_arm,
            warnings=tuple(self._events.warnings),
        )

    def _report_verdicts(self) -> None:
        fix_buffer, current = self._frame_pipeline.fix_buffer, self._frame_pipeline.current
        if current is None or not current.aligned:
            return
        t_s = self._frame_pipeline.t_s
        since_s, until_s = float(t_s[current.first_posed]), float(t_s[current.next_frame - 1])
        fix_class = self._intake.archive.fix_class
        self._events.add(self._verdicts.changes(fix_buffer, fix_class, since_s, until_s))
