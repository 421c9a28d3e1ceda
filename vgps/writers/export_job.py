"""What a writer is given to export: the frames chosen, and their coordinates in the system asked for."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from functools import cached_property
from pathlib import Path

import numpy as np

from vgps.crs import CoordinateSystem
from vgps.crs.frames import local_R_world
from vgps.errors import RunFolderError, VgpsError
from vgps.geodesy import heading_deg, to_geodetic
from vgps.model import Camera, FloatArray, GeodeticPoint, IntArray, RgbImage
from vgps.readers.posed_video import RunVideo, open_posed_video
from vgps.readers.sources import is_image_folder, place_of
from vgps.readers.video.images import ImageFolder
from vgps.solution import Solution
from vgps.writers.colmap import IMAGE_NAME
from vgps.writers.frame_choice import FrameChoice


@dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """How to export a run.

    Attributes:
        crs: Coordinate system, as ``EPSG:25832`` or ``EPSG:25832+7837``; None for WGS 84.
        geoid: Geoid that heights are above: a name, a grid file, or its height [m]; None for the ellipsoid.
        gps_crs: Coordinate system of the run's fixes, if not WGS 84.
        choice: Which frames.
        columns: Columns of a CSV file; None for the usual ones.
        images: Recording, video or folder of images with the frames, if not where the run says.
    """

    crs: str | None = None
    geoid: str | None = None
    gps_crs: str | None = None
    choice: FrameChoice = field(default_factory=FrameChoice)
    columns: tuple[str, ...] | None = None
    images: Path | None = None


@dataclass(frozen=True, kw_only=True)
class ExportJob:
    """A run to write.

    Attributes:
        solution: The run with the frames chosen.
        frame: (F,) their numbers in the recording.
        system: What coordinates are in; None if the run is not georeferenced.
        options: The options.
        out: The final name of what is written, which a writer may have to state.
    """

    solution: Solution
    frame: IntArray
    system: CoordinateSystem | None
    options: ExportOptions
    out: Path

    @property
    def georeferenced(self) -> CoordinateSystem:
        """The coordinate system.

        Raises:
            RunFolderError: The run is not georeferenced.
        """
        return self._system_and_origin[0]

    @property
    def _system_and_origin(self) -> tuple[CoordinateSystem, GeodeticPoint]:
        """The coordinate system, and the origin of the run's world; raises as `georeferenced`."""
        if self.system is None or self.solution.world_origin is None:
            raise RunFolderError(
                "the run is not georeferenced",
                expected="a run tied to the world by fixes or control points",
                remedy="export it as tum, kitti, ply, colmap, nerfstudio or splat",
            )
        return self.system, self.solution.world_origin

    @cached_property
    def geodetic(self) -> FloatArray:
        """(F, 3) latitude, longitude [deg] and ellipsoidal height [m] of the cameras."""
        return self.geodetic_of(self.solution.world_T_camera[:, :3, 3])

    def geodetic_of(self, world_p_point: FloatArray) -> FloatArray:
        """Return latitude, longitude [deg] and ellipsoidal height [m] (N, 3) of points (N, 3)."""
        return to_geodetic(self._system_and_origin[1], world_p_point)

    @cached_property
    def coordinates(self) -> FloatArray:
        """(F, 3) coordinates of the cameras in the system."""
        return self.georeferenced.from_geodetic(self.geodetic)

    @cached_property
    def local_R_camera(self) -> FloatArray:
        """(F, 3, 3) rotations to east, north, up at each camera's own place."""
        rotation = local_R_world(self._system_and_origin[1], self.geodetic)
        return np.asarray(rotation @ self.solution.world_T_camera[:, :3, :3])

    @cached_property
    def heading_deg(self) -> FloatArray:
        """(F,) direction of the optical axis clockwise from true north; NaN straight up or down."""
        return heading_deg(self.local_R_camera)

    @property
    def utc(self) -> list[datetime] | None:
        """Instants of the frames on the clock of the GPS log; None if it is unknown."""
        start = self.solution.video_start_utc
        if start is None:
            return None
        start, stamps_s = start.astimezone(UTC), self.solution.sensors.clock.time_stamps(self.solution.t_s)
        return [start + timedelta(seconds=t_s) for t_s in stamps_s.tolist()]

    @cached_property
    def image_names(self) -> list[str]:
        """Names of the frames' images: those of a folder of images, else as FFmpeg numbers them."""
        files = image_files(self.options.images or self.solution.recording, self.solution.camera)
        if files is None or len(files) <= self.frame.max(initial=-1):
            return [IMAGE_NAME.format(number) for number in self.frame.tolist()]
        return [files[number].name for number in self.frame.tolist()]

    @property
    def jpeg_names(self) -> list[str]:
        """The same names for images that are written as JPEG."""
        return [
            name if name.lower().endswith((".jpg", ".jpeg")) else f"{Path(name).stem}.jpg"
            for name in self.image_names
        ]

    @cached_property
    def video(self) -> RunVideo:
        """The frames themselves.

        Raises:
            RunFolderError: They are not where the run says, or not as many.
        """
        return video_of(self.solution, self.options.images, int(self.frame.max(initial=-1)))

    def pictures(self) -> Iterator[tuple[int, RgbImage]]:
        """Yield row (of the frames chosen) and colours (H, W, 3) of the frames, those that can be decoded."""
        rows = {number: row for row, number in enumerate(self.frame.tolist())}
        wanted: Collection[int] = rows.keys()
        for number, picture in self.video.pictures(wanted):
            yield rows[number], picture


def image_files(place: Path | None, camera: Camera) -> list[Path] | None:
    """Return the files of a recording whose frames are a folder of images of this camera; None for others."""
    try:
        source = None if place is None else place_of(place)[1]
        if place is None or source is None or not is_image_folder(source):
            return None
        video = open_posed_video(place, replace(camera, focal_changes=None))
        return video.files if isinstance(video, ImageFolder) else None
    except VgpsError:
        return None


def video_of(solution: Solution, images: Path | None, last: int) -> RunVideo:
    """Return the video of a run, which has at least the frame ``last``.

    Raises:
        RunFolderError: It is not where the run says or ``images`` names, or too short.
    """
    place = images or solution.recording
    remedy = "name the recording, video or folder of images with --images"
    if place is None:
        raise RunFolderError("the run does not say where its recording is", remedy=remedy)
    try:
        video = open_posed_video(place, solution.camera)
    except VgpsError as error:
        raise RunFolderError(f"no frames to export ({error})", remedy=remedy) from error
    if last >= len(video.times_s):
        raise RunFolderError(
            f"{len(video.times_s)} frames", file=place, expected=f"at least {last + 1}, as in the run"
        )
    return video
