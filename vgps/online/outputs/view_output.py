"""Estimates for a view that knows nothing of the live mode."""

from typing import Protocol

import numpy as np

from vgps.model import FixClass, FloatArray, GrayImage
from vgps.online.estimate import OnlineEstimate
from vgps.online.outputs.output import PoseOutput
from vgps.solution import Verdict


class View(Protocol):
    """A window, or a file, that shows a path as it grows; times are those of the video, seconds."""

    def pose(self, t_s: float, world_T_camera: FloatArray, sigma_m: FloatArray) -> None:
        """Show a pose (4, 4) and the standard deviations (3,) of its position; NaN without one."""

    def fix(self, t_s: float, position_m: FloatArray, fix_class: FixClass, verdict: Verdict) -> None:
        """Show a fix, its position (3,) and the verdict on it."""

    def latency(self, t_s: float, seconds: float) -> None:
        """Show the time from the arrival of a frame to its pose."""

    def message(self, t_s: float, text: str) -> None:
        """Show a message."""

    def image(self, t_s: float, gray: GrayImage) -> None:
        """Show a frame (H, W)."""

    def close(self) -> None:
        """Send what is left."""


class ViewOutput(PoseOutput):
    """Output to a view."""

    def __init__(self, view: View) -> None:
        self._view = view

    def write(self, estimate: OnlineEstimate, latency_s: float) -> None:
        """Show the events and the pose of a frame."""
        for event in estimate.events:
            self._view.message(event.t_s, event.text)
            if event.kind == "fix":
                of = event.details
                position_m = np.array([of["east_m"], of["north_m"], of["up_m"]])
                self._view.fix(of["fix_t_s"], position_m, FixClass(of["class"]), Verdict(of["verdict"]))
        self._view.pose(estimate.t_s, estimate.global_T_camera, estimate.sigma_position_m)
        self._view.latency(estimate.t_s, latency_s)

    def show(self, t_s: float, gray: GrayImage) -> None:
        """Show a frame."""
        self._view.image(t_s, gray)

    def close(self) -> None:
        """Close the view."""
        self._view.close()
