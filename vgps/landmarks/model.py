"""Data of a landmark database in memory: landmark views, keyframes, and the runs they come from."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vgps.model import BoolArray, Camera, FloatArray, GeodeticPoint, GrayImage, IntArray


@dataclass(frozen=True, kw_only=True)
class LandmarkViews:
    """Views of landmarks, one per row; (A)-(D) of Matsuda 2007.

    A template is a picture of a small plane through the landmark. Its pixel (column, row), counted from the
    middle, shows the world point ``world_p_landmark + column * world_v_column + row * world_v_row``. The two
    vectors thus hold the plane's normal (C) and the scale (D); at level k both count ``2**k`` times.

    Attributes:
        landmark: (N,) ids in the database; views of one landmark share its id.
        world_p_landmark: (N, 3) metres.
        world_p_camera: (N, 3) position of the camera that took the view, metres.
        world_v_column, world_v_row: (N, 3) metres per template pixel at level 0.
        templates: (N, levels, P, P) uint8, P odd, finest level first.
        sigma_px: (N,) reliability sigma_j of the landmark, Eq. (13), Kume 2010.
        position_sigma_m: (N,) standard deviation of the landmark's position along its least certain axis.
    """

    landmark: IntArray
    world_p_landmark: FloatArray
    world_p_camera: FloatArray
    world_v_column: FloatArray
    world_v_row: FloatArray
    templates: npt.NDArray[np.uint8]
    sigma_px: FloatArray
    position_sigma_m: FloatArray

    def __len__(self) -> int:
        return len(self.landmark)

    def take(self, rows: IntArray | BoolArray) -> "LandmarkViews":
        """Return the views in ``rows``."""
        return LandmarkViews(**{name: values[rows] for name, values in vars(self).items()})


@dataclass(frozen=True, kw_only=True)
class Keyframe:
    """Features of one frame by which a camera of unknown pose is relocalised.

    Attributes:
        world_T_camera: (4, 4) pose of the frame.
        landmark: (N,) landmark ids, sorted; a landmark may have several descriptors.
        world_p_landmark: (N, 3) position of each feature: at its landmark's depth, a few pixels beside it.
        descriptors: (N, 32) uint8, packed bits, see :func:`vgps.landmarks.descriptors.describe`.
        thumbnail: (h, w) the whole frame, reduced.
    """

    world_T_camera: FloatArray
    landmark: IntArray
    world_p_landmark: FloatArray
    descriptors: npt.NDArray[np.uint8]
    thumbnail: GrayImage


@dataclass(frozen=True)
class Cameras:
    """Calibration of a recording, as given and as its run refined it."""

    given: Camera
    refined: Camera


@dataclass(frozen=True)
class Source:
    """A run that contributed to a database.

    Attributes:
        recording: Folder of the run's recording.
        frames: Frames that gave templates: all, even or odd.
        landmarks: Number of landmarks from this run.
        settings: The :class:`vgps.config.LandmarksConfig`, as JSON.
        cameras: Calibration of the recording; None in early databases.
    """

    recording: str
    frames: str
    landmarks: int
    settings: str
    cameras: Cameras | None = None


@dataclass(frozen=True)
class DatabaseContents:
    """Everything in a database; landmark ids are unique in it.

    Attributes:
        world_origin: Origin of the ENU frame; None where control points alone define the world.
        views: Sorted by landmark.
        keyframes: Their landmarks are among those of ``views``.
        sources: One per run.
    """

    world_origin: GeodeticPoint | None
    views: LandmarkViews
    keyframes: tuple[Keyframe, ...]
    sources: tuple[Source, ...]
