"""Velocities and biases at knots of a path, and which of them the IMU links."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import gtsam
import numpy as np

from vgps.config import ImuConfig
from vgps.imu.camera_imu import CameraImu
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.solution import Trajectory


@dataclass(frozen=True, kw_only=True)
class ImuStates:
    """Velocity and bias at K knots, which are frames of a path.

    Attributes:
        frame: (K,) ascending.
        linked: (K - 1,) whether the IMU covers the time from a knot to the next.
        velocity: (K, 3) world_v_camera, m/s.
        bias: (K, 6) of specific force [m/s^2] and rates [rad/s], in the camera's axes.
    """

    frame: IntArray
    linked: BoolArray
    velocity: FloatArray
    bias: FloatArray

    def __len__(self) -> int:
        return len(self.frame)

    @property
    def carried(self) -> BoolArray:
        """(K,) whether the IMU leads from the knot before to each, and on to the next."""
        return np.asarray(np.append(True, self.linked) & np.append(self.linked, True))

    def moved(self, vectors: Mapping[int, FloatArray]) -> "ImuStates":
        """Return the states with the values of an optimised graph, by key."""
        velocity = np.array([vectors[velocity_key(k)] for k in range(len(self))])
        bias = np.array([vectors[bias_key(k)] for k in range(len(self))])
        return replace(self, velocity=velocity, bias=bias)


def velocity_key(knot: int) -> int:
    """Return the key of the velocity of a knot."""
    return int(gtsam.symbol("v", knot))


def bias_key(knot: int) -> int:
    """Return the key of the bias of a knot."""
    return int(gtsam.symbol("b", knot))


def as_bias(bias: FloatArray) -> gtsam.imuBias.ConstantBias:
    """Return a bias (6,) of specific force and rates as GTSAM's."""
    return gtsam.imuBias.ConstantBias(bias[:3], bias[3:])


def first_states(path: Trajectory, loose: BoolArray, imu: CameraImu, config: ImuConfig) -> ImuStates | None:
    """Choose knots and return their states: velocities of the path, expected biases.

    Args:
        path: All frames.
        loose: (F,) frames that the IMU has to hold, which are knots.
        imu: The samples.
        config: Distance of the knots.

    Returns:
        The states; None if the IMU covers no interval between knots.
    """
    t_s = path.t_s
    # intervals of one length: in a short one the IMU would hold frames tighter than the video knows them
    intervals = max(1, round((t_s[-1] - t_s[0]) / config.knot_s))
    knot = np.zeros(len(t_s), dtype=bool)
    knot[np.searchsorted(t_s, np.linspace(t_s[0], t_s[-1], intervals + 1) - 1e-6)] = True
    frame = np.flatnonzero(knot | loose)
    linked = imu.covers(t_s[frame[:-1]], t_s[frame[1:]])
    used = np.append(linked, False) | np.append(False, linked)
    if not used.any():
        return None
    frame = frame[used]
    # between the knots that are left, intervals that were not covered are still not
    linked = imu.covers(t_s[frame[:-1]], t_s[frame[1:]])
    velocity = np.gradient(path.world_T_camera[:, :3, 3], t_s, axis=0)[frame]
    return ImuStates(frame=frame, linked=linked, velocity=velocity, bias=np.tile(imu.bias, (len(frame), 1)))
