"""The epipolar geometry of pairs of views for a given lens: residuals, steps and starts, all pairs at once.

Each pair has a rotation and a direction of motion. The residual of a feature is its Sampson distance in the
distorted images,

    e / |de/d(u1, v1, u2, v2)|  with  e = b2 . (t x R b1)

and b1, b2 its unit rays. The loss is Cauchy's.
"""

import cv2
import numpy as np

from vgps.camera_calibration.lens import rays
from vgps.geometry import cross_matrices, rotation_matrices
from vgps.model import FloatArray
from vgps.tracking.view_pairs import ViewPairs

POSE_PRIOR = np.array([1e-6, 1e-6, 1e-6, 1e-3, 1e-3])  # bounds the direction of a camera that only turns
_POSE_STEP = 1e-6
_OUTSIDE_PX = 3.0  # residual where the lens model does not hold
_MOST_TURN = 0.3  # rad in one step
_MIN_AHEAD = 0.3  # cosine of the angle from the axis, for an essential matrix
_MIN_ESSENTIAL = 20


class PairRays:
    """The rays of all features for one set of parameters."""

    def __init__(self, pairs: ViewPairs, model: str, parameters: FloatArray) -> None:
        self.pair = pairs.pair
        self.first, self._by_first, holds = rays(model, parameters, pairs.first_px)
        self.second, self._by_second, also = rays(model, parameters, pairs.second_px)
        self._outside = ~(holds & also)

    def residual(self, rotation: FloatArray, direction: FloatArray) -> FloatArray:
        """Return the Sampson distances (N,) [px]."""
        essential = (cross_matrices(direction) @ rotation)[self.pair]
        line = np.einsum("nij,nj->ni", essential, self.first)
        other = np.einsum("nji,nj->ni", essential, self.second)
        gradient = np.hypot(
            np.linalg.norm(np.einsum("ni,nij->nj", other, self._by_first), axis=1),
            np.linalg.norm(np.einsum("ni,nij->nj", line, self._by_second), axis=1),
        )
        e = np.einsum("ni,ni->n", self.second, line) / np.maximum(gradient, 1e-12)
        return np.where(self._outside, _OUTSIDE_PX, e)

    def by_pose(self, rotation: FloatArray, direction: FloatArray) -> FloatArray:
        """Return the derivatives (N, 5) of the distances by rotation and direction of their pair."""
        here = self.residual(rotation, direction)
        columns = []
        for k in range(5):
            step = np.zeros((len(rotation), 5))
            step[:, k] = _POSE_STEP
            columns.append((self.residual(*retracted(rotation, direction, step)) - here) / _POSE_STEP)
        return np.stack(columns, axis=1)


def pose_step(
    pairs: ViewPairs, lens: PairRays, rotation: FloatArray, direction: FloatArray, noise_px: float
) -> tuple[FloatArray, FloatArray]:
    """Return rotations and directions after one step of Gauss-Newton with the lens held."""
    r, J = lens.residual(rotation, direction) / noise_px, lens.by_pose(rotation, direction) / noise_px
    weight = 1.0 / (1.0 + r**2)
    A = sums_by_pair(pairs, weight, J, J) + np.diag(POSE_PRIOR / noise_px**2)
    A = A + 1e-9 * np.trace(A, axis1=1, axis2=2)[:, None, None] * np.eye(5)
    step = -np.linalg.solve(A, sums_by_pair(pairs, weight, J, r[:, None]))[..., 0]
    turn = np.maximum(np.linalg.norm(step[:, :3], axis=1), _MOST_TURN)
    return retracted(rotation, direction, step * (_MOST_TURN / turn)[:, None])


def pure_rotations(pairs: ViewPairs, lens: PairRays) -> FloatArray:
    """Return the robust rotation (P, 3, 3) of each pair, as of a camera that does not move."""
    weight, rotation = np.ones(len(pairs.pair)), np.tile(np.eye(3), (pairs.count, 1, 1))
    for _ in range(6):
        products = sums_by_pair(pairs, weight, lens.second, lens.first)
        u, _, vt = np.linalg.svd(products)
        sign = np.linalg.det(u @ vt)
        u[:, :, 2] *= sign[:, None]
        rotation = u @ vt
        error = np.linalg.norm(
            lens.second - np.einsum("nij,nj->ni", rotation[pairs.pair], lens.first), axis=1
        )
        weight = 1.0 / (1.0 + (error / max(float(np.median(error)), 1e-6)) ** 2)
    return rotation


def essential_starts(
    pairs: ViewPairs, lens: PairRays, rotation: FloatArray, noise: float
) -> tuple[FloatArray, FloatArray]:
    """Return rotations and directions of the pairs by their essential matrices, where they have one."""
    rotation, direction = rotation.copy(), np.tile(np.array([0.0, 0.0, 1.0]), (pairs.count, 1))
    ahead = (lens.first[:, 2] > _MIN_AHEAD) & (lens.second[:, 2] > _MIN_AHEAD)
    for pair in range(pairs.count):
        rows = ahead & (pairs.pair == pair)
        if rows.sum() < _MIN_ESSENTIAL:
            continue
        first, second = (ray[rows, :2] / ray[rows, 2:] for ray in (lens.first, lens.second))
        essential, _ = cv2.findEssentialMat(
            first, second, np.eye(3), method=cv2.USAC_MAGSAC, prob=0.999, threshold=2.0 * noise
        )
        if essential is not None and essential.shape == (3, 3):
            *both, t = cv2.decomposeEssentialMat(essential)
            # one of an essential matrix's two rotations includes half a revolution about the baseline
            rotation[pair], direction[pair] = max(both, key=np.trace), t[:, 0]
    return rotation, direction


def sums_by_pair(pairs: ViewPairs, weight: FloatArray, left: FloatArray, right: FloatArray) -> FloatArray:
    """Return the weighted sums (P, a, b) of products of rows left (N, a) and right (N, b) over each pair."""
    products = np.einsum("n,na,nb->nab", weight, left, right)
    first = np.searchsorted(pairs.pair, np.arange(pairs.count))
    return np.asarray(np.add.reduceat(products, first, axis=0), np.float64)


def retracted(rotation: FloatArray, direction: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return rotations and directions moved by steps (P, 5): rotation in the first's axes, direction in the
    plane perpendicular to it."""
    turned = rotation @ rotation_matrices(step[:, :3])
    across = cross_matrices(direction)
    smallest = np.argmin(np.abs(direction), axis=1)
    one = across[np.arange(len(direction)), :, smallest]  # the cross product with the axis of that number
    one /= np.linalg.norm(one, axis=1)[:, None]
    other = (across @ one[:, :, None])[:, :, 0]
    moved = direction + step[:, 3:4] * one + step[:, 4:] * other
    return turned, moved / np.linalg.norm(moved, axis=1)[:, None]


def cauchy_loss(r: FloatArray) -> FloatArray:
    """Return the losses (N,) of residuals in units of their noise."""
    return 0.5 * np.log1p(r**2)
