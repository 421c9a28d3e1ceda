"""Textures filtered for distance and slant."""

import math

import cv2
import numpy as np
import numpy.typing as npt

from vgps.model import FloatArray
from vgps.simulate.textures import Image

_Float = npt.NDArray[np.float32]

_LAID_TEXELS = 1024
_SHARPNESS = 0.7  # texels per sample, relative to pixels: samples are half a pixel apart
_HORIZON = 1e-12  # inverse depth in the place of zero: the coarsest level


class Ripmap:
    """A texture with width and height halved independently; each size is made on first use.

    A texture that does not repeat has a transparent rim of one texel, so that its edges are in the right
    place. Small sizes of a repeating texture are tiled, since filtering across the border is slow.
    """

    def __init__(self, image: Image, repeats: bool) -> None:
        self.height, self.width = image.shape[:2]
        self.repeats = repeats
        self._image = image
        self._levels: dict[tuple[int, int], Image] = {}

    def warped(self, H: FloatArray, size: tuple[int, int], u: float, v: float) -> Image:
        """Return an image of (width, height), filtered as its pixel (u, v) requires.

        ``H`` maps its pixels (u, v, 1) to texture coordinates (a, b, 1), up to scale.
        """
        a, b, density = self.density(H, u, v)
        level, to_level, laid = self.level(*density)
        if self.repeats:  # by whole repetitions to the middle of the tiling
            columns, rows = laid[0] // 2 - math.floor(a), laid[1] // 2 - math.floor(b)
            to_level = to_level @ np.array([[1, 0, columns], [0, 1, rows], [0, 0, 1]])
        border = cv2.BORDER_WRAP if self.repeats else cv2.BORDER_CONSTANT
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(
            cv2.warpPerspective(level, to_level @ H, size, flags=flags, borderMode=border), np.uint8
        )

    def looked_up(self, a: _Float, b: _Float, density: tuple[float, float]) -> Image:
        """Return the texture at coordinates (H, W), filtered for texels per pixel along both axes."""
        level, to_level, laid = self.level(*density)
        if self.repeats:  # in the middle of the tiling
            a, b = a - np.floor(a) + laid[0] // 2, b - np.floor(b) + laid[1] // 2
        (w, _, x0), (_, h, y0), _ = to_level.tolist()
        border = cv2.BORDER_WRAP if self.repeats else cv2.BORDER_CONSTANT
        x, y = (c * np.float32(size) + np.float32(rim) for c, size, rim in ((a, w, x0), (b, h, y0)))
        return np.asarray(cv2.remap(level, x, y, cv2.INTER_LINEAR, borderMode=border), np.uint8)

    def level(
        self, texels_per_px_u: float, texels_per_px_v: float
    ) -> tuple[Image, FloatArray, tuple[int, int]]:
        """Return the level for a density, the (3, 3) map from texture to texels, and the numbers of tiles."""
        key = (_octave(texels_per_px_u, self.width), _octave(texels_per_px_v, self.height))
        w, h = max(1, self.width >> key[0]), max(1, self.height >> key[1])
        laid = (max(1, _LAID_TEXELS // w), max(1, _LAID_TEXELS // h)) if self.repeats else (1, 1)
        if key not in self._levels:
            small = np.asarray(cv2.resize(self._image, (w, h), interpolation=cv2.INTER_AREA), np.uint8)
            self._levels[key] = np.tile(small, (laid[1], laid[0], 1)) if self.repeats else _rimmed(small)
        rim = -0.5 if self.repeats else 0.5
        return self._levels[key], np.array([[w, 0, rim], [0, h, rim], [0, 0, 1.0]]), laid

    def density(self, H: FloatArray, u: float, v: float) -> tuple[float, float, tuple[float, float]]:
        """Return texture coordinates at a pixel, and texels per pixel along both texture axes."""
        (a0, a1, a2), (b0, b1, b2), (c0, c1, c2) = H.tolist()
        c = c0 * u + c1 * v + c2 or _HORIZON
        a, b = (a0 * u + a1 * v + a2) / c, (b0 * u + b1 * v + b2) / c
        along_u = math.hypot(a0 - a * c0, a1 - a * c1) / abs(c)
        along_v = math.hypot(b0 - b * c0, b1 - b * c1) / abs(c)
        return a, b, (along_u * self.width, along_v * self.height)


def _rimmed(image: Image) -> Image:
    image = np.asarray(cv2.copyMakeBorder(image, 1, 1, 1, 1, cv2.BORDER_REPLICATE), np.uint8)
    image[[0, -1], :, 3] = 0
    image[:, [0, -1], 3] = 0
    return image


def _octave(texels_per_px: float, size: int) -> int:
    """Return how often to halve a size for about one texel per sample, with at least four texels left."""
    return min(max(0, round(math.log2(max(texels_per_px * _SHARPNESS, 1e-9)))), max(0, size.bit_length() - 3))
