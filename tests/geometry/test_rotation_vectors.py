import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vgps.geometry import rotation_matrices, rotation_vectors

AXES = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.6, 0.0, 0.8], [2.0, -1.0, 2.0]])
AXES /= np.linalg.norm(AXES, axis=1)[:, None]


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-9, 1e-4, 0.3, 1.5, 2.1, 3.0, np.pi - 1e-9])
def test_they_are_those_of_scipy(angle):
    """Also where the sine of the angle is small."""
    turns = Rotation.from_rotvec(angle * AXES)
    np.testing.assert_allclose(rotation_matrices(angle * AXES), turns.as_matrix(), atol=1e-15)
    np.testing.assert_allclose(rotation_vectors(turns.as_matrix()), angle * AXES, rtol=1e-9, atol=1e-15)


def test_there_may_be_none():
    assert rotation_matrices(np.zeros((0, 3))).shape == (0, 3, 3)
    assert rotation_vectors(np.zeros((0, 3, 3))).shape == (0, 3)
