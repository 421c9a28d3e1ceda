"""Positions that a simulation gives, as fixes of one class."""

from pathlib import Path

import numpy as np

from vgps.config import Config
from vgps.gps.fixes import Fixes, fixes_in_world
from vgps.model import FixClass, FloatArray, GpsLog


def simulated_fixes(
    t_s: FloatArray, world_p_fix: FloatArray, fix_class: FixClass, sigma_m: float, config: Config
) -> Fixes:
    """Return positions (M, 3) at times (M,) as fixes of a class that state so large a sigma."""
    unknown = np.full(len(t_s), np.nan)
    log = GpsLog(
        t_s=t_s,
        latitude_deg=unknown,
        longitude_deg=unknown,
        height_m=unknown,
        fix_class=(fix_class,) * len(t_s),
        sigma_m=np.full((len(t_s), 3), sigma_m),
        hdop=unknown,
        satellites=unknown,
        correction_age_s=unknown,
        line=np.arange(len(t_s)),
        source=Path("simulated"),
    )
    return fixes_in_world(log, world_p_fix, config.gps)
