"""Fixes as a receiver sends them, on their way into the world."""

from pathlib import Path

import numpy as np

from vgps.config import GpsConfig
from vgps.geodesy import to_enu
from vgps.gps.fixes import fixes_in_world
from vgps.gps.regions import region_sizes
from vgps.gps.world_frame import fix_origin
from vgps.model import GeodeticPoint
from vgps.online.archive import FixArchive
from vgps.online.estimate import counts_as_news
from vgps.online.fusion.node_fixes import SAME_TIME_S
from vgps.pipeline.frame_pipeline import FramePipeline
from vgps.readers.gps_formats.fixes import Fix, counted, repeats

_FURTHEST_AHEAD_S = 3600.0  # of the newest frame; later fixes are those of a clock that jumped


class FixIntake:
    """Gives a frame pipeline the fixes, late or out of order, once a usable one defines the world's origin.

    Args:
        frame_pipeline: Takes the fixes, and notes for the user.
        config: Regions of the fix classes.
        source: Name of their log.
        origin: Of the world, if it is given.

    Attributes:
        archive: All fixes that were accepted.
        origin: Of the world; None before the first usable fix.
    """

    def __init__(
        self, frame_pipeline: FramePipeline, config: GpsConfig, source: Path, origin: GeodeticPoint | None
    ) -> None:
        self._frame_pipeline, self._config, self._source = frame_pipeline, config, source
        self._placed = self._ahead = 0
        self._newest: Fix | None = None
        self.archive, self.origin = FixArchive(), origin

    def add(self, fix: Fix) -> bool:
        """Add a fix, and return whether it was accepted: see :meth:`OnlineSmoother.add_fix`."""
        frames_s = self._frame_pipeline.t_s
        if len(frames_s) and fix.t_s - frames_s[-1] > _FURTHEST_AHEAD_S:
            self._ahead += 1
            if counts_as_news(self._ahead):
                fixes = counted(self._ahead, "fix")
                self._frame_pipeline.warnings.append(
                    f"the receiver's clock jumped: {fixes} from the future left out so far"
                )
            return False
        taken = np.append(self._frame_pipeline.fix_buffer.fixes.t_s, self.archive.times_s(self._placed))
        if not np.isfinite(fix[:4]).all() or (np.abs(taken - fix.t_s) < SAME_TIME_S).any():
            return False
        newest = self._newest
        if newest is not None and newest.fix_class is fix.fix_class and repeats(fix, newest):
            return False
        self._newest = fix
        self.archive.append(fix)
        self.place()
        return True

    def place(self) -> None:
        """Convert new fixes to world coordinates, once a usable fix defines the origin."""
        if self._placed == len(self.archive):
            return
        log = self.archive.log(self._source, slice(self._placed, None))
        if self.origin is None:
            if not len(self._frame_pipeline.t_s):
                return
            r_m, _ = region_sizes(log.fix_class, self._config)
            usable = np.flatnonzero(np.isfinite(r_m) & (log.t_s >= self._frame_pipeline.t_s[0]))
            if not len(usable):
                return
            self.origin = fix_origin(log, int(usable[int(np.argmin(log.t_s[usable]))]))
        position = to_enu(self.origin, log.latitude_deg, log.longitude_deg, log.height_m)
        self._frame_pipeline.add_fixes(fixes_in_world(log, position, self._config))
        self._placed = len(self.archive)
