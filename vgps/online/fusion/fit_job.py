"""When a fit of the live path begins, and when it is used."""

from concurrent.futures import Future
from dataclasses import dataclass

import numpy as np

from vgps.config import Config
from vgps.gps.fix_buffer import FixBuffer
from vgps.mapping.local_map import LocalMap
from vgps.model import FloatArray
from vgps.online.fusion.fusion_fit import FitInput, FitResult
from vgps.online.fusion.node_fixes import SAME_TIME_S

# Time after which a fit is used, without and with verdicts, however quickly it was found.
FIT_S, VERDICT_S = 0.05, 0.13


@dataclass(frozen=True)
class FitJob:
    """A fit at work that is due at a time of the video."""

    due_s: float
    given: FitInput
    fit: "Future[FitResult]"

    def counts(self, t_s: float, repeatable: bool) -> bool:
        """Return whether it is used at a time: when it is due, or else not before it is found."""
        return t_s >= self.due_s and (repeatable or self.fit.done())


def fix_count(t_s: float, fix_buffer: FixBuffer) -> int:
    """Return how many fixes have come for times until one."""
    return int(fix_buffer.number[fix_buffer.fixes.t_s <= t_s].max(initial=-1)) + 1


@dataclass(frozen=True)
class SeenByFit:
    """What a fit sees: number of frames, time of the newest fix, the map's last frame and its pose (4, 4)."""

    frames: int
    newest_fix_s: float
    last_frame: int
    pose: FloatArray

    @classmethod
    def of(cls, current: LocalMap, t_s: FloatArray, fix_buffer: FixBuffer) -> "SeenByFit":
        """Return what a fit sees of a map now, by the times (F,) of all frames and the fixes that came."""
        fix_t_s = fix_buffer.fixes.t_s
        newest_fix_s = float(fix_t_s[fix_t_s <= t_s[-1]].max(initial=-np.inf))
        return cls(len(t_s), newest_fix_s, current.next_frame - 1, current.poses[-1].copy())

    def calls_for_another(self, now: "SeenByFit", current: LocalMap, config: Config) -> bool:
        """Return whether what is seen now, or a change of the map, calls for another fit.

        New fixes do once they are of another offset than those seen: until then fits to the newest ones alone
        say as much.
        """
        since_s = now.newest_fix_s - self.newest_fix_s  # NaN without fixes
        return (
            since_s > config.gps.memory.interval_s - SAME_TIME_S
            or now.frames >= self.frames + config.window.every_frames
            or not self._same_shape(current)
        )

    def _same_shape(self, current: LocalMap) -> bool:
        """Return whether the map has not changed since but for new frames; stage C changes its scale."""
        return np.array_equal(current.pose(self.last_frame), self.pose, equal_nan=True)
