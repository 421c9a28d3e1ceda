"""The path of a map: poses, times and tracked displacements of consecutive frames."""

import numpy as np

from vgps.mapping.growing_array import GrowingArray, read_only
from vgps.mapping.map_update import NewFrame, Similarity
from vgps.model import FloatArray


class MapPath:
    """Rows of frames, from ``first_frame`` on.

    Attributes:
        first_frame: Index of the first frame.
        bridged: Frames without observations, posed by interpolation.
    """

    def __init__(self, first_frame: int) -> None:
        self.first_frame = first_frame
        self.bridged: frozenset[int] = frozenset()
        self._poses, self._t_s, self._odometry = GrowingArray((4, 4)), GrowingArray(), GrowingArray((3,))
        self._bending = GrowingArray()

    def __len__(self) -> int:
        return len(self._poses)

    @property
    def next_frame(self) -> int:
        """Index of the frame after the last one."""
        return self.first_frame + len(self)

    @property
    def poses(self) -> FloatArray:
        """(n, 4, 4) world_T_camera, NaN where unknown; read-only."""
        return read_only(self._poses.values)

    @property
    def t_s(self) -> FloatArray:
        """(n,) times; read-only."""
        return read_only(self._t_s.values)

    @property
    def odometry(self) -> FloatArray:
        """(n, 3) tracked displacement from the previous frame, in its axes, NaN where unknown; read-only."""
        return read_only(self._odometry.values)

    @property
    def bending(self) -> FloatArray:
        """(n,) variance, rad^2 about each axis, by which a rotation may err more than the one before, by the
        covariance of stage C; NaN where that says nothing; read-only.
        """
        return read_only(self._bending.values)

    def snapshot(self) -> "MapPath":
        """Return a copy."""
        return self.part(self.first_frame, self.next_frame)

    def append(self, frame: NewFrame) -> None:
        """Append a frame."""
        previous = self._poses.values[-1] if len(self) else np.full((4, 4), np.nan)
        if frame.bridged:
            self.bridged |= {self.next_frame}
        self._odometry.append(previous[:3, :3].T @ (frame.world_T_camera[:3, 3] - previous[:3, 3]))
        self._poses.append(frame.world_T_camera)
        self._t_s.append(frame.t_s)
        self._bending.append(np.nan)

    def replace(self, first_frame: int, poses: FloatArray, bending: FloatArray | None) -> None:
        """Replace the poses from a frame on by others (n, 4, 4), and the bending (n,) where it is finite."""
        row = first_frame - self.first_frame
        rows = slice(row, row + len(poses))
        self._poses.values[rows] = poses
        if bending is not None:
            known = np.flatnonzero(np.isfinite(bending))
            self._bending.values[row + known] = bending[known]

    def transform(self, to_world: Similarity) -> None:
        """Move the path, and give it another unit."""
        self._poses.values[:] = to_world.poses(self._poses.values)
        self._odometry.values[:] *= to_world.scale

    def part(self, first: int, end: int) -> "MapPath":
        """Return a copy of the frames from one on to before another."""
        copied = MapPath(first)
        copied.bridged = frozenset(bridged for bridged in self.bridged if first <= bridged < end)
        rows = slice(first - self.first_frame, end - self.first_frame)
        arrays = self._poses, self._t_s, self._odometry, self._bending
        copied._poses, copied._t_s, copied._odometry, copied._bending = (
            GrowingArray.of(values.values[rows]) for values in arrays
        )
        return copied
