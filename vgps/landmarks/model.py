"""What a landmark database holds, in memory: views of landmarks, keyframes, and what they were made from."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vgps.model import FloatArray, GeodeticPoint, GrayImage, IntArray


@dataclass(frozen=True)
class LandmarkViews:
    """Views of landmarks, a row each; (A)-(D) of Matsuda 2007.

    A template is a picture of a small plane through the landmark: its pixel (column, row), counted from its
    middle, shows the world point ``world_p_landmark + column * world_v_column + row * world_v_row``. So the
    two vectors hold the plane's normal (C) and the scale (D); at level k both count ``2**k`` times.

    Attributes:
        landmark: (N,) id in the database; several views of one landmark share it.
        world_p_landmark: (N, 3) metres.
        world_p_camera: (N, 3) from where it was seen, metres.
        world_v_column, world_v_row: (N, 3) metres per template pixel at level 0.
        templates: (N, levels, P, P) uint8, P odd, finest level first.
        sigma_px: (N,) the landmark's reliability sigma_j, Eq. (13), Kume 2010.
        position_sigma_m: (N,) how well the landmark's position is known.
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

    def take(self, rows: IntArray) -> "LandmarkViews":
        """Some of them."""
        return LandmarkViews(*(values[rows] for values in vars(self).values()))

    @property
    def world_n(self) -> FloatArray:
        """(N, 3) unit normals of the planes, towards the camera that saw them."""
        # columns run right and rows down in the picture, so their product points away from the camera
        normal = -np.cross(self.world_v_column, self.world_v_row)
        return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


@dataclass(frozen=True)
class Keyframe:
    """A frame by which a camera without any pose finds its place again.

    Attributes:
        world_T_camera: (4, 4) its pose.
        landmark: (N,) ids of landmarks seen in it, sorted; one may have several descriptors.
        world_p_landmark: (N, 3) what the descriptor shows: at its landmark's depth, a few pixels beside it.
        descriptors: (N, 32) uint8, bits, as :func:`vgps.landmarks.descriptors.describe` gives them.
        thumbnail: (h, w) the whole frame, small.
    """

    world_T_camera: FloatArray
    landmark: IntArray
    world_p_landmark: FloatArray
    descriptors: npt.NDArray[np.uint8]
    thumbnail: GrayImage


@dataclass(frozen=True)
class Source:
    """A run that a database was made from.

    Attributes:
        recording: Of the run.
        frames: Which of its frames gave templates: all, even or odd.
        landmarks: How many it gave.
        settings: The :class:`vgps.config.LandmarksConfig`, as JSON.
    """

    recording: str
    frames: str
    landmarks: int
    settings: str


@dataclass(frozen=True)
class DatabaseContents:
    """Everything in a database; ids of landmarks are unique in it.

    Attributes:
        world_origin: Where the ENU frame stands; absent where the world is known by control points alone.
        views: Sorted by landmark.
        keyframes: Their landmarks are among those of ``views``.
    """

    world_origin: GeodeticPoint | None
    views: LandmarkViews
    keyframes: tuple[Keyframe, ...]
    sources: tuple[Source, ...]
