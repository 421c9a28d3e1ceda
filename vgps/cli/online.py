"""The verb ``online``."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from vgps.cli.app import print_line
from vgps.cli.options import GpsSettings, NotNegative

if TYPE_CHECKING:
    from vgps.online.outputs.output import PoseOutput


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Sources:
    """Live sources, or files used instead of those in the recording folder.

    Attributes:
        video: Live video instead of a recording: /dev/video0, or an rtsp://, http:// or tcp:// address.
        gps: With --video a receiver: /dev/ttyACM0, /dev/ttyUSB0@38400, tcp://HOST:PORT, gpsd://HOST, or - for
            standard input. With a recording its GPS log; a path, or a name inside the folder.
        imu: Angular rates and specific force of a recording, as imu.csv; a path, or a name inside the folder.
        camera: camera.yaml; required with --video.
        rig: rig.yaml.
        video_delay: Delay of a live picture from exposure to arrival [s], if the computer's clock times it.
    """

    video: str | None = None
    gps: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None  # - is a receiver
    imu: str | None = None
    camera: Path | None = None
    rig: Path | None = None
    video_delay: NotNegative = 0.0


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Listeners:
    """Where poses go beside standard output.

    Attributes:
        nmea: tcp://HOST:PORT to listen there, or a serial port as /dev/ttyUSB0@38400: poses as a receiver's
            GGA, GST and HDT.
        websocket: HOST:PORT to listen there: the lines of standard output as WebSocket messages.
        rerun: Show path, camera, fixes and standard deviations in a window of the viewer.
    """

    nmea: str | None = None
    websocket: str | None = None
    rerun: Annotated[bool, Parameter(negative=())] = False


_NONE, _SETTINGS, _QUIET = Sources(), GpsSettings(), Listeners()


def online(
    recording: Path | None = None,
    *,
    out: Path | None = None,
    finish: bool = False,
    realtime: bool = False,
    lag_s: NotNegative = 0.0,
    sources: Sources = _NONE,
    listeners: Listeners = _QUIET,
    settings: GpsSettings = _SETTINGS,
) -> None:
    """Estimate poses while a video runs; print one line of JSON per frame and per event.

    Args:
        recording: Folder with video, camera.yaml, rig.yaml and GPS log, or a video with these beside it.
        out: Run folder to write at the end, also after Ctrl-C.
        finish: Keep all data and run the final optimisation (stage D) at the end, as `smooth` does.
        realtime: Play a recording at its own pace instead of as fast as possible.
        lag_s: Write each pose this much later [s], by the fixes and frames that came until then.
        sources: Live sources or other files.
        listeners: Where poses go.
        settings: Settings.
    """
    from vgps.online.session import OnlineOptions, pose_live, pose_recording

    options = OnlineOptions(
        config=settings.read(),
        out=out,
        finish=finish,
        gps=sources.gps,
        imu=sources.imu,
        camera=sources.camera,
        rig=sources.rig,
        lag_s=lag_s,
        nmea=listeners.nmea,
        websocket=listeners.websocket,
        open_view=_live_view if listeners.rerun else None,
    )
    if sources.video is None:
        frames = pose_recording(recording, options, realtime=realtime)
    else:
        frames = pose_live(sources.video, recording, options, delay_s=sources.video_delay)
    print_line(f"{frames} frames{f': {out}' if out else ''}", to_stderr=True)


def _live_view() -> "PoseOutput":
    from vgps.online.outputs.view_output import ViewOutput
    from vgps.viewer import open_live_view

    return ViewOutput(open_live_view())
