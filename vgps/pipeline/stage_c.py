"""Stage C, Kume 2010: time offset, outliers and drift from the fixes so far, then the newest window."""

from dataclasses import replace

import numpy as np

from vgps.errors import GeometryError
from vgps.gps.fix_buffer import FixBuffer
from vgps.gps.sensors import Sensors
from vgps.mapping.local_map import LocalMap
from vgps.mapping.trajectory import map_trajectory, odometry_trajectory
from vgps.model import Camera
from vgps.pipeline.live_calibration import LiveCalibration
from vgps.runtime.timing import StageTimer
from vgps.smoothing.alignment.drift_correction import correct_drift, restore_odometry
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.stage_c.incremental_window import IncrementalWindow
from vgps.smoothing.stage_c.window import contradicts, optimise_window


class StageC:
    """Stage C: correction of time offset, outliers and drift, and optimisation of the newest window.

    Args:
        context: Camera, control points and settings.
        timer: Timer of the parts.

    Attributes:
        used_until_s: Time of the newest frame that was optimised.
    """

    def __init__(self, context: SmoothingContext, timer: StageTimer) -> None:
        self._context, self._timer = context, timer
        self._isam2 = IncrementalWindow(context) if context.config.window.solver == "isam2" else None
        self._calibration = LiveCalibration(context) if context.calibrates else None
        self.used_until_s = -np.inf

    @property
    def camera(self) -> Camera:
        """The camera of the maps that it optimised last."""
        return self._context.camera

    @property
    def failures(self) -> int:
        """Number of windows that iSAM2 could not solve."""
        return 0 if self._isam2 is None else self._isam2.failures

    def calibrate(self, local_map: LocalMap, fix_buffer: FixBuffer, camera: Camera) -> None:
        """Take over a refined camera that is due, from the next window on, and begin to refine it again.

        ``camera`` is that of the map.
        """
        if self._calibration is not None:
            self._calibration.update(local_map, camera, fix_buffer.sensors)

    def run(
        self, local_map: LocalMap, fix_buffer: FixBuffer, camera: Camera, suffix: str = ""
    ) -> tuple[str, ...]:
        """Correct drift if fixes contradict the frames that the window will hold, then optimise the window.

        Without the correction the path would be discontinuous where the window begins, and remain so.

        Args:
            local_map: Snapshot of the map; updated in place.
            fix_buffer: Snapshot of the fixes; updated in place.
            camera: Of the map: not the refined one if the window before failed.
            suffix: Suffix of the timer's stages.

        Returns:
            Warnings.

        Raises:
            GeometryError, RuntimeError, LinAlgError: The map cannot be optimised from its present state.
        """
        until_s = float(local_map.t_s[-1])
        notes = self._use_calibration(local_map, camera, fix_buffer.sensors)
        with self._timer.measure("drift" + suffix):
            corrected = local_map.aligned and self._correct(local_map, fix_buffer, until_s)
        with self._timer.measure("window" + suffix):
            fixes, antenna = fix_buffer.usable(until_s), fix_buffer.sensors.prior_antenna
            tolerance = self._context.config.window.corrected_tolerance if corrected else 1.0
            if self._isam2 is not None:
                result = self._isam2.optimise(local_map, fixes, antenna, tolerance)
            else:
                result = optimise_window(local_map, fixes, antenna, self._context, tolerance)
            local_map.apply(result.update)
        self.used_until_s = until_s
        if result.converged:
            return notes
        stuck = f"stage C found no step that lowers the cost at {until_s:.2f} s: the window is unchanged"
        return (*notes, stuck)

    def _use_calibration(self, local_map: LocalMap, camera: Camera, sensors: Sensors) -> tuple[str, ...]:
        """Let a map follow the refined camera, if it is not the map's, and return what was refined."""
        calibration = self._calibration
        notes: tuple[str, ...] = ()
        if calibration is not None and calibration.camera is not camera:
            try:
                local_map.apply(calibration.resolved(local_map, camera, sensors))
                camera, notes = calibration.camera, calibration.warnings
            except (GeometryError, RuntimeError, np.linalg.LinAlgError):
                calibration.camera = camera
        if camera is not self.camera:
            self._context = replace(self._context, camera=camera)
            if self._isam2 is not None:
                self._isam2 = IncrementalWindow(self._context)
        return notes

    def _correct(self, local_map: LocalMap, fix_buffer: FixBuffer, until_s: float) -> bool:
        """Update time offset and outliers, correct the map's drift if fixes contradict it, and return whether
        that was so."""
        config, antenna = self._context.config, fix_buffer.sensors.prior_antenna
        since_s = until_s - config.drift.horizon_s

        def contradicted() -> bool:
            return contradicts(local_map, fix_buffer.usable(until_s), antenna, config)

        fix_buffer.update_time_offset(odometry_trajectory(local_map, since_s))
        if not contradicted():
            return False
        rejected_s = fix_buffer.detect_outliers(map_trajectory(local_map, since_s), self.used_until_s)
        if rejected_s < until_s:
            local_map.apply(restore_odometry(local_map, rejected_s - config.window.bend_s))
        if not contradicted():
            return False
        local_map.apply(correct_drift(local_map, fix_buffer.usable(until_s), antenna, config, since_s))
        return True
