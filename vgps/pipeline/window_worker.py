"""Stage C, synchronously or in a thread while the next frames are tracked."""

from concurrent.futures import Future
from dataclasses import dataclass, replace

import numpy as np

from vgps.gps.fix_buffer import FixBuffer
from vgps.imu.rotation import rotation_sigma_rad
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate
from vgps.model import Camera
from vgps.pipeline.later_frames import PosingLimits
from vgps.pipeline.reconciliation import Reconciliation, reconcile
from vgps.pipeline.stage_c import StageC
from vgps.runtime.threads import begin
from vgps.runtime.timing import CONCURRENT, StageTimer
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.scene.other_calibration import undistorted_again


@dataclass(frozen=True)
class WindowOutcome:
    """Result of stage C: the map, its update, and warnings."""

    local_map: LocalMap
    reconciliation: Reconciliation
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class _Job:
    """Stage C of a snapshot of a map; ``warnings`` is its result."""

    original: LocalMap
    refined: LocalMap
    fix_buffer: FixBuffer
    warnings: "Future[tuple[str, ...]]"


class WindowWorker:
    """Runner of stage C on snapshots of the map; results are reconciled with the map as it has grown.

    Args:
        context: Camera, control points and settings.
        fix_buffer: The fixes; stage C updates their verdicts and time offset.
        timer: Timer of the stages.
    """

    def __init__(self, context: SmoothingContext, fix_buffer: FixBuffer, timer: StageTimer) -> None:
        self._context, self._fix_buffer, self._timer = context, fix_buffer, timer
        self._stage_c = StageC(context, timer)
        self._job: _Job | None = None

    @property
    def busy(self) -> bool:
        """Whether stage C was started and :meth:`finish` not yet called."""
        return self._job is not None

    @property
    def camera(self) -> Camera:
        """The camera of the outcomes so far."""
        return self._context.camera

    @property
    def failures(self) -> int:
        """Number of windows that iSAM2 could not solve."""
        return self._stage_c.failures

    @property
    def used_until_s(self) -> float:
        """Time of the newest frame that stage C has optimised."""
        return self._stage_c.used_until_s

    @used_until_s.setter
    def used_until_s(self, t_s: float) -> None:
        self._stage_c.used_until_s = t_s

    def optimise(self, local_map: LocalMap) -> WindowOutcome:
        """Run stage C now.

        Raises:
            GeometryError, RuntimeError, LinAlgError: The map cannot be optimised from its present state.
        """
        refined, fix_buffer = local_map.snapshot(), self._fix_buffer.snapshot()
        warnings = self._stage_c.run(refined, fix_buffer, self.camera)
        return self._outcome(local_map, refined, fix_buffer, warnings)

    def start(self, local_map: LocalMap) -> None:
        """Start stage C on the map as it is; the map may grow until :meth:`finish` is called."""
        self._stage_c.calibrate(local_map, self._fix_buffer, self.camera)
        refined, fix_buffer = local_map.snapshot(), self._fix_buffer.snapshot()
        warnings = begin(self._stage_c.run, refined, fix_buffer, self.camera, CONCURRENT)
        self._job = _Job(local_map, refined, fix_buffer, warnings)

    def finish(self) -> WindowOutcome | None:
        """Wait for stage C and return its outcome, or None if it was not started.

        Raises:
            GeometryError, RuntimeError, LinAlgError: See :meth:`optimise`.
        """
        job, self._job = self._job, None
        if job is None:
            return None
        with self._timer.measure("wait"):
            warnings = job.warnings.result()
        return self._outcome(job.original, job.refined, job.fix_buffer, warnings)

    def _outcome(
        self, local_map: LocalMap, refined: LocalMap, fix_buffer: FixBuffer, warnings: tuple[str, ...]
    ) -> WindowOutcome:
        self._fix_buffer.update_from(fix_buffer)
        if self._stage_c.camera is not self.camera:
            local_map.apply(MapUpdate(undistorted=undistorted_again(self._stage_c.camera, self.camera)))
            self._context = replace(self._context, camera=self._stage_c.camera)
        reconciliation = reconcile(refined, local_map, self._context.camera, self._limits(local_map))
        return WindowOutcome(local_map, reconciliation, warnings)

    def _limits(self, local_map: LocalMap) -> PosingLimits:
        config, imu = self._context.config, self._context.imu
        limits = PosingLimits(config.tracking, config.mapping, config.window.min_features)
        if imu is None or len(local_map.t_s) < 2:
            return limits
        sigma_rad = rotation_sigma_rad(imu, float(np.median(np.diff(local_map.t_s))))
        return replace(limits, rotation_sigma_rad=sigma_rad / config.batch.video_sigma_scale)
