"""Estimates some time later: each pose by the fixes and frames that came since."""

import math
from collections import deque
from collections.abc import Iterator

from vgps.online.estimate import OnlineEstimate
from vgps.online.smoother import OnlineSmoother


class DelayedEstimates:
    """Estimates held back until the newest frame is ``lag_s`` later, then revised.

    Args:
        smoother: Gives the revised poses.
        lag_s: Delay; 0 passes estimates on as they come.
    """

    def __init__(self, smoother: OnlineSmoother, lag_s: float) -> None:
        self._smoother, self._lag_s = smoother, lag_s
        self._held: deque[tuple[OnlineEstimate, float]] = deque()

    def add(self, estimate: OnlineEstimate, arrival_s: float) -> Iterator[tuple[OnlineEstimate, float]]:
        """Yield the estimates that are due with the newest one, and the arrivals of their frames."""
        if not self._lag_s:
            yield estimate, arrival_s
            return
        self._held.append((estimate, arrival_s))
        yield from self._until(estimate.t_s - self._lag_s + 1e-9)

    def rest(self) -> Iterator[tuple[OnlineEstimate, float]]:
        """Yield the estimates still held, after the last frame."""
        yield from self._until(math.inf)

    def _until(self, t_s: float) -> Iterator[tuple[OnlineEstimate, float]]:
        while self._held and self._held[0][0].t_s <= t_s:
            due, arrived_s = self._held.popleft()
            yield self._smoother.revised(due), arrived_s
