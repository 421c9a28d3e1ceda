"""Factors that a camera is level, for rotations that no other factor determines."""

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from factors import level_factor
from vgps.config import StartConfig
from vgps.model import IntArray
from vgps.smoothing.scene.ground import Ground

_FRAMES = 20  # that share the prior of a level camera; their number does not change its total weight


def level_priors(
    frames: IntArray, config: StartConfig, ground: Ground | None = None
) -> gtsam.NonlinearFactorGraph:
    """Return the prior of a level camera: of its pitch alone where the ground shows the roll.

    Of a camera that flies the ground stands in for the prior of the pitch.

    Args:
        frames: Numbers of the frames.
        config: Standard deviations of roll and pitch.
        ground: The ground under the path.
    """
    graph = gtsam.NonlinearFactorGraph()
    axes, sigmas = config.upright.T[[0, 2]], np.radians(config.tilt_sigmas_deg)
    if ground is not None:
        # roads show the roll of what travels on them; a drone's camera keeps its roll, but not its pitch
        kept = slice(0, 1) if config.flies else slice(1, 2)
        axes, sigmas = axes[kept], sigmas[kept]
        for frame, axis, sigma in zip(*vars(ground).values(), strict=True):
            graph.push_back(level_factor(X(int(frame)), axis[None], [sigma]))
    rows = np.unique(np.linspace(0, len(frames) - 1, _FRAMES).astype(int))
    for frame in frames[rows].tolist():
        graph.push_back(level_factor(X(frame), axes, (sigmas * np.sqrt(len(rows))).tolist()))
    return graph
