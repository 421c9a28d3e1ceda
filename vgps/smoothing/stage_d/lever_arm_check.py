"""Do the fixes contradict the lever arm that is given or assumed? A wrong one shifts the path silently."""

from dataclasses import replace

import numpy as np

from vgps.errors import GeometryError
from vgps.gps.sensors import ANTENNA, Sensors
from vgps.model import FloatArray
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
    if given.sensors.antenna_sigma_m or (found := _contradiction(given, end)) is None:
        return ()
    step, covariance = found
    ratio = np.abs(step) / np.sqrt(np.diagonal(covariance))
    shown = [
        f"{abs(step[k]):.2f} m {_DIRECTIONS[k][int(step[k] > 0)]}"
        for k in np.flatnonzero(ratio >= min(2.0, ratio.max())).tolist()
    ]
    return (
        f"the fixes fit better an antenna at least {' and '.join(shown)} of where the lever arm has it, and "
        "the path is off by as much: check camera_p_antenna in rig.yaml",
    )


def with_possible_antenna(sensors: Sensors, given: BatchInput, end: BundleProblem) -> Sensors:
    """Return the sensors with the prior of a separate antenna if the fixes contradict one at the camera.

    Args:
        sensors: Their lever arm may be an assumption.
        given: Input of a problem with these.
        end: That problem at its minimum.
    """
    if not sensors.separate_antenna_sigma_m or _contradiction(given, end) is None:
        return sensors
    return sensors.with_separate_antenna()


def _contradiction(given: BatchInput, end: BundleProblem) -> tuple[FloatArray, FloatArray] | None:
    """Return the step from the prior lever arm to the one that fits best, and its covariance; None if the
    prior may be right."""
    sensors = given.sensors
    if not len(given.fixes):
        return None
    try:
        step, covariance = least_cost_step(given, end, replace(sensors, antenna_sigma_m=_PRIOR_M), ANTENNA)
    except (GeometryError, np.linalg.LinAlgError):  # said with the standard deviations of the poses
        return None
    step = step + end.shared.get(ANTENNA, sensors.prior_antenna) - sensors.prior_antenna
    spread = covariance + sensors.antenna_sigma_m**2 * np.eye(3)
    return (step, covariance) if step @ np.linalg.solve(spread, step) >= _CONTRADICTION else None
