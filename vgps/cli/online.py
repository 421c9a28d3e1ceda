"""The verb that poses a video while it runs."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vgps.cli.app import app, say
from vgps.config import GpsModel, read_config
from vgps.online.session import OnlineOptions, pose_live, pose_recording


@app.command
def online(
    recording: Path | None = None,
    *,
    video: str | None = None,
    gps: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,  # - is a receiver
    camera: Path | None = None,
    rig: Path | None = None,
    out: Path | None = None,
    finish: bool = False,
    realtime: bool = False,
    video_delay: float = 0.0,
    gps_model: GpsModel | None = None,
    survey: Path | None = None,
    config: Path | None = None,
    seed: int | None = None,
) -> None:
    """Pose a video while it runs: a line of JSON per frame, and per event, on standard output.

    Args:
        recording: Folder with video, camera.yaml, rig.yaml and GPS log, or a video with these beside it.
        video: Instead of a recording: /dev/video0, or an address as rtsp://, http:// or tcp://.
        gps: With a recording its GPS log, a path or a name inside the folder. With --video a receiver:
            /dev/ttyACM0, /dev/ttyUSB0@38400, tcp://HOST:PORT, gpsd://HOST, or - for standard input.
        camera: With --video the camera.yaml; else another one than the folder's.
        rig: With --video the rig.yaml; else another one than the folder's.
        out: Run folder to write at the end, at Ctrl-C too.
        finish: Keep everything and run stage D at the end, as `smooth` does.
        realtime: A recording at its own pace, else as fast as possible.
        video_delay: StageTimer from a picture's taking to its arrival, where this computer's clock counts.
        gps_model: How a fix acts on the path; a cylinder around it by default.
        survey: YAML with the region r_m, h_m of each fix class.
        config: YAML that overrides the defaults.
        seed: Of every random choice.
    """
    settings = read_config(config).with_gps(gps_model, survey).with_seed(seed)
    options = OnlineOptions(settings, out, finish, gps, camera, rig)
    if video is None:
        frames = pose_recording(recording, options, realtime=realtime)
    else:
        frames = pose_live(video, recording, options, delay_s=video_delay)
    where = f": {out}" if out else ""
    say(f"{frames} frames{where}", aside=True)
