"""Localization of a recording against a landmark database: the pose of every frame, as a Solution."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from vgps.config import Config
from vgps.errors import GeometryError
from vgps.landmarks.database import LandmarkDatabase
from vgps.localization.bridging import bridge_gaps
from vgps.localization.diagnostics import loss_warnings, speed_warnings
from vgps.localization.localizer import Localizer
from vgps.localization.result import Track, to_solution
from vgps.localization.tracker import TrackedFrame
from vgps.model import Camera, Float32Array, FloatArray, Recording
from vgps.readers.rig_cameras import refuse_several
from vgps.runtime.progress import NoProgress, Progress
from vgps.runtime.threads import one_blas_thread
from vgps.runtime.timing import StageTimer
from vgps.solution import Solution


def localize(
    recording: Recording,
    database: LandmarkDatabase | Path | str,
    config: Config | None = None,
    progress: Progress | None = None,
) -> Solution:
    """Localise every frame of a recording by the landmarks of a database and the gyro (Matsuda 2007).

    Frames with too few landmarks are interpolated between their neighbours and reported in the warnings.

    Args:
        recording: Video and camera, with rig and gyro if available; GPS is not used. If a run behind the
            database had the same calibration and refined it, the refined one is used.
        database: Of the place: its file, or one opened with ``config.localization.selection``.
        config: Its ``localization`` is used; None for the defaults.
        progress: Shows progress.

    Raises:
        GeometryError: No frame shows enough landmarks of the database.
        RecordingError: A rig of several cameras.
        VgpsError: The video or the database is damaged.
    """
    refuse_several(recording, "vgps track")
    if isinstance(database, Path | str):
        with LandmarkDatabase.open(Path(database), (config or Config()).localization.selection) as opened:
            return localize(recording, opened, config, progress)
    config, seconds = config or Config(), StageTimer()
    recording = replace(recording, camera=_camera_of_map(recording.camera, database))
    settings = config.localization
    localizer = Localizer(recording, database, settings)
    with one_blas_thread(), seconds.measure("track"):
        frames, gray, poses = _track(recording, localizer, settings.revise, progress or NoProgress())
    t_s, tracked = np.array(list(poses)), np.array([frame.tracked for frame in frames])
    if not tracked.any():
        raise GeometryError(
            "no frame shows enough landmarks of the database",
            file=recording.video.path,
            expected=f"{settings.min_inliers} that agree on a pose",
            remedy=f"check camera.yaml, and that the video was taken where {database.path} was built",
        )
    bridged = bridge_gaps(
        t_s,
        np.array(list(poses.values())),
        tracked,
        localizer.rotations,
        localizer.gyro_bias_rad_s,
        settings.coast_s,
    )
    warnings = (
        *recording.notes,
        *getattr(recording.video, "warnings", ()),
        *localizer.warnings,
        *loss_warnings(tracked, t_s),
        *speed_warnings(frames, recording.camera.fx, settings),
    )
    track = Track(
        frames=frames, gray=gray, world_T_camera=bridged, seconds=seconds.by_stage, warnings=warnings
    )
    return to_solution(recording, database.world_origin, config, track)


def _camera_of_map(camera: Camera, database: LandmarkDatabase) -> Camera:
    """Return the camera as the latest run of the database refined it, if it is one of theirs."""
    cameras = [source.cameras for source in database.sources() if source.cameras is not None]
    return next((each.refined for each in reversed(cameras) if each.given == camera), camera)


def _track(
    recording: Recording, localizer: Localizer, revise: bool, progress: Progress
) -> tuple[list[TrackedFrame], list[FloatArray], dict[float, FloatArray]]:
    """Return the frames, the grey values of their observations, and the poses by time, revised or not."""
    frames: list[TrackedFrame] = []
    gray: list[FloatArray] = []
    poses: dict[float, FloatArray] = {}
    for frame in progress.track(recording.video.frames(), len(recording.video.times_s)):
        image = localizer.undistort(frame.gray)
        tracked = localizer.add(frame.t_s, image)
        frames.append(tracked)
        gray.append(_gray(image, tracked.observations.seen_px))
        poses[frame.t_s] = tracked.world_T_camera
        poses |= localizer.revised() if revise else {}
    return frames, gray, poses


def _gray(image: Float32Array, uv_px: FloatArray) -> FloatArray:
    """Return the grey values (N,) of an image (H, W) at the nearest pixels to (N, 2)."""
    u, v = np.round(uv_px).astype(np.int64).T
    return np.asarray(image[np.clip(v, 0, image.shape[0] - 1), np.clip(u, 0, image.shape[1] - 1)])
