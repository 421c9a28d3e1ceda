"""Observations of several cameras of a rig in stage D: from where, and when."""

from dataclasses import dataclass

import numpy as np

from vgps.camera import row_shares
from vgps.lens_jacobian import lens_jacobian
from vgps.model import Camera, FloatArray, IntArray
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.scene.row_times import row_times
from vgps.solution import Observations, Solution
from vgps.solver.mounts import CameraMounts
from vgps.solver.row_times import RowTimes


@dataclass(frozen=True, eq=False)
class RigViews:
    """Cameras of a rig: number 0 is the reference, the others are those of the context.

    Attributes:
        camera: (L,) camera that observes each feature.
        delay_s: (C, F) time of each camera's frame after the reference's frame to which it belongs.
    """

    camera: IntArray
    delay_s: FloatArray

    def mounts(self, landmark: IntArray, context: SmoothingContext) -> CameraMounts:
        """Return the cameras of observations of landmarks (N,)."""
        poses = [np.eye(4), *(one.reference_T_camera for one in context.cameras)]
        K = np.array([(one.fx, one.fy, one.cx, one.cy) for one in _lenses(context)])
        return CameraMounts(camera=self.camera[landmark], K=K, reference_T_camera=np.stack(poses))

    def times(
        self, t_s: FloatArray, observations: Observations, context: SmoothingContext
    ) -> RowTimes | None:
        """Return the times of observations; None if all are at frames of the reference, with times t_s (F,).

        They are later than these by the delay of their camera and their row, in seconds as of a readout of 1.
        """
        camera = self.camera[observations.landmark]
        later_s = self.delay_s[camera, observations.frame]
        for k, lens in enumerate(_lenses(context)):
            if lens.readout_s:
                own = camera == k
                later_s[own] += lens.readout_s * row_shares(lens, observations.uv_px[own])
        if len(t_s) < 2 or not later_s.any():
            return None
        return RowTimes.of_frames(t_s, observations.frame, later_s, 1.0)

    def lenses(self, observations: Observations, context: SmoothingContext) -> FloatArray | None:
        """Return how the lenses of their cameras scale errors of observations, (N, 2, 2)."""
        camera, scaled = self.camera[observations.landmark], False
        lens = np.tile(np.eye(2), (len(camera), 1, 1))
        for k, one in enumerate(_lenses(context)):
            own = camera == k
            found = lens_jacobian(one, observations.uv_px[own])
            if found is not None:
                lens[own], scaled = found, True
        return lens if scaled else None


def observation_lenses(
    observations: Observations, context: SmoothingContext, rig: RigViews | None
) -> FloatArray | None:
    """Return how lenses scale errors of observations, (N, 2, 2); None for pinholes."""
    if rig is not None:
        return rig.lenses(observations, context)
    return lens_jacobian(context.camera, observations.uv_px)


def observation_times(
    t_s: FloatArray, observations: Observations, context: SmoothingContext, rig: RigViews | None
) -> RowTimes | None:
    """Return the times of observations; None if all are at the times of their frames, t_s (F,)."""
    if rig is not None:
        return rig.times(t_s, observations, context)
    return row_times(t_s, observations.frame, observations.uv_px, context.camera)


def rig_of(solution: Solution) -> RigViews | None:
    """Return which camera of a rig observes each of all landmarks, and when; None for one camera."""
    if not solution.cameras:
        return None
    maps = (solution.landmarks, *(one.landmarks for one in solution.cameras))
    counts = [len(landmarks.sigma_px) for landmarks in maps]
    delays = [np.zeros(len(solution.t_s)), *(one.delay_s for one in solution.cameras)]
    return RigViews(np.repeat(np.arange(len(counts)), counts), np.stack(delays))


def _lenses(context: SmoothingContext) -> tuple[Camera, ...]:
    return context.camera, *(one.camera for one in context.cameras)
