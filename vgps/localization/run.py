"""Localization of a recording against a landmark database: the pose of every frame, as a Solution."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vgps.config import Config, LocalizationConfig
from vgps.errors import GeometryError
from vgps.landmarks.database import LandmarkDatabase
from vgps.localization.bridging import bridge_gaps
from vgps.localization.diagnostics import loss_warnings, speed_warnings
from vgps.localization.lens_refinement import LensCheck
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
            database had the same calibration and refined it, the refined one is used; another one is
            refined by the landmarks if they contradict it.
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
    given, settings = recording.camera, config.localization
    of_map = _camera_of_map(given, database)
    checked = of_map is None and config.intrinsics.refine != "no"
    lens = LensCheck(given, recording.guesses, config) if checked else None
    run = _Run(replace(recording, camera=of_map or given), database, settings, lens)
    with one_blas_thread(), seconds.measure("track"):
        recording, localizer, frames, gray, poses = _track(run, progress or NoProgress())
    t_s, tracked = np.array(list(poses)), np.array([frame.tracked for frame in frames])
    if not tracked.any():
        raise GeometryError(
            "no frame shows enough landmarks of the database",
            file=recording.video.path,
            expected=f"{settings.min_inliers} that agree on a pose",
            remedy=f"check camera.yaml, and that the video was taken where {database.path} was built",
        )
    gyro, bias_rad_s = localizer.rotations, localizer.gyro_bias_rad_s
    found = np.array(list(poses.values()))
    bridged = bridge_gaps(t_s, found, tracked, gyro, bias_rad_s, settings.coast_s)
    warnings = (
        *recording.notes,
        *getattr(recording.video, "warnings", ()),
        *localizer.warnings,
        *(() if lens is None else lens.notes),
        *loss_warnings(tracked, t_s),
        *speed_warnings(frames, recording.camera.fx, settings),
    )
    track = Track(
        frames=frames, gray=gray, world_T_camera=bridged, seconds=seconds.by_stage, warnings=warnings
    )
    solution = to_solution(recording, database.world_origin, config, track)
    if lens is None or lens.found is None:
        return solution
    return replace(solution, sensors=replace(solution.sensors, camera_sigma=lens.found.sigma))


def _camera_of_map(camera: Camera, database: LandmarkDatabase) -> Camera | None:
    """Return the camera as the latest run of the database refined it; None if it is none of theirs."""
    cameras = [source.cameras for source in database.sources() if source.cameras is not None]
    return next((each.refined for each in reversed(cameras) if each.given == camera), None)


class _Run(NamedTuple):
    """What is tracked, against what, and what checks its calibration."""

    recording: Recording
    database: LandmarkDatabase
    settings: LocalizationConfig
    lens: LensCheck | None


class _Tracked(NamedTuple):
    """The recording as it was tracked, by what, the frames, grey values of their observations, and poses by
    time, revised or not."""

    recording: Recording
    localizer: Localizer
    frames: list[TrackedFrame]
    gray: list[FloatArray]
    poses: dict[float, FloatArray]


def _track(run: _Run, progress: Progress) -> _Tracked:
    """Track all frames; again from the first one, with another calibration, if landmarks contradict this."""
    recording, localizer = run.recording, Localizer(run.recording, run.database, run.settings)
    found = _Tracked(recording, localizer, [], [], {})
    for frame in progress.track(recording.video.frames(), len(recording.video.times_s)):
        image = localizer.undistort(frame.gray)
        tracked = localizer.add(frame.t_s, image)
        found.frames.append(tracked)
        found.gray.append(_gray(image, tracked.observations.seen_px))
        found.poses[frame.t_s] = tracked.world_T_camera
        if run.settings.revise:
            found.poses.update(localizer.revised())
        if run.lens is not None and (camera := run.lens.better(recording.camera, found.frames)) is not None:
            progress.stage("from the first frame again, with the calibration that the landmarks show")
            return _track(run._replace(recording=replace(recording, camera=camera)), progress)
    return found


def _gray(image: Float32Array, uv_px: FloatArray) -> FloatArray:
    """Return the grey values (N,) of an image (H, W) at the nearest pixels to (N, 2)."""
    u, v = np.round(uv_px).astype(np.int64).T
    return np.asarray(image[np.clip(v, 0, image.shape[0] - 1), np.clip(u, 0, image.shape[1] - 1)])
