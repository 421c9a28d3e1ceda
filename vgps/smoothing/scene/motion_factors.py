"""Factors of frames without observations: standing still, or constant velocity."""

from collections.abc import Sequence

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from factors import constant_velocity_factor
from vgps.config import MotionConfig
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import BoolArray, FloatArray, IntArray


def motion_factors(
    t_s: FloatArray,
    unseen: BoolArray,
    zero_motions: Sequence[ZeroMotion],
    config: MotionConfig,
    speed_scale: float = 1.0,
) -> gtsam.NonlinearFactorGraph:
    """Return zero-motion factors of standing frames, and constant velocity around unseen ones.

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
    for middle in _middles_around(np.flatnonzero(unseen), len(t_s)):
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


def _middles_around(frames: IntArray, count: int) -> Sequence[int]:
    """Return the middle frames of all triples that contain one of ``frames``."""
    middles = np.unique((frames[:, None] + np.array([-1, 0, 1])).ravel())
    return [int(middle) for middle in middles if 1 <= middle <= count - 2]
