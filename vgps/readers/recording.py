"""Recordings: folders of files under known names, or videos with the other files beside them."""

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np

from vgps.errors import CalibrationError, GpsLogError, RecordingError
from vgps.model import Camera, ControlPoints, GpsLog, GyroLog, Recording, Rig, Video
from vgps.readers.calibration import read_camera, read_rig
from vgps.readers.control_points import PointSystem, read_control_points
from vgps.readers.frame_times import FRAME_TIMES
from vgps.readers.gopro import GYRO_R_CAMERA, gopro_exposures, gps_stream, read_gopro_gps, read_gopro_gyro
from vgps.readers.gpmf import Telemetry, read_gpmf
from vgps.readers.gps import check_overlap, gps_format, read_gps_log
from vgps.readers.gyro import read_gyro
from vgps.readers.images import ImageFolder, list_images
from vgps.readers.video import VideoFile

log = logging.getLogger(__name__)
_CAMERAS = ("camera.yaml", "camera.yml", "camera.xml", "camera.json", "camchain.yaml", "cameras.txt")
_SUFFIXES = (".mp4", ".mov", ".avi", ".mkv", ".m4v")
PathLike = str | Path


def open_recording(
    path: PathLike,
    *,
    gps: PathLike | None = None,
    camera: PathLike | None = None,
    rig: PathLike | None = None,
    control_points: PathLike | None = None,
    control_system: PointSystem | None = None,
    with_gps: bool = True,
) -> Recording:
    """Open a recording; the video is indexed, its frames are not decoded yet.

    Args:
        path: A folder with ``video.mp4`` (.mov, .avi, or a folder of images with ``frame_times.csv``),
            ``camera.yaml`` (or a calibration of OpenCV's, Kalibr's or COLMAP's: ``camera.yml``, ``.xml``,
            ``.json``, ``camchain.yaml``, ``cameras.txt``) and, optional, ``rig.yaml``, ``gps.*``,
            ``gyro.csv``, ``control_points.csv`` or ``gcp_list.txt``; or a video or folder of images with the
            other files beside it.
        gps, camera, rig, control_points: Other files to use; a path, or a name inside the folder.
        control_system: What the coordinates of the control points are in, unless they say so.
        with_gps: Whether to look for a GPS log.

    Returns:
        The recording, every stream on the video's clock. A GoPro's video supplies its GPS, gyro,
        gyro_R_camera and median exposure where no file gives them.

    Raises:
        RecordingError: There is no video, or a named file is missing.
        VideoError, CalibrationError, GpsLogError, GyroLogError: From the readers; also if the camera's size
            is not the video's, there are several GPS logs and none is named, or no fix is during the video.
    """
    path = Path(path)
    folder, source = _place(path)
    video = _opened(source)
    lens = _camera(_given(folder, camera, *_CAMERAS), folder, video)
    rig_file = _given(folder, rig, "rig.yaml")
    mount = read_rig(rig_file) if rig_file else Rig()
    if mount.video_start_s == 0.0 and video.start_s != 0.0:
        # frame_times.csv is on the clock of gyro.csv
        mount = replace(mount, video_start_s=video.start_s)
    telemetry = read_gpmf(video.path) if isinstance(video, VideoFile) else Telemetry(video.path)
    gyro = _gyro(folder, mount, telemetry)
    mount = _with_gopro(mount, telemetry, gyro)
    points = _given(folder, control_points, "control_points.csv", "gcp_list.txt")
    return Recording(
        path=path,
        video=video,
        camera=lens,
        rig=mount,
        gps=_gps(folder, gps, video, mount, telemetry) if with_gps else None,
        gyro=gyro,
        control_points=_control_points(points, video, control_system) if points else None,
    )


def open_video(path: PathLike) -> VideoFile | ImageFolder:
    """Return the video or the folder of images of a recording, or beside it, without the other files.

    Raises:
        RecordingError, VideoError: There is none, or it cannot be read.
    """
    return _opened(_place(Path(path))[1])


def find_gps_logs(folder: PathLike) -> list[Path]:
    """Return the GPS logs of a folder: ``gps.*`` and ``gps_*`` with such content."""
    files = sorted(file for file in Path(folder).iterdir() if file.is_file())
    named = [file for file in files if file.stem == "gps" or file.name.startswith("gps_")]
    return [file for file in named if gps_format(file) is not None or file.stem == "gps"]


def find_rig(path: PathLike, rig: PathLike | None = None) -> Path | None:
    """Return the rig.yaml that `open_recording` reads, if there is one.

    Raises:
        RecordingError: There is no video, or the named ``rig`` is missing.
    """
    return _given(_place(Path(path))[0], rig, "rig.yaml")


def _place(path: Path) -> tuple[Path, Path]:
    """Return the folder of the other files, and the video or folder of images."""
    if path.is_file():
        return path.parent, path
    if not path.is_dir():
        raise RecordingError(
            "no such recording", file=path, expected="a folder with video.mp4 and camera.yaml, or a video"
        )
    videos = [file for suffix in _SUFFIXES if (file := path / f"video{suffix}").is_file()]
    if len(videos) > 1:
        names = ", ".join(file.name for file in videos)
        raise RecordingError(
            f"several videos: {names}", file=path, remedy="name one of them as the recording"
        )
    if videos:
        return path, videos[0]
    inner = sorted(sub for sub in path.iterdir() if sub.is_dir() and list_images(sub))
    if list_images(path):
        # a folder of images: the other files are in it, or beside it
        inside = any((path / name).is_file() for name in ("camera.yaml", "rig.yaml"))
        return (path if inside else path.parent), path
    if len(inner) == 1:
        return path, inner[0]
    found = f"several folders of images: {', '.join(sub.name for sub in inner)}" if inner else "no video"
    raise RecordingError(
        found,
        file=path,
        expected="video.mp4, video.mov, video.avi or one folder of images with frame_times.csv",
    )


def _opened(path: Path) -> VideoFile | ImageFolder:
    if path.is_dir():
        return ImageFolder(path)
    table = path.parent / FRAME_TIMES
    return VideoFile(path, table if table.is_file() else None)


def _given(folder: Path, name: PathLike | None, *defaults: str) -> Path | None:
    """Return the named file, or else the first of the defaults that exists."""
    if name is None:
        return next((folder / default for default in defaults if (folder / default).is_file()), None)
    for file in (folder / name, Path(name)):
        if file.is_file():
            return file
    raise RecordingError("no such file", file=Path(name), remedy=f"give a path, or a name inside {folder}")


def _camera(file: Path | None, folder: Path, video: Video) -> Camera:
    if file is None:
        raise RecordingError(
            "no camera.yaml",
            file=folder,
            remedy="add the calibration (model, width, height, fx, fy, cx, cy, distortion), or name that of "
            "another program with --camera",
        )
    camera = read_camera(file)
    if (camera.width, camera.height) != (video.width, video.height):
        raise CalibrationError(
            f"a camera of {camera.width} x {camera.height}",
            file=file,
            expected=f"{video.width} x {video.height} as in {video.path}",
            remedy="calibrate the camera at the video's size",
        )
    return camera


def _gps(folder: Path, name: PathLike | None, video: Video, rig: Rig, telemetry: Telemetry) -> GpsLog | None:
    if name is None:
        logs = find_gps_logs(folder) or _of_the_video(video, telemetry)
        if not logs:
            return None
        if len(logs) > 1:
            candidates = ", ".join(log.name for log in logs)
            raise GpsLogError(
                f"several GPS logs: {candidates}", file=folder, remedy=f"name one: --gps {logs[0].name}"
            )
        file = logs[0]
    else:
        given = _given(folder, name)
        assert given is not None
        file = given
    fixes = read_gps_log(file, rig, telemetry if file == telemetry.path else None)
    check_overlap(fixes, video.times_s, rig)
    return fixes


def _of_the_video(video: Video, telemetry: Telemetry) -> list[Path]:
    """Return the video's own log, if any: a GoPro's GPS in it, or a drone's subtitles beside it."""
    if gps_stream(telemetry) is not None:
        if read_gopro_gps(telemetry).fixes:
            return [video.path]
        log.warning("%s: the camera's GPS never had a fix; continuing without GPS", video.path)
    beside = [video.path.with_suffix(suffix) for suffix in (".srt", ".SRT")]
    return [file for file in beside if gps_format(file) == "srt"][:1]


def _gyro(folder: Path, rig: Rig, telemetry: Telemetry) -> GyroLog | None:
    file = folder / "gyro.csv"
    given = file.is_file()
    gyro = read_gyro(file, video_start_s=rig.video_start_s) if given else read_gopro_gyro(telemetry)
    if gyro is None:
        return None
    t_s, rate = gyro.t_s + rig.gyro_time_offset_s, gyro.rate_rad_s - rig.gyro_bias_rad_s
    return replace(gyro, t_s=t_s, rate_rad_s=rate)


def _with_gopro(rig: Rig, telemetry: Telemetry, gyro: GyroLog | None) -> Rig:
    """Return the rig completed with a GoPro's metadata."""
    exposures = gopro_exposures(telemetry)
    if rig.exposure_s is None and exposures is not None:
        rig = replace(rig, exposure_s=float(np.median(exposures[1])))
    if rig.gyro_R_camera is None and gyro is not None and gyro.source == telemetry.path:
        rig = replace(rig, gyro_R_camera=GYRO_R_CAMERA)
    return rig


def _control_points(file: Path, video: Video, system: PointSystem | None) -> ControlPoints:
    images = [image.name for image in video.files] if isinstance(video, ImageFolder) else None
    points = read_control_points(file, system, images)
    last = int(points.frame.max())
    if last >= len(video.times_s):
        raise RecordingError(f"frame {last}", file=file, expected=f"frames 0 to {len(video.times_s) - 1}")
    return points
