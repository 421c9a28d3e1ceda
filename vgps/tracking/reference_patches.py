"""Reference patches of features: each match is aligned to one patch, so that a track does not drift.

A match from frame to frame adds its error to all errors before it. So the patch in which a feature was first
observed is warped into the new frame by the poses and the feature's depth, an affine map, and aligned there
by inverse-compositional Lucas-Kanade (Baker and Matthews 2004) with a gain and an offset of the brightness.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from vgps.camera import distort, undistort
from vgps.mapping.local_map import LocalMap
from vgps.model import BoolArray, Camera, Float32Array, FloatArray, GrayImage, IntArray

_HALF = 5  # half the side of a patch in pixels: small enough to be a plane, large enough for noise
_STEP_PX = float(_HALF)  # of the differences that give a warp
_ITERATIONS = 3
_MIN_CORRELATION = 0.8  # between the patch and the frame
_MAX_SCALE = 1.3  # a patch that appears larger or smaller by more than this is taken anew
_MIN_GAIN = 0.2  # of the brightness; a smaller one is another surface
_MIN_POWER = 1e-3  # grey values squared: keeps a patch without texture finite
_MIN_DEPTH = 1e-3  # map units
_ARMS = _STEP_PX * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])


def _offsets(half: int) -> tuple[Float32Array, Float32Array]:
    """Return the offsets x and y (P,) of the pixels of a square from its centre."""
    grid = np.arange(-half, half + 1, dtype=np.float32)
    x, y = np.meshgrid(grid, grid)
    return x.ravel(), y.ravel()


_X, _Y = _offsets(_HALF)


@dataclass(frozen=True, kw_only=True)
class Patches:
    """Patches of n features.

    Attributes:
        ids: (n,) features, counted from the first one ever followed.
        frame: (n,) frame in which each was taken.
        arms: (n, 4, 2) undistorted directions (x / z, y / z) to four pixels around it, which give its warp.
        texture: (n, P) grey values, mean removed.
        gradient: (n, 2, P) their gradient, without what a change of gain or offset explains.
        inverse: (n, 2, 2) inverse of the sum of products of the gradient.
        scale: (n,) how much larger the patch appeared when it was last seen.
    """

    ids: IntArray
    frame: IntArray
    arms: FloatArray
    texture: Float32Array
    gradient: Float32Array
    inverse: Float32Array
    scale: FloatArray

    def rows(self, rows: IntArray) -> "Patches":
        """Return the patches of some rows."""
        return Patches(**{name: value[rows] for name, value in vars(self).items()})

    def joined(self, *others: "Patches") -> "Patches":
        """Return these patches and others."""
        columns = {
            name: [value, *(vars(other)[name] for other in others)] for name, value in vars(self).items()
        }
        return Patches(**{name: np.concatenate(column) for name, column in columns.items()})


NO_PATCHES = Patches(
    ids=np.zeros(0, np.int64),
    frame=np.zeros(0, np.int64),
    arms=np.zeros((0, 4, 2)),
    texture=np.zeros((0, len(_X)), np.float32),
    gradient=np.zeros((0, 2, len(_X)), np.float32),
    inverse=np.zeros((0, 2, 2), np.float32),
    scale=np.zeros(0),
)


@dataclass(frozen=True)
class AlignedPatches:
    """Aligned pixels ``uv_px`` (n, 2) in the distorted image; ``tried`` and ``found`` (n,) say of which
    features a patch could be warped, and for which of them it agrees with the frame."""

    uv_px: FloatArray
    tried: BoolArray
    found: BoolArray


class ReferencePatches:
    """The patches of the features that a map follows.

    Attributes:
        patches: The patches.
    """

    def __init__(self, camera: Camera, patches: Patches = NO_PATCHES) -> None:
        self._camera, self._K = camera, camera.K
        self.patches = patches

    def take(self, local_map: LocalMap, view: GrayImage | Float32Array) -> None:
        """Take patches of features that have none, or one of another scale, and drop those of lost features.

        Args:
            local_map: Features with their pixels in its newest view.
            view: The image of that view.
        """
        ids = local_map.ids + local_map.discarded_features
        _, rows, mine = np.intersect1d(ids, self.patches.ids, assume_unique=True, return_indices=True)
        scale = self.patches.scale[mine]
        good = (scale < _MAX_SCALE) & (scale > 1.0 / _MAX_SCALE)
        new = np.setdiff1d(np.arange(len(ids)), rows[good], assume_unique=True)
        taken = self._taken(ids[new], int(local_map.view_frames[-1]), view, local_map.raw_uv_px[new])
        order = np.argsort(np.concatenate([rows[good], new]))
        self.patches = self.patches.rows(mine[good]).joined(taken).rows(order)

    def align(
        self,
        local_map: LocalMap,
        world_T_camera: FloatArray,
        gray: GrayImage | Float32Array,
        start_uv_px: FloatArray,
        max_shift_px: float,
    ) -> AlignedPatches:
        """Align the patches of all followed features with a frame; call :meth:`take` before.

        Args:
            local_map: Gives poses and positions.
            world_T_camera: (4, 4) pose of the frame.
            gray: The frame.
            start_uv_px: (n, 2) where each feature is expected, in the distorted image.
            max_shift_px: A feature that is further away is not found.
        """
        warp, tried = self._warps(local_map, world_T_camera)
        scale = np.sqrt(np.abs(np.linalg.det(warp)))
        self.patches.scale[tried] = scale[tried]
        rows = np.flatnonzero(tried)
        image = gray.astype(np.float32, copy=False)
        moved, correlation = _aligned(self.patches.rows(rows), image, start_uv_px[rows], warp[rows])
        inside = np.all((moved > _HALF) & (moved < np.array(gray.shape[::-1]) - _HALF), axis=1)
        near = np.linalg.norm(moved - start_uv_px[rows], axis=1) < max_shift_px
        uv, found = start_uv_px.copy(), np.zeros(len(tried), dtype=bool)
        uv[rows], found[rows] = moved, near & inside & (correlation > _MIN_CORRELATION)
        return AlignedPatches(uv, tried, found)

    def _taken(self, ids: IntArray, frame: int, view: GrayImage | Float32Array, uv_px: FloatArray) -> Patches:
        """Return the patches of features (n,) at pixels (n, 2) of an image."""
        texture, gradient = _texture(view, uv_px)
        square = gradient @ gradient.transpose(0, 2, 1) + _MIN_POWER * np.eye(2, dtype=np.float32)
        ends = undistort(self._camera, (uv_px[:, None] + _ARMS).reshape(-1, 2))
        arms = (ends - self._K[:2, 2]) / (self._K[0, 0], self._K[1, 1])
        return Patches(
            ids=ids,
            frame=np.full(len(ids), frame),
            arms=arms.reshape(-1, 4, 2),
            texture=texture,
            gradient=gradient,
            inverse=np.linalg.inv(square).astype(np.float32),
            scale=np.ones(len(ids)),
        )

    def _warps(self, local_map: LocalMap, world_T_camera: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return affine warps (n, 2, 2) from the patches into a frame, and (n,) where they are known.

        A patch is taken to be parallel to the image in which it was taken, at the depth of its feature.
        """
        patches = self.patches
        points = local_map.points[patches.ids - local_map.discarded_features]
        row = patches.frame - local_map.first_frame
        taken = local_map.poses[np.maximum(row, 0)]
        depth = np.einsum("ni,ni->n", points - taken[:, :3, 3], taken[:, :3, 2])
        rays = np.concatenate([patches.arms, np.ones((len(row), 4, 1))], axis=2)
        ends = (depth[:, None, None] * rays) @ taken[:, :3, :3].transpose(0, 2, 1) + taken[:, None, :3, 3]
        seen = (ends - world_T_camera[:3, 3]) @ world_T_camera[:3, :3]
        valid = (row >= 0) & (depth > _MIN_DEPTH) & (seen[..., 2] > _MIN_DEPTH).all(axis=1)
        seen = np.where(valid[:, None, None], seen, 1.0)
        uv = seen[..., :2] / seen[..., 2:] * (self._K[0, 0], self._K[1, 1]) + self._K[:2, 2]
        uv = distort(self._camera, uv.reshape(-1, 2)).reshape(-1, 4, 2)
        warp = np.stack([uv[:, 0] - uv[:, 1], uv[:, 2] - uv[:, 3]], axis=2) / (2.0 * _STEP_PX)
        valid &= np.isfinite(warp).all(axis=(1, 2))
        return np.where(valid[:, None, None], warp, np.eye(2)), valid


def _texture(view: GrayImage | Float32Array, uv_px: FloatArray) -> tuple[Float32Array, Float32Array]:
    """Return the patches (n, P) around pixels (n, 2) without their mean, and their gradients (n, 2, P)
    orthogonal to the patches and to a constant."""
    n, side = len(uv_px), 2 * _HALF + 3
    window = _sampled(view.astype(np.float32, copy=False), uv_px, *_offsets(_HALF + 1)).reshape(n, side, side)
    texture = window[:, 1:-1, 1:-1].reshape(n, len(_X))
    texture = texture - texture.mean(axis=1, keepdims=True)
    by_u = window[:, 1:-1, 2:] - window[:, 1:-1, :-2]
    by_v = window[:, 2:, 1:-1] - window[:, :-2, 1:-1]
    gradient = 0.5 * np.stack([by_u, by_v], axis=1).reshape(n, 2, len(_X))
    gradient = gradient - gradient.mean(axis=2, keepdims=True)
    by_gain = np.einsum("nip,np->ni", gradient, texture) / _power(texture)[:, None]
    return texture, gradient - by_gain[:, :, None] * texture[:, None]


def _power(texture: Float32Array) -> Float32Array:
    power: Float32Array = np.maximum(np.sum(texture**2, axis=1), np.float32(_MIN_POWER))
    return power


def _sampled(image: Float32Array, uv_px: FloatArray, x: Float32Array, y: Float32Array) -> Float32Array:
    """Return the image (n, P) at offsets x and y, (P,) or (n, P), from pixels (n, 2), bilinear."""
    u, v = uv_px[:, :1].astype(np.float32) + x, uv_px[:, 1:].astype(np.float32) + y
    if len(u) == 0:  # OpenCV refuses it
        return u
    return np.asarray(cv2.remap(image, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)


def _aligned(
    patches: Patches, image: Float32Array, start_uv_px: FloatArray, warp: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the pixels (n, 2) at which patches agree best with an image, and their correlations (n,).

    The shift of a patch is ``H^-1 sum_p G(p) I(x + W p) / gain``, where the gradient G is orthogonal to what
    gain and offset change, so that they need no unknowns.
    """
    if len(patches.ids) == 0:
        return start_uv_px, np.zeros(0)
    a = warp.astype(np.float32)
    x, y = (a[:, i, :1] * _X + a[:, i, 1:] * _Y for i in range(2))
    power = _power(patches.texture)
    shift = np.zeros((len(a), 2), np.float32)
    uv = start_uv_px
    for _ in range(_ITERATIONS):
        seen = _sampled(image, uv, x, y)
        gain = np.maximum(np.einsum("np,np->n", seen, patches.texture) / power, _MIN_GAIN)
        slope = np.einsum("nip,np->ni", patches.gradient, seen) / gain[:, None]
        shift -= np.einsum("nij,nj->ni", patches.inverse, slope)
        uv = start_uv_px + np.einsum("nij,nj->ni", a, shift)
    seen = _sampled(image, uv, x, y)
    seen = seen - seen.mean(axis=1, keepdims=True)
    product = np.einsum("np,np->n", seen, patches.texture)
    correlation = product / np.sqrt(power * _power(seen))
    return uv, correlation.astype(np.float64)
