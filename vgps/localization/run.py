"""A recording localized against a landmark database: the pose of every frame, as a Solution."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from vgps.config import Config
from vgps.errors import GeometryError
from vgps.landmarks.database import LandmarkDatabase
from vgps.localization.bridging import bridge_gaps
from vgps.localization.localizer import Localizer
from vgps.localization.result import to_solution
from vgps.localization.tracker import TrackedFrame
from vgps.model import BoolArray, Float32Array, FloatArray, Frame, Recording
from vgps.runtime.progress import NoProgress, Progress
from vgps.runtime.threads import one_blas_thread
from vgps.runtime.timing import StageTimer
from vgps.solution import Solution

_NAMED_STRETCHES = 5


def localize(
    recording: Recording,
    database: LandmarkDatabase,
    config: Config | None = None,
    progress: Progress | None = None,
) -> Solution:
    """The pose of every frame of a recording, from landmarks seen before and the gyro (Matsuda 2007).

    Frames in which too few landmarks are found are bridged between their neighbours, and said.

    Args:
        recording: Video, camera, and if there are any rig and gyro; GPS is not used.
        database: Of the place, opened with ``config.localization.selection``.
        config: Its ``localization`` is used; the defaults if none is given.
        progress: Shows how far it is.

    Raises:
        GeometryError: No frame shows enough of the database's landmarks.
        VgpsError: The video or the database is damaged.
    """
    config, seconds = config or Config(), StageTimer()
    settings = config.localization
    localizer = Localizer(recording, database, settings)
    frames: list[TrackedFrame] = []
    gray: list[FloatArray] = []
    poses: dict[float, FloatArray] = {}
    decoded = _ahead(recording.video.frames())
    with one_blas_thread(), seconds.measure("track"):
        for frame in (progress or NoProgress()).track(decoded, len(recording.video.times_s)):
            image = localizer.undistort(frame.gray)
            tracked = localizer.add(frame.t_s, image)
            frames.append(tracked)
            gray.append(_gray(image, tracked.observations.uv_px))
            poses[frame.t_s] = tracked.world_T_camera
            poses |= localizer.revised() if settings.revise else {}
    if not any(frame.tracked for frame in frames):
        raise GeometryError(
            "no frame shows enough landmarks of the database",
            file=recording.video.path,
            expected=f"{settings.min_inliers} that agree on a pose",
            remedy=f"check that it was taken where {database.path} was, and camera.yaml",
        )
    t_s, found = np.array(list(poses)), np.array([frame.tracked for frame in frames])
    path = bridge_gaps(
        t_s,
        np.array(list(poses.values())),
        found,
        localizer.rotations,
        localizer.gyro_bias_rad_s,
        settings.coast_s,
    )
    seen_on_the_way = tuple(getattr(recording.video, "warnings", ()))
    warnings = (*seen_on_the_way, *localizer.warnings, *_losses(found, t_s))
    return to_solution(
        recording, database.world_origin, config, frames, path, gray, seconds.by_stage, warnings
    )


def _ahead(frames: Iterator[Frame]) -> Iterator[Frame]:
    """The same frames, the next one decoded on another core while one is tracked."""
    with ThreadPoolExecutor(1) as pool:
        coming = pool.submit(next, frames, None)
        while (frame := coming.result()) is not None:
            coming = pool.submit(next, frames, None)
            yield frame


def _gray(image: Float32Array, uv_px: FloatArray) -> FloatArray:
    """(N,) grey of an image (H, W) at the pixels nearest to (N, 2)."""
    u, v = np.round(uv_px).astype(np.int64).T
    return np.asarray(image[np.clip(v, 0, image.shape[0] - 1), np.clip(u, 0, image.shape[1] - 1)])


def _losses(tracked: BoolArray, t_s: FloatArray) -> list[str]:
    """What a user should know of the frames that were not posed by landmarks."""
    lost = np.flatnonzero(~tracked)
    if len(lost) == 0:
        return []
    begins = lost[np.diff(lost, prepend=-2) > 1]
    ends = lost[np.diff(lost, append=len(tracked) + 1) > 1]
    named = [
        f"{first} to {last} ({t_s[first]:.2f} to {t_s[last]:.2f} s)" if last > first else f"{first}"
        for first, last in zip(begins, ends, strict=True)
    ]
    more = f" and {len(named) - _NAMED_STRETCHES} more stretches" if len(named) > _NAMED_STRETCHES else ""
    return [
        f"{len(lost)} of {len(tracked)} frames did not show enough landmarks and are bridged: "
        f"{', '.join(named[:_NAMED_STRETCHES])}{more}"
    ]
