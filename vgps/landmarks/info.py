"""A landmark database from run folders; what is in one."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vgps.config import Frames, LandmarksConfig
from vgps.errors import LandmarkDatabaseError
from vgps.landmarks.build import build_database
from vgps.landmarks.database import LandmarkDatabase
from vgps.landmarks.merge import merge
from vgps.landmarks.model import DatabaseContents, Source
from vgps.model import FloatArray, GeodeticPoint
from vgps.readers.recording import open_recording
from vgps.readers.run_folder import read_run
from vgps.runtime.progress import Progress


def build_from_runs(
    runs: Sequence[Path],
    frames: Frames = "all",
    config: LandmarksConfig | None = None,
    recording: Path | None = None,
    progress: Progress | None = None,
) -> DatabaseContents:
    """Landmarks of one or several runs, in the world of the first.

    Args:
        runs: Run folders.
        frames: Which frames give templates and keyframes.
        config: Which landmarks are known well enough, and what is kept of them.
        recording: Where the recording is now, for a single run; by default where the run says it was.
        progress: Shows how far it is.

    Raises:
        LandmarkDatabaseError: As :func:`build_database` and :func:`merge`; a run that names no recording.
        RunFolderError, RecordingError, VideoError, CalibrationError: From the readers.
    """
    if not runs:
        raise LandmarkDatabaseError("no run is given", expected="run folders, as vgps smooth writes them")
    if recording is not None and len(runs) != 1:
        raise LandmarkDatabaseError(
            f"--recording names one recording for {len(runs)} runs",
            remedy="build a database of one run, or leave --recording out",
        )
    return merge([_build(run, frames, config, recording, progress) for run in runs])


def _build(
    run: Path,
    frames: Frames,
    config: LandmarksConfig | None,
    recording: Path | None,
    progress: Progress | None,
) -> DatabaseContents:
    solution = read_run(run)
    where = recording or solution.recording
    if where is None:
        raise LandmarkDatabaseError(
            "does not say which recording it was made from", file=run, remedy="name it with --recording"
        )
    return build_database(solution, open_recording(where, with_gps=False), frames, config, progress)


@dataclass(frozen=True)
class DatabaseInfo:
    """What a database holds, after all of it was checked.

    Attributes:
        extent_m: (2, 3) least and greatest east, north, up of the landmarks.
        sha256: Of the contents.
    """

    path: Path
    file_bytes: int
    world_origin: GeodeticPoint | None
    landmarks: int
    views: int
    keyframes: int
    descriptors: int
    patch_px: int
    levels: int
    extent_m: FloatArray
    sources: tuple[Source, ...]
    sha256: str


def database_info(path: Path) -> DatabaseInfo:
    """Look through a landmark database.

    Raises:
        LandmarkDatabaseError: It cannot be opened, or something in it is not as it was written.
    """
    with LandmarkDatabase.open(path) as database:
        sha256 = database.verify()
        points, keyframes = database.positions(), database.keyframes()
        return DatabaseInfo(
            path=path,
            file_bytes=path.stat().st_size,
            world_origin=database.world_origin,
            landmarks=database.landmark_count,
            views=database.view_count,
            keyframes=len(keyframes),
            descriptors=sum(len(keyframe.landmark) for keyframe in keyframes),
            patch_px=database.patch_px,
            levels=database.levels,
            extent_m=np.stack([points.min(axis=0), points.max(axis=0)]),
            sources=database.sources(),
            sha256=sha256,
        )
