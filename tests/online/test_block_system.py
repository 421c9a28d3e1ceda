import numpy as np
import pytest

from vgps.online.block_system import BlockSystem

NODES, UNKNOWNS = 4, 3


def dense(system):
    """The matrix of a system, block by block."""
    matrix = np.zeros((NODES, UNKNOWNS, NODES, UNKNOWNS))
    for k in range(NODES):
        matrix[k, :, k] = system.diagonal[k]
    for k, below in enumerate(system.below):
        matrix[k + 1, :, k], matrix[k, :, k + 1] = below, below.T
    return matrix.reshape(NODES * UNKNOWNS, -1)


@pytest.fixture
def system():
    rng = np.random.default_rng(0)
    square = rng.standard_normal((NODES, UNKNOWNS, UNKNOWNS))
    diagonal = square @ square.transpose(0, 2, 1) + 4.0 * np.eye(UNKNOWNS)
    below = 0.5 * rng.standard_normal((NODES - 1, UNKNOWNS, UNKNOWNS))
    return BlockSystem(diagonal, below, rng.standard_normal((NODES, UNKNOWNS)))


def test_the_step_solves_the_system(system):
    np.testing.assert_allclose(dense(system) @ system.step().ravel(), -system.gradient.ravel(), atol=1e-12)


def test_the_covariances_are_blocks_of_the_inverse(system):
    inverse = np.linalg.inv(dense(system)).reshape(NODES, UNKNOWNS, NODES, UNKNOWNS)
    np.testing.assert_allclose(system.last_covariance(), inverse[-1, :, -1], atol=1e-12)
    each = np.stack([inverse[k, :, k] for k in range(NODES)])
    np.testing.assert_allclose(system.covariances(), each, atol=1e-12)


def test_with_the_other_nodes_eliminated_the_last_has_the_same_solution_and_covariance(system):
    information, vector = system.eliminated()
    np.testing.assert_allclose(np.linalg.inv(information), system.last_covariance(), atol=1e-12)
    np.testing.assert_allclose(information @ system.step()[-1], -vector, atol=1e-12)


def test_a_matrix_that_is_not_positive_definite_is_refused(system):
    with pytest.raises(np.linalg.LinAlgError):
        BlockSystem(-system.diagonal, system.below, system.gradient).step()
