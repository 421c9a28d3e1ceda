"""Paths of the cameras of a rig, each tracked by itself, as one path of the reference camera."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.geometry import interpolate_poses
from vgps.model import BoolArray, FloatArray

_SCALE_FRAMES = 15  # over which a turn of the rig shows how far apart its cameras are


@dataclass(frozen=True)
class CameraPath:
    """Poses (F, 4, 4) of a camera, frames (F,) in which it was tracked, and its pose (4, 4) on the rig."""

    poses: FloatArray
    tracked: BoolArray
    reference_T_camera: FloatArray

    def at(self, own_s: FloatArray, t_s: FloatArray) -> "CameraPath":
        """Return the path at other times; tracked where the frames around these were."""
        inside = np.interp(t_s, own_s, self.tracked.astype(float), left=0.0, right=0.0)
        return replace(self, poses=interpolate_poses(own_s, self.poses, t_s), tracked=inside > 1.0 - 1e-9)

    def scaled(self, scale: float) -> "CameraPath":
        """Return the path in a unit ``scale`` times smaller."""
        poses = self.poses.copy()
        poses[:, :3, 3] *= scale
        return replace(self, poses=poses)

    @property
    def of_reference(self) -> FloatArray:
        """(F, 4, 4) poses of the reference camera."""
        return np.asarray(self.poses @ np.linalg.inv(self.reference_T_camera))

    @property
    def rotation(self) -> FloatArray:
        """(F, 3, 3) rotations of the reference camera."""
        return np.asarray(self.poses[:, :3, :3] @ self.reference_T_camera[:3, :3].T)


def relative_scale(path: CameraPath, other: CameraPath) -> float:
    """Return how much longer the first path is than the other one where both were tracked; 1 if nowhere."""
    both = path.tracked & other.tracked
    both = both[1:] & both[:-1]
    lengths = [np.linalg.norm(np.diff(p.poses[:, :3, 3], axis=0), axis=1)[both].sum() for p in (path, other)]
    return float(lengths[0] / lengths[1]) if min(lengths, default=0.0) > 0.0 else 1.0


def metres_per_unit(path: CameraPath, others: Sequence[CameraPath]) -> tuple[float, float]:
    """Return the scale of a path in metres, as the distances between the cameras show it when the rig turns.

    Over some frames the rig turns by R, and two cameras at c and d on it move by ``R c - c`` and ``R d - d``
    beyond their common motion. Across the direction in which the other camera moves, whose own scale is not
    known, the path (in units) differs from zero by ``(R - I) (c - d)`` times units per metre.

    Returns:
        Metres per unit, and its relative standard deviation, infinite if the turns do not show it. Where
        they do not, cameras count as close to each other: then their distance bends the path least.
    """
    products, squares, residuals = 0.0, 0.0, []
    for other in others:
        moved, lever = _across(path, other)
        products, squares = products + float(np.sum(moved * lever)), squares + float(np.sum(lever**2))
        residuals.append((moved, lever))
    if squares == 0.0:
        return 1.0, np.inf
    units = products / squares
    left = np.concatenate([moved - units * lever for moved, lever in residuals])
    sigma = float(np.sqrt(_SCALE_FRAMES * np.sum(left**2) / max(2 * len(left) - 1, 1) / squares))
    if units <= 2.0 * sigma:
        return 1.0 / max(units, sigma, 1e-9), np.inf
    return 1.0 / units, sigma / units


def _across(path: CameraPath, other: CameraPath) -> tuple[FloatArray, FloatArray]:
    """Return motions (n, 3) of a path, and of the cameras' distance, across those of another camera."""
    both = path.tracked & other.tracked
    first = np.flatnonzero(both[:-_SCALE_FRAMES] & both[_SCALE_FRAMES:])
    last = first + _SCALE_FRAMES
    steps = []
    for one in (path, other):
        world = one.poses[last, :3, 3] - one.poses[first, :3, 3]
        steps.append(np.einsum("nji,nj->ni", one.rotation[first], world))
    turn = np.einsum("nji,njk->nik", path.rotation[first], path.rotation[last]) - np.eye(3)
    lever = turn @ (path.reference_T_camera[:3, 3] - other.reference_T_camera[:3, 3])
    along = steps[1] / np.maximum(np.linalg.norm(steps[1], axis=1, keepdims=True), 1e-12)
    own, lever = (x - np.sum(x * along, axis=1, keepdims=True) * along for x in (steps[0], lever))
    return own, lever


def fill_from_other_camera(
    poses: FloatArray, tracked: BoolArray, other: CameraPath
) -> tuple[FloatArray, BoolArray]:
    """Return poses with the motion of another camera where only that one was tracked.

    Args:
        poses: (F, 4, 4) of the reference camera.
        tracked: (F,) whether any camera so far was tracked.
        other: Path of the other camera.
    """
    poses, found = poses.copy(), other.of_reference
    edges = np.flatnonzero(np.diff(np.concatenate([[0], other.tracked & ~tracked, [0]])))
    for begin, end in edges.reshape(-1, 2).tolist():
        poses[begin:end] = _fitted(poses, found, begin, end)
    return poses, tracked | other.tracked


def _fitted(poses: FloatArray, other: FloatArray, begin: int, end: int) -> FloatArray:
    """Return poses of frames begin..end as the other path moves there, fitted to the frames around them.

    What is left at the end, a drift of either path, is spread evenly.
    """
    first = begin - 1 if begin else end
    last = end if end < len(poses) else first
    if not 0 <= first < len(poses):
        return other[begin:end]
    rigid = np.asarray(poses[first] @ np.linalg.inv(other[first]) @ other)
    share = np.linspace(0.0, 1.0, end - begin + 2)[1:-1] if last != first else np.zeros(end - begin)
    out = rigid[begin:end].copy()
    out[:, :3, 3] += share[:, None] * (poses[last, :3, 3] - rigid[last, :3, 3])
    turn = Rotation.from_matrix(poses[last, :3, :3] @ rigid[last, :3, :3].T).as_rotvec()
    out[:, :3, :3] = Rotation.from_rotvec(share[:, None] * turn).as_matrix() @ out[:, :3, :3]
    return out
