"""What a fit says of its newest node and of the time offset that it held.

The normal equations are linear in the time offset, but a path is not straight: a walker sways several times a
second, so that the velocity at a fix says nothing about its place a third of a second earlier. So velocities
are means over as much time as the offset is unsure by, and what the path departs from them there counts as
noise (statistical linearisation).
"""

from dataclasses import dataclass, replace

import numpy as np

from vgps.config import SensorsConfig
from vgps.gps.sensors import TimeOffset
from vgps.model import FloatArray
from vgps.online.fusion.block_system import BlockSystem
from vgps.online.fusion.fusion_equations import (
    SCALE,
    TIME_OFFSET,
    FirstNodePrior,
    FusionState,
    normal_equations,
)
from vgps.online.fusion.fusion_nodes import FusionNodes
from vgps.online.fusion.live_time_offset import (
    LiveTimeOffset,
    any_time_offset,
    believed_time_offset,
    with_time_offset_sigma,
)


@dataclass(frozen=True)
class UnknownTimeOffset:
    """A fit with its time offset unknown.

    Attributes:
        system: The normal equations.
        time_offset: What is believed of its rest.
        covariance: (16, 16) of the last node.
    """

    system: BlockSystem
    time_offset: LiveTimeOffset
    covariance: FloatArray


def unknown_time_offset(
    nodes: FusionNodes, state: FusionState, prior: FirstNodePrior, config: SensorsConfig
) -> UnknownTimeOffset:
    """Return a fit with its time offset unknown.

    Args:
        nodes, state, prior: The fit.
        config: Prior of the time offset.
    """
    unsure = nodes.for_sigmas(any_time_offset(config))
    scale = np.exp(state.values[nodes.fixes.node, SCALE])
    bent = normal_equations(replace(unsure, fixes=nodes.fixes.with_bends(scale)), state, prior)
    covariance, preferred = bent.last_covariance(), state.moved(bent.step()).values[-1]
    found = TimeOffset(float(preferred[TIME_OFFSET]), float(covariance[TIME_OFFSET, TIME_OFFSET]) ** 0.5)
    believed = believed_time_offset(found, config)
    covariance = with_time_offset_sigma(covariance, TIME_OFFSET, believed.sigma_s)
    return UnknownTimeOffset(normal_equations(unsure, state, prior), believed, covariance)
