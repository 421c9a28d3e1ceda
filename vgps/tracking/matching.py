"""Match features of one frame in the next: pyramidal Lucas-Kanade, or SSD templates as in the thesis."""

from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np

from vgps.config import TrackingConfig
from vgps.model import BoolArray, Float32Array, FloatArray, GrayImage, IntArray
from vgps.tracking.brightness import equally_bright
from vgps.tracking.corners import harris_maxima

_MAX_CORNERS = 5000  # the strongest; more are noise and cost time


@dataclass(frozen=True)
class Match:
    """Matched pixels ``uv_px`` (N, 2) and whether each feature was ``found`` (N,)."""

    uv_px: FloatArray
    found: BoolArray


class Matcher(Protocol):
    """Interface of a matcher of features ``uv_px`` (N, 2) of the image ``previous`` in ``current``."""

    def match(
        self, previous: GrayImage, current: GrayImage, uv_px: FloatArray, predicted_uv_px: FloatArray
    ) -> Match:
        """Match tentatively (A-2): search widely around ``predicted_uv_px`` (N, 2)."""
        ...


class LucasKanade:
    """Pyramidal Lucas-Kanade with a forward-backward check."""

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config

    def match(
        self, previous: GrayImage, current: GrayImage, uv_px: FloatArray, predicted_uv_px: FloatArray
    ) -> Match:
        """See :class:`Matcher`."""
        previous, current = equally_bright(previous, current)
        match = self._flow(previous, current, uv_px, predicted_uv_px, self._config.first_levels)
        if match.found.sum() >= self._config.first_share * len(uv_px):
            return match
        # the prediction is poor: the whole pyramid takes several times as long
        rows = np.flatnonzero(~match.found)
        again = self._flow(previous, current, uv_px[rows], predicted_uv_px[rows], self._config.pyramid_levels)
        match.uv_px[rows], match.found[rows] = again.uv_px, again.found
        return match

    def _flow(
        self,
        previous: GrayImage,
        current: GrayImage,
        uv_px: FloatArray,
        predicted_uv_px: FloatArray,
        levels: int,
    ) -> Match:
        if len(uv_px) == 0:
            return Match(np.zeros((0, 2)), np.zeros(0, dtype=bool))
        side = self._config.window_px
        start = uv_px.astype(np.float32)[:, None]
        guess = predicted_uv_px.astype(np.float32)[:, None]
        end, ok, error = pyramidal_flow((previous, current), start, guess, side, levels)
        found = ok & (error < self._config.max_match_error) & _inside(end[:, 0], current.shape)
        kept = np.flatnonzero(found)
        if len(kept):
            # backward search from the first position, at full resolution only
            back, ok, _ = pyramidal_flow((current, previous), end[kept], start[kept], side, levels=1)
            distance = np.linalg.norm(back[:, 0] - start[kept, 0], axis=1)
            found[kept] = ok & (distance < self._config.forward_backward_px)
        return Match(end[:, 0].astype(np.float64), found)


def pyramidal_flow(
    images: tuple[GrayImage, GrayImage], start: Float32Array, guess: Float32Array, side: int, levels: int
) -> tuple[Float32Array, BoolArray, Float32Array]:
    """Find points of one image in another, by Lucas and Kanade's method from coarse to fine.

    Args:
        images: Both images.
        start: (n, 1, 2) pixels in the first.
        guess: (n, 1, 2) where to begin in the second.
        side: Width of the window, pixels.
        levels: Levels of the pyramid; 1 for the full resolution only.

    Returns:
        (n, 1, 2) the pixels in the second, and (n,) whether each is found and its mean difference of gray
        values.
    """
    end, ok, error = cv2.calcOpticalFlowPyrLK(
        *images,
        start,
        guess.copy(),
        winSize=(side, side),
        maxLevel=levels - 1,
        criteria=(cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 0.01),
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return np.asarray(end, np.float32), np.asarray(ok[:, 0] == 1), np.asarray(error[:, 0], np.float32)


class SsdTemplates:
    """The thesis's matcher: templates compared with Harris maxima by their sum of squared differences."""

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config

    def match(
        self, previous: GrayImage, current: GrayImage, uv_px: FloatArray, predicted_uv_px: FloatArray
    ) -> Match:
        """See :class:`Matcher`."""
        corners = harris_maxima(current, self._config)[0][:_MAX_CORNERS]
        best_uv, found = predicted_uv_px.copy(), np.zeros(len(uv_px), dtype=bool)
        if len(corners) == 0 or len(uv_px) == 0:
            return Match(best_uv, found)
        near = np.abs(predicted_uv_px[:, None] - corners[None]).max(axis=-1) <= self._config.search_px
        feature, corner = np.nonzero(near)
        if len(feature) == 0:
            return Match(best_uv, found)
        side = self._config.window_px
        templates = patches(previous, uv_px, side)
        ssd = _mean_squared_difference(templates, patches(current, corners, side), feature, corner)
        order = np.lexsort((ssd, feature))
        matched, first = np.unique(feature[order], return_index=True)
        winner = order[first]
        found[matched] = ssd[winner] < self._config.max_match_error**2
        best_uv[matched] = corners[corner[winner]]
        best_uv[matched] += _subpixel(current, templates[matched], best_uv[matched], side)
        return Match(best_uv, found & _inside(best_uv, current.shape))


def patches(gray: GrayImage, uv_px: FloatArray, side: int) -> Float32Array:
    """Return windows (N, side, side) of the image around pixels (N, 2), bilinear, with replicated edges."""
    half = side // 2
    offsets = np.arange(-half, half + 1, dtype=np.float32)
    u = uv_px[:, 0].astype(np.float32)[:, None, None] + offsets[None, None, :]
    v = uv_px[:, 1].astype(np.float32)[:, None, None] + offsets[None, :, None]
    shape = np.broadcast_shapes(u.shape, v.shape)
    # one row of the map per window; OpenCV allows 32767
    columns = np.broadcast_to(u, shape).reshape(shape[0], -1)
    rows = np.broadcast_to(v, shape).reshape(shape[0], -1)
    out = cv2.remap(
        gray,
        np.ascontiguousarray(columns),
        np.ascontiguousarray(rows),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(out.reshape(shape), dtype=np.float32)


def _mean_squared_difference(
    templates: Float32Array, windows: Float32Array, feature: IntArray, corner: IntArray
) -> FloatArray:
    # ||a - b||^2 = ||a||^2 + ||b||^2 - 2 a.b: one matrix product for all pairs
    a = templates.reshape(len(templates), -1).astype(np.float64)
    b = windows.reshape(len(windows), -1).astype(np.float64)
    squared = (a**2).sum(axis=1)[feature] + (b**2).sum(axis=1)[corner]
    return np.asarray((squared - 2.0 * (a @ b.T)[feature, corner]) / a.shape[1])


def _subpixel(gray: GrayImage, templates: Float32Array, uv_px: FloatArray, side: int) -> FloatArray:
    """Return shifts (N, 2) of at most one pixel to the minimum of a parabola through the SSD."""

    def ssd(du: float, dv: float) -> FloatArray:
        difference = patches(gray, uv_px + np.array([du, dv]), side) - templates
        return np.asarray((difference.astype(np.float64) ** 2).mean(axis=(1, 2)))

    centre = ssd(0, 0)
    shift = []
    for du, dv in ((1, 0), (0, 1)):
        before, after = ssd(-du, -dv), ssd(du, dv)
        curvature = before + after - 2 * centre
        shift.append(np.where(curvature > 1e-9, 0.5 * (before - after) / np.maximum(curvature, 1e-9), 0.0))
    return np.asarray(np.clip(np.stack(shift, axis=1), -1.0, 1.0))


def _inside(uv_px: FloatArray | Float32Array, shape: tuple[int, ...], margin_px: float = 2.0) -> BoolArray:
    limit = (shape[1] - 1 - margin_px, shape[0] - 1 - margin_px)
    return np.asarray(np.all((uv_px >= margin_px) & (uv_px <= limit), axis=1))


def make_matcher(config: TrackingConfig) -> Matcher:
    """Return the matcher that the configuration names."""
    return LucasKanade(config) if config.method == "lk" else SsdTemplates(config)
