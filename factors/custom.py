"""Custom factors from pure functions, with every shape checked.

In gtsam 4.3.0 a ``CustomFactor`` whose callback leaves a Jacobian unset or returns the wrong number of rows
crashes the process, and a wrong number of columns is accepted silently. Here each of these raises a
``ValueError`` that names the factor's keys and passes through the optimiser to its caller.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import gtsam
import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

Linearisation = tuple[FloatArray, Sequence[FloatArray]]
"""Residual (m,), and a Jacobian (m, d_k) for each variable."""


class Kind(NamedTuple):
    """A kind of variable: its accessor in ``gtsam.Values``, and the dimension of its tangent."""

    read: Callable[[gtsam.Values, int], Any]
    dim: int


POSE3 = Kind(gtsam.Values.atPose3, 6)
"""A ``gtsam.Pose3``: tangent [rotation; translation] in its own axes, chart ``T * Expmap(xi)``."""
POINT3 = Kind(gtsam.Values.atPoint3, 3)
"""A point or vector (3,)."""
VECTOR1 = Kind(gtsam.Values.atVector, 1)
"""A vector (1,)."""
VECTOR3 = Kind(gtsam.Values.atVector, 3)
"""A vector (3,)."""
SCALAR = Kind(gtsam.Values.atDouble, 1)
"""A float."""


class Variable(NamedTuple):
    """A variable of a factor."""

    key: int
    kind: Kind


def custom_factor(
    noise_model: gtsam.noiseModel.Base,
    variables: Sequence[Variable],
    error_function: Callable[..., Linearisation],
) -> gtsam.CustomFactor:
    """Make a factor whose unwhitened residual and Jacobians come from a pure function.

    Args:
        noise_model: Of dimension m; may be robust.
        variables: Variables of the factor, in the order of the function's arguments.
        error_function: Takes the variables' values; returns the residual (m,) and, for each variable, the
            Jacobian (m, d_k) to its tangent, d_k = ``variable.kind.dim``. The last result is cached, since
            iSAM2 linearises factors again whose variables have not moved.

    Returns:
        The factor. Evaluating it raises ``ValueError`` if the residual or a Jacobian has the wrong shape or
        is not finite, and propagates what ``error_function`` raises.

    Raises:
        ValueError: There are no variables, or two with the same key.
    """
    keys = [variable.key for variable in variables]
    if not keys or len(set(keys)) != len(keys):
        raise ValueError(f"keys are {_names(keys)}, expected one or more distinct keys")
    reads = [(variable.kind.read, variable.key) for variable in variables]
    m = noise_model.dim()
    shapes = [(m, variable.kind.dim) for variable in variables]

    last: dict[tuple[bytes, ...], Linearisation] = {}

    def linearise(values: gtsam.Values) -> Linearisation:
        arguments = [read(values, key) for read, key in reads]
        bits = tuple(_bytes(value) for value in arguments)
        if bits not in last:
            last.clear()
            last[bits] = error_function(*arguments)
        return last[bits]

    def evaluate(_this: gtsam.CustomFactor, values: gtsam.Values, jacobians_out: Any | None) -> FloatArray:
        residual, jacobians = linearise(values)
        residual = _checked(residual, (m,), "the residual", keys)
        if jacobians_out is None:
            return residual
        if len(jacobians) != len(shapes):
            raise ValueError(f"factor on {_names(keys)}: {len(jacobians)} Jacobians, expected {len(shapes)}")
        for k, (jacobian, shape) in enumerate(zip(jacobians, shapes, strict=True)):
            jacobians_out[k] = _checked(jacobian, shape, "a Jacobian", keys)
        return residual

    return gtsam.CustomFactor(noise_model, keys, evaluate)


def _bytes(value: Any) -> bytes:
    return np.asarray(value.matrix() if isinstance(value, gtsam.Pose3) else value).tobytes()


def _checked(array: FloatArray, shape: tuple[int, ...], what: str, keys: Sequence[int]) -> FloatArray:
    array = np.asarray(array, dtype=np.float64)
    if array.shape != shape:
        raise ValueError(f"factor on {_names(keys)}: {what} has shape {array.shape}, expected {shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"factor on {_names(keys)}: {what} is not finite: {array.tolist()}")
    return array


def _names(keys: Sequence[int]) -> str:
    return ", ".join(gtsam.DefaultKeyFormatter(key) for key in keys) or "none"
