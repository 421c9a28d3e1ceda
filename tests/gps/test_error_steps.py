"""Steps of the error from fix to fix: fixes of one place, where all can be computed by hand."""

import numpy as np
import pytest

from vgps.gps.error_steps import FixErrorEquations, error_steps

SIGMA_M = 0.03
NONE = np.zeros((11, 2))


def equations_of(error):
    """What n fixes of one unknown place say of their errors (n, 3): a mean and what remains of it."""
    n = len(error)
    centred = (np.eye(n) - 1.0 / n) / SIGMA_M**2
    information = np.einsum("ab,ij->aibj", centred, np.eye(3))
    return FixErrorEquations(information, -centred @ error)


def errors(n, *runs):
    error = np.zeros((n, 3))
    for begin, end, shift in runs:
        error[begin:end] = shift
    return error


@pytest.mark.parametrize(("begin", "end"), [(4, 7), (0, 3), (9, 12), (5, 6)])
def test_the_ends_of_a_run_and_its_error_are_found(begin, end):
    shift = np.array([0.3, -0.2, 0.4])
    expected = np.zeros((13, 3))
    expected[begin], expected[end] = shift, -shift
    expected[0] = 0.0  # what all share is no step
    steps = error_steps(equations_of(errors(12, (begin, end, shift))), NONE, 1.0)
    np.testing.assert_allclose(steps, expected[:12], atol=1e-4)


@pytest.mark.parametrize(("factor", "found"), [(0.99, True), (1.01, False)])
def test_a_run_counts_if_the_cost_falls_by_enough(factor, found):
    """Of n = 12 fixes k = 3 are off by d: it falls by d^2 k (n - k) / n / 2 sigma^2."""
    least = factor * 0.5 * 0.2**2 * 3 * 9 / 12 / SIGMA_M**2
    steps = error_steps(equations_of(errors(12, (4, 7, [0.0, 0.2, 0.0]))), NONE, least)
    assert steps.any() == found


def test_runs_beside_each_other_have_errors_of_their_own():
    runs = (2, 4, [0.0, 0.5, 0.0]), (4, 7, [0.0, 0.0, 0.3])
    steps = error_steps(equations_of(errors(12, *runs)), NONE, 1.0)
    np.testing.assert_allclose(steps[[2, 4, 7]], [[0, 0.5, 0], [0, -0.5, 0.3], [0, 0, -0.3]], atol=1e-4)
    assert np.count_nonzero(np.abs(steps).max(axis=1) > 1e-4) == 3


@pytest.mark.parametrize(("height_m", "found"), [(0.11, False), (0.4, True)])
def test_what_neighbours_may_differ_by_is_no_error(height_m, found):
    tolerance = np.tile([0.05, 0.12], (11, 1))
    assert error_steps(equations_of(errors(12, (4, 7, [0.0, 0.0, height_m]))), tolerance, 5.0).any() == found


def test_noise_is_no_error():
    noise = np.random.default_rng(3).normal(0.0, SIGMA_M, (12, 3))
    assert not error_steps(equations_of(noise), np.full((11, 2), 0.05), 5.0).any()


def test_an_unknown_that_all_errors_follow_leaves_nothing_to_find():
    """A clock that is wrong moves fixes as the speed tells: taken as unknown, it contradicts no fix."""
    velocity = np.linspace([1.0, 0.0, 0.0], [0.0, 2.0, 0.0], 12)
    late = equations_of(0.2 * velocity)
    assert error_steps(late, NONE, 1.0).any()
    assert not error_steps(late.without(velocity[:, :, None]), NONE, 1e-3).any()


def test_what_is_known_of_an_unknown_counts():
    """Oracle: the normal equations of errors and unknown together, inverted whole."""
    rng = np.random.default_rng(0)
    U, known = rng.normal(size=(5, 3, 2)), np.array([4.0, 9.0])
    equations = equations_of(rng.normal(size=(5, 3)))
    M, flat = equations.information.reshape(15, 15), U.reshape(15, 2)
    whole = np.block([[M, M @ flat], [flat.T @ M, flat.T @ M @ flat + np.diag(known)]])
    # the inverse of a block of the inverse; the mean of all fixes has no information of its own
    regular = whole + np.diag([1e-3] * 15 + [0.0, 0.0])
    expected = np.linalg.inv(np.linalg.inv(regular)[:15, :15]) - 1e-3 * np.eye(15)
    np.testing.assert_allclose(equations.without(U, known).information.reshape(15, 15), expected, atol=0.05)
