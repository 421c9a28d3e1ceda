"""A time offset that the live fit cannot find, by the displacements between fixes.

A fit is linear in the time offset, and its losses are robust: a walker's bob that contradicts a value wrong
by a third of a second counts as noise, while one period of it tells that value to hundredths. Displacements
are compared at every time offset of the prior (:mod:`vgps.gps.time_offset`); what they show twice in a row
counts.
"""

import numpy as np

from vgps.config import SensorsConfig
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import Sensors, TimeOffset
from vgps.gps.time_offset import update_time_offset
from vgps.mapping.map_update import Similarity
from vgps.model import FloatArray
from vgps.online.fusion.video_path import VideoPath
from vgps.solution import Trajectory

# Of a map's path, since a fit may be sure of a wrong time offset within seconds; and by how much longer it is
# each time: the ninth is after 8 s, when displacements begin to show something.
_FIRST_S, _LONGER = 1.34, 1.25


class ClockWatch:
    """When to compare the clocks of a map's path, and what that showed last.

    Args:
        config: From how many standard deviations on two time offsets differ.
    """

    def __init__(self, config: SensorsConfig) -> None:
        self._config, self._next_s = config, _FIRST_S
        self._shown: TimeOffset | None = None

    def is_due(self, path_s: float) -> bool:
        """Return whether to compare now, after so many seconds of path."""
        if path_s < self._next_s:
            return False
        while self._next_s <= path_s:
            self._next_s *= _LONGER
        return True

    def confirmed(self, shown: TimeOffset | None) -> TimeOffset | None:
        """Return a time offset that contradicts the fit if it did so the last time, too."""
        before, self._shown = self._shown, shown
        if before is None or shown is None or _differ(before, shown, self._config):
            return None
        return shown


def shown_time_offset(
    path: VideoPath,
    to_world: Similarity,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    believed: TimeOffset,
    config: SensorsConfig,
) -> TimeOffset | None:
    """Return the rest of the time offset that displacements show beyond doubt, if a fit believes another.

    Args:
        path: Of the video.
        to_world: From its map to the world.
        fixes: With their verdicts, the time offset known before the map removed.
        camera_p_antenna: (3,) metres.
        believed: The rest of the time offset, by the fit.
        config: Prior of the time offset, and limits of significance.
    """
    placed = Trajectory(path.t_s, to_world.poses(path.poses))
    about_zero = config.model_copy(update={"time_offset_s": 0.0})
    sensors = Sensors.from_config(camera_p_antenna, about_zero)
    found, _ = update_time_offset(sensors, placed, fixes, about_zero)
    shown = found.prior_time_offset
    return shown if shown.sigma_s and _differ(shown, believed, config) else None


def _differ(one: TimeOffset, other: TimeOffset, config: SensorsConfig) -> bool:
    apart_s = abs(one.time_offset_s - other.time_offset_s)
    return apart_s > config.significance_sigmas * float(np.hypot(one.sigma_s, other.sigma_s))
