"""A landmark database from a run: its landmarks, and how they looked in the frames of its recording."""

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from vgps.config import Frames, LandmarksConfig
from vgps.errors import LandmarkDatabaseError
from vgps.landmarks.keyframes import keyframe_rows, make_keyframe
from vgps.landmarks.model import DatabaseContents, Keyframe, LandmarkViews, Source
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
from vgps.runtime.progress import Progress, Silent
from vgps.solution import Solution


def build_database(
    solution: Solution,
    recording: Recording,
    frames: Frames = "all",
    config: LandmarksConfig | None = None,
    progress: Progress | None = None,
) -> DatabaseContents:
    """Landmarks with views and keyframes, (A) to (D) of Matsuda 2007, from a run and its video.

    The positions are those of the whole run, whichever frames give the templates. The video is decoded once.

    Args:
        solution: The run.
        recording: What it was made from; its video alone is used, the camera is the run's.
        frames: Which frames give templates and keyframes.
        config: Which landmarks are known well enough, and what is kept of them.
        progress: Shows how far it is.

    Returns:
        What :func:`vgps.landmarks.database_writer.write_database` writes; ids are the run's landmark rows.

    Raises:
        LandmarkDatabaseError: The run has no place in the world, is of another recording, or no landmark is
            known well enough.
        VideoError: The video cannot be decoded.
    """
    config = config or LandmarksConfig()
    _check(solution, recording)
    observations = collect_observations(solution)
    known, sigma_m = reliable_landmarks(solution, observations, config)
    observations = observations.take(known[observations.landmark])
    chosen = select_views(solution, observations, frames, config)
    if not len(chosen.landmark):
        raise LandmarkDatabaseError(
            f"none of {len(known)} landmarks is known well enough and seen in {frames} frames",
            file=recording.path,
            remedy="relax the limits on landmarks, or use all frames",
        )
    keyed = observations.take(np.isin(observations.landmark, chosen.landmark) & (observations.depth_m > 0))
    keys = keyframe_rows(template_frames(solution, frames), config.keyframe_every)
    video = (progress or Silent()).track(recording.video.frames(), len(recording.video.times_s))
    templates, keyframes = _pictures(video, solution, chosen, keyed, keys, config)
    views = _views(solution, chosen, sigma_m, templates)
    count = len(np.unique(views.landmark))
    source = Source(str(recording.path), frames, count, config.model_dump_json())
    return DatabaseContents(solution.world_origin, views, keyframes, (source,))


def _pictures(
    video: Iterable[Frame],
    solution: Solution,
    chosen: LandmarkObservations,
    keyed: LandmarkObservations,
    keys: IntArray,
    config: LandmarksConfig,
) -> tuple[npt.NDArray[np.uint8], tuple[Keyframe, ...]]:
    """Templates (N, levels, P, P) of the chosen observations, and the keyframes, of frames ``keys``."""
    templates = np.zeros((len(chosen.landmark), config.levels, config.patch_px, config.patch_px), np.uint8)
    keyframes, rectify = [], Rectifier(solution.camera)
    for frame in video:
        rows, key = np.flatnonzero(chosen.frame == frame.index), frame.index in keys
        if not (len(rows) or key):
            continue
        image = rectify(frame.gray)
        if len(rows):
            templates[rows] = Pyramid(image, config.levels).sample(chosen.uv_px[rows], config.patch_px)
        if key:
            keyframes.append(_keyframe(frame.index, image, solution, keyed, config))
    return templates, tuple(keyframes)


def _check(solution: Solution, recording: Recording) -> None:
    if not solution.georeferenced:
        raise LandmarkDatabaseError(
            "nothing ties the run to the world",
            file=recording.path,
            remedy="smooth the recording with GPS or control points",
        )
    video = recording.video
    if (video.width, video.height) != (solution.camera.width, solution.camera.height):
        raise _of_another(recording, f"{video.width} x {video.height} pixels", solution)
    if len(video.times_s) != len(solution.t_s):
        raise _of_another(recording, f"{len(video.times_s)} frames", solution)
    if not np.allclose(video.times_s, solution.t_s, rtol=0, atol=1e-3):
        raise _of_another(recording, "frames at other times", solution)


def _of_another(recording: Recording, what: str, solution: Solution) -> LandmarkDatabaseError:
    camera, last_s = solution.camera, solution.t_s[-1]
    return LandmarkDatabaseError(
        f"the run was not made from this video, which has {what}",
        file=recording.video.path,
        expected=f"{len(solution.t_s)} frames of {camera.width} x {camera.height} in {last_s:.3f} s",
        remedy="name the recording that the run was made from with --recording",
    )


def _keyframe(
    frame: int,
    image: Float32Array,
    solution: Solution,
    observations: LandmarkObservations,
    config: LandmarksConfig,
) -> Keyframe:
    seen = observations.take(observations.frame == frame)
    return make_keyframe(
        np.clip(np.round(image), 0, 255).astype(np.uint8),
        solution.camera,
        solution.world_T_camera[frame],
        seen.landmark,
        seen.world_p_landmark,
        reach_px=config.keyframe_reach_px,
        thumbnail_px=config.thumbnail_px,
    )


def _views(
    solution: Solution, chosen: LandmarkObservations, sigma_m: FloatArray, templates: npt.NDArray[np.uint8]
) -> LandmarkViews:
    column, row = plane_axes(chosen.world_T_camera, solution.camera, chosen.depth_m)
    return LandmarkViews(
        landmark=chosen.landmark,
        world_p_landmark=chosen.world_p_landmark,
        world_p_camera=chosen.world_T_camera[:, :3, 3],
        world_v_column=column,
        world_v_row=row,
        templates=templates,
        sigma_px=solution.landmarks.sigma_px[chosen.landmark],
        position_sigma_m=sigma_m[chosen.landmark],
    )
