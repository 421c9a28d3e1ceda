"""What is fuzzed: readers, the files it starts from, and how these are damaged."""

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path

import numpy as np

from scripts.experiments.fuzz.formats import (
    damage_boxes,
    damage_database,
    damage_gpmf,
    damage_nmea,
    damage_npz,
    damage_ubx,
)
from scripts.experiments.fuzz.loggers import damage_fit, damage_novatel, damage_sbf, damage_telemetry
from scripts.experiments.fuzz.mutators import LOG, TEXT, TREE, Mutator, damage_bytes, grow, nest_deeply
from vgps.config import read_config, read_survey
from vgps.crs import named_geoid
from vgps.landmarks.database import LandmarkDatabase
from vgps.model import Camera, Rig
from vgps.online.sources.gps_messages import Epochs, messages
from vgps.readers.bag import BagVideo
from vgps.readers.calibration.camera_file import read_camera
from vgps.readers.calibration.camera_guess import guess_cameras
from vgps.readers.calibration.rig_file import read_rig
from vgps.readers.control_points import read_control_points
from vgps.readers.gopro.gpmf import Telemetry, collect, read_gpmf
from vgps.readers.gopro.sensors import gopro_exposures, picture_rotations, read_gopro_gps, read_gopro_gyro
from vgps.readers.gps import gps_log, read_gps_log
from vgps.readers.gyro import read_gyro
from vgps.readers.run_folder import read_run
from vgps.readers.trajectory import read_trajectory
from vgps.readers.video.exif import exif_fixes
from vgps.readers.video.frame_times import read_frame_times
from vgps.readers.video.images import ImageFolder
from vgps.readers.video.metadata_tracks import Packet
from vgps.readers.video.video_file import VideoFile
from vgps.readers.video_gps.find import find_video_gps
from vgps.writers.export import export

_HAS_NOVATEL = importlib.util.find_spec("novatel_edie") is not None  # it has no wheels for macOS
CORPUS = Path(__file__).parent / "corpus"
_RIG = Rig(video_start_utc=datetime(2026, 5, 1, 9, 30, tzinfo=UTC))
_CAMERA = Camera(model="pinhole", width=64, height=48, fx=60.0, fy=60.0, cx=32.0, cy=24.0)
_ARRAYS = (*[damage_npz] * 8, damage_bytes)
_EXPORTS = ("geojson", "kml", "gpx", "tum", "kitti")


@dataclass(frozen=True, kw_only=True)
class Target:
    """A reader under test.

    Attributes:
        name: Its name, and its folder in the corpus unless ``corpus`` names another.
        read: Reads the damaged file.
        mutators: What damages the file.
        file: The name that the damaged file gets; that of the seed if it is empty.
        only: Glob of the seeds in the folder; all other files are copied beside the damaged one.
        corpus: Folder of the seeds.
    """

    name: str
    read: Callable[[Path], object]
    mutators: tuple[Mutator, ...]
    file: str = ""
    only: str = "*"
    corpus: str = ""

    def seeds(self) -> list[Path]:
        """Return the files to start from, in order."""
        return sorted((CORPUS / (self.corpus or self.name)).glob(self.only))

    def companions(self) -> list[Path]:
        """Return the files that stand beside the damaged one, undamaged."""
        return sorted(set((CORPUS / (self.corpus or self.name)).iterdir()) - set(self.seeds()))


def _read_sensors(telemetry: Telemetry) -> None:
    read_gopro_gyro(telemetry)
    gopro_exposures(telemetry)
    picture_rotations(telemetry)
    read_gopro_gps(telemetry)


def _read_gpmf_payloads(path: Path) -> None:
    data = path.read_bytes()
    _read_sensors(collect(path, [Packet(data, 0.0, 1.0), Packet(data, 1.0, 1.0)]))


def _read_video(path: Path) -> None:
    video = VideoFile(path)
    for _ in video.frames():
        pass
    telemetry = read_gpmf(path)
    if telemetry.sensors:
        _read_sensors(telemetry)
    elif (found := find_video_gps(path, telemetry)) is not None:
        gps_log(found, _RIG, path)
    guess_cameras(video, telemetry)


def _read_images(path: Path) -> None:
    for _ in ImageFolder(path.parent).frames():
        pass


def _read_pictures(path: Path) -> None:
    pictures = ImageFolder(path.parent)
    exif_fixes([pictures.taken(index) for index in range(len(pictures.files))], pictures.times_s)


def _read_bag(path: Path) -> None:
    for topic in ("/image", "/packed"):
        video = BagVideo(path, topic)
        video.camera()
        video.gyro()
        gps_log(video.fixes(), None, path)
        for _ in video.frames():
            pass


def _read_bag_folder(path: Path) -> None:
    _read_bag(path.parent)


def _read_geoid(path: Path) -> None:
    named_geoid(str(path)).height_m([49.0, -33.0], [8.4, 151.0])


def _read_stream(path: Path) -> None:
    epochs = Epochs()
    for raw in messages(BytesIO(path.read_bytes())):
        epochs.add(raw)
    epochs.flush()


def _read_run(path: Path) -> None:
    solution = read_run(path.parent)
    to = _EXPORTS[path.stat().st_size % len(_EXPORTS)]
    solution.observations.uv_px.sum()
    export(path.parent, to, path.parent.with_name(f"exported.{to}"))


def _read_database(path: Path) -> None:
    with LandmarkDatabase.open(path) as database:
        database.sources()
        database.positions()
        database.keyframes()
        database.views(np.eye(4), _CAMERA)
        database.views(np.eye(4), _CAMERA, max_landmarks=5, max_depth_m=20.0)
        database.verify()


def _gps(path: Path) -> object:
    return read_gps_log(path, _RIG)


def _run_target(name: str, corpus: str, file: str, mutators: tuple[Mutator, ...]) -> Target:
    """Return the target for one file of a run folder."""
    stem, suffix = file.split(".")
    seeds = f"{stem}*.{suffix}"
    return Target(name=name, read=_read_run, mutators=mutators, corpus=corpus, only=seeds, file=file)


TARGETS = (
    Target(name="gpmf", read=_read_gpmf_payloads, mutators=(damage_gpmf, damage_gpmf, damage_bytes)),
    Target(name="mp4", read=_read_video, mutators=(damage_boxes, damage_boxes, damage_bytes)),
    Target(name="images", read=_read_images, mutators=(damage_bytes,), only="0.*"),
    Target(name="ubx", read=_gps, mutators=(*[damage_ubx] * 20, *[damage_bytes] * 10, grow)),
    Target(name="nmea", read=_gps, mutators=(*LOG, *[damage_nmea] * 20)),
    Target(name="stream", read=_read_stream, mutators=(*TEXT, damage_nmea, damage_ubx)),
    Target(name="pos", read=_gps, mutators=LOG),
    Target(name="srt", read=_gps, mutators=LOG),
    Target(name="gpx", read=_gps, mutators=(*LOG, nest_deeply)),
    Target(name="xml_track", read=_gps, mutators=(*LOG, nest_deeply)),
    Target(name="gps_csv", read=_gps, mutators=LOG),
    Target(name="android", read=_gps, mutators=LOG),
    Target(name="sbf", read=_gps, mutators=(*[damage_sbf] * 20, *[damage_bytes] * 10, grow)),
    *[Target(name="novatel", read=_gps, mutators=(*[damage_novatel] * 20, *LOG))] * _HAS_NOVATEL,
    Target(name="fit", read=_gps, mutators=(*[damage_fit] * 10, *[damage_bytes] * 20, grow)),
    Target(name="igc", read=_gps, mutators=LOG),
    Target(name="ulog", read=_gps, mutators=(*[damage_bytes] * 30, grow)),
    Target(
        name="telemetry", read=_gps, mutators=(*[damage_telemetry] * 20, *[damage_bytes] * 10, grow),
        corpus="mavlink", only="*.tlog",
    ),
    Target(
        name="dataflash", read=_gps, mutators=(*[damage_bytes] * 30, grow), corpus="mavlink", only="*.bin"
    ),
    Target(name="bag", read=_read_bag, mutators=(*[damage_bytes] * 30, grow)),
    Target(
        name="ros2", read=_read_bag_folder, mutators=(*[damage_bytes] * 30, grow), only="*.db3"
    ),
    Target(
        name="ros2_metadata", read=_read_bag_folder, mutators=TREE,
        corpus="ros2", only="metadata.yaml", file="metadata.yaml",
    ),
    Target(name="exif", read=_read_pictures, mutators=(damage_bytes,), only="0.*"),
    Target(name="camera", read=read_camera, mutators=TREE),
    Target(name="rig", read=read_rig, mutators=TREE),
    Target(name="settings", read=read_config, mutators=TREE),
    Target(name="survey", read=read_survey, mutators=TREE),
    Target(name="frame_times", read=read_frame_times, mutators=LOG),
    Target(name="gyro", read=read_gyro, mutators=LOG),
    Target(name="control_points", read=read_control_points, mutators=LOG),
    Target(name="gcp_list", read=read_control_points, mutators=LOG),
    Target(name="geoid", read=_read_geoid, mutators=(*TEXT * 5, grow)),
    Target(name="trajectory", read=read_trajectory, mutators=LOG),
    _run_target("run_arrays", "run", "measurements.npz", _ARRAYS),
    _run_target("run_summary", "run", "solution.json", TREE),
    _run_target("run_config", "run", "config.yaml", TREE),
    _run_target("whole_arrays", "whole_run", "measurements.npz", _ARRAYS),
    _run_target("whole_summary", "whole_run", "solution.json", TREE),
    Target(name="database", read=_read_database, mutators=(*[damage_database] * 6, damage_bytes)),
)  # fmt: skip
