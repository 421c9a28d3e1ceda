"""Drift of a video that is posed without GPS, and the least time that it can take."""

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from scripts.common.stopwatch import Elapsed, stopwatch
from vgps.config import TrackingConfig
from vgps.evaluation.alignment import align
from vgps.geometry import travelled
from vgps.model import FloatArray, IntArray, Video
from vgps.tracking.corners import new_corners
from vgps.tracking.matching import pyramidal_flow

_PIECE_M = 10.0  # of the true path, over which a scale is taken
_START_M = 20.0  # of the true path, which gives a run without a metre its scale
_DRIFT_M = 100.0


@dataclass(frozen=True, kw_only=True)
class Drift:
    """Errors of a path posed by its video alone; NaN where the path is too short to have one.

    Attributes:
        sim3_m, se3_m: Root mean square errors of the camera's centre after a similarity, and after a rigid
            motion once the scale is the run's own.
        scale: Run over truth, by the similarity.
        scale_drift: Change of log scale per 100 m: root mean square over all pieces of that length, or of
            half the path if it is shorter than twice that.
        rotation_drift_deg: Likewise of the angle between the run's rotation and the true one.
        pieces: Scale along the path.
    """

    sim3_m: float
    se3_m: float
    scale: float
    scale_drift: float
    rotation_drift_deg: float
    pieces: "Pieces"


class Pieces(NamedTuple):
    """Frames (n + 1,) at the ends of the pieces, and scales (n,), run over truth."""

    ends: IntArray
    scale: FloatArray


def scale_of_pieces(centres: FloatArray, true: FloatArray) -> Pieces:
    """Return the scale of centres (N, 3) by pieces of 10 m of the true path (N, 3)."""
    length = travelled(true)
    ends = np.unique(np.searchsorted(length, np.arange(0.0, length[-1], _PIECE_M)))
    chord, true_chord = (np.linalg.norm(np.diff(x[ends], axis=0), axis=1) for x in (centres, true))
    return Pieces(ends, chord / np.maximum(true_chord, 1e-9))


def drift_of(poses: FloatArray, true: FloatArray, *, is_metric: bool) -> Drift:
    """Return the drift of poses (N, 4, 4) against the true ones.

    Args:
        poses, true: Of the same frames.
        is_metric: Whether the run has a scale of its own; otherwise the first 20 m of the truth give it.
    """
    centres, true_centres = poses[:, :3, 3], true[:, :3, 3]
    pieces, length = scale_of_pieces(centres, true_centres), travelled(true_centres)
    similar = align(centres, true_centres, with_scale=True)
    start = length <= _START_M
    own = 1.0 if is_metric else travelled(centres)[start][-1] / length[start][-1]
    rigid = align(centres / own, true_centres, with_scale=False)
    scale_drift, rotation_drift = _drifts(poses, true, pieces, length)
    return Drift(
        sim3_m=_rmse(similar),
        se3_m=_rmse(rigid),
        scale=1.0 / similar[0] if similar else float("nan"),
        scale_drift=scale_drift,
        rotation_drift_deg=rotation_drift,
        pieces=pieces,
    )


def _rmse(aligned: tuple[float, FloatArray] | None) -> float:
    return float(np.sqrt(np.mean(np.sum(aligned[1] ** 2, axis=1)))) if aligned else float("nan")


def _drifts(poses: FloatArray, true: FloatArray, pieces: Pieces, length: FloatArray) -> tuple[float, float]:
    """Return the changes of log scale and rotation [deg] per 100 m."""
    apart = int(min(_DRIFT_M, 0.5 * length[-1]) / _PIECE_M)
    if apart < 1 or len(pieces.scale) <= apart:
        return float("nan"), float("nan")
    log_scale = np.log(pieces.scale)
    change = log_scale[apart:] - log_scale[:-apart]
    at = pieces.ends
    error = Rotation.from_matrix(poses[at, :3, :3] @ true[at, :3, :3].transpose(0, 2, 1))
    angle = (error[apart:] * error[:-apart].inv()).magnitude()
    per_100_m = _DRIFT_M / (apart * _PIECE_M)
    return (
        per_100_m * float(np.sqrt(np.mean(change**2))),
        per_100_m * float(np.degrees(np.sqrt(np.mean(angle**2)))),
    )


def least_time(video: Video, config: TrackingConfig) -> Elapsed:
    """Measure decoding a video and one forward pass of Lucas-Kanade from every frame to the next.

    The corners, as many as vgps follows, are found before: their time does not count.
    """
    rng, nothing = np.random.default_rng(0), np.zeros((0, 2))
    corners = [new_corners(one.gray, nothing, config.max_features, config, rng) for one in video.frames()]
    with stopwatch() as elapsed:
        for (before, frame), uv_px in zip(pairwise(video.frames()), corners, strict=False):
            if len(uv_px):
                start, images = uv_px.astype(np.float32)[:, None], (before.gray, frame.gray)
                pyramidal_flow(images, start, start, config.window_px, config.pyramid_levels)
    return elapsed
