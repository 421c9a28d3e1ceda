"""The one way to make a ``gtsam.CustomFactor``: from a pure function, with every shape checked.

gtsam 4.3.0 itself ends the process when a callback leaves a Jacobian unset or gives the wrong number of rows,
and silently accepts a wrong number of columns. Here each of these is a ``ValueError`` that names the factor's
keys; it travels through the optimiser to whoever called it.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import gtsam
import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

Linearised = tuple[FloatArray, Sequence[FloatArray]]
"""What an error function returns: the residual (m,) and one Jacobian (m, d_k) for each variable."""


class Kind(NamedTuple):
    """A kind of variable: how it is read from ``gtsam.Values``, and the dimension of its tangent."""

    read: Callable[[gtsam.Values, int], Any]
    dim: int


POSE3 = Kind(gtsam.Values.atPose3, 6)
"""``gtsam.Pose3``, tangent [rotation; translation] in its own axes, chart ``T * Expmap(xi)``."""
POINT3 = Kind(gtsam.Values.atPoint3, 3)
"""A point or vector (3,)."""
VECTOR1 = Kind(gtsam.Values.atVector, 1)
"""A vector (1,)."""
VECTOR3 = Kind(gtsam.Values.atVector, 3)
"""A vector (3,)."""
SCALAR = Kind(gtsam.Values.atDouble, 1)
"""A float."""


class Variable(NamedTuple):
    """A variable that a factor depends on."""

    key: int
    kind: Kind


def custom_factor(
    noise_model: gtsam.noiseModel.Base,
    variables: Sequence[Variable],
    error_function: Callable[..., Linearised],
) -> gtsam.CustomFactor:
    """Make a factor whose unwhitened residual and Jacobians come from a pure function.

    Args:
        noise_model: Of dimension m; may be robust.
        variables: What the factor depends on, in the order of the function's arguments.
        error_function: Takes the variables' values; returns the residual (m,) and, for each variable, the
            Jacobian (m, d_k) with respect to its tangent, d_k = ``variable.kind.dim``. It is not asked again
            at the values that it was asked at last: iSAM2 linearises what has not moved over and over.

    Returns:
        The factor. Evaluating it raises ``ValueError`` if the residual or a Jacobian has the wrong shape or
        is not finite, and passes on what ``error_function`` raises.

    Raises:
        ValueError: ``variables`` is empty or names a key twice.
    """
    keys = [variable.key for variable in variables]
    if not keys or len(set(keys)) != len(keys):
        raise ValueError(f"a factor needs one or more distinct keys, not {_names(keys)}")
    reads = [(variable.kind.read, variable.key) for variable in variables]
    m = noise_model.dim()
    shapes = [(m, variable.kind.dim) for variable in variables]

    last: dict[tuple[bytes, ...], Linearised] = {}

    def linearise(values: gtsam.Values) -> Linearised:
        at = [read(values, key) for read, key in reads]
        name = tuple(_bits(value) for value in at)
        if name not in last:
            last.clear()
            last[name] = error_function(*at)
        return last[name]

    def evaluate(_this: gtsam.CustomFactor, values: gtsam.Values, jacobians_out: Any | None) -> FloatArray:
        residual, jacobians = linearise(values)
        residual = _checked(residual, (m,), "the residual", keys)
        if jacobians_out is None:
            return residual
        if len(jacobians) != len(shapes):
            raise ValueError(
                f"factor on {_names(keys)}: {len(jacobians)} Jacobians for {len(shapes)} variables"
            )
        for k, (jacobian, shape) in enumerate(zip(jacobians, shapes, strict=True)):
            jacobians_out[k] = _checked(jacobian, shape, "a Jacobian", keys)
        return residual

    return gtsam.CustomFactor(noise_model, keys, evaluate)


def _bits(value: Any) -> bytes:
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
