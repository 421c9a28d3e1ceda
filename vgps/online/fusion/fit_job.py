"""When a fit of the live path begins, and when it is used."""

from concurrent.futures import Future
from dataclasses import dataclass

import numpy as np

from vgps.mapping.local_map import LocalMap
from vgps.model import FloatArray
from vgps.online.fusion.fusion_fit import FitInput, FitResult

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


@dataclass(frozen=True)
class SeenByFit:
    """What a fit saw: numbers of frames and fixes, and the map's last frame with its pose (4, 4)."""

    frames: int
    fixes: int
    last_frame: int
    pose: FloatArray

    @classmethod
    def of(cls, current: LocalMap, frames: int, fixes: int) -> "SeenByFit":
        """Return what a fit sees of a map now."""
        return cls(frames, fixes, current.next_frame - 1, current.poses[-1].copy())

    def same_shape(self, current: LocalMap) -> bool:
        """Return whether the map has not changed since but for new frames; stage C changes its scale."""
        return np.array_equal(current.pose(self.last_frame), self.pose, equal_nan=True)
