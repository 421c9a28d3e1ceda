"""Factors of frames without observations: standing still, or constant velocity."""

from collections.abc import Sequence

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from factors import constant_velocity_factor
from vgps.config import MotionConfig
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import BoolArray, FloatArray

_SHORT_GAP_S = 0.3  # in which an acceleration of 3 m/s^2 makes 0.03 m


def motion_factors(
    t_s: FloatArray,
    unseen: BoolArray,
    zero_motions: Sequence[ZeroMotion],
    config: MotionConfig,
    speed_scale: float = 1.0,
) -> gtsam.NonlinearFactorGraph:
    """Return zero-motion factors of standing frames, and constant velocity over unseen ones.

    Over a longer gap, and beyond the ends of the path, the velocity is that of the frames beside it. A short
    gap takes none from them and gives them none: a video converted to more frames a second shows pictures up
    to a frame late, by which the velocity between two of its pictures may be wrong by half.

    Args:
        t_s: (F,) times of the frames.
        unseen: (F,) frames that nothing else holds.
        zero_motions: Zero-motion constraints.
        config: Densities of the motion noise.
        speed_scale: Map units per metre, for a map that has no scale yet.
    """
    graph = gtsam.NonlinearFactorGraph()
    for constraint in zero_motions:
        noise = gtsam.noiseModel.Diagonal.Sigmas(constraint.sigma)
        relative = gtsam.Pose3(constraint.reference_T_frame)
        reference, frame = X(constraint.reference), X(constraint.frame)
        graph.push_back(gtsam.BetweenFactorPose3(reference, frame, relative, noise))
    for middle in _middles_over(unseen, t_s):
        a, b, c = middle - 1, middle, middle + 1
        graph.push_back(
            constant_velocity_factor(
                (X(a), X(b), X(c)),
                (float(t_s[b] - t_s[a]), float(t_s[c] - t_s[b])),
                config.rotation_density,
                config.translation_density * speed_scale,
            )
        )
    return graph


def _middles_over(unseen: BoolArray, t_s: FloatArray) -> Sequence[int]:
    """Return the middle frames of triples at constant velocity: unseen ones, and those beside longer gaps."""
    steps = np.diff(np.concatenate([[False], unseen, [False]]).astype(int))
    before, after = np.flatnonzero(steps == 1) - 1, np.flatnonzero(steps == -1)  # the frames beside each gap
    last = len(t_s) - 1
    open_ended = (before < 0) | (after > last)
    longer = open_ended | (t_s[np.minimum(after, last)] - t_s[np.maximum(before, 0)] > _SHORT_GAP_S)
    middles = np.unique(np.concatenate([np.flatnonzero(unseen), before[longer], after[longer]]))
    return [int(middle) for middle in middles if 1 <= middle < last]
