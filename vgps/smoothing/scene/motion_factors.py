"""Factors of frames that nothing else ties to their neighbours: standing still, or constant velocity."""

from collections.abc import Sequence

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from factors import constant_velocity_factor
from vgps.config import MotionConfig
from vgps.model import BoolArray, IntArray
from vgps.smoothing.scene.scene import Scene

_SHORT_GAP_S = 0.3  # in which an acceleration of 3 m/s^2 makes 0.03 m
_SHORT_PIECE_S = 1.0  # between tears: a receiver of one fix a second gives a shorter one no scale


def motion_factors(
    scene: Scene,
    unseen: BoolArray,
    torn: BoolArray,
    config: MotionConfig,
    speed_scale: float = 1.0,
    carried: BoolArray | None = None,
) -> gtsam.NonlinearFactorGraph:
    """Return zero-motion factors of standing frames, and constant velocity over what is unseen or torn.

    Over a gap, where the path is torn, and beyond its ends, the velocity is that of the frames beside it. A
    short gap that tracks cross takes none from them and gives them none: a video converted to more frames a
    second shows pictures up to a frame late, by which the velocity between two may be wrong by half.

    Args:
        scene: Frames, with zero-motion constraints.
        unseen: (F,) frames that nothing else holds.
        torn: (F - 1,) places between successive frames that nothing else ties, as between two maps.
        config: Densities of the motion noise.
        speed_scale: Map units per metre, for a map that has no scale yet.
        carried: (F,) frames beside tears that an IMU ties instead; None without one.
    """
    graph = gtsam.NonlinearFactorGraph()
    for constraint in scene.zero_motions:
        noise = gtsam.noiseModel.Diagonal.Sigmas(constraint.sigma)
        relative = gtsam.Pose3(constraint.reference_T_frame)
        reference, frame = X(constraint.reference), X(constraint.frame)
        graph.push_back(gtsam.BetweenFactorPose3(reference, frame, relative, noise))
    for middle in _middles_over(scene, unseen, torn, carried):
        a, b, c = middle - 1, middle, middle + 1
        graph.push_back(
            constant_velocity_factor(
                (X(a), X(b), X(c)),
                (float(scene.t_s[b] - scene.t_s[a]), float(scene.t_s[c] - scene.t_s[b])),
                config.rotation_density,
                config.translation_density * speed_scale,
            )
        )
    return graph


def _middles_over(
    scene: Scene, unseen: BoolArray, torn: BoolArray, carried: BoolArray | None
) -> Sequence[int]:
    """Return the middle frames of triples at constant velocity: unseen ones, and those beside most gaps."""
    steps = np.diff(np.concatenate([[False], unseen, [False]]).astype(int))
    before, after = np.flatnonzero(steps == 1) - 1, np.flatnonzero(steps == -1)  # the frames beside each gap
    last = len(scene.t_s) - 1
    inside = (before >= 0) & (after <= last)
    short = np.zeros(len(before), dtype=bool)
    short[inside] = scene.t_s[after[inside]] - scene.t_s[before[inside]] <= _SHORT_GAP_S
    beside = np.concatenate([before[~short], after[~short]])
    tied = _of_short_pieces(scene, torn)
    if carried is not None:
        tied = tied[~carried[tied]]
    middles = np.unique(np.concatenate([np.flatnonzero(unseen), beside, tied]))
    return [int(middle) for middle in middles if 1 <= middle < last]


def _of_short_pieces(scene: Scene, torn: BoolArray) -> IntArray:
    """Return the frames on both sides of each tear, and all of a short piece between two, which hardly has a
    scale: some steps of such pieces, of dark pictures, were kilometres long."""
    tears = np.flatnonzero(torn)
    if not len(tears):
        return tears
    begin, end = np.append(0, tears + 1), np.append(tears, len(scene.t_s) - 1)
    short = scene.t_s[end] - scene.t_s[begin] < _SHORT_PIECE_S
    within = [np.arange(a, b + 1) for a, b in zip(begin[short], end[short], strict=True)]
    return np.concatenate([tears, tears + 1, *within])
