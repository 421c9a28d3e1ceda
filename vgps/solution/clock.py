"""The receiver's clock against the video's."""

from typing import NamedTuple

from vgps.model import FloatArray


class GpsClock(NamedTuple):
    """How much older positions are than their time stamps.

    Attributes:
        time_offset_s: At the video's first frame.
        rate: By how much more in each second, by the time stamps.
    """

    time_offset_s: float
    rate: float = 0.0

    def on_video(self, stamps_s: FloatArray) -> FloatArray:
        """Return the times (M,) of positions on the video's clock."""
        return stamps_s - self.time_offset_s - self.rate * stamps_s

    def time_stamps(self, t_s: FloatArray) -> FloatArray:
        """Return the time stamps (M,) of positions at times of the video."""
        return (t_s + self.time_offset_s) / (1.0 - self.rate)
