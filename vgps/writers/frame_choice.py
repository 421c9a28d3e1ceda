"""Choice of frames for an export: one per stretch of path or time, the sharpest one on request."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from vgps.errors import RunFolderError
from vgps.geometry import travelled
from vgps.model import FloatArray, GrayImage, IntArray
from vgps.readers.posed_video import RunVideo
from vgps.solution import FrameState, Observations, Solution

Select = Literal["all", "sharp"]
_SHARP_S = 0.5  # stretch of which the sharpest frame is taken, if no other is given: about a stride


@dataclass(frozen=True, kw_only=True)
class FrameChoice:
    """Which frames to export.

    Attributes:
        select: Every frame, or the sharpest one of each stretch.
        every_m: Length of a stretch along the path [m].
        every_s: Duration of a stretch [s].
    """

    select: Select = "all"
    every_m: float | None = None
    every_s: float | None = None

    @property
    def takes_all(self) -> bool:
        """Whether every frame is exported."""
        return self.select == "all" and self.every_m is None and self.every_s is None


def choose_frames(solution: Solution, choice: FrameChoice, video: RunVideo | None) -> IntArray:
    """Return the indices of the frames chosen, in order.

    Args:
        solution: The run.
        choice: What to choose.
        video: Its frames, for ``sharp`` only.

    Raises:
        RunFolderError: A stretch is not positive, or there are no frames to compare.
    """
    count = len(solution.t_s)
    if choice.takes_all:
        return np.arange(count)
    stretch = _stretches(solution, choice)
    score = np.arange(count, 0, -1.0)  # the first frame of each stretch
    if choice.select == "sharp":
        if video is None:
            raise RunFolderError("no frames to compare", remedy="name the recording with --images")
        score = _sharpness(video, count)
    bridged = np.array([state is FrameState.BRIDGED for state in solution.state])
    order = np.lexsort((-score, bridged, stretch))  # the picture of a bridged one may be of another pose
    first = np.unique(stretch[order], return_index=True)[1]
    return np.sort(order[first]).astype(np.int64)


def subset(solution: Solution, frame: IntArray) -> Solution:
    """Return the run with some of its frames, and the landmarks' observations in them."""
    if len(frame) == len(solution.t_s):
        return solution
    row = np.full(len(solution.t_s), -1)
    row[frame] = np.arange(len(frame))
    seen = solution.observations
    kept = row[seen.frame] >= 0
    before = solution.world_p_before
    return replace(
        solution,
        t_s=solution.t_s[frame],
        world_T_camera=solution.world_T_camera[frame],
        sigma_rotation_rad=solution.sigma_rotation_rad[frame],
        sigma_position_m=solution.sigma_position_m[frame],
        state=tuple(solution.state[k] for k in frame.tolist()),
        observations=Observations(row[seen.frame[kept]], seen.landmark[kept], seen.uv_px[kept]),
        world_p_before=None if before is None else before[frame],
    )


def _stretches(solution: Solution, choice: FrameChoice) -> IntArray:
    """Return the number of the stretch of each frame (F,)."""
    if choice.every_m is not None and choice.every_s is not None:
        raise RunFolderError("--every-m and --every-s together", remedy="give one of them")
    along, length = solution.t_s - solution.t_s[0], _SHARP_S if choice.every_s is None else choice.every_s
    if choice.every_m is not None:
        along, length = travelled(solution.world_T_camera[:, :3, 3]), choice.every_m
    if not length > 0.0:
        raise RunFolderError(f"a stretch of {length:g} between frames", expected="more than 0")
    return np.asarray(np.floor(along / length + 1e-9), np.int64)


def _sharpness(video: RunVideo, count: int) -> FloatArray:
    """Return (F,) the mean squared gradient of each frame, which blur lowers; -1 for frames not decoded."""
    found = np.full(count, -1.0)
    for frame in video.frames():
        if frame.index >= count:
            break
        found[frame.index] = _gradient(frame.gray)
    return found


def _gradient(gray: GrayImage) -> float:
    """Return the mean squared difference of neighbours, of every second row and column of 8-bit grey."""
    values = gray.astype(np.float32)
    across, down = np.diff(values[::2], axis=1), np.diff(values[:, ::2], axis=0)
    return float(np.mean(across**2) + np.mean(down**2))
