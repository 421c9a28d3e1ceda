from collections.abc import Callable

import gtsam
import numpy as np
import pytest

CheckJacobians = Callable[..., None]


@pytest.fixture(scope="session")
def check_jacobians() -> CheckJacobians:
    """A function that compares a factor's linearisation with central differences in GTSAM's own charts."""

    def check(
        factor: gtsam.NoiseModelFactor, values: gtsam.Values, step: float = 1e-5, tolerance: float = 1e-6
    ) -> None:
        jacobian, right_hand_side = factor.linearize(values).jacobian()
        numerical = numerical_jacobian(factor, values, step)
        assert jacobian.shape == numerical.shape
        scale = max(1.0, np.abs(numerical).max())
        np.testing.assert_allclose(jacobian, numerical, atol=tolerance * scale, rtol=0)
        np.testing.assert_allclose(right_hand_side, -factor.whitenedError(values), rtol=1e-12, atol=0)

    return check


def numerical_jacobian(
    factor: gtsam.NoiseModelFactor, values: gtsam.Values, step: float
) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """(m, sum of d_k), whitened, the columns in the order of the factor's keys."""
    dims = values.zeroVectors()
    columns = []
    for key in factor.keys():  # noqa: SIM118
        for k in range(len(dims.at(key))):
            delta = np.zeros(len(dims.at(key)))
            delta[k] = step
            ahead, behind = gtsam.VectorValues(dims), gtsam.VectorValues(dims)
            ahead.update(_single(key, delta))
            behind.update(_single(key, -delta))
            difference = factor.whitenedError(values.retract(ahead)) - factor.whitenedError(
                values.retract(behind)
            )
            columns.append(difference / (2 * step))
    return np.column_stack(columns)


def _single(key: int, delta: np.ndarray[tuple[int], np.dtype[np.float64]]) -> gtsam.VectorValues:
    vector_values = gtsam.VectorValues()
    vector_values.insert(key, delta)
    return vector_values
