"""Stage C, Kume 2010: time offset, outliers and drift by the fixes so far, then the newest window."""

import numpy as np

from vgps.gps.fix_buffer import FixBuffer
from vgps.mapping.local_map import LocalMap
from vgps.mapping.trajectory import map_trajectory, odometry_trajectory
from vgps.runtime.timing import StageTimer
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.drift_correction import correct_drift, undo_bending
from vgps.smoothing.window import contradicts, optimise_window

_BENT_TOLERANCE = 5.0  # a bent path suits no long track well: without these the window would tear off
_TEAR_S = 1.0  # before a wrong fix the path begins to bend to it


class StageC:
    """Stage C of one map after the other.

    Args:
        context: Camera, control points and settings.
        timer: Counts the seconds of its parts.
    """

    def __init__(self, context: SmoothingContext, timer: StageTimer) -> None:
        self._context, self._timer = context, timer
        self._used_until_s = -np.inf

    def run(self, local_map: LocalMap, fix_buffer: FixBuffer, beside: str = "") -> tuple[str, ...]:
        """Optimise the newest window of a map; first take out drift where fixes contradict what will be held.

        Otherwise the window would tear to reach the fixes, and the tear would stay.

        Args:
            local_map: A snapshot of its own, which is updated.
            fix_buffer: A snapshot of its own, which is updated.
            beside: Ends the names under which its seconds are counted.

        Returns:
            Warnings.

        Raises:
            GeometryError, RuntimeError, LinAlgError: The map is so far off that it cannot be optimised.
        """
        until_s = float(local_map.t_s[-1])
        with self._timer.measure("drift" + beside):
            bent = local_map.aligned and self._correct(local_map, fix_buffer, until_s)
        with self._timer.measure("window" + beside):
            fixes, antenna = fix_buffer.believed(until_s), fix_buffer.sensors.prior_antenna
            tolerance = _BENT_TOLERANCE if bent else 1.0
            result = optimise_window(local_map, fixes, antenna, self._context, tolerance)
            local_map.apply(result.update)
        self._used_until_s = until_s
        if result.converged:
            return ()
        return (f"stage C found no better poses at {until_s:.2f} s, from a start that is no minimum",)

    def _correct(self, local_map: LocalMap, fix_buffer: FixBuffer, until_s: float) -> bool:
        """Update time offset and outliers, and bend the map where fixes contradict it; return whether it
        was."""
        config, antenna = self._context.config, fix_buffer.sensors.prior_antenna
        since_s = until_s - config.drift.horizon_s

        def contradicted() -> bool:
            return contradicts(local_map, fix_buffer.believed(until_s), antenna, config)

        fix_buffer.update_time_offset(odometry_trajectory(local_map, since_s))
        if not contradicted():
            return False
        torn_s = fix_buffer.detect_outliers(map_trajectory(local_map, since_s), self._used_until_s)
        if torn_s < until_s:
            local_map.apply(undo_bending(local_map, torn_s - _TEAR_S))
        if not contradicted():
            return False
        local_map.apply(correct_drift(local_map, fix_buffer.believed(until_s), antenna, config, since_s))
        return True
