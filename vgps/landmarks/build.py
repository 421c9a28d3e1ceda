"""Building of a landmark database from runs: their landmarks, and templates from their videos."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from vgps.config import Frames, LandmarksConfig
from vgps.errors import LandmarkDatabaseError
from vgps.landmarks.keyframes import keyframe_rows, make_keyframe
from vgps.landmarks.merge import merge
from vgps.landmarks.model import Cameras, DatabaseContents, Keyframe, LandmarkViews, Source
from vgps.landmarks.observation_selection import (
    LandmarkObservations,
    collect_observations,
    reliable_landmarks,
    select_views,
    template_frames,
)
from vgps.landmarks.patches import Pyramid, plane_axes
from vgps.landmarks.rectify import Rectifier
from vgps.model import Float32Array, FloatArray, Frame, IntArray, Recording
from vgps.readers.recording import open_recording
from vgps.readers.run_files import run_folders
from vgps.readers.run_folder import read_run
from vgps.readers.video.retimed_video import at_speed
from vgps.readers.views.steady import as_posed
from vgps.runtime.progress import NoProgress, Progress
from vgps.solution import Solution


def build_from_runs(
    runs: Sequence[Path],
    frames: Frames = "all",
    config: LandmarksConfig | None = None,
    recording: Path | None = None,
    progress: Progress | None = None,
) -> DatabaseContents:
    """Build a database from run folders, in the world of the first.

    Args:
        runs: Run folders, or folders of joined runs.
        frames: Frames that give templates and keyframes.
        config: Which landmarks are reliable enough, and what is kept of them.
        recording: Folder of the recording of a single run; by default the one that the run names.
        progress: Shows progress.

    Raises:
        LandmarkDatabaseError: As :func:`build_database` and :func:`merge`; or a run names no recording.
        RunFolderError, RecordingError, VideoError, CalibrationError: From the readers.
    """
    runs = [part for run in runs for part in run_folders(run)]
    if not runs:
        raise LandmarkDatabaseError("no run is given", expected="run folders written by vgps smooth")
    if recording is not None and len(runs) != 1:
        raise LandmarkDatabaseError(
            f"--recording names one recording for {len(runs)} runs",
            remedy="build a database of one run, or omit --recording",
        )
    parts = []
    for run in runs:
        solution = read_run(run)
        folder = recording or solution.recording
        if folder is None:
            raise LandmarkDatabaseError("names no recording", file=run, remedy="name it with --recording")
        opened = open_recording(folder, with_gps=False, cameras=False)
        parts.append(build_database(solution, opened, frames, config, progress))
    return merge(parts)


def build_database(
    solution: Solution,
    recording: Recording,
    frames: Frames = "all",
    config: LandmarksConfig | None = None,
    progress: Progress | None = None,
) -> DatabaseContents:
    """Build landmarks with views, and keyframes, from a run and its video; (A) to (D) of Matsuda 2007.

    The positions are those of the whole run, whichever frames give templates. The video is decoded once.

    Args:
        solution: The run.
        recording: The recording of the run; only its video is used, the camera is the run's.
        frames: Frames that give templates and keyframes.
        config: Which landmarks are reliable enough, and what is kept of them.
        progress: Shows progress.

    Returns:
        Input of :func:`vgps.landmarks.database_writer.write_database`; ids are the run's landmark rows.

    Raises:
        LandmarkDatabaseError: The run is not georeferenced, the recording is another one, or no landmark is
            reliable enough.
        VideoError: The video cannot be decoded.
    """
    config = config or LandmarksConfig()
    _check(solution, recording)
    cameras = Cameras(recording.camera, replace(solution.camera, focal_changes=None))
    recording = as_posed(recording, solution.camera)
    observations = collect_observations(solution)
    reliable, sigma_m = reliable_landmarks(solution, observations, config)
    observations = observations.take(reliable[observations.landmark])
    selected = select_views(solution, observations, frames, config)
    if not len(selected.landmark):
        raise LandmarkDatabaseError(
            f"none of {len(reliable)} landmarks is reliable and observed in {frames} frames",
            file=recording.path,
            remedy="relax the limits on landmarks, or use all frames",
        )
    in_front = np.isin(observations.landmark, selected.landmark) & (observations.depth_m > 0)
    observations = observations.take(in_front)
    video = (progress or NoProgress()).track(recording.video.frames(), len(recording.video.times_s))
    keys = keyframe_rows(template_frames(solution, frames), config.keyframe_every)
    templates, keyframes = _read_video(video, solution, selected, observations, keys, config)
    views = _views(solution, selected, sigma_m, templates)
    count = len(np.unique(views.landmark))
    source = Source(str(recording.path), frames, count, config.model_dump_json(), cameras)
    return DatabaseContents(solution.world_origin, views, keyframes, (source,))


def _read_video(
    video: Iterable[Frame],
    solution: Solution,
    selected: LandmarkObservations,
    observations: LandmarkObservations,
    keys: IntArray,
    config: LandmarksConfig,
) -> tuple[npt.NDArray[np.uint8], tuple[Keyframe, ...]]:
    """Return templates (N, levels, P, P) of the selected observations, and keyframes of frames ``keys``."""
    shape = (len(selected.landmark), config.levels, config.patch_px, config.patch_px)
    templates = np.zeros(shape, np.uint8)
    keyframes, rectify = [], Rectifier(solution.camera)
    for frame in video:
        rows, is_key = np.flatnonzero(selected.frame == frame.index), frame.index in keys
        if not (len(rows) or is_key):
            continue
        image = rectify(frame.gray)
        if len(rows):
            templates[rows] = Pyramid(image, config.levels).sample(selected.uv_px[rows], config.patch_px)
        if is_key:
            keyframes.append(_keyframe(frame.index, image, solution, observations, config))
    return templates, tuple(keyframes)


def _keyframe(
    frame: int,
    image: Float32Array,
    solution: Solution,
    observations: LandmarkObservations,
    config: LandmarksConfig,
) -> Keyframe:
    observed = observations.take(observations.frame == frame)
    gray = np.clip(np.round(image), 0, 255).astype(np.uint8)
    pose = solution.world_T_camera[frame]
    return make_keyframe(gray, solution.camera, pose, observed, config)


def _views(
    solution: Solution, selected: LandmarkObservations, sigma_m: FloatArray, templates: npt.NDArray[np.uint8]
) -> LandmarkViews:
    column, row = plane_axes(selected.world_T_camera, solution.camera, selected.depth_m)
    return LandmarkViews(
        landmark=selected.landmark,
        world_p_landmark=selected.world_p_landmark,
        world_p_camera=selected.world_T_camera[:, :3, 3],
        world_v_column=column,
        world_v_row=row,
        templates=templates,
        sigma_px=solution.landmarks.sigma_px[selected.landmark],
        position_sigma_m=sigma_m[selected.landmark],
    )


def _check(solution: Solution, recording: Recording) -> None:
    if not solution.georeferenced:
        raise LandmarkDatabaseError(
            "the run is not georeferenced",
            file=recording.path,
            remedy="smooth the recording with GPS or control points",
        )
    video = recording.video
    if (video.width, video.height) != (solution.camera.width, solution.camera.height):
        raise _mismatch(recording, f"{video.width} x {video.height} pixels", solution)
    if len(video.times_s) != len(solution.t_s):
        raise _mismatch(recording, f"{len(video.times_s)} frames", solution)
    # a run moves the pictures of a converted video by a frame at most
    times_s = at_speed(video, solution.sensors.video_speed).times_s
    frame_s = max(1e-3, float(np.ptp(times_s)) / len(times_s))
    if not np.allclose(times_s, solution.t_s, rtol=0, atol=frame_s):
        raise _mismatch(recording, "other frame times", solution)


def _mismatch(recording: Recording, what: str, solution: Solution) -> LandmarkDatabaseError:
    camera, last_s = solution.camera, solution.t_s[-1]
    return LandmarkDatabaseError(
        f"is not the video of the run: it has {what}",
        file=recording.video.path,
        expected=f"{len(solution.t_s)} frames of {camera.width} x {camera.height} in {last_s:.3f} s",
        remedy="name the recording of the run with --recording",
    )
