"""What a landmark database holds, in memory: views of landmarks, keyframes, and what they were made from."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vgps.landmarks.views import LandmarkViews
from vgps.model import FloatArray, GeodeticPoint, GrayImage, IntArray


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
class LandmarkContents:
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
