"""A live session: poses of a recording or of live sources as JSON lines, and a run folder at the end."""

import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TextIO

from vgps.config import Config
from vgps.errors import ConfigError, GpsLogError, RecordingError
from vgps.model import Rig
from vgps.online.delay import DelayedEstimates
from vgps.online.estimate import OnlineEstimate
from vgps.online.outputs.output import JsonLines, Outputs, PoseOutput
from vgps.online.outputs.robot_outputs import NmeaOutput, WebSocketOutput
from vgps.online.replay import replay
from vgps.online.run import FeedItem, TimedImage, run_online, stopped_by_signals
from vgps.online.smoother import OnlineSmoother
from vgps.online.sources.gps_source import GpsSource
from vgps.online.sources.live_feed import live_feed, start_utc
from vgps.online.sources.video_source import VideoSource
from vgps.pipeline.airborne import with_airborne
from vgps.pipeline.video_speed import with_video_speed
from vgps.readers.calibration.camera_file import read_camera
from vgps.readers.calibration.rig_file import read_rig
from vgps.readers.recording import open_recording
from vgps.readers.rig_cameras import refuse_several
from vgps.runtime.threads import one_blas_thread
from vgps.writers.run_folder import check_writable, write_run


@dataclass(frozen=True, kw_only=True)
class OnlineOptions:
    """Options common to recordings and live sources.

    Attributes:
        config: Settings.
        out: Run folder to write at the end, if any.
        finish: Whether to keep all observations and run stage D at the end.
        gps: GPS log, or address of a receiver.
        imu: IMU's log that replaces that of the recording.
        camera, rig: Files that replace those of the recording.
        lag_s: Delay after which a pose is written, by all that came until then.
        nmea, websocket: Addresses where poses are sent, too.
        open_view: Opens a view of the poses as they come; it is closed at the end.
    """

    config: Config
    out: Path | None = None
    finish: bool = False
    gps: str | None = None
    imu: str | None = None
    camera: Path | None = None
    rig: Path | None = None
    lag_s: float = 0.0
    nmea: str | None = None
    websocket: str | None = None
    open_view: Callable[[], PoseOutput] | None = None

    def check(self) -> None:
        """Check before the session that its result can be written.

        Raises:
            ConfigError: Stage D is asked for without a folder for its result.
            RunFolderError: ``out`` cannot be written.
        """
        if self.finish and self.out is None:
            raise ConfigError("--finish without --out", remedy="name the run folder with --out")
        if self.out is not None:
            check_writable(self.out)


def pose_recording(
    path: Path | None, options: OnlineOptions, *, realtime: bool = False, stream: TextIO | None = None
) -> int:
    """Pose a recording as if it were live, and return the number of frames.

    Args:
        path: Recording, see :func:`vgps.open_recording`.
        options: Options.
        realtime: Whether to replay at the speed of the recording.
        stream: For the JSON lines; standard output if none is given.

    Raises:
        VgpsError: Bad input.
    """
    if path is None:
        raise RecordingError("no recording", expected="a folder, or --video SOURCE --camera CAMERA.YAML")
    options.check()
    opened = open_recording(
        path,
        gps=options.gps,
        imu=options.imu,
        camera=options.camera,
        rig=options.rig,
        guess_camera=False,
        views=False,
    )
    refuse_several(opened, "vgps online")
    opened = with_video_speed(opened, options.config)
    smoother = OnlineSmoother(
        opened.camera,
        opened.rig,
        with_airborne(opened, options.config),
        keep_all=options.finish,
        source=opened.path,
        imu=opened.imu,
    )
    for note in opened.notes:
        smoother.add_note(note)
    stop = threading.Event()
    with _opened_outputs(options, stream, opened.rig.video_start_utc) as outputs:
        return _run(replay(opened, stop, realtime=realtime), smoother, outputs, options, stop)


def pose_live(
    video: str,
    recording: Path | None,
    options: OnlineOptions,
    *,
    delay_s: float = 0.0,
    stream: TextIO | None = None,
) -> int:
    """Pose a camera or stream with a receiver until they end or Ctrl-C, and return the number of frames.

    Args:
        video: Address, see :class:`VideoSource`.
        recording: Must be None.
        options: ``camera`` is required; ``gps`` is an address, see :class:`GpsSource`, or None.
        delay_s: Latency of the camera, from exposure to arrival.
        stream: For the JSON lines; standard output if none is given.

    Raises:
        VgpsError: Bad input.
    """
    if recording is not None:
        raise RecordingError("both a recording and --video", expected="one of them")
    if options.imu is not None:
        raise RecordingError("both --imu and --video", expected="a recording with --imu")
    if options.camera is None:
        raise RecordingError("--video without a calibration", expected="--camera CAMERA.YAML")
    options.check()
    lens = read_camera(options.camera)
    rig = read_rig(options.rig) if options.rig is not None else Rig(antenna_known=False)
    source = VideoSource(video)
    if not source.live and options.gps is not None and rig.video_start_utc is None:
        raise GpsLogError(
            "fixes in UTC, while the file's start in UTC is not known",
            file=video,
            remedy="give video_start_utc in a rig.yaml and name it with --rig",
        )
    gps = GpsSource(options.gps) if options.gps is not None else None
    config = options.config
    if source.live:  # nothing that comes is the same again
        config = config.model_copy(update={"online": config.online.model_copy(update={"repeatable": False})})
    smoother = OnlineSmoother(lens, rig, config, keep_all=options.finish, source=Path(video))
    stop = threading.Event()
    try:
        with _opened_outputs(options, stream, None) as outputs:
            feed = _timed(live_feed(source, gps, rig, stop, delay_s), outputs, smoother, source, rig, delay_s)
            return _run(feed, smoother, outputs, options, stop)
    finally:
        source.close()
        if gps is not None:
            gps.close()


@contextlib.contextmanager
def _opened_outputs(
    options: OnlineOptions, stream: TextIO | None, start_utc: datetime | None
) -> Iterator[Outputs]:
    """Open all outputs, and close them at the end."""
    with contextlib.ExitStack() as opened:
        outputs: list[PoseOutput] = [JsonLines(stream or sys.stdout)]
        if options.nmea is not None:
            nmea = NmeaOutput(options.nmea, options.config.gps)
            outputs.append(opened.enter_context(contextlib.closing(nmea)))
        if options.websocket is not None:
            websocket = WebSocketOutput(options.websocket)
            outputs.append(opened.enter_context(contextlib.closing(websocket)))
        if options.open_view is not None:
            outputs.append(opened.enter_context(contextlib.closing(options.open_view())))
        yield Outputs(outputs, start_utc)


def _timed(
    feed: Iterable[FeedItem],
    outputs: Outputs,
    smoother: OnlineSmoother,
    source: VideoSource,
    rig: Rig,
    delay_s: float,
) -> Iterator[FeedItem]:
    """Yield the same items, and set the UTC of the first frame in lines and result once it is known."""
    for item in feed:
        if outputs.start_utc is None and source.start_unix_s and (source.live or rig.video_start_utc):
            outputs.start_utc = smoother.video_start_utc = start_utc(source, rig, delay_s)
        yield item


def _shown(feed: Iterable[FeedItem], outputs: Outputs) -> Iterator[FeedItem]:
    """Yield the same items; outputs see each frame when the next item is asked for, after its pose."""
    for item in feed:
        yield item
        if isinstance(item, TimedImage):
            outputs.show(item.t_s, item.gray)


@one_blas_thread()  # to the end, since stage C may still work after the last frame
def _run(
    feed: Iterable[FeedItem],
    smoother: OnlineSmoother,
    outputs: Outputs,
    options: OnlineOptions,
    stop: threading.Event,
) -> int:
    delayed = DelayedEstimates(smoother, options.lag_s)

    def write(due: Iterable[tuple[OnlineEstimate, float]]) -> None:
        try:
            for estimate, arrival_s in due:
                outputs.write(estimate, time.monotonic() - arrival_s)
        except BrokenPipeError:  # the reader has gone: stop, but write the run folder
            stop.set()
            with contextlib.suppress(OSError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())

    def sink(estimate: OnlineEstimate, latency_s: float) -> None:
        write(delayed.add(estimate, time.monotonic() - latency_s))

    with stopped_by_signals(stop):
        frames = run_online(_shown(feed, outputs), smoother, sink, stop)
        write(delayed.rest())
        if options.out is not None:
            write_run(smoother.finish(stage_d=options.finish), options.out)
    return frames
