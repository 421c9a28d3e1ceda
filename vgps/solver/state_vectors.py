"""Vectors that stand between the poses of a problem."""

from dataclasses import dataclass, replace

import gtsam

from vgps.model import FloatArray

MAX_STATE_SIZE = 6  # coordinates of a state, which takes the place of a pose in the reduced matrix


@dataclass(frozen=True)
class StateVector:
    """A vector that belongs to a place in the video, such as the offset of a receiver during a second.

    Attributes:
        vector: (d,) its value, d <= 6.
        frame: Frame after which it stands in the order of elimination; close to the frames with which it
            shares factors, it keeps the reduced matrix narrow.
        is_bias: Whether the graph knows it as ``imuBias.ConstantBias`` [accelerometer; gyro], d = 6.
    """

    vector: FloatArray
    frame: int
    is_bias: bool = False

    def moved(self, vector: FloatArray) -> "StateVector":
        """Return the state with another value (d,)."""
        return replace(self, vector=vector)

    def insert_into(self, values: gtsam.Values, key: int) -> None:
        """Add the state to GTSAM's values."""
        values.insert(
            key, gtsam.imuBias.ConstantBias(self.vector[:3], self.vector[3:]) if self.is_bias else self.vector
        )

    def read_from(self, values: gtsam.Values, key: int) -> "StateVector":
        """Return the state with its value among GTSAM's."""
        return self.moved(values.atConstantBias(key).vector() if self.is_bias else values.atVector(key))
