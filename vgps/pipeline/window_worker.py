"""Alignment and stage C of a growing map, by the fixes so far; stage C also beside the frames that follow."""

from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from vgps.config import Config
from vgps.gps.fix_buffer import FixBuffer
from vgps.mapping.control_observations import ControlObservations
from vgps.mapping.local_map import LocalMap
from vgps.model import FloatArray, IntArray
from vgps.pipeline.reconciliation import reconcile
from vgps.runtime.timing import CONCURRENT, StageTimer
from vgps.smoothing.drift_correction import correct_drift, path_of, seen_path, unbend
from vgps.smoothing.map_alignment import align_to_control, try_alignment
from vgps.smoothing.window import contradicts, optimise_window

_BENT_TOLERANCE = 5.0
_TEAR_S = 1.0  # before a fix the path begins to bend to it


@dataclass(frozen=True)
class _Job:
    """Stage C of a copy of a map, at work in a thread of its own; it ends with warnings."""

    original: LocalMap
    refined: LocalMap
    fix_buffer: FixBuffer
    ends: "Future[list[str]]"


class WindowWorker:
    """Puts maps into the world and optimises their newest frames.

    Args:
        K: (3, 3).
        fix_buffer: The fixes; judged here.
        config: Everything.
        controls: Observations of known points, ``control_poses`` (4, 4) by frame what they give.
        seconds: Where its time is counted.
    """

    def __init__(
        self,
        K: FloatArray,
        fix_buffer: FixBuffer,
        config: Config,
        controls: ControlObservations,
        control_poses: Mapping[int, FloatArray],
        seconds: StageTimer,
    ) -> None:
        self._K, self._ledger, self._config, self._seconds = K, fix_buffer, config, seconds
        self._controls, self._control_poses = controls, control_poses
        self._job: _Job | None = None
        self._used_until_s = -np.inf  # by stage C

    @property
    def _antenna(self) -> FloatArray:
        return self._ledger.sensors.prior_antenna

    def align(self, local_map: LocalMap, t_s: FloatArray) -> list[str] | None:
        """Warnings if the map, moved in place, lies in the world now; nothing if that has to wait.

        Args:
            local_map: Not aligned yet.
            t_s: Times of all frames so far.
        """
        with self._seconds.measure("align"):
            if align_to_control(local_map, self._control_poses, self._config.start.min_control_travel_m):
                return []
            if not self._ledger.news(float(t_s[-2]), float(t_s[-1])):
                return None
            return try_alignment(local_map, t_s, self._ledger.fixes, self._antenna, self._config)

    @property
    def busy(self) -> bool:
        """Whether stage C was begun, and its result not taken yet."""
        return self._job is not None

    def optimise(self, local_map: LocalMap, t_s: FloatArray) -> list[str]:
        """Stage C; first, where the fixes contradict what will be held, its drift is taken out.

        Otherwise the window would tear to reach the fixes, and the tear would stay.

        Args:
            local_map: Changed in place.
            t_s: Times of all frames so far.

        Returns:
            Warnings.

        Raises:
            GeometryError, RuntimeError, LinAlgError: The map is so far off that it cannot be optimised.
        """
        return self._optimise(local_map, t_s, self._ledger)

    def begin(self, local_map: LocalMap, t_s: FloatArray) -> None:
        """Begin stage C of the map as it is; while it works the map may grow, and :meth:`finish` follows.

        Args:
            local_map: As in :meth:`optimise`.
            t_s: Times of all frames so far.
        """
        refined, fix_buffer = local_map.snapshot(), self._ledger.snapshot()
        pool = ThreadPoolExecutor(1)
        ends = pool.submit(self._optimise, refined, t_s, fix_buffer, CONCURRENT)
        self._job = _Job(local_map, refined, fix_buffer, ends)
        pool.shutdown(wait=False)

    def finish(self) -> tuple[IntArray, list[str]]:
        """Wait for what was begun, and put it into the map.

        Returns:
            Features of the map that stage C did not know, and warnings.

        Raises:
            GeometryError, RuntimeError, LinAlgError: As in :meth:`optimise`; the map stays as it is.
        """
        job, self._job = self._job, None
        if job is None:
            return np.zeros(0, dtype=np.int64), []
        with self._seconds.measure("wait"):
            warnings = job.ends.result()
        self._ledger.take(job.fix_buffer)
        inlier_px = self._config.tracking.inlier_px
        return reconcile(job.refined, job.original, self._K, inlier_px), warnings

    def _optimise(
        self, local_map: LocalMap, t_s: FloatArray, fix_buffer: FixBuffer, beside: str = ""
    ) -> list[str]:
        until_s = float(t_s[-1])
        since_s = until_s - self._config.drift.horizon_s
        antenna, config = self._antenna, self._config

        def contradicted() -> bool:
            return contradicts(local_map, t_s, fix_buffer.believed(until_s), antenna, config)

        bent = False
        with self._seconds.measure("drift" + beside):
            if local_map.aligned:
                fix_buffer.update_time_offset(*seen_path(local_map, t_s, since_s))
            if local_map.aligned and contradicted():
                torn_s = fix_buffer.judge(*path_of(local_map, t_s, since_s), self._used_until_s)
                if torn_s < until_s:
                    unbend(local_map, t_s, torn_s - _TEAR_S)
                bent = contradicted()
            if bent:
                correct_drift(local_map, t_s, fix_buffer.believed(until_s), antenna, config, since_s)
        with self._seconds.measure("window" + beside):
            fixes = fix_buffer.believed(until_s)
            # a bent path suits no long track well: without these the window would tear off
            tolerance = _BENT_TOLERANCE if bent else 1.0
            found = optimise_window(
                local_map, t_s, self._K, fixes, antenna, config, self._controls, tolerance
            )
        self._used_until_s = until_s
        if found:
            return []
        return [f"stage C found no better poses at {until_s:.2f} s, from a start that is no minimum"]
