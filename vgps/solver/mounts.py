"""Observations of a rig: each is of one camera, whose place on the rig is known."""

from dataclasses import dataclass, replace

import gtsam
import numpy as np

from vgps.model import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraMounts:
    """Cameras of a rig, and which of them made each observation.

    The poses of a problem are those of the reference camera: camera c of a frame is at
    ``world_T_reference @ reference_T_camera[c]``.

    Attributes:
        camera: (N,) camera of each observation.
        K: (C, 4) fx, fy, cx, cy of each camera.
        reference_T_camera: (C, 4, 4); None once the poses are those of the cameras.
    """

    camera: IntArray
    K: FloatArray
    reference_T_camera: FloatArray | None

    def rows(self, rows: IntArray) -> "CameraMounts":
        """Return the cameras of some observations."""
        return replace(self, camera=self.camera[rows])

    @property
    def intrinsics(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """fx, fy, cx, cy (N,) of each observation's camera."""
        fx, fy, cx, cy = self.K.T[:, self.camera]
        return fx, fy, cx, cy

    def views(self, world_T_reference: FloatArray, frame: IntArray) -> tuple[FloatArray, IntArray]:
        """Return the poses (C F, 4, 4) of all cameras in frames (F, 4, 4), and each observation's (N,)."""
        if self.reference_T_camera is None:
            return world_T_reference, frame
        poses = world_T_reference @ self.reference_T_camera[:, None]
        return poses.reshape(-1, 4, 4), self.camera * len(world_T_reference) + frame

    def by_reference(self, jp: FloatArray) -> FloatArray:
        """Return Jacobians (2, 6, n) by the reference camera's pose, from those by the own camera's.

        ``world_T_reference Exp(d) reference_T_camera = world_T_camera Exp(Ad(camera_T_reference) d)``.
        """
        if self.reference_T_camera is None:
            return jp
        moved = np.empty_like(jp)
        for c, mount in enumerate(self.reference_T_camera):
            of_camera = self.camera == c
            adjoint = gtsam.Pose3(mount).inverse().AdjointMap()
            moved[:, :, of_camera] = np.einsum("ian,ab->ibn", jp[:, :, of_camera], adjoint)
        return moved
