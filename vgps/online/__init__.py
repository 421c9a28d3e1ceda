"""Live mode: poses while the video runs."""

from vgps.online.estimate import OnlineEstimate, OnlineEvent, OnlineState
from vgps.online.smoother import OnlineSmoother
from vgps.readers.gps_formats.fixes import Fix

__all__ = ["Fix", "OnlineEstimate", "OnlineEvent", "OnlineSmoother", "OnlineState"]
