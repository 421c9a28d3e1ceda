import numpy as np
import pytest

from vgps.online.fusion.block_system import BlockSum, BlockSystem

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


def test_residuals_of_the_same_node_add_up_in_any_order():
    rng, node = np.random.default_rng(1), np.array([2, 0, 2, 3])
    J, w, r = rng.standard_normal((4, 2, UNKNOWNS)), rng.random((4, 2)), rng.standard_normal((4, 2))
    total, nothing = BlockSum(NODES, UNKNOWNS), BlockSum(NODES, UNKNOWNS)
    total.add_each(J, w, r, node)
    for k in range(NODES):
        rows = J[node == k].reshape(-1, UNKNOWNS)
        weighted = (w[node == k].reshape(-1, 1) * rows).T
        np.testing.assert_allclose(total.diagonal[k] - nothing.diagonal[k], weighted @ rows, atol=1e-12)
        np.testing.assert_allclose(total.gradient[k], weighted @ r[node == k].ravel(), atol=1e-12)


def test_there_may_be_no_residuals():
    total = BlockSum(NODES, UNKNOWNS)
    total.add_each(
        np.zeros((0, 2, UNKNOWNS)), np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, dtype=np.int64)
    )
    assert not total.gradient.any()


def test_changes_are_what_lies_between_nodes():
    rng = np.random.default_rng(2)
    w, change = rng.random((NODES - 1, 2)), rng.standard_normal((NODES - 1, 2))
    found, expected = BlockSum(NODES, UNKNOWNS), BlockSum(NODES, UNKNOWNS)
    found.add_changes(w, change)
    pick = np.tile(np.eye(UNKNOWNS)[1:], (NODES - 1, 1, 1))
    expected.add_between(-pick, pick, w[:, :, None] * np.eye(2), change)
    for name in ("diagonal", "below", "gradient"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-12)
