"""Recordings: folders of files under known names, or videos with the other files beside them."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from vgps.errors import GpsLogError, RecordingError
from vgps.model import ControlPoints, GpsLog, GyroLog, ImuLog, ImuMount, Recording, Rig, Video
from vgps.readers.bag import BagVideo
from vgps.readers.calibration.camera_guess import guess_cameras
from vgps.readers.calibration.projection_checks import check_flat, check_square_pixels, log_other_tracks
from vgps.readers.calibration.rig_file import read_rig
from vgps.readers.control_points import PointSystem, read_control_points
from vgps.readers.gopro.chapters import ChapteredVideo
from vgps.readers.gopro.gpmf import Telemetry
from vgps.readers.gopro.lens import with_readout
from vgps.readers.gopro.sensors import (
    GYRO_R_CAMERA,
    gopro_exposures,
    read_gopro_gyro,
    read_gopro_imu,
)
from vgps.readers.gopro.stabilisation import with_picture_motion
from vgps.readers.gps import UnknownStartError, gps_format, read_gps_log
from vgps.readers.gyro import read_gyro
from vgps.readers.imu import during_video, gyro_of, on_video_clock, read_imu
from vgps.readers.overlap import check_overlap
from vgps.readers.own_gps import own_gps
from vgps.readers.rig_cameras import open_cameras
from vgps.readers.sources import PathLike, Source, opened, place_of, telemetry_of
from vgps.readers.video.images import ImageFolder
from vgps.readers.video.masks import find_masks
from vgps.readers.video.tags import stated_time
from vgps.readers.video.video_file import VideoFile
from vgps.readers.views.lenses import Equirectangular, WideFisheye
from vgps.readers.views.wide_pictures import Lens, front_of, read_lens, with_views

_CALIBRATE = (
    "give a calibration with --camera, such as the camera.yaml of a run or of vgps calibrate-camera, or one "
    "of another program"
)
_STATED = "but some cameras write local time there, and some phones the end of the recording"
_CAMERAS = ("camera.yaml", "camera.yml", "camera.xml", "camera.json", "camchain.yaml", "cameras.txt")


def open_recording(
    path: PathLike,
    *,
    gps: PathLike | None = None,
    camera: PathLike | None = None,
    rig: PathLike | None = None,
    imu: PathLike | None = None,
    control_points: PathLike | None = None,
    control_system: PointSystem | None = None,
    image_topic: str | None = None,
    with_gps: bool = True,
    guess_camera: bool = True,
    cameras: bool = True,
    views: bool = True,
) -> Recording:
    """Open a recording; the video is indexed, its frames are not decoded yet.

    Args:
        path: A folder with ``video.mp4`` (.mov, .avi, or a bag named ``video``, or a folder of images),
            ``camera.yaml`` (or a calibration of OpenCV's, Kalibr's or COLMAP's: ``camera.yml``, ``.xml``,
            ``.json``, ``camchain.yaml``, ``cameras.txt``) and, optional, ``rig.yaml``, ``gps.*``,
            ``gyro.csv``, ``imu.csv``, ``control_points.csv`` or ``gcp_list.txt``; or a video, bag or folder
            of images with the other files beside it.
        gps, camera, rig, imu, control_points: Other files to use; a path, or a name inside the folder.
        control_system: What the coordinates of the control points are in, unless they say so.
        image_topic: Topic of the images of a bag that has several.
        with_gps: Whether to look for a GPS log.
        guess_camera: Whether a missing calibration is guessed; else it is an error.
        cameras: Whether to open the other cameras that rig.yaml lists, and the other views of a wide lens.
        views: Whether a fisheye of more than 180 degrees is seen through several views; else its rim is lost.

    Returns:
        The recording, every stream on the video's clock. A GoPro's video supplies its GPS, gyro,
        accelerometer, gyro_R_camera, median exposure and readout where no file gives them. An IMU whose
        mounting the rig does not give is left out, with a note.

    Raises:
        RecordingError: There is no video, or a named file is missing.
        VideoError, CalibrationError, GpsLogError, GyroLogError: From the readers; also if the camera's size
            is not the video's, there are several GPS logs and none is named, or no fix is during the video.
    """
    path = Path(path)
    folder, source = place_of(path)
    video = opened(source, image_topic)
    telemetry = telemetry_of(video)
    wide = read_lens(_given(folder, camera, *_CAMERAS), video)
    if isinstance(wide, WideFisheye) and not views:
        wide = wide.camera
    lens = None if wide is None else front_of(wide)
    rig_file = _given(folder, rig, "rig.yaml")
    mount = _with_start(read_rig(rig_file) if rig_file else Rig(antenna_known=False), video)
    others = open_cameras(rig_file, video, wide) if rig_file and cameras else ()
    if lens is None and not guess_camera:
        raise RecordingError("no camera.yaml", file=folder, remedy=_CALIBRATE)
    _check_picture(video, wide)
    guesses = guess_cameras(video, telemetry) if lens is None else ()
    lens = with_readout(lens or guesses[0].camera, telemetry, getattr(video, "quarter_turns", 0))
    gyro = _gyro(folder, mount, telemetry, video)
    mount = _with_gopro(mount, telemetry, gyro)
    inertial, notes = _imu(_given(folder, imu, "imu.csv"), mount, telemetry, video)
    if inertial is not None and mount.imu is not None and (gyro is None or imu is not None):
        gyro, mount = gyro_of(inertial, mount), replace(mount, gyro_R_camera=mount.imu.imu_R_camera)
    log = _gps(folder, gps, video, mount, telemetry) if with_gps else None
    doubts = () if log is None else tuple(f"{log.source.name}: {doubt}" for doubt in log.doubts)
    points = _given(folder, control_points, "control_points.csv", "gcp_list.txt")
    found = Recording(
        path=path,
        video=video,
        camera=lens,
        guesses=guesses,
        rig=mount,
        gps=log,
        gyro=gyro,
        imu=inertial,
        notes=(*notes, *doubts),
        masks=find_masks(folder, video),
        cameras=others,
        control_points=_control_points(points, video, control_system) if points else None,
    )
    return with_picture_motion(with_views(found, wide, all_views=cameras), telemetry)


def _with_start(rig: Rig, video: Source) -> Rig:
    """Return the rig with when the video begins, where the rig does not say it and the video does."""
    if rig.video_start_s == 0.0:
        rig = replace(rig, video_start_s=video.start_s)  # frame_times.csv is on the clock of gyro.csv
    if rig.video_start_utc is not None:
        return rig
    if isinstance(video, ImageFolder):
        return replace(rig, video_start_utc=video.taken(0).utc)
    return replace(rig, video_start_utc=video.start_utc) if isinstance(video, BagVideo) else rig


def _check_picture(video: Source, lens: Lens | None) -> None:
    """Refuse pictures that no lens model describes; raises as `check_flat` and `check_square_pixels`."""
    if isinstance(video, VideoFile | ChapteredVideo):
        if not isinstance(lens, Equirectangular):
            check_flat(video.path)
        log_other_tracks(video.path)
        if lens is None:
            check_square_pixels(video.path)


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
    return _given(place_of(Path(path))[0], rig, "rig.yaml")


def _given(folder: Path, name: PathLike | None, *defaults: str) -> Path | None:
    """Return the named file, or else the first of the defaults that exists."""
    if name is None:
        return next((folder / default for default in defaults if (folder / default).is_file()), None)
    for file in (folder / name, Path(name)):
        if file.is_file():
            return file
    raise RecordingError("no such file", file=Path(name), remedy=f"give a path, or a name inside {folder}")


def _gps(folder: Path, name: PathLike | None, video: Source, rig: Rig, telemetry: Telemetry) -> GpsLog | None:
    given = _given(folder, name) if name is not None else None
    logs = find_gps_logs(folder) if given is None else [given]
    if len(logs) > 1:
        candidates = ", ".join(log.name for log in logs)
        raise GpsLogError(
            f"several GPS logs: {candidates}", file=folder, remedy=f"name one: --gps {logs[0].name}"
        )
    if not logs:
        return own_gps(video, rig, telemetry)
    (file,) = logs
    try:
        fixes = read_gps_log(file, rig, telemetry if file == telemetry.path else None)
    except UnknownStartError as error:
        if (said := stated_time(video.path)) is None:
            raise
        hint = f"{error.remedy}; {video.path.name} says {said}, {_STATED}"
        raise GpsLogError(error.found, file=file, remedy=hint) from None
    check_overlap(fixes, video.times_s, rig)
    return fixes


def _gyro(folder: Path, rig: Rig, telemetry: Telemetry, video: Source) -> GyroLog | None:
    """Return the angular rates on the video's clock, without the rig's bias: by file, bag or GoPro."""
    gyro = video.gyro() if isinstance(video, BagVideo) else read_gopro_gyro(telemetry)
    if (file := folder / "gyro.csv").is_file():
        gyro = read_gyro(file, video_start_s=rig.video_start_s)
    if gyro is None:
        return None
    t_s, rate = gyro.t_s + rig.gyro_time_offset_s, gyro.rate_rad_s - rig.gyro_bias_rad_s
    return replace(gyro, t_s=t_s, rate_rad_s=rate)


def _imu(
    file: Path | None, rig: Rig, telemetry: Telemetry, video: Source
) -> tuple[ImuLog | None, tuple[str, ...]]:
    """Return the IMU's log and notes on it; None if there is none, or if mounting or clock are not known."""
    if rig.imu is None:
        if file is None:
            return None, ()
        what = f"{file.name} is left out: rig.yaml has no imu_R_camera, the rotation of the IMU on the camera"
        return None, (f"{what}; give it, or find it with vgps calibrate-imu",)
    if file is not None:
        log = on_video_clock(read_imu(file, video_start_s=rig.video_start_s), rig)
        return during_video(log, video.times_s, rig)
    own = read_gopro_imu(telemetry)
    return (None, ()) if own is None else (on_video_clock(own, rig), own.notes)


def _with_gopro(rig: Rig, telemetry: Telemetry, gyro: GyroLog | None) -> Rig:
    """Return the rig completed with a GoPro's metadata."""
    exposures = gopro_exposures(telemetry)
    if rig.exposure_s is None and exposures is not None:
        rig = replace(rig, exposure_s=float(np.median(exposures[1])))
    if rig.gyro_R_camera is None and gyro is not None and gyro.source == telemetry.path:
        rig = replace(rig, gyro_R_camera=GYRO_R_CAMERA)
    if rig.imu is None and "ACCL" in telemetry.sensors:
        rig = replace(rig, imu=ImuMount(imu_R_camera=GYRO_R_CAMERA))
    return rig


def _control_points(file: Path, video: Video, system: PointSystem | None) -> ControlPoints:
    images = [image.name for image in video.files] if isinstance(video, ImageFolder) else None
    points = read_control_points(file, system, images)
    last = int(points.frame.max())
    if last >= len(video.times_s):
        raise RecordingError(f"frame {last}", file=file, expected=f"frames 0 to {len(video.times_s) - 1}")
    return points
