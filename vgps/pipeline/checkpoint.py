"""Checkpoints of a run, from which an interrupted one goes on as if nothing had happened."""

import contextlib
import hashlib
import json
import shutil
import time
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from vgps.config import Config
from vgps.errors import RunFolderError
from vgps.gps.fix_buffer import FixBuffer
from vgps.gps.fixes import Fixes
from vgps.gps.outlier_detection import FixAssessment
from vgps.gps.sensors import Sensors, TimeOffset
from vgps.mapping.feature_table import FeatureTable
from vgps.mapping.followed_features import FollowedFeatures
from vgps.mapping.growing_array import GrowingArray
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_path import MapPath
from vgps.mapping.observation_log import ObservationLog
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import ControlPoints, GpsLog, ImuLog, Recording, RigCamera
from vgps.pipeline.frame_pipeline import FramePipeline
from vgps.pipeline.map_builder import MapBuilder
from vgps.runtime.journal import Journal
from vgps.runtime.state_file import read_state, write_checkpoint
from vgps.tracking.reference_patches import Patches
from vgps.tracking.static_regions import StaticCells
from vgps.writers.claim import claimed

EVERY_S = 30.0  # between checkpoints
_SHARE = 0.05  # of the time that may go into writing checkpoints
_CLASSES = (
    FeatureTable, FixAssessment, FixBuffer, Fixes, FollowedFeatures, GrowingArray, LocalMap, MapBuilder,
    MapPath, ObservationLog, Patches, Sensors, StaticCells, TimeOffset, ZeroMotion,
)  # fmt: skip


class Checkpoint:
    """The newest checkpoint of stages A to C, and the steps of D, in a hidden folder beside the run folder.

    Args:
        out: Run folder.
        recording, config: What the run is made of; a checkpoint of anything else is refused.
        resume: Whether to go on from a checkpoint that is there; else it is replaced.

    Attributes:
        journal: Long steps of stage D.
    """

    def __init__(self, out: Path, recording: Recording, config: Config, *, resume: bool) -> None:
        self._folder = checkpoint_folder(out)
        self._file, self._run = self._folder / "front_end.npz", fingerprint(recording, config)
        self._resume, self._next_s = resume, time.monotonic() + EVERY_S
        self.journal = Journal(self._folder, self._run, resume=resume)

    def restore(self, frame_pipeline: FramePipeline) -> int:
        """Take over the state of the checkpoint, if there is one, and return its number of frames.

        Raises:
            RunFolderError: The checkpoint is damaged, or of another recording, version or configuration.
        """
        if not (self._resume and self._file.is_file()):
            return 0
        state = read_state(self._file, _CLASSES)
        if state.get("run") != self._run:
            raise RunFolderError(
                "the interrupted run has another recording, configuration or version of vgps",
                file=self._file,
                remedy="run as before, or without --resume",
            )
        frame_pipeline.restore(state["pipeline"])
        return int(state["frames"])

    def offer(self, frame_pipeline: FramePipeline) -> None:
        """Write a checkpoint if the last one is old enough and stage C is not running."""
        if time.monotonic() >= self._next_s:
            self.write(frame_pipeline)

    def write(self, frame_pipeline: FramePipeline) -> None:
        """Write a checkpoint, unless stage C is running.

        Raises:
            RunFolderError: The disk cannot be written.
        """
        state = frame_pipeline.state()
        if state is None:
            return
        begun = time.monotonic()
        whole = {"run": self._run, "frames": len(frame_pipeline.t_s), "pipeline": state}
        write_checkpoint(whole, self._file, _CLASSES, without=("_config",))
        now = time.monotonic()
        self._next_s = now + max(EVERY_S, (now - begun) / _SHARE)

    def remove(self) -> None:
        """Remove the checkpoint, after the run is written."""
        shutil.rmtree(self._folder, ignore_errors=True)


def checkpoint_folder(out: Path) -> Path:
    """Return the folder of the checkpoints of a run."""
    out = out.resolve()
    return out.with_name(f".{out.name}.resume")


def forget_checkpoint(out: Path) -> None:
    """Remove the checkpoint of a run, unless another process is writing that run."""
    folder = checkpoint_folder(out)
    if folder.is_dir():
        with contextlib.suppress(RunFolderError), claimed(out):
            shutil.rmtree(folder, ignore_errors=True)


def fingerprint(recording: Recording, config: Config) -> str:
    """Return a digest of what decides the result of a run."""
    gps, points = recording.gps, recording.control_points
    parts = {
        "config": config.model_dump(mode="json"),
        "camera": repr(recording.camera),
        "rig": repr(recording.rig),
        "cameras": [_camera_parts(camera) for camera in recording.cameras],
        "times": _digest(recording.video.times_s),
        "video": file_stamp(recording.video.path),
        "masks": None if recording.masks is None else [file_stamp(file) for file in recording.masks.files],
        "gps": None if gps is None else _digest_fields(gps),
        "imu": None if recording.imu is None else _digest_fields(recording.imu),
        "points": None if points is None else _digest_fields(points),
    }
    return digest(parts)


def _camera_parts(camera: RigCamera) -> list[Any]:
    """Return what decides the part of another camera of the rig."""
    mount = np.concatenate([camera.reference_T_camera.ravel(), camera.sigma])
    masks = None if camera.masks is None else [file_stamp(file) for file in camera.masks.files]
    times = _digest(camera.video.times_s)
    return [camera.name, repr(camera.camera), _digest(mount), times, file_stamp(camera.video.path), masks]


def digest(parts: Mapping[str, Any]) -> str:
    """Return a digest of plain data and the version of vgps."""
    text = json.dumps({"version": version("vgps"), **parts}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _digest_fields(table: GpsLog | ImuLog | ControlPoints) -> list[str]:
    return [_digest(value) for value in vars(table).values() if isinstance(value, np.ndarray | tuple)]


def _digest(values: np.ndarray | tuple[str, ...]) -> str:
    return hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()


def file_stamp(path: Path) -> list[Any]:
    """Return what changes when a file does: name, size and time of change."""
    try:
        about = path.stat()
    except OSError:
        return [str(path)]
    return [str(path), about.st_size, about.st_mtime_ns]
