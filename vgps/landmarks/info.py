"""Summary of a landmark database, after a check of the whole file."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vgps.landmarks.database import LandmarkDatabase
from vgps.landmarks.model import Source
from vgps.model import FloatArray, GeodeticPoint


@dataclass(frozen=True, kw_only=True)
class DatabaseInfo:
    """Summary of a database.

    Attributes:
        path, file_bytes: The file and its size.
        schema_version: Of the file.
        world_origin: Origin of the ENU frame; None where control points alone define the world.
        landmarks, views, keyframes, descriptors: Their numbers.
        patch_px, levels: Side of the templates, and number of their scales.
        extent_m: (2, 3) least and greatest east, north, up of the landmarks.
        sources: Runs that the database was built from.
        sha256: Of the contents.
    """

    path: Path
    file_bytes: int
    schema_version: int
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
    """Check a landmark database and summarise it.

    Raises:
        LandmarkDatabaseError: The file cannot be opened, or its contents differ from what was written.
    """
    with LandmarkDatabase.open(path) as database:
        sha256 = database.verify()
        points, keyframes = database.positions(), database.keyframes()
        return DatabaseInfo(
            path=path,
            file_bytes=path.stat().st_size,
            schema_version=database.schema_version,
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
