"""Do the fixes contradict the lever arm that a rig gives? A wrong one shifts the path silently."""

from dataclasses import replace

import numpy as np

from vgps.errors import GeometryError
from vgps.gps.sensors import ANTENNA
from vgps.smoothing.stage_d.batch_problem import BatchInput
from vgps.smoothing.stage_d.sensor_steps import least_cost_step
from vgps.solver.problem import BundleProblem

_PRIOR_M = 10.0  # says nothing
# Squared sigmas of the three coordinates together. Right lever arms reach 19 on pieces of kitti03 and kitti07
# with any receiver, since the path's errors are not independent; ones that are 1 m wrong reach 5 to 80.
_CONTRADICTION = 25.0
_DIRECTIONS = (("left", "right"), ("up", "down"), ("back", "forward"))


def lever_arm_warnings(given: BatchInput, end: BundleProblem) -> tuple[str, ...]:
    """Return a warning if the fixes fit another lever arm much better than the one that is held.

    Args:
        given: Input of the last problem of stage D.
        end: That problem at its minimum.
    """
    if given.sensors.antenna_sigma_m or not len(given.fixes):
        return ()
    try:
        sensors = replace(given.sensors, antenna_sigma_m=_PRIOR_M)
        step, covariance = least_cost_step(given, end, sensors, ANTENNA)
    except (GeometryError, np.linalg.LinAlgError):  # said with the standard deviations of the poses
        return ()
    if step @ np.linalg.solve(covariance, step) < _CONTRADICTION:
        return ()
    ratio = np.abs(step) / np.sqrt(np.diagonal(covariance))
    shown = [
        f"{abs(step[k]):.2f} m {_DIRECTIONS[k][int(step[k] > 0)]}"
        for k in np.flatnonzero(ratio >= min(2.0, ratio.max())).tolist()
    ]
    return (
        f"the fixes fit better an antenna at least {' and '.join(shown)} of where the lever arm has it, and "
        "the path is off by as much: check camera_p_antenna in rig.yaml",
    )
