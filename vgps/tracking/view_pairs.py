"""Pairs of views of a video with the pixels of the features that both show, found without a calibration."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from vgps.config import CameraCalibrationConfig, TrackingConfig
from vgps.model import FloatArray, Frame, GrayImage, IntArray
from vgps.tracking.corners import new_corners
from vgps.tracking.matching import Matcher, make_matcher


@dataclass(frozen=True)
class ViewPairs:
    """The pixels of features in P pairs of views.

    Attributes:
        first_px, second_px: (N, 2) in the distorted images of either view.
        pair: (N,) the pair of each feature, ascending.
        count: Number of pairs.
    """

    first_px: FloatArray
    second_px: FloatArray
    pair: IntArray
    count: int

    def thinned(self, most: int) -> "ViewPairs":
        """Return the pairs with about so many features each, evenly taken, or fewer."""
        first = np.searchsorted(self.pair, self.pair)
        step = np.bincount(self.pair, minlength=self.count)[self.pair] // most
        kept = (np.arange(len(self.pair)) - first) % np.maximum(step, 1) == 0
        return ViewPairs(self.first_px[kept], self.second_px[kept], self.pair[kept], self.count)


def view_pairs(
    frames: Iterable[Frame],
    size: tuple[int, int],
    tracking: TrackingConfig,
    config: CameraCalibrationConfig,
    rng: np.random.Generator,
) -> ViewPairs:
    """Follow corners until the image has moved far enough, then begin anew; return the pairs so found.

    Args:
        frames: The video, or a piece of it.
        size: Width and height of the images, pixels.
        tracking: Settings of the matcher.
        config: How far the image moves from one view to the other, and how many pairs are enough.
        rng: Source of the choice of corners.
    """
    far_px, matcher = config.pair_flow_share * float(np.hypot(*size)), make_matcher(tracking)
    found: list[tuple[FloatArray, FloatArray]] = []
    previous: GrayImage | None = None
    start = here = np.zeros((0, 2))
    for frame in frames:
        if previous is not None:
            start, here = _followed(matcher, (previous, frame.gray), start, here)
        enough = len(here) >= config.min_pair_features
        flow_px = float(np.median(np.linalg.norm(here - start, axis=1))) if enough else 0.0
        if enough and flow_px > far_px:
            found.append((start, here))
        if not enough or flow_px > far_px:
            start = here = new_corners(frame.gray, np.zeros((0, 2)), tracking.max_features, tracking, rng)
        previous = frame.gray
    return _joined(found, config.max_pairs)


def _followed(
    matcher: Matcher, images: tuple[GrayImage, GrayImage], start: FloatArray, here: FloatArray
) -> tuple[FloatArray, FloatArray]:
    match = matcher.match(*images, here, here)
    return start[match.found], match.uv_px[match.found]


def _joined(found: list[tuple[FloatArray, FloatArray]], most: int) -> ViewPairs:
    """Return at most so many of the pairs, evenly spread."""
    kept = np.unique(np.linspace(0, len(found) - 1, min(len(found), most)).astype(int)).tolist()
    chosen = [found[k] for k in kept]
    empty = np.zeros((0, 2))
    return ViewPairs(
        np.concatenate([empty, *(pair[0] for pair in chosen)]),
        np.concatenate([empty, *(pair[1] for pair in chosen)]),
        np.repeat(np.arange(len(chosen)), [len(pair[0]) for pair in chosen]).astype(np.int64),
        len(chosen),
    )
