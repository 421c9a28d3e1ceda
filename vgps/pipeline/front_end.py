"""Stages A to C over a whole recording, and their result."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import numpy as np

from vgps.camera import WIDEST_DEG, unused_share
from vgps.config import Config
from vgps.errors import GeometryError
from vgps.gps.clock_search import ClockCheck
from vgps.gps.fixes import Fixes
from vgps.gps.frame_gaps import frame_gaps, in_gaps
from vgps.gps.sensors import Sensors
from vgps.gps.world_frame import world_fixes
from vgps.imu.camera_imu import CameraImu, used_imu
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS, ControlObservations
from vgps.mapping.local_map import LocalMap
from vgps.model import Camera, FloatArray, Frame, GeodeticPoint, IntArray, Recording
from vgps.pipeline.checkpoint import Checkpoint
from vgps.pipeline.frame_pipeline import FramePipeline
from vgps.pipeline.rig_recordings import check_settings, seen_by, settings_for
from vgps.pipeline.shown_frames import shown_frames
from vgps.runtime.journal import Journal
from vgps.runtime.progress import Progress
from vgps.runtime.threads import one_blas_thread
from vgps.runtime.timing import StageTimer
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.merging.merge_cameras import CameraMaps
from vgps.tracking.control_points import world_controls

_NOTABLE_SHARE = 0.01  # of a picture that is left out


@dataclass(frozen=True, kw_only=True)
class FrontEnd:
    """Result of stages A to C, the input of stage D.

    Attributes:
        recording: Camera, rig and GPS log.
        origin: Origin of the world frame, if there is one.
        t_s: (F,) times of all frames.
        maps: Maps in order of time.
        fixes: All fixes in the world frame, at the times of their time stamps.
        sensors: Time offset of the fixes, as estimated so far, and lever arm.
        controls: Observations of control points.
        static_regions, moving_regions: (n, 6) as in :class:`~vgps.solution.Solution`.
        warnings: Warnings for the user.
        repeated_frames: (n,) frames that repeat the picture before them while the camera moves on.
        seconds: Wall seconds by stage.
        others: Maps of the other cameras of a rig.
        journal: Where stage D keeps its long steps.
        clock: What the video alone shows of the GPS clock; None before they are compared.
        inertial: Whether IMU and fixes gave the path; the IMU then holds every frame.
    """

    recording: Recording
    origin: GeodeticPoint | None
    t_s: FloatArray
    maps: tuple[LocalMap, ...]
    fixes: Fixes
    sensors: Sensors
    controls: ControlObservations
    static_regions: IntArray
    moving_regions: IntArray
    warnings: tuple[str, ...]
    repeated_frames: IntArray
    seconds: Mapping[str, float]
    others: tuple[CameraMaps, ...] = ()
    journal: Journal | None = None
    clock: ClockCheck | None = None
    inertial: bool = False

    def context(self, config: Config) -> SmoothingContext:
        """Return the camera, the control points and the settings for stage D."""
        imu = camera_imu(self.recording, self.origin, config)
        recording, journal = self.recording, self.journal
        if self.inertial:
            config = config.with_imu_knots(float(np.median(np.diff(self.t_s))))
        return SmoothingContext(
            recording.camera, config, self.controls, imu, recording.cameras, journal=journal
        )

    def with_camera(self, name: str, other: "FrontEnd") -> "FrontEnd":
        """Return the result with that of another camera of the rig."""
        notes = other.warnings if other.maps else (*other.warnings, "it shows too little to be tracked")
        stages = {*self.seconds, *other.seconds}
        return replace(
            self,
            others=(*self.others, CameraMaps(other.maps, other.t_s, other.sensors, name)),
            warnings=(*self.warnings, *(f"camera {name}: {note}" for note in notes)),
            seconds={key: self.seconds.get(key, 0.0) + other.seconds.get(key, 0.0) for key in stages},
        )


class Probe(Protocol):
    """Looks at what the first frames of a video show."""

    def stops(self, frames: int, so_far: Callable[[], FrontEnd]) -> bool:
        """Return whether to stop after some number of frames, of which a function gives the result."""
        ...


def run_front_end(
    recording: Recording,
    config: Config,
    progress: Progress,
    checkpoint: Checkpoint | None = None,
    probe: Probe | None = None,
) -> FrontEnd:
    """Run stages A to C over all frames of every camera.

    Args:
        recording: The recording.
        config: Settings.
        progress: Progress display.
        checkpoint: Where the state of the reference camera is kept, and resumed from.
        probe: May stop after the first frames of the reference camera; then the result is that of these.

    Raises:
        ConfigError: Settings that a rig of several cameras does not support.
        GpsLogError: Too few usable fixes.
        RecordingError: Control points in ENU beside a GPS log, and no origin.
        GeometryError: No two views start a map.
    """
    if recording.cameras:
        check_settings(config)
    found = _run_camera(recording, config, progress, checkpoint, probe)
    if not found.maps and config.start.chance_of_start < 1.0:
        start = config.start.model_copy(update={"max_chance": 1.0})  # a doubtful map is better than none
        found = _run_camera(recording, config.model_copy(update={"start": start}), progress)
    for camera in recording.cameras:
        progress.stage(f"camera {camera.name}")
        alone = _run_camera(seen_by(camera, recording), settings_for(camera, config), progress)
        found = found.with_camera(camera.name, alone)
    if not any((found.maps, *(one.maps for one in found.others))):
        raise GeometryError(
            "no map could be started: the camera hardly moves, too few features are visible, or they cannot "
            "be followed from frame to frame (an exposure that jumps, frames far apart)",
            file=recording.video.path,
            expected=f"two views with {config.start.min_inliers} common features that move by "
            f"{config.start.min_flow_px:g} px",
        )
    return found


def _run_camera(
    recording: Recording,
    config: Config,
    progress: Progress,
    checkpoint: Checkpoint | None = None,
    probe: Probe | None = None,
) -> FrontEnd:
    """Run stages A to C over all frames of a camera, from those of a checkpoint on if one is given."""
    origin, fixes = world_fixes(recording, config)
    controls = world_controls(recording.control_points, recording.camera, origin) or NO_CONTROL_OBSERVATIONS
    context = SmoothingContext(recording.camera, config, controls, camera_imu(recording, origin, config))
    frame_pipeline = FramePipeline(context, recording.rig.camera_p_antenna, fixes)
    so_far = partial(front_end_of, frame_pipeline, recording, origin, controls)
    done = 0 if checkpoint is None else checkpoint.restore(frame_pipeline)
    frames = _decoded(shown_frames(recording), frame_pipeline.timer)
    with one_blas_thread():
        for frame in progress.track(frames, len(recording.video.times_s)):
            if frame.index < done:
                continue
            frame_pipeline.add_frame(frame)
            if probe is not None and probe.stops(len(frame_pipeline.t_s), so_far):
                checkpoint = None  # a run that is resumed stops here again
                break
            if checkpoint is not None:
                checkpoint.offer(frame_pipeline)
        frame_pipeline.finish()
    if checkpoint is not None:
        checkpoint.write(frame_pipeline)
    return so_far()


def camera_imu(recording: Recording, origin: GeodeticPoint | None, config: Config) -> CameraImu | None:
    """Return the IMU at the camera; None if there is none, or if it is not to be used."""
    return used_imu(recording.imu, recording.rig.imu, origin, config.imu)


def front_end_of(
    frame_pipeline: FramePipeline,
    recording: Recording,
    origin: GeodeticPoint | None,
    controls: ControlObservations = NO_CONTROL_OBSERVATIONS,
) -> FrontEnd:
    """Return the result of a frame pipeline as plain data."""
    return FrontEnd(
        recording=recording,
        origin=origin,
        t_s=frame_pipeline.t_s,
        maps=tuple(frame_pipeline.maps),
        fixes=frame_pipeline.fix_buffer.fixes,
        sensors=_sensors(frame_pipeline, recording),
        controls=controls,
        static_regions=frame_pipeline.tracker.static.rectangles,
        moving_regions=frame_pipeline.tracker.moving.boxes,
        warnings=(
            *recording.notes,
            *getattr(recording.video, "warnings", ()),
            *frame_pipeline.warnings,
            *_repeats(frame_pipeline),
            *_gaps(frame_pipeline),
            *_failures(frame_pipeline),
            *_unused(recording.camera),
        ),
        repeated_frames=np.array(frame_pipeline.repeated_frames, int),
        seconds=dict(frame_pipeline.timer.by_stage),
    )


def _failures(frame_pipeline: FramePipeline) -> tuple[str, ...]:
    count = frame_pipeline.window_failures
    if not count:
        return ()
    return (f"windows that iSAM2 could not solve: {count}; window.solver schur took their place",)


def _repeats(frame_pipeline: FramePipeline) -> tuple[str, ...]:
    repeats, t_s = frame_pipeline.repeated_frames, frame_pipeline.t_s
    if not repeats:
        return ()
    return (
        f"{len(repeats)} of {len(t_s)} frames repeat the picture before them while the camera moves on, the "
        f"first at {t_s[repeats[0]]:.2f} s: they have poses between those of their neighbours",
    )


def _gaps(frame_pipeline: FramePipeline) -> tuple[str, ...]:
    t_s, fixes = frame_pipeline.t_s, frame_pipeline.fix_buffer.fixes
    unused = int(np.sum(in_gaps(t_s, fixes.t_s) & ~fixes.used & np.isfinite(fixes.r_m)))
    if not unused:
        return ()
    gaps = frame_gaps(t_s)
    begin_s, end_s = (t_s[gaps + beside] for beside in (0, 1))
    longest = int(np.argmax(end_s - begin_s))
    gap = f"{end_s[longest] - begin_s[longest]:.1f} s from {begin_s[longest]:.2f} s on"
    return (
        f"frames are missing, for up to {gap}: what the camera did in such gaps is unknown, and the "
        f"fixes in them ({unused}) are not used",
    )


def _unused(camera: Camera) -> tuple[str, ...]:
    share = unused_share(camera)
    if share < _NOTABLE_SHARE:
        return ()
    return (
        f"{100.0 * share:.0f} % of the picture is left out: it lies beyond the lens model, or more than "
        f"{WIDEST_DEG:g} degrees off the axis of a fisheye",
    )


def _sensors(frame_pipeline: FramePipeline, recording: Recording) -> Sensors:
    """Return the sensors as estimated so far, for stage D with the uncertainty of an unknown lever arm."""
    config, fixes = frame_pipeline.config, frame_pipeline.fix_buffer.fixes
    if recording.rig.antenna_known or config.gps.model == "none" or not fixes.used.any():
        return frame_pipeline.fix_buffer.sensors
    return frame_pipeline.fix_buffer.sensors.with_unknown_antenna(config.sensors, fixes.are_rtk)


def _decoded(frames: Iterator[Frame], timer: StageTimer) -> Iterator[Frame]:
    """Yield the same frames and time how long decoding them takes."""
    while True:
        with timer.measure("decode"):
            frame = next(frames, None)
        if frame is None:
            return
        yield frame
