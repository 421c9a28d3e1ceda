"""Alignment and stage C of a growing map, by the fixes so far."""

from collections.abc import Mapping

import numpy as np

from vgps.config import Config
from vgps.local_map import Controls, LocalMap
from vgps.model import FloatArray
from vgps.seconds import Seconds
from vgps.smoothing.drift import correct_drift
from vgps.smoothing.fixes import Fixes
from vgps.smoothing.ledger import FixLedger
from vgps.smoothing.start import align_to_control, try_alignment
from vgps.smoothing.window import contradicts, optimise_window


class Refiner:
    """Puts maps into the world and optimises their newest frames.

    Args:
        K: (3, 3).
        ledger: The fixes; judged here.
        config: Everything.
        controls: Sightings of known points, ``control_poses`` (4, 4) by frame what they give.
        seconds: Where its time is counted.
    """

    def __init__(
        self,
        K: FloatArray,
        ledger: FixLedger,
        config: Config,
        controls: Controls,
        control_poses: Mapping[int, FloatArray],
        seconds: Seconds,
    ) -> None:
        self._K, self._ledger, self._config, self._seconds = K, ledger, config, seconds
        self._controls, self._control_poses = controls, control_poses

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
        ledger = self._ledger
        with self._seconds.measure("drift"):
            if local_map.aligned:
                ledger.settle_lag(*path_of(local_map, t_s))
            if local_map.aligned and self._contradicted(local_map, t_s):
                ledger.judge(*path_of(local_map, t_s))
                if self._contradicted(local_map, t_s):
                    correct_drift(local_map, t_s, self._believed(t_s), self._antenna, self._config)
        fixes = self._believed(t_s)
        with self._seconds.measure("window"):
            found = optimise_window(
                local_map, t_s, self._K, fixes, self._antenna, self._config, self._controls
            )
        if found:
            return []
        return [f"stage C found no better poses at {t_s[-1]:.2f} s, from a start that is no minimum"]

    def _believed(self, t_s: FloatArray) -> Fixes:
        return self._ledger.believed(float(t_s[-1]))

    def _contradicted(self, local_map: LocalMap, t_s: FloatArray) -> bool:
        return contradicts(local_map, t_s, self._believed(t_s), self._antenna, self._config)


def path_of(local_map: LocalMap, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Poses of a map from its first posed frame on, and their times; ``t_s`` of all frames."""
    first = local_map.first_posed
    poses = local_map.poses[first - local_map.first_frame :]
    return poses, np.asarray(t_s[first : first + len(poses)])
